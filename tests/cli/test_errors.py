"""Errors name an argument as whoever asked calls it: Python by its name, the command line by its option."""

from __future__ import annotations

import ast
import pickle
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.main import get_command

import flownav
from command import printed, run
from flownav.cli import OPTIONS, app, option_of
from flownav.core.errors import BEGIN, END, InputError, VerdictError, arg
from replay_logs import log_of_flight

SOURCE = Path(flownav.__file__).parent
MODULES = [path for path in sorted(SOURCE.rglob("*.py")) if SOURCE / "cli" not in path.parents]


def texts(raised: ast.AST) -> Iterator[str]:
    """The strings of an expression, what is formatted into them as "..."."""
    if isinstance(raised, ast.JoinedStr):
        yield "".join(str(part.value) if isinstance(part, ast.Constant) else "..." for part in raised.values)
    elif isinstance(raised, ast.Constant) and isinstance(raised.value, str):
        yield raised.value
    for inner in ast.iter_child_nodes(raised):
        yield from () if isinstance(raised, ast.JoinedStr) and isinstance(inner, ast.Constant) else texts(inner)


def names_an_option(text: str) -> bool:
    """Whether a text names an option, but for commands that stand in backticks as a whole."""
    return re.search(r"--[a-z]", re.sub("`flownav [^`]*`", "", text)) is not None


def test_what_names_an_option_is_found():
    found = ast.parse("raise InputError(f'--gps-delay {delay}: no', 'see `flownav fly --json`', f'{x:--a}', '--' + y)")
    assert [text for text in texts(found) if names_an_option(text)] == ["--gps-delay ...: no", "--a"]


def test_errors_of_lower_rooms_name_no_option():
    found = []
    for path in MODULES:
        raised = [node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.Raise)]
        found += [f"{path}: {text}" for node in raised for text in texts(node) if names_an_option(text)]
    assert found == []


def test_every_argument_that_an_error_names_has_its_option():
    commands = get_command(app).commands.values()
    options = {option for command in commands for parameter in command.params for option in parameter.opts}
    named = {name for path in MODULES for name in re.findall(r"\barg\([\"'](\w+)[\"']\)", path.read_text("utf-8"))}
    assert len(named) > 20
    assert {option_of(name) for name in named} <= options
    assert OPTIONS.keys() <= named


@pytest.mark.parametrize("kind", [InputError, VerdictError])
def test_an_error_is_told_to_python_without_marks(kind):
    error = kind(f"{arg('gps_delay_s')} 7: seconds from 0 to 5 are needed; see {arg('topics')}")
    for told in (error, pickle.loads(pickle.dumps(error))):
        assert str(told) == told.args[0] == "gps_delay_s 7: seconds from 0 to 5 are needed; see topics"
        assert repr(told) == f"{kind.__name__}('{told}')"
        assert printed(told) == "--gps-delay 7: seconds from 0 to 5 are needed; see --topic"


def test_an_error_made_of_an_error_has_no_marks():
    error = InputError(f"a.ulg: {InputError(arg('heights_m'))}")
    assert not {BEGIN, END} & {*error.marked, *printed(error)}


def test_the_same_error_for_python_and_for_the_command_line(tmp_path):
    log = log_of_flight(duration_s=10.0).write(tmp_path / "log")
    with pytest.raises(InputError, match=r"^gps_delay_s 7: seconds from 0 to 5 are needed$"):
        flownav.replay(log, gps_delay_s=7)
    done = run("replay", log, "--outage-table", "0:900:0.01", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("flownav: --outage-table 0:900:0.01: that is 90000 windows; ")


@pytest.mark.parametrize("name", ["a\nb", "a\rb", "a\x1b[2Jb", "a\x00b", "a\x9bb", "a\u2028b", "a\tb"])
def test_a_name_in_a_message_neither_begins_a_line_nor_moves_the_cursor(name):
    text = str(InputError(f"{name}: no such file"))
    assert text.isprintable()
    assert text == f"{repr(name)[1:-1]}: no such file"
    assert str(InputError(f"{arg('gps')} für {name}")).startswith("gps für a\\")
