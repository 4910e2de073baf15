"""Names for what is written: nothing that is there is replaced unless that is asked for; it is numbered instead.

`out/landing.fnr` is there: the next one is `out/landing-1.fnr`, with its report `out/landing-1.html`.
"""

import os
from collections.abc import Callable, Iterable, Sequence
from glob import escape
from pathlib import Path

from flownav.core.errors import InputError
from flownav.core.guard import a_record_place, an_output, an_output_folder

MOST_NUMBERS = 10_000  # that a name is counted on to


def a_place(path: Path, inputs: Iterable[Path] = (), *, force: bool, beside: Sequence[str] = ()) -> Path:
    """The path of a file to be written, or the first of the numbered names where something is there.

    beside: endings of files that are written beside it under the same name (.html, _layout.json). force: what is there
    is replaced, if flownav wrote it and can write it again. InputError where the path may not be written whatever it is
    called: it is an input, a link, a folder, a FIFO, a socket or a device; with force also where it holds what is not
    replaced.
    """
    read = list(inputs)
    for each in _with_beside(path, beside):
        if force:
            an_output(each, read)
        else:
            a_record_place(each, read, force=False)
    if force:
        return path
    return _first_free(path, lambda found: all(map(_is_free, _with_beside(found, beside))))


def a_place_of_several(path: Path, inputs: Iterable[Path] = (), *, force: bool) -> Path:
    """A free place for files that are all called after a path: NAME_estimate.tum, NAME_truth.tum, ... of NAME.tum.

    force: as of `a_place`, of each that is there.
    """
    for each in [path.with_name(f"{path.stem}_estimate{path.suffix}"), *sorted(_several(path))]:
        a_place(each, inputs, force=force)
    return path if force else _first_free(path, lambda found: not _several(found))


def _several(path: Path) -> list[Path]:
    """Existing files of such names."""
    return list(path.parent.glob(f"{escape(path.stem)}_*{path.suffix}")) if path.parent.is_dir() else []


def a_folder_place(path: Path, *, force: bool = False) -> Path:
    """The path of a folder to be written, or the first of the numbered names where it is there and holds something.

    force: the path itself, for its writer to look into. InputError where it is a link, or no folder.
    """
    an_output_folder(path)

    def is_free(found: Path) -> bool:  # nothing is there, or an empty folder
        return not os.path.lexists(found) or (found.is_dir() and not found.is_symlink() and not any(found.iterdir()))

    return path if force else _first_free(path, is_free)


def numbered(path: Path, number: int) -> Path:
    """flight.fnr, flight-1.fnr, flight-2.fnr, ..."""
    return path.with_name(f"{path.stem}-{number}{path.suffix}") if number else path


def free_name(path: Path) -> Path:
    """The first of the numbered names that nothing has. InputError where all are taken."""
    return _first_free(path, lambda found: not os.path.lexists(found))


def _first_free(path: Path, is_free: Callable[[Path], bool]) -> Path:
    for number in range(MOST_NUMBERS):
        if is_free(found := numbered(path, number)):
            return found
    raise InputError(f"{path}: it is there, and so are {MOST_NUMBERS} numbered beside it; give another name")


def _with_beside(path: Path, endings: Iterable[str]) -> list[Path]:
    return [path, *(path.with_name(path.stem + ending) for ending in endings)]


def _is_free(path: Path) -> bool:
    """Whether nothing is there, or an empty file."""
    return not os.path.lexists(path) or (path.is_file() and not path.is_symlink() and not path.stat().st_size)
