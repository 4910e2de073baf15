"""Sample logs written into a folder: each whole or not at all, and nothing that is there already silently replaced."""

import shutil
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from flownav.core.errors import InputError
from flownav.core.free_names import free_name
from flownav.core.guard import an_output_folder
from flownav.export.samples.kinds import SAMPLES, Sample

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
