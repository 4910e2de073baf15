"""`flownav accuracy` and its ablations: what each variant lacks, targets, exit status, files and errors."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from command import printed
from flownav.campaigns.accuracy import CASES, Target, _consistent, flights_of, scenario_of
from flownav.campaigns.judged import (
    ablations,
    ageless,
    constant_flow_noise,
    fly_judged,
    without_compass_states,
    without_gps_states,
)
from flownav.campaigns.local import fly_many, home_epoch, known_exactly
from flownav.cli import app
from flownav.core.errors import InputError, VerdictError
from flownav.core.measurement import Sensor
from flownav.scoring.consistency import GROUP_FLIGHTS, inside_steps
from flownav.sensors.flow import flow_noise_sigma
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario, with_filter


@pytest.fixture(scope="module")
def approach():
    return assemble(scenario_of("approach"))


@pytest.fixture(scope="module")
def takeoff():
    return assemble(scenario_of("takeoff"))


def test_every_variant_lacks_one_piece_that_the_scenario_has(approach, takeoff):
    told, carried = ["flow's age", "height schedule", "compass deviation"], ["barometer", "flow"]
    assert list(ablations(takeoff)) == [*told, *carried]
    assert list(ablations(approach)) == [*told, "GPS error states", "barometer", "pad fix", "flow"]
    whole = approach.flight
    sensors = {"barometer": "barometer", "pad fix": "pad_camera", "flow": "flow_camera"}
    for lacking, flight in ablations(approach).items():
        assert flight._replace(onboard=whole.onboard, table=whole.table, settings=whole.settings) == whole, lacking
        assert flight.table.horizon_epochs == whole.table.horizon_epochs, lacking
        missing = [sensors[lacking]] if lacking in sensors else []
        same = {"carried": None, "pad_seen": None}
        assert flight.onboard._replace(**same) == whole.onboard._replace(**same), lacking
        for name, fitting in whole.onboard.carried._asdict().items():
            clock = fitting.clock._replace(fitted=0) if name in missing else fitting.clock
            assert getattr(flight.onboard.carried, name) == fitting._replace(clock=clock), lacking
        settings_differ = not np.array_equal(flight.settings, whole.settings)
        assert settings_differ == (lacking not in sensors and lacking != "flow's age"), lacking


def flow_instants(flight):
    """When the flow readings are taken to have been, and in which epoch they are taken."""
    rows = flight.table.sensor == Sensor.FLOW_RATE
    return flight.table.t_s[rows], flight.table.epoch[rows]


def test_an_ageless_flow_is_taken_for_that_of_its_arrival(approach):
    timing = approach.fitted.timing[Sensor.FLOW_RATE]
    assert ageless(approach.fitted) == timing._replace(lag_s=0.0, latency_s=0.0)
    right, epochs = flow_instants(approach.flight)
    wrong, later = flow_instants(ablations(approach)["flow's age"])
    np.testing.assert_allclose(wrong - right, timing.lag_s + timing.latency_s, atol=1e-12)
    assert (later >= epochs).all()
    others = approach.flight.table.sensor != Sensor.FLOW_RATE
    same = ablations(approach)["flow's age"].table
    np.testing.assert_array_equal(same.t_s[same.sensor != Sensor.FLOW_RATE], approach.flight.table.t_s[others])


def test_what_is_not_carried_is_not_in_the_timetable(approach):
    for lacking, sensor in (("barometer", Sensor.BARO), ("pad fix", Sensor.PAD), ("flow", Sensor.FLOW_RATE)):
        table = ablations(approach)[lacking].table
        assert sensor not in table.sensor
        assert sensor in approach.flight.table.sensor
        others = approach.flight.table.sensor != sensor
        np.testing.assert_array_equal(table.t_s, approach.flight.table.t_s[others])


def test_the_constant_noise_is_the_schedules_root_mean_square(approach):
    noise = approach.fitted.given.noise
    constant = constant_flow_noise(noise)
    sigma = [flow_noise_sigma(h, constant) for h in (0.3, 1.0, 3.0)]
    assert np.ptp(sigma) == 0.0
    heights = np.linspace(noise.noise_low_m, noise.noise_high_m, 500)
    rms = np.sqrt(np.mean([flow_noise_sigma(h, noise) ** 2 for h in heights]))
    assert sigma[0] == pytest.approx(rms, rel=0.01)
    assert flow_noise_sigma(0.6, noise) < sigma[0] < flow_noise_sigma(1.5, noise)


def test_without_its_error_states_all_of_the_gps_error_is_white(approach):
    told = approach.fitted.given
    before, after = told.settings, without_gps_states(told).settings
    none = ("gps_slow_sigma_m", "gps_slow_sigma_down_m", "gps_fast_sigma_m", "gps_fast_sigma_down_m",
            "gps_velocity_sigma_m_s")  # fmt: skip
    assert all(getattr(after, name) == 0.0 < getattr(before, name) for name in none)
    for down in ("", "_down"):
        parts = [getattr(before, f"gps_{part}_sigma{down}_m") for part in ("white", "slow", "fast")]
        assert getattr(after, f"gps_white_sigma{down}_m") == pytest.approx(np.sqrt(np.sum(np.square(parts))))
        white, lasting = getattr(before, f"gps_velocity_white{down}_m_s"), before.gps_velocity_sigma_m_s
        assert getattr(after, f"gps_velocity_white{down}_m_s") == pytest.approx(np.hypot(white, lasting))


def test_without_its_deviation_states_all_of_the_compass_error_is_noise(approach):
    before = approach.fitted.given.settings
    after = without_compass_states(approach.fitted.given).settings
    assert after.compass_sigma_rad == 0.0 < before.compass_sigma_rad
    assert after.heading_noise_rad == pytest.approx(np.hypot(before.heading_noise_rad, before.compass_sigma_rad))


def test_only_the_navigator_can_be_taken_apart():
    with pytest.raises(ValueError, match="only the navigator can be taken apart"):
        ablations(assemble(with_filter(load_scenario("approach"), "paper")))


# -- judged flights ----------------------------------------------------------------------------------------
def test_the_papers_filter_notes_its_pad_at_the_start_or_last_before_take_off_and_the_navigator_counts_from_it():
    def papers(name):
        return assemble(with_filter(scenario_of(name), "paper"))

    assert home_epoch(papers("approach").flight) is None
    assert home_epoch(papers("landing").flight) == 0
    takeoff = papers("takeoff")
    assert home_epoch(takeoff.flight) == round(takeoff.scenario.flight.takeoff_at_s / 0.02) - 1
    assert home_epoch(assemble(scenario_of("takeoff")).flight) is None


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("takeoff", "its position on the ground until take-off at 10 s"),
        ("landing", "its position in hover for the first 5 s (true state used)"),
        ("approach", "nothing (true state used for the first 5 s)"),
    ],
)
def test_what_a_vehicle_knows_exactly_is_said(name, known):
    assert known_exactly(scenario_of(name)) == known


def short(scenario, duration_s=8.0):
    return assemble(
        scenario.model_copy(update={"flight": scenario.flight.model_copy(update={"duration_s": duration_s})})
    )


def test_judged_flights_have_the_scores_of_plain_ones_and_no_lane_of_the_last_block_too_many():
    setup = short(scenario_of("landing"), 6.0)
    flight, epochs, handed = setup.flight, setup.flight.plan.epochs, round(5.0 / 0.02)
    judged = fly_judged(flight, 3, GROUP_FLIGHTS + 5)
    assert np.array_equal(judged.scores, fly_many(flight, 3, GROUP_FLIGHTS + 5), equal_nan=True)
    assert judged.largest_horizontal_m.shape == (GROUP_FLIGHTS + 5,)
    assert judged.flown.steps.sum() == (GROUP_FLIGHTS + 5) * (epochs - handed)  # all in flight
    assert judged.sums.flights == GROUP_FLIGHTS + 5
    started = np.argmax(judged.sums.running == judged.sums.flights)
    in_all = epochs - flight.table.horizon_epochs
    assert started < 60  # a shaken vehicle levels itself for a second
    assert judged.sums.errors.steps.sum() == judged.sums.running.sum()
    assert [inside_steps(group)[1] for group in judged.groups] == [in_all - started]  # a rest is left out
    few = fly_judged(flight, 3, 5)
    assert len(few.groups) == 1
    worst = np.abs(judged.flown.squares).max()
    assert 0.0 < worst < np.inf


def test_the_papers_filter_is_judged_by_what_it_flew_on_alone():
    flight = short(with_filter(scenario_of("landing"), "paper"), 2.0).flight
    judged = fly_judged(flight, 3, 5)
    assert judged.sums is None
    assert judged.groups is None
    assert judged.flown.steps.sum() == 5 * flight.plan.epochs
    assert (judged.largest_horizontal_m > 0.0).all()


# -- the command -------------------------------------------------------------------------------------------
def run(*arguments):
    return CliRunner().invoke(app, ["accuracy", *map(str, arguments)])


def test_the_command_says_every_target_and_writes_what_it_prints(tmp_path):
    out = tmp_path / "accuracy.md"
    done = run("--flights", 16, "--cases", "takeoff, approach", "--ablations", 16, "--out", out)
    assert done.exception is None or isinstance(done.exception, VerdictError)
    mark, _, table = out.read_text(encoding="utf-8").partition("\n")
    assert mark.startswith("<!-- written by flownav; SHA-256 of what follows: ")
    assert done.stdout.strip() == table.strip()
    assert "takeoff without" in done.stdout
    assert "96 flights" not in done.stdout  # 16 were flown
    assert done.stdout.count("steps with the ANEES of 16 flights in its") == 2  # a column of two tables
    assert (
        done.stdout.count("| ANEES, the squared errors over the stated ones ") == 8
    )  # two limits, two cases, two truths
    for truth_model in ("matched", "ensemble"):
        assert f"{truth_model}: RMSE over the bound of the filter's own model, at the horizon" in done.stdout
        assert f"| {truth_model}: touchdown " in done.stdout
        (heading,) = (line for line in done.stdout.splitlines() if f"{truth_model}: RMSE of the autopilot's" in line)
        assert " in flight [m, m/s, °] | x " in heading
        assert [cell.strip() for cell in heading.split("|")][8:11] == ["roll", "pitch", "yaw"]
    assert "| takeoff  | its position on the ground until take-off at 10 s " in done.stdout
    assert "| pad fix " in done.stdout
    for line in done.stdout.splitlines():
        assert line == "" or (line.startswith("| ") and line.endswith(" |"))


def test_json_has_every_figure_and_the_exit_status_follows_the_targets():
    done = run("--flights", 32, "--cases", "landing", "--ablations", 0, "--json")
    facts = json.loads(done.stdout)
    (case,) = facts["cases"]
    assert (case["case"], case["flights"], case["ablations"]) == ("landing", 32, {})
    for truth_model in ("matched", "ensemble"):
        facts = case[truth_model]
        assert set(facts["rmse_over_bound"]) == set("xyzuvw")
        assert all(0.1 < ratio < 10.0 for ratio in facts["rmse_over_bound"].values())
        assert 0.03 < facts["p95_largest_axis_m"] < 1.0
        assert set(facts["rms_attitude_deg"]) == {"roll", "pitch", "yaw"}
        assert all(0.01 < angle < 10.0 for angle in facts["rms_attitude_deg"].values())
        assert 0.0 < facts["touchdown"]["success"]["rate"] <= 1.0
    assert {target["truth_model"] for target in case["targets"]} == {"matched", "ensemble"}
    assert case["matched"]["p95_largest_axis_m"] != case["ensemble"]["p95_largest_axis_m"]
    assert case["known_exactly"] == "its position in hover for the first 5 s (true state used)"
    missed = [target for target in case["targets"] if not target["kept"]]
    assert bool(missed) == isinstance(done.exception, VerdictError)
    for target in missed:
        assert f"landing: {target['truth_model']}: {target['what']}" in printed(done.exception)


def test_a_target_is_kept_on_its_side_and_not_by_nan():
    assert Target("matched", "x", 1.0, 1.0).kept
    assert not Target("matched", "x", 1.01, 1.0).kept
    assert Target("matched", "x", 1.0, 1.0, at_least=True).kept
    assert not Target("matched", "x", 0.99, 1.0, at_least=True).kept
    assert not Target("matched", "x", np.nan, 1.0).kept
    assert not Target("matched", "x", np.nan, 1.0, at_least=True).kept
    assert Target("ensemble", "error [m]", 0.5, 0.4).sentence() == "ensemble: error [m] 0.500, at most 0.4"


@pytest.mark.parametrize(("anees", "kept"), [
    (0.79, [False, True]), (0.8, [True, True]), (1.15, [True, True]), (1.16, [True, False]), (None, [True, False]),
])  # fmt: skip
def test_errors_may_be_a_little_smaller_or_larger_than_stated(anees, kept):
    targets = _consistent("ensemble", {"anees": anees})
    assert [target.kept for target in targets] == kept
    assert [target.at_least for target in targets] == [True, False]
    assert {target.truth_model for target in targets} == {"ensemble"}


def test_the_progress_bar_knows_how_many_flights_there_are():
    assert flights_of(("pad_return",), 100, 10) == 300 + 10 * 7
    assert flights_of(CASES, 10, 0) == 110
    assert flights_of(("pad_return",), 100, 10, "quad-450") == 200 + 10 * 7


def test_a_multirotor_flies_the_cases_and_is_not_held_against_the_papers_filter():
    done = run("--flights", 16, "--cases", "pad_return", "--ablations", 0, "--vehicle", "quad-450", "--json")
    (case,) = json.loads(done.stdout)["cases"]
    assert case["vehicle"] == "450 mm quadrotor, 10-inch propellers"
    assert "papers_p95_largest_horizontal_m" not in case["matched"]
    assert not any("paper" in target["what"] for target in case["targets"])
    assert case["ensemble"]["touchdown"]["success"]["rate"] > 0.5
    assert scenario_of("pad_return", "quad-450").wind == scenario_of("pad_return").wind


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("--cases", "landing,hover"),
            "--cases hover: choose from takeoff, landing, pad_return, approach, approach_8_m_s, all",
        ),
        (("--cases", ""), "--cases : choose from takeoff"),
        (("--vehicle", "kite.toml"), "kite.toml"),
        (("--flights", 0), "--flights 0: must be from 1 to"),
        (("--ablations", -1), "--ablations -1: must be from 0 to"),
        (("--seed", -1), "--seed -1: must be from 0 to"),
    ],
)
def test_a_mistake_is_an_input_error(arguments, message):
    done = run(*arguments)
    assert isinstance(done.exception, InputError)
    assert message in printed(done.exception)


def test_an_out_file_that_cannot_be_written_is_said_before_anything_flies(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    done = run("--out", tmp_path / "file" / "x.md")
    assert isinstance(done.exception, InputError)
    assert "cannot be written" in printed(done.exception)
