"""`flownav certify`: plans, exit status, JSON, what is printed, and mistakes in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from command import printed
from flownav.cli import app
from flownav.cli.certify import _ranking
from flownav.core.errors import InputError, VerdictError
from requirements import ASKED, HEAD, WINDY, write

CALM = "[set.wind]\ngusts = true\n"
CRASH = '[[requirement]]\nmeasure = "crash"\nat_most = 0\nprobability = 0.8\n'


def run(*arguments):
    return CliRunner().invoke(app, ["certify", *map(str, arguments)])


def test_the_plan_is_told_and_nothing_is_flown(tmp_path):
    told = run(write(tmp_path, HEAD + WINDY + ASKED + CRASH), "--plan", "--json")
    assert json.loads(told.stdout) == {
        "schema": 1,
        "requirement": "small",
        "flights": 52,
        "requirements": [
            {
                "requirement": "touchdown.horizontal_m at most 0.5 m with 90 % probability at 90 % confidence",
                "words": "distance of the first contact from the pad's centre",
                "needed": {"0": 22, "1": 38, "2": 52},
                "allowed_failures": 2,
                "flights": 52,
                "allowed_of_all": 2,
            },
            {
                "requirement": "no crash with 80 % probability at 90 % confidence",
                "words": "1 where the flight crashed, else 0",
                "needed": {"0": 11, "1": 18, "2": 25},
                "allowed_failures": 2,
                "flights": 25,
                "allowed_of_all": 6,
            },
        ],
    }
    printed = run("approach", "--plan")
    assert printed.stdout.startswith("approach: 767 flights\n")
    assert printed.exit_code == 0
    for number in ("45", "77", "105", "767", "1296", "1773"):
        assert number in printed.stdout
    below = " ".join(printed.stdout.split("└")[-1].split("\n", 1)[1].split())
    assert below == (
        "touchdown.rest_m at most 0.03 m with 95 % probability at 90 % confidence: of all 767 flights 30 may fail"
    )


def test_a_pass_is_exit_status_0_and_everything_else_1(tmp_path):
    calm = write(tmp_path, HEAD + CALM + CRASH)
    passed = run(calm, "--out", tmp_path / "calm", "--ranking", 0, "--records", 1)
    assert passed.exception is None
    assert passed.stdout.startswith("PASS  small\n")
    assert "0 of 25 (at most 2)" in passed.stdout
    assert f"page      {tmp_path / 'calm' / 'certificate.html'}" in passed.stdout
    few = run(calm, "--out", tmp_path / "few", "--ranking", 0, "--records", 0, "--flights", 10, "--json")
    assert isinstance(few.exception, VerdictError)
    assert str(few.exception) == "small: not shown: no crash with 80 % probability at 90 % confidence"
    facts = json.loads(few.stdout)
    assert (facts["verdict"], facts["flights"], facts["needed"], facts["failures"]) == ("not shown", 10, 25, 0)
    assert facts["ranking"] is None
    more = run(calm, "--out", tmp_path / "few", "--ranking", 0, "--records", 0)
    assert isinstance(more.exception, InputError)
    assert "was planned with 10 flights a cell, not 25; to add flights until they pass takes more" in str(
        more.exception
    )
    windy = write(tmp_path, HEAD + WINDY.replace("[0, 8]", "[8, 12]") + CRASH, "windy.toml")
    failed = run(windy, "--out", tmp_path / "windy", "--ranking", 16, "--records", 0)
    assert isinstance(failed.exception, VerdictError)
    assert str(failed.exception).startswith("small: fail: no crash")
    assert failed.stdout.startswith("FAIL  small\n")
    assert "rank      " in failed.stdout
    assert "known     what nobody knows: first " in failed.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["aproach"], "aproach: no such requirement; shipped: "),
        (["approach", "--flights", 0], "--flights 0: must be from 1 to 100000000"),
        (["approach", "--ranking", 48], "--ranking 48: must be 0 or a power of 2 from 16 to 65536"),
        (["approach", "--ranking", 8], "--ranking 8: must be 0 or a power of 2"),
        (["approach", "--records", 11], "--records 11: must be from 0 to 10"),
        (["approach", "--vehicle", "none.toml"], "none.toml"),
        (["absent.toml"], "absent.toml"),
    ],
)
def test_mistakes_are_one_line(arguments, said):
    failed = run(*arguments)
    assert isinstance(failed.exception, InputError)
    assert said in printed(failed.exception)
    assert "\n" not in str(failed.exception)


def test_a_folder_of_something_else_is_not_written_to(tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "flight.txt").write_text("mine", encoding="utf-8")
    failed = run(write(tmp_path, HEAD + CALM + CRASH), "--out", tmp_path / "full")
    assert "full: is there and holds no campaign; give another name" in printed(failed.exception)
    assert [path.name for path in (tmp_path / "full").iterdir()] == ["flight.txt"]


@pytest.mark.parametrize(("text", "said"), [
    (HEAD.replace("[set.filter]", 'vehicle = "nosuch"\n[set.filter]') + ASKED, "nosuch: no such vehicle; shipped"),
    (HEAD + WINDY + 'vehicle = ["nosuch"]\n' + ASKED, "nosuch: no such vehicle; shipped: maxi-joker-3"),
    (HEAD + WINDY + 'sensor = ["/dev/zero"]\n' + ASKED, "/dev/zero: a device is not read"),
    (HEAD + WINDY + 'fault = ["gps_loss"]\n' + ASKED, "fault gps_loss: the paper's filter has no sensors that fail"),
])  # fmt: skip
def test_a_plan_of_what_cannot_be_flown_is_refused_as_the_flights_are(tmp_path, text, said):
    path = write(tmp_path, text)
    for more in (["--plan"], []):
        done = run(path, "--out", tmp_path / "out", *more)
        assert isinstance(done.exception, InputError)
        assert said in str(done.exception)
    assert not (tmp_path / "out").exists()
    assert "f16: no such vehicle" in str(run("approach", "--plan", "--vehicle", "f16").exception)


def test_an_index_of_too_few_rows_is_no_figure():
    known = {"input": "wind.from_direction_deg", "known": "day",
             "first": 0.3, "first_interval": [0.2, 0.4], "total": 0.5, "total_interval": [0.4, 0.6]}  # fmt: skip
    half = known | {"first": -0.29, "first_interval": [-0.9, 0.4]}
    few = half | {"total": 1.36, "total_interval": [0.8, 2.0]}
    assert _ranking({"ranking": [known, half], "split": [few]}) == [
        "rank      wind from (°): first 0.30 (0.20 to 0.40), total 0.50 (0.40 to 0.60)",
        "rank      wind from (°): first unknown, total 0.50 (0.40 to 0.60)",
        "known     all that is known on the day: first unknown, total unknown",
    ]
    nothing = ["rank      too few rows to rank any input; give a larger --ranking"]
    assert _ranking({"ranking": [few, few], "split": [few]}) == nothing


def test_a_plan_refuses_a_key_and_a_folder_that_a_flight_would_refuse(tmp_path):
    """`--plan` took any, and the same command without it then stopped."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("years")
    (tmp_path / "file").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "mine")
    for name, why in (("mine", "holds no campaign"), ("file", "it is a file"), ("link", "through a symbolic link")):
        done = run("approach", "--plan", "--out", tmp_path / name)
        assert isinstance(done.exception, InputError)
        assert why in str(done.exception)
    assert isinstance(run("approach", "--plan", "--sign", tmp_path / "absent.pem").exception, InputError)
    for name in (Path("/proc/nowhere/new"), tmp_path / "file" / "new"):
        done = run("approach", "--plan", "--out", name)
        assert isinstance(done.exception, InputError)
        assert str(done.exception).startswith(f"{name}: cannot be written (")
    assert run("approach", "--plan", "--out", tmp_path / "new" / "er").exception is None
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "link", "mine"]
    assert not (tmp_path / "new").exists()
