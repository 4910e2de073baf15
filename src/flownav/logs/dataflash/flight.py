"""An ArduPilot DataFlash log (.bin) as a Log, with the autopilot's own estimate, a simulator's truth and parameters.

docs/reference/dataflash.md lists the messages that are read and how.
"""

from pathlib import Path

import numpy as np

from flownav.core.errors import InputError
from flownav.core.frames import quaternion_from_euler
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.provenance import hash_of
from flownav.core.record import POSITION_NED, Table
from flownav.logs.assembly import Origin, local_ned
from flownav.logs.csv_table import CsvTable
from flownav.logs.dataflash import sensors
from flownav.logs.dataflash.columns import DataFlash, Field, check_rows, good_rows, held_at, message_rows
from flownav.logs.dataflash.events import battery, happened, parameters, setpoints
from flownav.logs.log import SIMULATOR, Log, absences_of, state_table
from flownav.logs.plausible import check_plausible

FARTHEST_M, FASTEST_M_S = 1e5, 300.0
EKF_ORIGIN = 0  # ORGN's Type: the filter's origin; 1 is home
FILTERS = {3: ("EKF3", "XKF"), 2: ("EKF2", "NKF"), 1: ("EKF1", "EKF")}  # by AHRS_EKF_TYPE; the last before 2016

GEODETIC = (Field("Lat", -90, 90), Field("Lng", -180, 180), Field("Alt", -1000, 20000))
POSITION_VELOCITY = (
    *(Field(f"P{axis}", -FARTHEST_M, FARTHEST_M) for axis in "NED"),
    *(Field(f"V{axis}", -FASTEST_M_S, FASTEST_M_S) for axis in "NED"),
)
ESTIMATE = (
    *POSITION_VELOCITY,
    *(Field("Roll", -181, 181), Field("Pitch", -91, 91), Field("Yaw", -361, 361)),
    Field("C", 0, 255, required=False),
)
TRUE_STATE = (*GEODETIC, *(Field(f"Q{i}", -1.01, 1.01) for i in (1, 2, 3, 4)))
LONGEST_DELAY_S = 1.0


def filter_origins(log: DataFlash) -> CsvTable | None:
    """Where the autopilot's local frame had its origin, and from when."""
    return good_rows(log, "ORGN", (*GEODETIC, Field("Type", EKF_ORIGIN, EKF_ORIGIN)))


def estimate_rows(log: DataFlash, settings: dict[str, float]) -> tuple[str, CsvTable] | None:
    """The filter that flew, by name, and the rows of its primary core; None where it was not logged."""
    preferred = int(settings.get("AHRS_EKF_TYPE", 3)) if np.isfinite(settings.get("AHRS_EKF_TYPE", 3)) else 3
    for kind in sorted(FILTERS, key=lambda kind: kind != preferred):
        name, prefix = FILTERS[kind]
        table = message_rows(log, f"{prefix}1", ESTIMATE)
        if table is None:
            continue
        if "C" in table.columns:
            table.keep(table.columns["C"] == _primary(log, f"{prefix}4", table), "another_core")
        check_rows(table, ESTIMATE)
        if len(table.t_s):
            return name, table
    return None


def _primary(log: DataFlash, name: str, table: CsvTable) -> Array:
    """The core in use at each row's time; the lowest one where the log does not state it."""
    primary = good_rows(log, name, (Field("PI", 0, 8),))
    if primary is None:
        return np.full(len(table.t_s), table.columns["C"].min(initial=np.inf))
    return held_at(table.t_s, primary.t_s, primary.columns["PI"])


def estimate(table: CsvTable, origins: CsvTable | None, origin: Origin | None) -> Table:
    """The estimate about the log's origin; about the filter's own where either is unknown."""
    position = about_origin(table.t_s, table.matrix("PN", "PE", "PD"), origins, origin)
    angles = np.radians(table.matrix("Roll", "Pitch", "Yaw"))
    quaternion = np.column_stack(quaternion_from_euler(*angles.T))
    return state_table(table.t_s, position, table.matrix("VN", "VE", "VD"), quaternion)


def about_origin(t_s: Array, position: Array, origins: CsvTable | None, origin: Origin | None) -> Array:
    """Positions (n, 3) of the filter's frame about the log's origin; as they are where either origin is unknown."""
    if origins is None or origin is None:
        return position
    shift = local_ned(origins.matrix("Lat", "Lng", "Alt"), origin)
    return np.asarray(position + held_at(t_s, origins.t_s, shift))


def asked_about(table: Table, origins: CsvTable | None, origin: Origin | None) -> Table:
    """A set-point's table, a position of it moved likewise."""
    if POSITION_NED[0] not in table:
        return table
    place = np.column_stack([table[name] for name in POSITION_NED])
    moved = about_origin(table["t_s"], place, origins, origin)
    return table | dict(zip(POSITION_NED, moved.T, strict=True))


def true_rows(log: DataFlash) -> tuple[CsvTable, CsvTable | None] | None:
    """A simulator's SIM rows (geodetic position and attitude) and SIM2 rows (position and velocity)."""
    state, motion = good_rows(log, "SIM", TRUE_STATE), good_rows(log, "SIM2", POSITION_VELOCITY)
    return None if state is None else (state, motion)


