"""The reference of the commands: what each says of itself under `--help`."""

from __future__ import annotations

import os

import typer.main
from typer.testing import CliRunner

from flownav.cli import app

COLUMNS = "92"
INTRODUCTION = """# Commands

What each command says of itself, `flownav COMMAND --help`, with flownav {version}. Every command prints a table for
people. With `--json` it prints one JSON object and nothing else.

| command | what it does |
|---|---|
"""


def commands() -> dict[str, str]:
    """Each command's name and its one line, in the order of `flownav --help`."""
    group = typer.main.get_command(app)
    return {name: found.get_short_help_str(limit=200) for name, found in group.commands.items()}  # type: ignore[attr-defined]


def page() -> str:
    """The page: a table of the commands, then each with its help. RuntimeError where one refuses to tell."""
    from flownav.core.version import __version__

    rows = [f"| [`flownav {name}`](#flownav-{name}) | {what} |" for name, what in commands().items()]
    sections = [f"## flownav {name}\n\n```text\n{_help(name)}\n```" for name in commands()]
    return INTRODUCTION.format(version=__version__) + "\n".join(rows) + "\n\n" + "\n\n".join(sections) + "\n"


def _help(name: str) -> str:
    """The help text of a command."""
    surroundings = {**os.environ, "COLUMNS": COLUMNS, "TERMINAL_WIDTH": COLUMNS, "NO_COLOR": "1"}
    result = CliRunner(env=surroundings).invoke(app, [name, "--help"], prog_name="flownav")
    if result.exit_code:
        raise RuntimeError(f"flownav {name} --help failed: {result.output}")
    return "\n".join(line.rstrip() for line in result.output.strip().splitlines())
