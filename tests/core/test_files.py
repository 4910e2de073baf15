"""The order in which a folder's files are taken."""

from __future__ import annotations

from pathlib import Path

from flownav.core.files import natural_order


def test_numbers_in_names_count_by_their_value():
    names = ["run-1/a", "run-2/a", "run-10/a", "run-10/b2", "run-10/b10", "run-010/a", "x", "x1y2", "x1y10"]
    paths = [Path(name) for name in names]
    found = [str(path) for path in sorted(reversed(paths), key=natural_order)]
    assert found == [*names[:2], "run-010/a", *names[2:5], *names[6:]]


def test_names_without_numbers_and_with_foreign_digits_are_sorted_too():
    paths = [Path("b"), Path("a"), Path("\N{SUPERSCRIPT TWO}"), Path("3"), Path("")]
    assert sorted(paths, key=natural_order)[:4] == [Path(""), Path("3"), Path("a"), Path("b")]
