"""A record in Rerun's viewer: the flight in space, its cameras, flow, errors and innovations on one time line."""

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
NEEDED = "flownav view needs Rerun's package rerun-sdk: pip install 'flownav[view]'"


class Prepared(NamedTuple):
    """A recording with everything logged, the viewer's layout, its bytes where they are kept in memory, and notes."""

    stream: Any
    blueprint: Any
    memory: Any
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
    prepared = _prepare(record, path.stem, kept=True)
    with written_whole(path) as temporary:
        temporary.write_bytes(prepared.memory.drain_as_bytes())
    return prepared.notes


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


def _prepare(record: Record, name: str, *, kept: bool = False) -> Prepared:
    """Log a record to a new recording. kept: in memory, whole, since a file that Rerun writes itself may be cut, or
    never end, where the disk is full.
    """
    paths = trajectories(record)
    import rerun as rr

    from flownav.export.viewing.plots import arrangement, log_plots
    from flownav.export.viewing.scene import log_scene

    stream = rr.RecordingStream(APPLICATION, recording_id=str(uuid.uuid4()), send_properties=False)
    blueprint = arrangement(record, paths)
    memory = stream.memory_recording() if kept else None
    if kept:
        stream.send_blueprint(blueprint)
    stream.send_recording_name(name)
    log_scene(stream, record, paths)
    log_plots(stream, record, paths)
    return Prepared(stream, blueprint, memory, [note for path in paths for note in path.notes])
