"""Tests that read the package: documented, layered, and honest about its data."""

from __future__ import annotations

import importlib
import pkgutil
import re
import tomllib
from pathlib import Path

import pytest

import flownav
import house
from docs_tools import notebooks, reference
from places import DOCS

PACKAGE = Path(flownav.__file__).parent
PROJECT = PACKAGE.parents[1]
MODULES = sorted(m.name for m in pkgutil.walk_packages([str(PACKAGE)], "flownav.") if m.name != "flownav.__main__")
SOURCES = sorted(PACKAGE.rglob("*.py"))
LONGEST_FILE = 330

MOST_ENTRIES, MOST_FLOORS = 24, 10


@pytest.mark.parametrize("name", MODULES)
def test_every_module_imports_and_says_what_it_is(name):
    assert importlib.import_module(name).__doc__, f"{name} has no docstring"


def test_imports_run_one_way_between_rooms():
    drawn = house.arrows()
    assert not house.circles(house.between_rooms(drawn))
    assert max(house.floors(house.between_rooms(drawn)).values()) <= MOST_FLOORS


def test_no_modules_import_one_another_in_a_circle():
    assert not house.circles(house.arrows())


def test_the_house_has_few_rooms_and_is_drawn_as_it_is():
    assert (
        sum(not entry.name.startswith(("__pycache", "py.typed", "kernels")) for entry in PACKAGE.iterdir())
        <= MOST_ENTRIES
    )
    assert house.drawing(house.between_rooms(house.arrows())) in (PROJECT / "ARCHITECTURE.md").read_text(
        encoding="utf-8"
    )


def test_a_circle_and_its_absence_are_seen():
    loop = {house.Arrow("a", "b"), house.Arrow("b", "c"), house.Arrow("c", "b"), house.Arrow("c", "d")}
    assert house.circles(loop) == [["b", "c"]]
    straight = {house.Arrow("cli", "api"), house.Arrow("api", "core"), house.Arrow("cli", "core")}
    assert not house.circles(straight)
    assert house.drawing(straight) == " 3  cli\n 2  api\n 1  core"


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_compile_knows_numba(source):
    if source.relative_to(PACKAGE).parts[1:2] not in (("compile.py",), ("compiling",)):
        imported = re.findall(r"^\s*(?:import|from)\s+(numba|llvmlite)", source.read_text(encoding="utf-8"), re.M)
        assert not imported


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_files_can_be_read_in_one_sitting(source):
    assert len(source.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE


def test_folders_of_tests_are_rooms():
    rooms = {path.name for path in PACKAGE.rglob("*") if path.is_dir()}
    folders = {path.parent.name for path in (PROJECT / "tests").glob("*/test_*.py")}
    assert folders <= rooms | {"docs"}  # tests of tools/docs


def test_constraints_pin_every_dependency_and_name_no_address():
    lines = (PROJECT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+_-]+", line) for line in lines)
    pinned = {re.sub(r"[-_.]+", "-", line.split("==")[0]).lower() for line in lines}
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    named = [name for group in project["dependency-groups"].values() for name in group]
    wanted = [*project["project"]["dependencies"], *(name for name in named if isinstance(name, str))]  # else a group
    names = {re.sub(r"[-_.]+", "-", re.split(r"[<>=\[; ]", name)[0]).lower() for name in wanted}
    assert names <= pinned


@pytest.mark.parametrize(
    "source", [*SOURCES, PROJECT / "Makefile", PROJECT / "CHANGELOG.md"], ids=lambda path: path.name
)
def test_pages_that_are_named_exist(source):
    for name in re.findall(r"(?<!/)\bdocs/[a-z/-]+\.md", source.read_text(encoding="utf-8")):
        if not name.startswith("docs/en/"):  # PX4's own documentation
            place = (PROJECT / name).resolve()
            assert place.exists() or place in GENERATED, f"{source.name}: {name}"


def test_docs_have_a_place_in_the_navigation():
    navigation = (PROJECT / "mkdocs.yml").read_text(encoding="utf-8")
    for page in (PROJECT / "docs").rglob("*.md"):
        name = page.relative_to(PROJECT / "docs").as_posix()
        assert f": {name}\n" in navigation, f"docs/{name} is not in mkdocs.yml"


GENERATED = {
    *((DOCS / name).resolve() for name in reference.PAGES),
    *(script.with_suffix(".md").resolve() for script in notebooks.tutorials()),
}
PAGES = sorted(page.relative_to(PROJECT).as_posix() for page in (PROJECT / "docs").rglob("*.md"))


@pytest.mark.parametrize("page", ["README.md", "ARCHITECTURE.md", *PAGES])
def test_links_between_pages_lead_somewhere(page):
    text = (PROJECT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", text):
        place = ((PROJECT / page).parent / target).resolve()
        assert place.exists() or place in GENERATED, f"{page}: {target}"
