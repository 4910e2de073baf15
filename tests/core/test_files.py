"""The order in which a folder's files are taken; what cannot be written is named as its user named it."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from flownav.core.files import folder_written_whole, natural_order, written_whole


def full(path):
    """As a write to a disk without room fails: it names no file."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def full_in_arrow(path):
    raise OSError(errno.ENOSPC, "Error writing bytes to file. Detail: [errno 28] No space left on device")


def absent(path):
    (path / "b" / "c").write_bytes(b"")


@pytest.mark.parametrize("written", [written_whole, folder_written_whole])
@pytest.mark.parametrize(("write", "named"), [(full, "a"), (full_in_arrow, "a"), (absent, "a/b/c")])
def test_what_cannot_be_written_is_named_by_its_own_name(tmp_path, written, write, named):
    with (
        pytest.raises(OSError, match=r"No space|No such file|Not a directory") as error,
        written(tmp_path / "a") as new,
    ):
        write(new)
    assert error.value.filename == str(tmp_path / named)
    assert error.value.strerror == os.strerror(error.value.errno)
    assert not list(tmp_path.iterdir())


def test_what_was_not_about_writing_stays_as_it_was(tmp_path):
    with pytest.raises(OSError, match="Input/output") as error, written_whole(tmp_path / "a"):
        raise OSError(errno.EIO, os.strerror(errno.EIO))
    assert error.value.filename is None
    with pytest.raises(OSError, match="No such file") as error, written_whole(tmp_path / "a"):
        Path("/absent/b").read_bytes()
    assert error.value.filename == "/absent/b"


def test_numbers_in_names_count_by_their_value():
    names = ["run-1/a", "run-2/a", "run-10/a", "run-10/b2", "run-10/b10", "run-010/a", "x", "x1y2", "x1y10"]
    paths = [Path(name) for name in names]
    found = [str(path) for path in sorted(reversed(paths), key=natural_order)]
    assert found == [*names[:2], "run-010/a", *names[2:5], *names[6:]]


def test_names_without_numbers_and_with_foreign_digits_are_sorted_too():
    paths = [Path("b"), Path("a"), Path("\N{SUPERSCRIPT TWO}"), Path("3"), Path("")]
    assert sorted(paths, key=natural_order)[:4] == [Path(""), Path("3"), Path("a"), Path("b")]
