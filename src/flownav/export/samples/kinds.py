"""Which sample logs there are, what each holds, what to try with it, and how the plainer ones are written.

The folder of CSV files is what `logs/csv_folder.py` reads (docs/reference/csv-folder.md); a ground station's MAVLink
log is what the simulated vehicle of `live` tells, a time before each frame.

Last: they are written into a folder, each whole or not at all, and nothing that is there already is silently replaced.
"""

import shutil
import struct
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.free_names import free_name
from flownav.core.guard import an_output_folder
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
    from flownav.lab.rig.experiment import RigSettings, run_campaign, run_folders, write_rig_folder

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


README = "README.txt"
FIRST_LINE = "Sample logs, written by `flownav sample`."


class Written(NamedTuple):
    """A sample and where it lies. state: "written", "unchanged" or "replaced"; instead_of: a name that was taken."""

    sample: Sample
    path: Path
    size_bytes: int
    state: str
    instead_of: Path | None = None

    @property
    def commands(self) -> list[str]:
        """What to try with it."""
        return [command.format(path=self.path) for command in self.sample.commands]


def write_samples(
    samples: Iterable[Sample],
    folder: Path,
    seed: int,
    *,
    force: bool = False,
    on_written: Callable[[Written], None] = lambda written: None,
) -> list[Written]:
    """Write samples into a folder; the same seed gives the same bytes. on_written: called with each.

    What is there with the same content stays as it is. What is there with another content is replaced with force, if
    flownav wrote it; without, the next free number is taken. InputError where the folder cannot be written.
    """
    an_output_folder(folder)
    found = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        ours = _is_ours(folder)
        for sample in samples:
            with tempfile.TemporaryDirectory(prefix=".sample-", dir=folder) as place:
                made = Path(place) / sample.name
                if sample.folder:
                    made.mkdir()
                sample.write(seed, made)
                found.append(_put(sample, made, folder / sample.name, force=force, ours=ours))
            on_written(found[-1])
        if ours or not (folder / README).exists():
            (folder / README).write_text(readme(seed), encoding="utf-8", newline="\n")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); give another name") from error
    return found


def _put(sample: Sample, made: Path, path: Path, *, force: bool, ours: bool) -> Written:
    """Move what was made to its place."""
    content, size = _content(made), sum(map(len, _content(made).values()))
    if path.is_symlink():
        raise InputError(f"{path}: cannot be written (nothing is written through a symbolic link); give another name")
    if not path.exists():
        made.rename(path)
        return Written(sample, path, size, "written")
    if _content(path) == content:
        return Written(sample, path, size, "unchanged")
    if not force:
        free = free_name(path)
        made.rename(free)
        return Written(sample, free, size, "written", path)
    if not ours:
        raise InputError(f"{path}: is there already and was not written by flownav, so it is not replaced")
    if path.is_dir():
        shutil.rmtree(path)
    made.replace(path)
    return Written(sample, path, size, "replaced")


def _is_ours(folder: Path) -> bool:
    readme = folder / README
    return readme.is_file() and readme.read_text(encoding="utf-8", errors="replace").startswith(FIRST_LINE)


def _content(path: Path) -> dict[str, bytes]:
    """A file's bytes, or those of a folder's files, by their names in it."""
    files = [path] if path.is_file() else sorted(file for file in path.rglob("*") if file.is_file())
    return {str(file.relative_to(path)): file.read_bytes() for file in files}


def readme(seed: int) -> str:
    """What the files are, in words."""
    lines = [FIRST_LINE, *ABOUT.format(seed=seed).splitlines(), ""]
    for sample in SAMPLES:
        lines += [f"{sample.name} ({sample.kind})", f"  {sample.what}. Try here:"]
        lines += [f"    {command.format(path=sample.name)}" for command in sample.commands]
        lines.append("")
    return "\n".join(lines)


ABOUT = """
Everything here is simulated; nothing was flown. These were made with seed {seed};
the same seed gives the same bytes.

All flight.* and flight-csv are of one flight: a quadrotor takes off, flies legs
at 1 to 2 m/s and 1.5 to 2.5 m, returns and lands, in 100 s of light wind.
Its sensors: GPS (2 m CEP, fixes 0.22 s old), flow with a gyro, lidar range,
IMU, magnetometer, barometer. Beside them stands the truth.
The flow sensor reads 12 % too little (gain 0.88), and a reading is 64 ms old
when it arrives: that is what `flownav identify` should find.
The autopilot's estimate in flight.ulg is that of flownav's navigator, which
flew the simulated vehicle and knew its flow sensor."""
