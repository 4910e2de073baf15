"""Everything that the pages ask a reader to type exists: commands with their options, targets of make, files of
tests.
"""

from __future__ import annotations

import re
import shlex

import pytest
import typer.main

from flownav.cli import app
from places import DOCS, PROJECT

README = (PROJECT / "README.md").read_text(encoding="utf-8")
MAKEFILE = (PROJECT / "Makefile").read_text(encoding="utf-8")
CI = (PROJECT / ".ci" / "run").read_text(encoding="utf-8")
COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]
PAGES = [PROJECT / "README.md", PROJECT / "ARCHITECTURE.md", *sorted(DOCS.rglob("*.md"))]


def _typed(text: str) -> list[str]:
    """Every `flownav COMMAND ...` in backticks, once; an optional argument's brackets and a table's bars undone."""
    lines = re.findall(r"`flownav ([a-z][^`\n]*)`", text.replace("\\|", "|"))
    return sorted({re.sub(r"[\[\]]|\.\.\.", "", line) for line in lines})


@pytest.mark.parametrize("line", _typed(README))
def test_readme_names_commands_that_parse(line):
    name, *arguments = shlex.split(line)
    known = {option for parameter in COMMANDS[name].params for option in (*parameter.opts, *parameter.secondary_opts)}
    assert {argument for argument in arguments if argument.startswith("--")} <= known


def test_readme_names_every_command():
    assert set(COMMANDS) <= set(re.findall(r"`flownav ([a-z]+)", README))


def test_make_knows_what_it_is_told_to_make():
    told = set(re.findall(r"(?:^|`)make ([a-z][a-z-]*)", README + CI, re.M))
    assert told <= set(re.findall(r"^([a-z-]+):", MAKEFILE, re.M))


def test_ci_makes_what_the_readme_names():
    named = set(re.findall(r"^make ([a-z-]+)", README, re.M))
    assert named
    assert named <= {word for line in re.findall(r"^make (.*)", CI, re.M) for word in line.split()}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_name_files_of_tests_that_exist(page):
    for name in re.findall(r"\b(?:tests|benchmarks)/[\w/*]+\.py", page.read_text(encoding="utf-8")):
        assert list(PROJECT.glob(name)), f"{page.name}: {name}"
