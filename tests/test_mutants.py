"""The runner of mutations: that its lists fit the tree, and that it tells killed, survived and broken apart."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import mutants
from mutants import ListError, Mutant, listed, run

SOURCE = "def twice(x):\n    return 2 * x\n\n\ndef thrice(x):\n    return 3 * x\n"
TEST = "from flownav.sums import twice\n\n\ndef test_twice():\n    assert twice(4) == 8\n"
ENTRY = '[[mutant]]\nname = "{}"\nfile = "sums.py"\nold = "{}"\nnew = "{}"\ntests = ["test_sums.py"]\n'


def project(folder: Path, *entries: str, test: str = TEST) -> Path:
    """A tree of one module and one test, with a list of mutations."""
    for name, text in (("src/flownav/__init__.py", ""), ("src/flownav/sums.py", SOURCE), ("tests/test_sums.py", test),
                       ("tests/mutants/sums.toml", "\n".join(entries))):  # fmt: skip
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


def test_every_listed_mutation_fits_the_tree():
    found = listed()
    assert len(found) >= 600
    assert all(mutant.tests for mutant in found)


def test_the_killed_and_the_survivors_are_counted_and_the_tree_stays_as_it_was(tmp_path, capsys):
    wrong = ENTRY.format("half", "return 2 * x", "return x / 2"), ENTRY.format("quad", "return 3 * x", "return 4 * x")
    tree = project(tmp_path, *wrong)
    assert run(tree, (), jobs=1) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[0] == "killed"
    assert "test_sums.py::test_twice" in lines[0]
    assert lines[1].split()[0] == "survived"
    assert lines[2] == "  survived: sums.py: quad"
    assert lines[-1] == "1 of 2 killed (50.0 %), 1 survived, 0 could not be tried"
    assert (tree / "src/flownav/sums.py").read_text() == SOURCE
    assert run(tree, ("half",), jobs=1) == 0
    capsys.readouterr()
    assert run(tree, (), jobs=1, every=2) == 0  # a sample: the first of the two
    assert capsys.readouterr().out.splitlines()[-1].startswith("1 of 1 killed")


def test_a_mutation_that_no_test_can_run_with_is_not_killed(tmp_path, capsys):
    tree = project(tmp_path, ENTRY.format("no name", "def twice(x):", "def twofold(x):"))
    assert run(tree, (), jobs=1) == 1
    assert "0 of 1 killed (0.0 %), 0 survived, 1 could not be tried" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        (ENTRY.format("gone", "return 5 * x", "x"), "gone: in sums.py this occurs 0 times, not once: 'return 5 * x'"),
        (ENTRY.format("twofold", "return", "pass"), "twofold: in sums.py this occurs 2 times, not once: 'return'"),
        (ENTRY.format("same", "2 * x", "2 * x"), "same: changes nothing"),
        (ENTRY.format("lost", "2 * x", "x").replace("sums.py", "sum.py", 1), "lost: no such file: sum.py"),
        (ENTRY.format("idle", "2 * x", "x").replace("test_sums", "test_sum"), "idle: no such test: tests/test_sum.py"),
        (2 * ENTRY.format("again", "2 * x", "x"), "named twice: again"),
    ],
)
def test_a_list_that_does_not_fit_is_one_line_with_the_name(tmp_path, entry, says):
    with pytest.raises(ListError, match="^" + re.escape(says) + "$"):
        run(project(tmp_path, entry), (), jobs=1)


def test_tests_that_fail_on_their_own_kill_nothing(tmp_path):
    tree = project(tmp_path, ENTRY.format("half", "2 * x", "x / 2"), test=TEST.replace("8", "9"))
    with pytest.raises(ListError, match=r"the tests fail without any mutation: FAILED tests/test_sums.py::test_twice"):
        run(tree, (), jobs=1)


def test_what_is_mutated_is_what_the_tests_import(tmp_path):
    mutant = Mutant("half", "sums.py", "2 * x", "x / 2", ("test_sums.py",))
    with mutants.copied(project(tmp_path)) as tree:
        assert mutants.verdict(tree, mutant, tmp_path)[0] == "killed"
        assert mutants.tested(tree, mutant.tests, tmp_path)[0] == 0
