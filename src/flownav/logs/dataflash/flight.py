"""An ArduPilot DataFlash log (.bin) as a Log. docs/reference/dataflash.md says which messages are read and how."""

from __future__ import annotations

import hashlib
from pathlib import Path

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream
from flownav.core.record import Table
from flownav.logs.absences import absences_of
from flownav.logs.csv_table import CsvTable
from flownav.logs.dataflash import reference, sensors
from flownav.logs.dataflash.columns import DataFlash
from flownav.logs.fixes import Origin
from flownav.logs.log import SIMULATOR, Log
from flownav.logs.plausible import check_plausible

LONGEST_DELAY_S = 1.0


def read_dataflash(path: Path, *, flow_instance: int | None = None) -> Log:
    """Read a log; times are seconds since the first reading used.

    flow_instance: which flow sensor, where the log has several; the one with most data by default. InputError where
    the file cannot be read or holds no sensor's message; where its clock restarts; where two sensors cannot be
    right together. Bad rows are counted in `Stream.rejected`, unreadable bytes told in a note.
    """
    log = DataFlash(path)
    notes = _file_notes(log)
    settings = reference.parameters(log)
    tables = sensors.sensor_rows(log, flow_instance, notes)
    _check_needed(log, tables)
    estimated, simulated = reference.estimate_rows(log, settings), reference.true_rows(log)
    origins = reference.filter_origins(log)
    beside = [*(estimated[1:] if estimated else ()), *(simulated or ()), origins]
    start_s = min(table.t_s[0] for table in tables.values())
    for table in (*tables.values(), *beside):
        if table is not None:
            table.t_s = table.t_s - start_s
    _check_overlap(path, tables)
    origin = _origin(tables)
    about = origin or _first(origins) or _first(simulated[0] if simulated else None)
    streams = _streams(tables, origin, settings)
    check_plausible(path, streams)
    if estimated and origins is None:
        notes.append("ORGN is absent: the autopilot's estimate stands about its own origin")
    return Log(
        path,
        streams,
        origin,
        _truth(simulated, about),
        {path.name: _sha256(path)},
        (*notes, *(note for table in tables.values() for note in table.notes)),
        reference.estimate(estimated[1], origins, about) if estimated else None,
        estimated[0] if estimated else "",
        reference.stated_limits(settings, sensors.rangefinder_instance(log)) if "RFND" in tables else {},
        tuple(absences_of(streams, flow_rate="no optical flow (OF)", range="no downward rangefinder (RFND)")),
        clock_start_s=float(start_s),
        truth_name=SIMULATOR,
    )


def _file_notes(log: DataFlash) -> list[str]:
    notes = []
    if log.skipped_bytes:
        places = "one place" if log.gaps == 1 else f"{log.gaps} places"
        notes.append(
            f"{log.path.name}: {log.skipped_bytes} of {log.size_bytes} bytes are no message ({places}); skipped"
        )
    if log.contradictions:
        notes.append(f"{log.path.name}: {log.contradictions} FMT messages contradict earlier ones; the first stand")
    return notes


def _check_needed(log: DataFlash, tables: dict[str, CsvTable]) -> None:
    if not tables.keys() & {"GPS", *sensors.STREAMS}:
        wanted = ", ".join(["GPS", *sensors.STREAMS])
        raise InputError(f"{log.path}: no usable {wanted} in the log; LOG_BITMASK decides what the vehicle writes")


def _check_overlap(path: Path, tables: dict[str, CsvTable]) -> None:
    """Messages of one flight share a clock: their times must meet the attitude's."""
    if "ATT" not in tables:
        return
    attitude = tables["ATT"].t_s
    for name, table in tables.items():
        if name in sensors.STREAMS and (table.t_s[-1] < attitude[0] or table.t_s[0] > attitude[-1]):
            raise InputError(
                f"{path}: {name} covers {table.t_s[0]:g} to {table.t_s[-1]:g} s and ATT {attitude[0]:g} to "
                f"{attitude[-1]:g} s; one flight's log is needed"
            )


def _streams(tables: dict[str, CsvTable], origin: Origin | None, settings: dict[str, float]) -> dict[Sensor, Stream]:
    found = [convert(tables[name]) for name, convert in sensors.STREAMS.items() if name in tables]
    if origin is not None:
        delay_s = _delay_s(settings, ("GPS1_DELAY_MS", "GPS_DELAY_MS"), 1e-3)
        found = [*found, *sensors.gps(tables["GPS"], tables.get("GPA"), origin, delay_s)]
    if "EV" in tables:
        found.append(sensors.landed(tables["EV"], 0.0))
    streams = {stream.sensor: stream for stream in found}
    if "PL" in tables and Sensor.ATTITUDE in streams:
        delay_s = _delay_s(settings, ("PLND_LAG",), 1.0)
        streams[Sensor.PAD] = sensors.pad(tables["PL"], streams[Sensor.ATTITUDE], delay_s)
    return streams


def _delay_s(settings: dict[str, float], names: tuple[str, ...], unit_s: float) -> float:
    """A delay that the vehicle was told of; 0 where it was told none."""
    stated = [settings[name] * unit_s for name in names if name in settings]
    return stated[0] if stated and 0.0 <= stated[0] <= LONGEST_DELAY_S else 0.0


def _origin(tables: dict[str, CsvTable]) -> Origin | None:
    return _first(tables.get("GPS"))


def _first(table: CsvTable | None) -> Origin | None:
    if table is None:
        return None
    latitude, longitude, altitude = table.matrix("Lat", "Lng", "Alt")[0].tolist()
    return latitude, longitude, altitude


def _truth(simulated: tuple[CsvTable, CsvTable | None] | None, about: Origin | None) -> Table | None:
    if simulated is None or about is None:
        return None
    return reference.truth(*simulated, about)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
