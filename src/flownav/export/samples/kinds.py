"""Which sample logs there are, what each holds, what to try with it, and how the plainer ones are written.

The folder of CSV files is what `logs/csv_folder.py` reads (docs/reference/csv-folder.md); a ground station's MAVLink
log is what the simulated vehicle of `live` tells, a time before each frame.
"""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import COLUMNS, Array, Sensor
from flownav.core.record import POSITION_NED
from flownav.export.samples.dataflash import write_dataflash
from flownav.export.samples.flight import Fixes, angles_of, changes, fixes_of, sample_log, sample_record
from flownav.export.samples.ulog import write_ulog
from flownav.live.simulated import SimulatedVehicle
from flownav.logs.log import Log

MILLIGAUSS_PER_GAUSS = 1e3
FIX_3D = 3.0
Columns = dict[str, Array]
START_US = 1_767_225_600_000_000  # 2026-01-01: of the ground station's clock, which no flight was flown by
STEP_S = 0.002
LINK_S = 0.004  # from the vehicle to the ground station
RIG_HEIGHTS_M, RIG_RUNS = (0.6, 1.0), 2


def write_csv_folder(log: Log, folder: Path) -> None:
    """Write a file for each sensor of a log into a folder that is there."""
    for name, columns in tables_of(log):
        formats = ["%.9f" if key in ("lat_deg", "lon_deg") else "%.6f" if key == "t_s" else "%.9g" for key in columns]
        line = ",".join(formats)
        rows = np.column_stack(list(columns.values())).tolist()
        text = "\n".join([",".join(columns), *(line % tuple(row) for row in rows)]) + "\n"
        (folder / f"{name}.csv").write_text(text, encoding="utf-8", newline="\n")


def tables_of(log: Log) -> Iterator[tuple[str, Columns]]:
    """Name and columns of each file; the attitude is the one that the vehicle's autopilot flew on."""
    if log.autopilot is not None:
        own = log.autopilot
        angles = zip(("roll_rad", "pitch_rad", "yaw_rad"), angles_of(own).T, strict=True)
        yield "attitude", {"t_s": own["t_s"], **dict(angles)}
    for name, sensor in (("imu", Sensor.IMU), ("flow", Sensor.FLOW_RATE), ("baro", Sensor.BARO)):
        if sensor in log.streams:
            stream = log.streams[sensor]
            columns = {"t_s": stream.t_s, **dict(zip(COLUMNS[sensor], stream.value.T, strict=True))}
            yield name, columns | ({"quality": stream.quality} if sensor == Sensor.FLOW_RATE else {})
    if Sensor.GPS_POSITION in log.streams:
        yield "gps", _gps(fixes_of(log))
    if Sensor.RANGE in log.streams:
        ranges = log.streams[Sensor.RANGE]
        yield "range", {"t_s": ranges.t_s, "range_m": ranges.value[:, 0], "valid": (ranges.quality > 0.0).astype(float)}
    if Sensor.MAG in log.streams:
        field = log.streams[Sensor.MAG]
        names = (f"mag_{axis}_mgauss" for axis in "xyz")
        yield "mag", {"t_s": field.t_s, **dict(zip(names, MILLIGAUSS_PER_GAUSS * field.value.T, strict=True))}
    if Sensor.LANDED in log.streams:
        t_s, landed = changes(log)
        yield "landed", {"t_s": t_s, "landed": landed}
    if log.truth is not None:
        place = {f"{axis}_m": log.truth[name] for axis, name in zip("xyz", POSITION_NED, strict=True)}
        yield "truth", {"t_s": log.truth["t_s"], **place}
        yield "heading_truth", {"t_s": log.truth["t_s"], "yaw_rad": angles_of(log.truth)[:, 2]}