def truth(state: CsvTable, motion: CsvTable | None, origin: Origin) -> Table:
    """The truth at the times of SIM, about an origin.

    SIM2's position is finer than SIM's 1e-7 degrees but has the simulator's own origin: its median distance from
    SIM's gives that origin.
    """
    position = local_ned(state.matrix("Lat", "Lng", "Alt"), origin)
    velocity = np.full_like(position, np.nan)
    if motion is not None:
        both = motion.matrix("PN", "PE", "PD", "VN", "VE", "VD")
        inside = (state.t_s >= motion.t_s[0]) & (state.t_s <= motion.t_s[-1])
        moved = np.column_stack([np.interp(state.t_s, motion.t_s, column) for column in both.T])
        velocity[inside] = moved[inside, 3:]
        if inside.any():
            shift = np.median(position[inside] - moved[inside, :3], axis=0)
            position[inside] = moved[inside, :3] + shift
    quaternion = state.matrix("Q1", "Q2", "Q3", "Q4")
    size = np.linalg.norm(quaternion, axis=1)
    return state_table(state.t_s, position, velocity, quaternion / np.where(size > 0, size, np.nan)[:, None])


def stated_limits(settings: dict[str, float], rangefinder: int) -> dict[str, tuple[float, float]]:
    """The range limits in the vehicle's parameters for its rangefinder (counted from 0): centimetres, metres since
    ArduPilot 4.7.
    """
    prefix = f"RNGFND{'123456789A'[rangefinder] if 0 <= rangefinder < 10 else ''}_"
    for low, high, metre in (("MIN", "MAX", 1.0), ("MIN_CM", "MAX_CM", 0.01)):
        least, most = settings.get(prefix + low, np.nan) * metre, settings.get(prefix + high, np.nan) * metre
        if 0 <= least < most < np.inf:
            return {"range_m": (least, most)}
    return {}


# -- the log ------------------------------------------------------------------------------------------------
@np.errstate(all="ignore")  # a flipped bit makes numbers that overflow; the limits leave them out
def read_dataflash(path: Path, *, flow_instance: int | None = None) -> Log:
    """Read a log; times are seconds since the first reading used.

    flow_instance: which flow sensor, where the log has several; the one with most data by default. InputError where
    the file cannot be read or holds no sensor's message; where its clock restarts; where two sensors cannot be
    right together. Bad rows are counted in `Stream.rejected`, unreadable bytes stated in a note.
    """
    log = DataFlash(path)
    notes = _file_notes(log)
    settings = parameters(log)
    tables = sensors.sensor_rows(log, flow_instance, notes)
    _check_needed(log, tables, notes)
    estimated, simulated = estimate_rows(log, settings), true_rows(log)
    origins = filter_origins(log)
    beside = [*(estimated[1:] if estimated else ()), *(simulated or ()), origins]
    start_s = min(table.t_s[0] for table in tables.values())
    for table in (*tables.values(), *beside):
        if table is not None:
            table.t_s = table.t_s - start_s
    _check_overlap(path, tables)
    origin = _first(tables.get("GPS"))
    about = origin or _first(origins) or _first(simulated[0] if simulated else None)
    streams = _streams(tables, origin, settings)
    check_plausible(path, streams, flow=False)
    if estimated and origins is None:
        notes.append("ORGN is absent: the autopilot's estimate stands about its own origin")
    return Log(
        path, streams, origin, _truth(simulated, about), {path.name: hash_of(path)},
        (*notes, *(note for table in tables.values() for note in table.notes)),
        estimate(estimated[1], origins, about) if estimated else None, estimated[0] if estimated else "",
        stated_limits(settings, sensors.rangefinder_instance(log)) if "RFND" in tables else {},
        tuple(absences_of(streams, flow_rate="no optical flow (OF)", range="no downward rangefinder (RFND)")),
        clock_start_s=float(start_s), truth_name=SIMULATOR,
        parameters={name: value for name, value in settings.items() if np.isfinite(value)},
        happened=happened(log, start_s), battery=battery(log, start_s),
        setpoints=tuple(asked_about(each, origins, about) for each in setpoints(log, start_s)),
    )  # fmt: skip


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


def _check_needed(log: DataFlash, tables: dict[str, CsvTable], notes: list[str]) -> None:
    """InputError where no sensor's message can be read; notes: why those that occur cannot."""
    wanted = ["GPS", *sensors.STREAMS]
    if tables.keys() & set(wanted):
        return
    reasons = [note for note in notes if note.partition(" ")[0].rstrip(":") in wanted]
    why = "; ".join(reasons) or "LOG_BITMASK decides what the vehicle writes"
    raise InputError(f"{log.path}: no usable {', '.join(wanted)} in the log; {why}")


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
    """A delay that the vehicle's parameters state [s]; 0 where they state none."""
    stated = [settings[name] * unit_s for name in names if name in settings]
    return stated[0] if stated and 0.0 <= stated[0] <= LONGEST_DELAY_S else 0.0


def _first(table: CsvTable | None) -> Origin | None:
    if table is None:
        return None
    latitude, longitude, altitude = table.matrix("Lat", "Lng", "Alt")[0].tolist()
    return latitude, longitude, altitude


def _truth(simulated: tuple[CsvTable, CsvTable | None] | None, about: Origin | None) -> Table | None:
    if simulated is None or about is None:
        return None
    return truth(*simulated, about)
