"""Tests that read the package: documented, layered, and honest about its data."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import re
import tomllib
from pathlib import Path

import pytest

import flownav
from docs_tools import notebooks, reference
from places import DOCS

PACKAGE = Path(flownav.__file__).parent
PROJECT = PACKAGE.parents[1]
MODULES = sorted(m.name for m in pkgutil.walk_packages([str(PACKAGE)], "flownav.") if m.name != "flownav.__main__")
SOURCES = sorted(PACKAGE.rglob("*.py"))
LONGEST_FILE = 330

# rooms from the ground up; a room imports its own floor's neighbours named here and what lies below
GROUND = {"errors", "files", "compile", "frames", "measurement", "record", "parameter_files", "provenance"}
GROUND |= {"record_file", "parquet_pages"}
GROUND |= {"guard", "free_names", "text", "toml_text"}
EQUATIONS = {"vehicle", "sensors", "control", "estimation", "optics"}
# what the public API stands on: every room but the faces
JOBS = {"navigation", "simulation", "logs", "mavlink", "scoring", "replays", "live", "campaigns", "faults"}
JOBS |= {"identification", "report", "export", "parts"}
ALLOWED = {
    "vehicle": GROUND,
    "sensors": GROUND,
    "control": GROUND | {"vehicle"},
    "estimation": GROUND,
    "optics": GROUND | {"sensors"},
    "scoring": GROUND,
    "mavlink": GROUND,
    "logs": GROUND | {"mavlink"},
    "rig": GROUND | {"optics", "sensors"},
    "inspection": GROUND | EQUATIONS | {"logs", "replays", "scoring", "identification"},
    "identification": GROUND | EQUATIONS | {"logs", "rig", "replays", "scoring"},
    "simulation": GROUND | (EQUATIONS - {"optics"}) | {"navigation"},
    "navigation": GROUND | EQUATIONS,
    "replays": GROUND | EQUATIONS | {"navigation", "logs", "scoring"},
    "compare": GROUND | EQUATIONS | {"navigation", "logs", "replays", "scoring"},
    "tuning": GROUND | EQUATIONS | {"navigation", "logs", "replays", "scoring", "compare"},
    "live": GROUND | EQUATIONS | {"mavlink", "logs", "navigation", "replays"},
    "campaigns": GROUND | EQUATIONS | {"simulation", "navigation", "scoring"},
    "faults": GROUND | EQUATIONS | {"logs", "simulation", "campaigns", "scoring", "navigation", "replays"},
    "certification": GROUND | EQUATIONS | {"simulation", "campaigns", "scoring", "faults", "report"},
    "schemas": GROUND | EQUATIONS | {"simulation", "campaigns", "navigation"},
    "samples": GROUND
    | EQUATIONS
    | {"logs", "mavlink", "rig", "navigation", "simulation", "scoring", "campaigns", "faults", "live", "export"},
    "validation": GROUND | EQUATIONS | {"navigation", "simulation", "logs", "replays", "scoring"},
    "report": GROUND | {"scoring"},
    "export": GROUND,
    "parts": GROUND | EQUATIONS | {"navigation", "simulation", "campaigns", "logs", "replays"},
    "examples": GROUND | EQUATIONS | {"navigation", "parts"},
    "viewing": GROUND | {"export"},
    "api": GROUND | EQUATIONS | JOBS,
    "paper": GROUND | EQUATIONS | {"simulation", "campaigns", "scoring", "rig", "identification", "report"},
}


@pytest.mark.parametrize("name", MODULES)
def test_every_module_imports_and_says_what_it_is(name):
    assert importlib.import_module(name).__doc__, f"{name} has no docstring"


def _rooms_imported(source: Path) -> set[str]:
    tree = ast.parse(source.read_text(encoding="utf-8"))
    modules = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    modules += [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    return {module.split(".")[1] for module in modules if module.startswith("flownav.") and module.count(".")}


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_run_one_way(source):
    room = source.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if room in ("compile", "compiling"):
        assert _rooms_imported(source) <= {"compiling", "files"}
    elif room in ALLOWED:
        assert _rooms_imported(source) - {room} <= ALLOWED[room]
    elif room in GROUND:
        assert _rooms_imported(source) <= GROUND


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_compile_knows_numba(source):
    if source.relative_to(PACKAGE).parts[0] not in ("compile.py", "compiling"):
        imported = re.findall(r"^\s*(?:import|from)\s+(numba|llvmlite)", source.read_text(encoding="utf-8"), re.M)
        assert not imported


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_files_can_be_read_in_one_sitting(source):
    assert len(source.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE


def test_folders_of_tests_are_rooms():
    rooms = {source.relative_to(PACKAGE).parts[0].removesuffix(".py") for source in SOURCES}
    folders = {path.parent.name for path in (PROJECT / "tests").glob("*/test_*.py")}
    assert folders <= rooms | {"docs"}  # tests of tools/docs


def test_constraints_pin_every_dependency_and_name_no_address():
    lines = (PROJECT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+_-]+", line) for line in lines)
    pinned = {re.sub(r"[-_.]+", "-", line.split("==")[0]).lower() for line in lines}
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    groups = project["dependency-groups"].values()
    wanted = [*project["project"]["dependencies"], *(name for group in groups for name in group)]
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