def _gps(fixes: Fixes) -> Columns:
    velocity = dict(zip((f"vel_{axis}_m_s" for axis in "ned"), fixes.velocity_ned_m_s.T, strict=True))
    place = {"lat_deg": fixes.lat_deg, "lon_deg": fixes.lon_deg, "alt_m": fixes.alt_m}
    return {"t_s": fixes.t_s, "fix_type": np.full(len(fixes.t_s), FIX_3D), **place, **velocity}


def write_tlog(log: Log, path: Path) -> None:
    """Write a log as a .tlog. InputError where pymavlink is not installed."""
    vehicle, parts = SimulatedVehicle(log), []
    for t_s in np.arange(0.0, vehicle.end_s + STEP_S, STEP_S).tolist():
        stamp = struct.pack(">Q", START_US + round((t_s + LINK_S) * 1e6))
        parts += [stamp + frame for frame in vehicle.due(t_s, 0.0)]
    path.write_bytes(b"".join(parts))


class Sample(NamedTuple):
    """A kind of sample log. write: seed and the path of the file, or of a folder that is there.

    commands: what to try, {path} in place of the file. uses: the extra that the kind needs; "" for none.
    """

    kind: str
    name: str
    what: str
    write: Callable[[int, Path], None]
    commands: tuple[str, ...]
    folder: bool = False
    uses: str = ""


def _rig(seed: int, folder: Path) -> None:
    """Two runs at each of two heights, as `flownav rig` makes them."""
    from flownav.core.compile import announce_compilation
    from flownav.lab.rig.experiment import RigSettings, run_campaign
    from flownav.lab.rig.log_folder import run_folders, write_rig_folder

    heights = " ".join(f"--height {height:g}" for height in RIG_HEIGHTS_M)
    command = f"flownav rig {heights} --runs {RIG_RUNS} --seed {seed}"
    settings = RigSettings(height_m=RIG_HEIGHTS_M[0], runs=RIG_RUNS, seed=seed)
    places = run_folders(folder, len(RIG_HEIGHTS_M) * RIG_RUNS)
    with announce_compilation("rig"):
        for log, place in zip(run_campaign(settings, RIG_HEIGHTS_M), places, strict=True):
            write_rig_folder(log, place, command, dated=False)


SAMPLES = (
    Sample(
        "csv", "flight-csv", "a quadrotor's flight, one CSV file a sensor",
        lambda seed, at: write_csv_folder(sample_log(seed), at),
        ("flownav info {path}", "flownav replay {path} --gps-outage 30:75", "flownav identify {path}"), folder=True,
    ),
    Sample(
        "ulog", "flight.ulg", "the same flight as a PX4 log", lambda seed, at: write_ulog(sample_log(seed), at),
        ("flownav info {path}", "flownav replay {path}", "flownav identify {path} --for px4"),
    ),
    Sample(
        "tlog", "flight.tlog", "the same flight as a ground station's MAVLink log",
        lambda seed, at: write_tlog(sample_log(seed), at),
        ("flownav info {path}", "flownav replay {path}"), uses="live",
    ),
    Sample(
        "dataflash", "flight.bin", "the same flight as an ArduPilot log",
        lambda seed, at: write_dataflash(sample_log(seed), at),
        ("flownav info {path}", "flownav replay {path}", "flownav identify {path} --for ardupilot"),
    ),
    Sample(
        "rig", "rig", "a flow sensor that swings over a pad at 0.6 and 1 m", _rig,
        ("flownav identify {path}",), folder=True,
    ),
    Sample(
        "record", "pad_return.fnr", "a take-off from a pad and a landing on it, flownav's own record",
        lambda seed, at: sample_record(seed).save(at, replacing=True),
        ("flownav report {path}", "flownav replay {path}", "flownav export {path} --to mcap"),
    ),
)  # fmt: skip
KINDS = tuple(sample.kind for sample in SAMPLES)


def sample_of(kind: str) -> Sample:
    """The sample of a kind. InputError where there is none."""
    for sample in SAMPLES:
        if sample.kind == kind:
            return sample
    raise InputError(f"{kind}: no such sample; choose from {', '.join(KINDS)}")
