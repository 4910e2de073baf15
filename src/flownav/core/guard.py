"""Limits on what a run may read and where it may write: no output is ever an input, a link, a device or a file that
flownav did not write.

Readers pass every path through `an_input` before they open it. What a user named to be written is written with the
`written_whole` of this file, which passes it through `an_output`. Within `a_run` (the command line's is one) what was
read is remembered, so that a file which another file names is held to be an input too.
"""

import json
import os
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from flownav.core import files
from flownav.core.errors import InputError
from flownav.core.marks import HASH, is_ours, is_signed, manifest_of, marked, marked_page

KINDS = (
    (stat.S_ISFIFO, "a FIFO (a named pipe)"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
MOST_JSON_BYTES = 4 << 20  # of a file that we wrote ourselves; lists in it take thirty times as much memory
LONGEST_SHOWN = 200  # characters of a name in a message
READ_IN_FOLDERS = {".csv", ".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm"}  # by those who take a folder
RIG = "rig.toml"

Identity = tuple[int, int]  # of a file, whatever its names: device and inode


class Inputs:
    """Inputs that a run reads: files by their identity, and folders."""

    def __init__(self) -> None:
        self._paths: dict[Identity, Path] = {}
        self._folders: dict[Identity, Path] = {}

    def note(self, path: Path, info: os.stat_result) -> None:
        """A path that is read."""
        kept = self._folders if stat.S_ISDIR(info.st_mode) else self._paths
        kept[info.st_dev, info.st_ino] = path

    def file(self, info: os.stat_result | None) -> Path | None:
        """Under which path a file is read, if it is."""
        return None if info is None else self._paths.get((info.st_dev, info.st_ino))

    def folder_of(self, path: Path) -> Path | None:
        """The input folder in which a path lies, if it does, at whatever depth."""
        for parent in Path(os.path.realpath(path)).parents:
            try:
                info = parent.stat()
            except OSError:
                continue
            if (info.st_dev, info.st_ino) in self._folders:
                return self._folders[info.st_dev, info.st_ino]
        return None


_run: Inputs | None = None


@contextmanager
def a_run() -> Iterator[None]:
    """Within it what is read is remembered, and not written to."""
    global _run
    before, _run = _run, Inputs()
    try:
        yield
    finally:
        _run = before


def an_input(path: Path) -> Path:
    """The path, to be opened and read; what is missing is left to whoever opens it.

    InputError where it is a FIFO, a socket or a device, which would be read for ever, or its name cannot be one.
    """
    info = _status(path, os.stat)
    if info is not None:
        kind = _special(info)
        if kind:
            raise InputError(f"{path}: {kind} is not read; write what it gives to a file, and give that")
        if _run is not None:
            _run.note(path, info)
    return path


def object_in(path: Path, advice: str, most: int = MOST_JSON_BYTES) -> dict[str, Any]:
    """The object that a JSON file holds. InputError, with advice, where it cannot be read or is none."""
    try:
        with an_input(path).open("rb") as file:
            text = file.read(most + 1)
        if len(text) > most:
            raise ValueError(f"it has more than {most} bytes")
        content = json.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())[:LONGEST_SHOWN]
        raise InputError(f"{path}: cannot be read ({reason}); {advice}") from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: cannot be read (it holds no object); {advice}")
    return content


def inputs_there(paths: Iterable[Path], what: str) -> None:
    """InputError where a file or folder that is to be read is missing, or cannot be read; `what` names the kind of
    input.
    """
    for path in paths:
        if not an_input(path).exists():
            raise InputError(f"{path}: no such file or folder; {what}")


def a_record_place(path: Path, inputs: Iterable[Path] = (), *, force: bool) -> Path:
    """The path of a record that is numbered where one is there, or that replaces it (force).

    InputError as of `an_output`, but that what is there may be a live record; with force it must be a record.
    """
    info = _status_of_output(path, inputs)
    if force and info is not None and info.st_size and manifest_of(path) is None:
        raise InputError(f"{path}: is there already and is no record, so it is not replaced; give another name")
    return path


def an_output(path: Path, inputs: Iterable[Path] = (), *, signed_by: Path | None = None) -> Path:
    """The path of a file to be written, which may be there already if flownav wrote it.

    inputs: paths that are read in the same run, besides those remembered. signed_by: the file that says by its SHA-256
    that this one is flownav's, where it does not do so itself. InputError where the path is one of them or
    would become one, is a link, a folder, a FIFO, a socket or a device, or holds what flownav does not replace.
    """
    info = _status_of_output(path, inputs)
    if info is not None and info.st_size and not (is_signed(path, signed_by) if signed_by else is_ours(path)):
        raise InputError(
            f"{path}: is there already and was not written by flownav, or cannot be made again, so it is not replaced; "
            "give another name, or move it away"
        )
    return path


def an_output_folder(path: Path) -> Path:
    """The path of a folder to be written. InputError where it is a link, or no folder."""
    info = _status(path, _unfollowed)
    if info is not None and stat.S_ISLNK(info.st_mode):
        raise InputError(_through_a_link(path))
    if info is not None and not stat.S_ISDIR(info.st_mode):
        raise InputError(f"{path}: cannot be written (it is {_special(info) or 'a file'}); give a folder's name")
    return path


def require_may_be_made(path: Path) -> None:
    """InputError where a folder, or a file in it, could not be made. It is tried beside the nearest folder that is
    there, and nothing of it stays.
    """
    there = next((folder for folder in (path, *path.absolute().parents) if os.path.lexists(folder)), path)
    try:
        with TemporaryDirectory(prefix=".", suffix=".part", dir=there):
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another folder") from None


@contextmanager
def written_whole(path: Path, *, replacing: bool = False) -> Iterator[Path]:
    """A file that a user named, written whole as by files.written_whole.

    replacing: whoever asks knows that what is there may go. InputError, unless replacing, where `an_output` refuses;
    OSError where the file cannot be written.
    """
    if not replacing:
        an_output(path)
    with files.written_whole(path) as temporary:
        yield temporary


def write_page(page: str, path: Path) -> None:
    """Write an HTML page, whole or not at all, with the mark by which it is known as flownav's. As `written_whole`."""
    with written_whole(path) as temporary:
        temporary.write_bytes(marked_page(page))


def write_text(text: str, path: Path, comment: tuple[str, str] = HASH) -> None:
    """Write a text, whole or not at all, with the line by which it is known as flownav's. As `written_whole`.

    comment: how one begins and ends in that format.
    """
    with written_whole(path) as temporary:
        temporary.write_bytes(marked(text, comment))


@contextmanager
def folder_written_whole(path: Path) -> Iterator[Path]:
    """A folder that a user named, written whole as by files.folder_written_whole. InputError where it is a link."""
    with files.folder_written_whole(an_output_folder(path)) as temporary:
        yield temporary


def _status_of_output(path: Path, inputs: Iterable[Path]) -> os.stat_result | None:
    """Status of a file to be written; None where there is none yet. InputError where it is no file, or is an input."""
    info = _status(path, _unfollowed)
    if info is not None and stat.S_ISLNK(info.st_mode):
        raise InputError(_through_a_link(path))
    if info is not None and stat.S_ISDIR(info.st_mode):
        raise InputError(f"{path}: cannot be written (it is a folder); give a file's name")
    if info is not None and (kind := _special(info)):
        raise InputError(f"{path}: cannot be written ({kind}); give another name")
    _check_no_input(path, info, inputs)
    return info


def _through_a_link(path: Path) -> str:
    return f"{path}: cannot be written (nothing is written through a symbolic link); give the name it leads to"


def _check_no_input(path: Path, info: os.stat_result | None, inputs: Iterable[Path]) -> None:
    read = Inputs()
    for each in inputs:
        status = _status(each, os.stat)
        if status is not None:
            read.note(each, status)
    in_folders = path.suffix.lower() in READ_IN_FOLDERS or path.name.lower() == RIG
    for known in (read, _run):
        taken = None if known is None else known.file(info)
        if taken is not None:
            also = "" if str(taken) == str(path) else f" (the same file as {taken})"
            raise InputError(f"{path}{also}: this would replace what it is made from; give another name")
        folder = None if known is None or not in_folders else known.folder_of(path)
        if folder is not None:
            raise InputError(f"{path}: lies in {folder}, which this run reads, as one of its files; give another name")


def _special(info: os.stat_result) -> str:
    return next((name for test, name in KINDS if test(info.st_mode)), "")


def _unfollowed(path: Path) -> os.stat_result:
    """A path, the links of its folders followed; `absent/../x` is x, as it will be once the folder is made."""
    return os.lstat(os.path.join(os.path.realpath(path.parent), path.name))


def _status(path: Path, look: Callable[[Path], os.stat_result]) -> os.stat_result | None:
    """Status of a path; None where nothing is there. InputError where the path cannot be one."""
    try:
        return look(path)
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return None
    except (OSError, ValueError) as error:
        name = str(path) if len(str(path)) <= LONGEST_SHOWN else f"{str(path)[:LONGEST_SHOWN]}..."
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{name}: cannot be the name of a file ({reason}); give another") from error
