"""`flownav live --help`: groups that hold each option once, and examples that the command line takes."""

from __future__ import annotations

import shlex

import pytest
import typer.main
from typer.testing import CliRunner

from flownav.cli import app, live_help
from flownav.cli.grouped import OTHERS

LIVE = typer.main.get_command(app).commands["live"]  # type: ignore[attr-defined]
HELP = CliRunner().invoke(app, ["live", "--help"]).output


def test_each_option_stands_once_and_under_its_title():
    listed = [name for names in live_help.GROUPS.values() for name in names]
    assert len(listed) == len(set(listed))
    for title in (*live_help.GROUPS, OTHERS):
        assert f"\n{title}:\n" in HELP
    lines = [line.split() for line in HELP.split("\nExamples:")[0].splitlines()[1:]]
    for param in LIVE.params:
        if param.param_type_name == "option":
            assert sum(bool(words) and words[0].rstrip(",") == param.opts[0] for words in lines) == 1, param.name
    assert HELP.index("--origin") > HELP.index("Setting the vehicle up") > HELP.index("--record")


@pytest.mark.parametrize("typed", [typed for _, typed in live_help.EXAMPLES])
def test_the_examples_are_shown_and_can_be_typed(typed):
    assert f"\n    {typed}\n" in HELP
    program, command, *rest = shlex.split(typed)
    assert (program, command) == ("flownav", "live")
    assert LIVE.make_context("live", list(rest)).params["url"] == rest[0]
