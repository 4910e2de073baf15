"""The lines that say how loops over lanes are called: that they are those of the loops, and what must be named."""

from __future__ import annotations

import inspect

import pytest

from calls import PACKAGES, file_of, first_by_name, imported, loops_of, written


@pytest.mark.parametrize("package", PACKAGES)
def test_the_lines_are_those_of_the_loops(package):
    """After a change: `python tools/calls.py`."""
    assert file_of(package).read_text(encoding="utf-8") == written(package)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_loop_over_lanes_takes_the_line_of_its_own_name(package):
    """In source: a line of another function would let mypy check calls against another's arguments."""
    for module in imported(package):
        source = inspect.getsource(module)
        for name in loops_of([module]):
            assert f"(calls.{name})\ndef {name}(" in source, (module.__name__, name)


def test_an_argument_that_one_before_could_be_taken_for_is_passed_by_its_name():
    assert first_by_name(["float", "int", "bool", "GpsSettings", "Output"]) is None
    assert first_by_name(["float", "int", "bool", "bool", "int"]) == 3
    assert first_by_name(["float", "float"]) == 1
    assert first_by_name(["int", "Work"]) == 1  # a buffer is of any type
    assert first_by_name(["Work"]) is None
    assert first_by_name([]) is None
