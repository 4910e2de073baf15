"""The command line as a user meets it: JSON alone on stdout, one-line errors, exit status, nothing half-written."""

from __future__ import annotations

import json
import re
import socket
from collections import Counter
from contextlib import suppress
from functools import partial
from threading import Thread

import numpy as np
import pytest
from typer.testing import CliRunner

import flownav
from command import run
from flownav.cli import app
from flownav.core.parameter_files import shipped
from flownav.core.record import Record
from flownav.live import byte_links, loop
from flownav.live.loop import run_vehicle
from virtual_link import Clock, VirtualLink


def one_line_error(done):
    """The only line of a refused command, after the status and the silence of stdout are checked."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    return lines[0]


def short(tmp_path, text="", name="landing", duration="2.0"):
    """A short copy of a shipped scenario, with its hand-over after half a second, with lines added to its end."""
    path = tmp_path / "short.toml"
    original = shipped(f"{name}.toml").read_text(encoding="utf-8")
    soon = "\n[filter]\nhandover_s = 0.5\n"
    path.write_text(original.replace("duration_s = 50.0", f"duration_s = {duration}") + soon + text, encoding="utf-8")
    return path


NUMBER_KEYS = {"mean_error", "std_error", "rms_error", "max_error"}


def test_fly_json_has_every_key_and_its_record_is_there(tmp_path):
    done = run("fly", short(tmp_path), "--json", "--seed", 3, "--out", tmp_path / "f.fnr", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert {
        "scenario",
        "filter",
        "gps",
        "seed",
        "flights",
        "states",
        "max_position_error_m",
        "touchdown",
        "record",
    } <= set(facts)
    assert (facts["filter"], facts["gps"], facts["seed"], facts["flights"]) == ("landing", "white", 3, 1)
    assert list(facts["states"]) == list("xyzuvw")
    assert all(set(entry) == NUMBER_KEYS for entry in facts["states"].values())
    assert facts["touchdown"] is None
    assert [facts[key] for key in ("rmse_over_bound", "anees_inside_fraction")] == [None, None]
    assert facts["known_exactly"] == "its position in hover for the first 0.5 s (true state used)"
    record = Record.load(tmp_path / "f.fnr")
    handed = record.tables["truth"]["t_s"] >= 0.5
    error = (record.matrix("flown", ("pos_n_m",)) - record.matrix("truth", ("pos_n_m",)))[handed]
    assert facts["states"]["x"]["rms_error"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
    assert (tmp_path / "f.html").stat().st_size > 1e5


BLIND = """schema_version = 1
name = "blind"
[flight]
duration_s = 14.0
start = "hover"
may_land_after_s = 6.0
path = [{ t_s = 0.0, height_m = 2.0 }, { t_s = 6.0, height_m = 2.0 }, { t_s = 24.0, height_m = -3.4 }]
[autopilot.precision]
search_height_m = 1.0
"""


def test_a_flight_that_never_finds_its_pad_is_a_verdict_with_its_reason_and_exit_status_1(tmp_path):
    (tmp_path / "blind.toml").write_text(BLIND, encoding="utf-8")
    done = run("fly", "blind.toml", "--no-report", "--json", cwd=tmp_path)
    assert done.returncode == 1
    reason = json.loads(done.stdout)["touchdown"]["reason"]
    assert reason.startswith("looks for its pad from 1 m, ")
    assert done.stderr.splitlines()[-1] == f"flownav: never landed: {reason}"
    shown = run("fly", "blind.toml", "--no-report", "--force", cwd=tmp_path)
    assert " ".join(shown.stdout.split()).startswith(f"Never landed: {reason}")
    assert flownav.load(tmp_path / "out" / "blind.fnr").verdict == f"never landed: {reason}"


def test_a_scenario_is_flown_in_the_wind_that_is_asked_for(tmp_path):
    done = run("fly", short(tmp_path), "--wind", "8:270", "--json", "--no-report", "--out", "w.fnr", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    wind = Record.load(tmp_path / "w.fnr").manifest["parameters"]["scenario"]["wind"]
    assert (wind["speed_20ft_m_s"], wind["from_direction_deg"], wind["gusts"]) == (8.0, 270.0, True)
    assert flownav.Scenario.load("landing").changed(wind=8).file.wind.speed_20ft_m_s == 8.0
    assert flownav.Scenario.load("landing").changed(wind="3:-90.5").file.wind.from_direction_deg == -90.5


def test_a_flight_that_ends_before_the_hand_over_has_null_errors_and_a_table(tmp_path):
    path = short(tmp_path)
    path.write_text(path.read_text(encoding="utf-8").replace("handover_s = 0.5", "handover_s = 9.0"), encoding="utf-8")
    done = run("fly", path, "--json", "--no-report", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["max_position_error_m"] is None
    assert set(facts["states"]["w"].values()) == {None}
    shown = run("fly", path, "--force", cwd=tmp_path)
    assert shown.returncode == 0, shown.stderr
    assert "known without error: its position in hover for the first 9 s" in shown.stdout
    assert (tmp_path / "out" / "landing.html").exists()


def test_many_flights_turn_every_number_into_median_and_percentiles(tmp_path):
    done = run("fly", short(tmp_path), "--json", "--flights", 20, "--no-report", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    for entry in (*facts["states"].values(), {"largest": facts["max_position_error_m"]}):
        for number in entry.values():
            assert number["p05"] <= number["median"] <= number["p95"]
    assert 0 <= facts["paper_percentile"]["max_position_error_m"] <= 100
    assert all(0.1 < facts["rmse_over_bound"][state] < 10.0 for state in "xyzuvw")
    assert all(0.1 < facts["error_over_stated"][state] < 10.0 for state in "xyzuvw")
    assert 0.0 <= facts["anees_inside_fraction"] <= 1.0
    assert facts["touchdown"] is None  # 2 s: none lands
    record = Record.load(tmp_path / facts["record"])
    assert record.manifest["scores"]["max_position_error_m"] == pytest.approx(
        facts["max_position_error_m"]["median"], rel=0.2
    )


def landing_at_once(tmp_path):
    """From 0.5 m down at once, so that a few seconds hold a whole landing."""
    path = short(tmp_path, duration="30.0")  # it learns the vehicle first
    text = path.read_text(encoding="utf-8").replace("may_land_after_s = 10.0", "may_land_after_s = 1.0")
    text = text.replace("{ t_s = 0.0, height_m = 3.0 }", "{ t_s = 0.0, height_m = 0.5 }")
    text = text.replace("{ t_s = 10.0, height_m = 3.0 }", "{ t_s = 2.0, height_m = 0.5 }")
    path.write_text(text, encoding="utf-8")
    return path


def test_the_touchdown_of_one_flight_is_its_values_and_of_many_radius_interval_success_and_what_limits_it(tmp_path):
    path = landing_at_once(tmp_path)
    one = json.loads(run("fly", path, "--json", "--no-report", cwd=tmp_path).stdout)
    assert one["truth_model"] == "matched"
    landing = one["touchdown"]
    assert landing["success"] is True
    assert 0.0 < landing["contact"]["distance_m"] < 3.0
    assert abs(landing["contact"]["distance_m"] - landing["rest"]["distance_m"]) <= landing["rest"]["slide_m"]
    assert set(landing["limited_by"]) == {"estimate_m", "guidance_m", "pad_m"}
    done = run("fly", path, "--json", "--no-report", "--flights", 20, cwd=tmp_path)
    many = json.loads(done.stdout)
    assert many["truth_model"] == "ensemble"
    landings = many["touchdown"]
    for end in ("contact", "rest"):
        assert {"r95_m", "r95_interval_m"} <= set(landings[end])
    assert set(landings["limited_by"]) == {"estimate_m", "guidance_m", "pad_m"}
    success = landings["success"]
    assert success["rate"] == many["landed"] / 20
    assert 0.0 <= success["low"] <= success["rate"] <= success["high"] <= 1.0
    assert "r95_m" not in many
    record = Record.load(tmp_path / many["record"])
    assert record.manifest["truth_model"] == "ensemble"
    assert record.manifest["parameters"]["drawn"]["vehicle.body.mass_kg"] != 7.9
    shown = run("fly", path, "--no-report", "--flights", 4, "--matched", cwd=tmp_path).stdout
    assert "vehicle, sensors as it expects" in " ".join(shown.split())
    assert "at rest" in shown
    assert re.search(r"landed  [34] of 4 flights, (75|100)\.0 % \(95 % interval ", shown)


def test_matched_and_ensemble_differ_and_each_is_itself_again(tmp_path):
    path = short(tmp_path)
    flown = {
        (model, again): json.loads(run("fly", path, "--json", "--no-report", "--force", model, cwd=tmp_path).stdout)
        for model in ("--matched", "--ensemble")
        for again in (1, 2)
    }
    for model in ("--matched", "--ensemble"):
        assert flown[model, 1] == flown[model, 2]
        assert flown[model, 1]["truth_model"] == model.removeprefix("--")
    assert flown["--matched", 1]["states"] != flown["--ensemble", 1]["states"]


def test_a_seed_gives_the_same_flight_again(tmp_path):
    first, again = (
        run("fly", short(tmp_path), "--json", "--no-report", "--force", cwd=tmp_path).stdout for _ in range(2)
    )
    assert first == again


@pytest.mark.parametrize(
    "choice",
    [("--filter", "paper"), ("--truth", "linear", "--filter", "paper"), ("--feedback", "truth"), ("--gps", "midg")],
)
def test_choices_replace_the_files_own(tmp_path, choice):
    done = run("fly", short(tmp_path), "--json", "--no-report", *choice, "--out", tmp_path / "c.fnr", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    manifest = Record.load(tmp_path / "c.fnr").manifest
    assert ("rmse_over_bound" in json.loads(done.stdout)) == (manifest["filter"] == "landing")
    assert manifest[choice[0].removeprefix("--")] == choice[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("fly", "nowhere"),
            "nowhere: no such scenario; shipped: sortie, takeoff, landing, gusty, pad_return, approach, or give a "
            "TOML file",
        ),
        (("fly", "nowhere.toml"), "nowhere.toml: no such file"),
        (("fly", "landing", "--flights", "0"), "--flights 0: must be from 1 to"),
        (("fly", "landing", "--flights", "3", "--flight", "1"), "--flight names one flight, --flights many"),
        (("fly", "gusty", "--truth", "linear"), 'truth = "linear" has no air to move'),
        (("fly", "landing", "--truth", "linear"), 'truth = "linear" has no forces for an IMU to feel'),
        (("fly", "landing", "--seed", "-1"), "--seed -1: must be from 0 to"),
        (
            ("fly", "landing", "--gps", "rtk"),
            "--gps rtk: choose from white, midg",
        ),
        (
            ("fly", "landing", "--filter", "ukf"),
            "--filter ukf: no such filter; by name: landing, paper",
        ),
        (
            ("fly", "landing", "--truth", "real"),
            "--truth real: choose from nonlinear, linear",
        ),
        (("fly", "landing", "--sensor", "none.toml"), "none.toml: no such file"),
        (("report", "none.fnr"), "none.fnr: no such record"),
        (("vehicle", "none.toml"), "none.toml: no such file"),
        (("replay", "nowhere"), "nowhere"),
        (("bench", "--flights", "1"), "--flights 1: must be from 16 to"),
        (("rig", "--seed", "2147483648"), "--seed 2147483648: must be from 0 to 2147483647"),
        (("pad", "--seed", "-1"), "--seed -1: must be from 0 to"),
        (("flow", "frames", "--fps", "0"), "--fps 0.0: must be from 0.001 to"),
        (("flow", "frames", "--fps", "30", "--range", "0"), "--range 0.0: must be from 0.01 to"),
        (("fly", "landing", "--speed", "0"), "--speed 0.0: must be from 0.01 to 100.0"),
    ],
)
def test_a_mistake_is_one_line_and_status_2(tmp_path, arguments, message):
    assert message in one_line_error(run(*arguments, cwd=tmp_path))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("size_m = 2.0", "size_m = -2.0"), "pad.size_m: Input should be greater than 0.05, got -2.0"),
        (('start = "hover"', 'start = "fly"'), "flight.start: Input should be 'ground' or 'hover', got 'fly'"),
        (("t_s = 10.0", "t_s = 0.0"), "flight.path: the knots' t_s must increase"),
        (("may_land_after_s", "may_land_after_ms"), "flight.may_land_after_ms: unknown key; known here: "),
        (
            ("duration_s = 2.0", 'duration_s = "2"'),
            "flight.duration_s: a number is needed, not true, false or text, got '2'",
        ),
        (("height_m = 3.0 }", "height_m = -3.0 }"), "flight.path: a hover starts at a height_m of 0 or more"),
        (('name = "landing"', 'name = "../landing"'), "name: String should match pattern"),
        (('start = "hover"', 'start = "ground"\ntakeoff_at_s = 20.0'), "more than takeoff_at_s = 20 is needed"),
        (("duration_s = 2.0", "duration_s = nan"), "flight.duration_s: Input should be a finite number, got nan"),
        (("schema_version = 1", "schema_version = 2"), "schema_version: Input should be 1, got 2"),
        (("[flight]", "[flight"), "not valid TOML"),
    ],
)
def test_a_wrong_scenario_file_names_file_key_and_range(tmp_path, change, message):
    path = short(tmp_path, "\n[pad]\nsize_m = 2.0\n")
    path.write_text(path.read_text(encoding="utf-8").replace(*change), encoding="utf-8")
    line = one_line_error(run("fly", path, cwd=tmp_path))
    assert "short.toml" in line
    assert message in line


def test_a_record_that_cannot_be_written_is_said_in_one_line(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    line = one_line_error(run("fly", short(tmp_path), "--out", tmp_path / "file" / "x.fnr", cwd=tmp_path))
    assert "cannot be written" in line


def test_a_crash_is_status_1_with_the_record_written(tmp_path):
    storm = short(tmp_path, "\n[wind]\nspeed_20ft_m_s = 30.0\n", duration="20.0")
    done = run(
        "fly", storm, "--filter", "paper", "--json", "--no-report", "--out", tmp_path / "storm.fnr", cwd=tmp_path
    )
    assert done.returncode == 1
    assert json.loads(done.stdout)["crashed"] is True
    assert "1 of 1 flights crashed" in done.stderr
    assert Record.load(tmp_path / "storm.fnr").manifest["scores"]["crashed"] is True


def test_one_flight_of_a_seed_can_be_flown_again(tmp_path):
    many = json.loads(run("fly", short(tmp_path), "--json", "--flights", 3, "--no-report", cwd=tmp_path).stdout)
    index = Record.load(tmp_path / many["record"]).manifest["flight"]
    again = run("fly", short(tmp_path), "--json", "--flight", index, "--ensemble", "--no-report", cwd=tmp_path)
    assert json.loads(again.stdout)["max_position_error_m"] == many["max_position_error_m"]["median"]


def test_files_that_a_scenario_names_lie_beside_it(tmp_path):
    folder = tmp_path / "scenarios"
    folder.mkdir()
    (folder / "mine.toml").write_text(shipped("maxi_joker_3.toml").read_text(encoding="utf-8"), encoding="utf-8")
    path = short(folder, '\n[vehicle]\nfile = "mine.toml"\n')
    assert run("fly", path, "--json", "--no-report", cwd=tmp_path).returncode == 0


def assert_told(numbers):
    assert numbers[105] > numbers[106] > numbers[132] > numbers[24] >= 3  # IMU, flow, range, and GPS at 5 Hz
    assert numbers[31] > 90  # attitude


def test_a_flight_is_told_as_an_autopilot_tells_it(tmp_path, monkeypatch):
    clock, numbers = Clock(), Counter()
    link = VirtualLink(clock, hear=lambda frame, now_s: numbers.update([int.from_bytes(frame[7:10], "little")]) or [])
    monkeypatch.setattr(byte_links, "open_link", lambda url: link)
    monkeypatch.setattr(loop, "run_vehicle", partial(run_vehicle, clock=clock))
    given = [str(short(tmp_path)), "--gps", "midg", "--json", "--no-report", "--out", str(tmp_path / "f.fnr")]
    done = CliRunner().invoke(app, ["fly", *given, "--mavlink", "udpout:127.0.0.1:9", "--speed", "4"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["told"]["flight_s"] == pytest.approx(2.0, abs=0.02)
    assert clock.now_s == pytest.approx(0.5, abs=0.01)
    assert_told(numbers)


def test_a_flight_without_gps_velocity_is_not_told(tmp_path):
    white = run("fly", short(tmp_path), "--json", "--no-report", "--mavlink", "udpout:127.0.0.1:9", cwd=tmp_path)
    assert white.returncode == 2
    assert "no GPS velocity; give --filter landing --gps midg" in white.stderr


@pytest.mark.real_time
def test_a_flight_is_told_over_a_socket(tmp_path):
    numbers = Counter()

    def listen(ear):
        with suppress(TimeoutError, OSError):
            while True:
                numbers[int.from_bytes(ear.recv(2048)[7:10], "little")] += 1

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(120.0)
        url = f"udpout:127.0.0.1:{ear.getsockname()[1]}"
        listener = Thread(target=listen, args=(ear,), daemon=True)  # as it comes: the system keeps few datagrams unread
        listener.start()
        done = run("fly", short(tmp_path), "--gps", "midg", "--json", "--no-report", "--mavlink", url, "--speed", "4",
                   cwd=tmp_path)  # fmt: skip
        assert done.returncode == 0, done.stderr
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as last:
            ear.settimeout(0.5)
            last.sendto(bytes(12), ear.getsockname())  # the last word, so that the listener looks at its new patience
        listener.join(120.0)
        assert not listener.is_alive()
    assert_told(numbers)


def test_help_lists_every_command(tmp_path):
    done = run("--help", cwd=tmp_path)
    assert done.returncode == 0
    assert all(command in done.stdout for command in ("fly", "replay", "info", "vehicle", "report", "bench"))
