"""Tests that read the public API: every name documented, annotated, with an example, and every example runs."""

from __future__ import annotations

import ast
import doctest
import inspect
import re
import typing
from pathlib import Path

import pytest

import flownav
from replay_logs import log_of_flight
from rig_logs import swing

NAMES = [name for name in flownav.__all__ if name != "__version__"]
ERRORS = ("FlownavError", "InputError")  # their lines are shown wherever they are raised


def _members(name: str) -> dict[str, object]:
    """A public name, and the public methods and properties that a class of ours defines."""
    thing = getattr(flownav, name)
    found = {name: thing}
    if inspect.isclass(thing) and name not in ERRORS:
        own = {key: value for key, value in vars(thing).items() if not key.startswith("_")}
        found |= {f"{name}.{key}": _function(value) for key, value in own.items() if _function(value) is not None}
    return found


def _function(value: object) -> object:
    """The function behind a class's entry; None of a constant."""
    if isinstance(value, property):
        return value.fget
    if isinstance(value, classmethod | staticmethod):
        return value.__func__
    return value if inspect.isfunction(value) else None


MEMBERS = {place: thing for name in NAMES for place, thing in _members(name).items()}
DOCUMENTED = {place: thing for place, thing in MEMBERS.items() if place not in ERRORS}
FUNCTIONS = {place: thing for place, thing in DOCUMENTED.items() if not inspect.isclass(thing)}


def test_the_members_are_what_the_design_names():
    assert set(NAMES) == {
        "Campaign", "FlownavError", "InputError", "Record", "Scenario", "Sensor", "Table", "Vehicle", "build",
        "campaign", "explain", "fly", "identify", "load", "replay", "verify",
    }  # fmt: skip
    asked = {"rescore", "score", "scores", "plot", "report", "save", "export", "load", "verdict", "name", "of"}
    assert {place.partition(".")[2] for place in MEMBERS if place.startswith("Record.")} == asked
    for name in ("to_pandas", "to_xarray", "to_polars"):
        assert f"Table.{name}" in MEMBERS
    for name in ("Scenario", "Sensor", "Vehicle"):
        assert {f"{name}.load", f"{name}.save", f"{name}.changed"} <= set(MEMBERS)


@pytest.mark.parametrize("place", sorted(MEMBERS))
def test_every_name_has_a_docstring_that_says_more_than_its_name(place):
    text = inspect.getdoc(MEMBERS[place]) or ""
    assert len(text.split()) >= 5, f"flownav.{place}: {text!r}"
    assert text.splitlines()[0].endswith((".", ":", ",")) or len(text.splitlines()) > 1, place


@pytest.mark.parametrize("place", sorted(DOCUMENTED))
def test_every_name_has_an_example(place):
    assert ">>>" in (inspect.getdoc(DOCUMENTED[place]) or ""), f"flownav.{place} has no example"


@pytest.mark.parametrize("place", sorted(FUNCTIONS))
def test_every_parameter_and_every_return_is_annotated(place):
    signature = inspect.signature(FUNCTIONS[place])
    bare = [p.name for p in signature.parameters.values() if p.annotation is p.empty and p.name not in ("self", "cls")]
    assert not bare, f"flownav.{place}: {bare}"
    assert signature.return_annotation is not signature.empty, f"flownav.{place} does not say what it returns"


@pytest.mark.parametrize("place", [place for place in sorted(FUNCTIONS) if "." not in place])
def test_every_argument_of_a_function_is_explained_by_its_name(place):
    text = inspect.getdoc(FUNCTIONS[place]) or ""
    for name in inspect.signature(FUNCTIONS[place]).parameters:
        assert re.search(rf"\b{name}\b", text), f"flownav.{place}: its docstring does not name {name}"


@pytest.fixture(scope="module")
def around(tmp_path_factory):
    """The names that the examples use: a folder to write to, a flight's log and a rig's log."""
    folder = tmp_path_factory.mktemp("examples")
    log = log_of_flight(40.0).write(folder / "garden")
    return {"flownav": flownav, "folder": folder, "log": log, "rig_log": swing(folder / "swing.csv")}


@pytest.mark.parametrize("place", sorted(DOCUMENTED))
def test_every_example_runs_and_prints_what_stands_there(place, around, capsys):
    examples = doctest.DocTestParser().get_doctest(
        inspect.getdoc(DOCUMENTED[place]) or "", dict(around), f"flownav.{place}", None, None
    )
    said: list[str] = []
    result = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(examples, out=said.append)
    assert result.attempted > 0
    assert result.failed == 0, "".join(said)
    assert capsys.readouterr().out == "", "an example printed something of its own accord"


def test_the_lazy_package_and_its_types_name_the_same_things():
    tree = ast.parse(Path(flownav.__file__).read_text(encoding="utf-8"))
    guarded = next(node for node in tree.body if isinstance(node, ast.If))
    places = {
        alias.name: node.module for node in guarded.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert places == flownav._PLACES
    assert set(places) | {"__version__"} == set(flownav.__all__)
    assert dir(flownav) == sorted(flownav.__all__)


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'land'"):
        flownav.land  # noqa: B018


def test_annotations_can_be_resolved_by_name():
    hints = typing.get_type_hints(flownav.replay)
    assert hints["return"] is flownav.Record
