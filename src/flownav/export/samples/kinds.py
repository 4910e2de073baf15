"""Which sample logs there are, what each holds, and what to try with it.

They are written into a folder, each whole or not at all, and nothing that is there already is silently replaced.
What flies and writes them is loaded when one is written: `sample --list` and the command's help want only their names.
"""

import hashlib
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from flownav.core.errors import InputError
from flownav.core.free_names import free_name
from flownav.core.guard import an_output_folder

RIG_HEIGHTS_M, RIG_RUNS = (0.6, 1.0), 2


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


def _as_csv(seed: int, folder: Path) -> None:
    from flownav.export.samples.flight import sample_log, write_csv_folder

    write_csv_folder(sample_log(seed), folder)


def _as_ulog(seed: int, path: Path) -> None:
    from flownav.export.samples.flight import sample_log
    from flownav.export.samples.ulog import write_ulog

    write_ulog(sample_log(seed), path)


def _as_tlog(seed: int, path: Path) -> None:
    from flownav.export.samples.flight import sample_log, write_tlog

    write_tlog(sample_log(seed), path)


def _as_dataflash(seed: int, path: Path) -> None:
    from flownav.export.samples.dataflash import write_dataflash
    from flownav.export.samples.flight import sample_log

    write_dataflash(sample_log(seed), path)


def _as_record(seed: int, path: Path) -> None:
    from flownav.export.samples.flight import sample_record

    sample_record(seed).save(path, replacing=True)


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
        "csv", "flight-csv", "a quadrotor's flight, one CSV file per sensor",
        _as_csv,
        ("flownav info {path}", "flownav replay {path} --gps-outage 30:75", "flownav identify {path}"), folder=True,
    ),
    Sample(
        "ulog", "flight.ulg", "the same flight as a PX4 log", _as_ulog,
        ("flownav info {path}", "flownav replay {path}", "flownav identify {path} --for px4"),
    ),
    Sample(
        "tlog", "flight.tlog", "the same flight as a ground station's MAVLink log",
        _as_tlog,
        ("flownav info {path}", "flownav replay {path}"), uses="live",
    ),
    Sample(
        "dataflash", "flight.bin", "the same flight as an ArduPilot log",
        _as_dataflash,
        ("flownav info {path}", "flownav replay {path}", "flownav identify {path} --for ardupilot"),
    ),
    Sample(
        "rig", "rig", "a flow sensor that swings over a pad at 0.6 and 1 m", _rig,
        ("flownav identify {path}",), folder=True,
    ),
    Sample(
        "record", "pad_return.fnr", "a take-off from a pad and a landing on it, flownav's own record",
        _as_record,
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
DIGESTS = "By these digests `flownav sample --force` knows what it may replace:"
DIGEST_DIGITS = 32  # of a SHA-256's 64
DIGEST_LINE = re.compile(r"^  ([0-9a-f]{32})  (\S+)$", re.MULTILINE)
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
        """Commands to try with it."""
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
        known = _known(folder)
        for sample in samples:
            with tempfile.TemporaryDirectory(prefix=".sample-", dir=folder) as place:
                made = Path(place) / sample.name
                if sample.folder:
                    made.mkdir()
                sample.write(seed, made)
                found.append(_put(sample, made, folder / sample.name, force=force, known=known))
            on_written(found[-1])
        if known is not None or not (folder / README).exists():
            digests = (known or {}) | {one.path.name: _digest(_content(one.path)) for one in found}
            (folder / README).write_bytes(readme(seed, digests).encode())
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); give another name") from error
    return found


def _put(sample: Sample, made: Path, path: Path, *, force: bool, known: dict[str, str] | None) -> Written:
    """Move what was made to its place. known: the digests of what flownav wrote into the folder before."""
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
    if known is None or known.get(path.name) != _digest(_content(path)):
        raise InputError(f"{path}: is there already and was not written by flownav, so it is not replaced")
    if path.is_dir():
        shutil.rmtree(path)
    made.replace(path)
    return Written(sample, path, size, "replaced")


def _known(folder: Path) -> dict[str, str] | None:
    """Digests by name of what flownav wrote into a folder, as its README has them; None where that is not ours."""
    readme = folder / README
    text = readme.read_text(encoding="utf-8", errors="replace") if readme.is_file() else ""
    if not text.startswith(FIRST_LINE):
        return None
    return {found[2]: found[1] for found in DIGEST_LINE.finditer(text)}


def _digest(content: dict[str, bytes]) -> str:
    """The first half of SHA-256 of a file, or over the names and contents of a folder's files."""
    own = hashlib.sha256()
    for name, data in content.items():
        own.update(f"{name} {hashlib.sha256(data).hexdigest()}\n".encode())
    return own.hexdigest()[:DIGEST_DIGITS]


def _content(path: Path) -> dict[str, bytes]:
    """A file's bytes, or those of a folder's files, by their names in it."""
    files = [path] if path.is_file() else sorted(file for file in path.rglob("*") if file.is_file())
    return {str(file.relative_to(path)): file.read_bytes() for file in files}


def readme(seed: int, digests: Mapping[str, str]) -> str:
    """Description of the files in words, with their digests by name, by which flownav knows them again."""
    lines = [FIRST_LINE, *ABOUT.format(seed=seed).splitlines(), ""]
    for sample in SAMPLES:
        lines += [f"{sample.name} ({sample.kind})", f"  {sample.what}. Try here:"]
        lines += [f"    {command.format(path=sample.name)}" for command in sample.commands]
        lines.append("")
    lines += [DIGESTS, *(f"  {digest}  {name}" for name, digest in sorted(digests.items())), ""]
    return "\n".join(lines)


ABOUT = """
Everything here is simulated; nothing was flown. These were made with seed {seed};
the same seed gives the same bytes.

All flight.* and flight-csv are of one flight: a quadrotor takes off, flies legs
at 1 to 2 m/s and 1.5 to 2.5 m, returns and lands, in 100 s of light wind.
Its sensors: GPS (2 m CEP, fixes 0.22 s old), flow with a gyro, lidar range,
IMU, magnetometer, barometer. Beside them stands the truth.
The flow sensor reads 12 % too little (gain 0.88): `flownav identify` shows it.
A reading is 64 ms old when it arrives, which takes faster motion to show: the
flight shows it too vaguely, the swinging rig shows its own sensor's.
The autopilot's estimate in flight.ulg is that of flownav's navigator, which
flew the simulated vehicle and knew its flow sensor."""
