"""A record in Rerun's viewer: the flight in space, its cameras, flow, errors and innovations on one time line."""

import errno
import os
import sys
import uuid
from pathlib import Path
from typing import Any, NamedTuple

from flownav.core.errors import InputError
from flownav.core.guard import written_whole
from flownav.core.record import Record
from flownav.export.trajectory import trajectories

APPLICATION = "flownav"
SUFFIX = ".rrd"
HEADER, FOOTER, TAIL_BYTES = b"RRF2", b"RRF2FOOT", 12  # a file of that format begins and ends so
NEEDED = "flownav view needs Rerun's package rerun-sdk: pip install 'flownav[view]'"


class Prepared(NamedTuple):
    """A recording with everything logged, how the viewer is laid out, and what a user should know, one line each."""

    stream: Any
    blueprint: Any
    notes: list[str]


def has_display() -> bool:
    """Whether a window can be opened here: always on macOS and Windows, elsewhere where X11 or Wayland is there."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def write_rrd(record: Record, path: Path) -> list[str]:
    """Write a record as one file for Rerun, whole or not at all; notes.

    InputError where rerun-sdk is not installed or the record holds no path; OSError where nothing can be written.
    """
    _require_rerun()
    with written_whole(path) as temporary:
        try:
            prepared = _prepare(record, path.stem, to=temporary)
            prepared.stream.flush()
            prepared.stream.disconnect()
        except RuntimeError as error:  # Rerun's, for whatever the system says
            raise OSError(errno.EIO, f"Rerun: {str(error).splitlines()[0]}; is the disk full?", str(path)) from error
        if not _is_whole(temporary):
            raise OSError(errno.ENOSPC, "Rerun could not write all of it; is the disk full?", str(path))
    return prepared.notes


def _is_whole(path: Path) -> bool:
    """Whether a file ends as Rerun ends one: where its last bytes cannot be written, it only logs that."""
    with path.open("rb") as file:
        if file.read(len(HEADER)) != HEADER:  # of a later Rerun, whose end is not known
            return True
        file.seek(max(os.fstat(file.fileno()).st_size - TAIL_BYTES, 0))
        return FOOTER in file.read(TAIL_BYTES)


def show(record: Record, name: str) -> list[str]:
    """Open a record in Rerun's viewer, a window of its own that stays after this process; notes.

    InputError where rerun-sdk is not installed, the record holds no path, or the viewer cannot be started.
    """
    _require_rerun()
    prepared = _prepare(record, name)
    try:
        prepared.stream.spawn(default_blueprint=prepared.blueprint)
    except (RuntimeError, OSError) as error:
        raise InputError(
            f"Rerun's viewer does not start ({str(error).splitlines()[0]}); `flownav view --out FILE.rrd` writes a file"
        ) from error
    prepared.stream.flush()
    return prepared.notes


def _require_rerun() -> None:
    os.environ.setdefault("RUST_LOG", "off")  # else its own lines stand beside ours
    try:
        import rerun  # noqa: F401
    except ImportError as error:
        raise InputError(NEEDED) from error


def _prepare(record: Record, name: str, to: Path | None = None) -> Prepared:
    """Log a record to a new recording, which streams into a file where one is given."""
    paths = trajectories(record)
    import rerun as rr

    from flownav.export.viewing.plots import arrangement, log_plots
    from flownav.export.viewing.scene import log_scene

    stream = rr.RecordingStream(APPLICATION, recording_id=str(uuid.uuid4()), send_properties=False)
    blueprint = arrangement(record, paths)
    if to is not None:
        stream.save(to, default_blueprint=blueprint)
    stream.send_recording_name(name)
    log_scene(stream, record, paths)
    log_plots(stream, record, paths)
    return Prepared(stream, blueprint, [note for path in paths for note in path.notes])
