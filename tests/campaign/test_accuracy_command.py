"""`flownav accuracy` and its ablations: what each variant lacks, targets, exit status, files and errors."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from flownav.campaign.ablations import (
    ablations,
    constant_flow_noise,
    first_order_lag,
    no_lag,
    without_gps_states,
    without_imu,
)
from flownav.campaign.accuracy import CASES, Target, flights_of, scenario_of
from flownav.campaign.judged import fly_judged, home_epoch
from flownav.campaign.local import fly_many
from flownav.cli import app
from flownav.errors import InputError, VerdictError
from flownav.estimation.landing.states import GPS_FAST, GPS_SLOW, GPS_VELOCITY
from flownav.scoring.consistency import GROUP_FLIGHTS
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
    everywhere = ["second-order dynamics", "latency and dynamics", "height schedule"]
    assert list(ablations(takeoff)) == [*everywhere, "IMU", "flow"]
    assert list(ablations(approach)) == [*everywhere, "GPS error states", "IMU", "pad fix", "flow"]
    for lacking, flight in ablations(approach).items():
        whole = approach.flight
        assert flight.plan is whole.plan, lacking
        assert (flight.vehicle, flight.wind, flight.path) == (whole.vehicle, whole.wind, whole.path), lacking
        truth = flight.sensors._replace(imu=whole.sensors.imu, pad_fix=whole.sensors.pad_fix)
        assert truth == whole.sensors, lacking


def lagged(lag, speed, epochs):
    """Readings of a lag whose seen velocity is speed(t) and goes in straight lines between epochs."""
    x1 = x2 = 0.0
    readings = []
    for k in range(1, epochs):
        m0, m1 = speed(0.02 * (k - 1)), speed(0.02 * k)
        x1, x2 = (
            lag.f11 * x1 + lag.f12 * x2 + lag.start_1 * m0 + lag.end_1 * m1,
            lag.f21 * x1 + lag.f22 * x2 + lag.start_2 * m0 + lag.end_2 * m1,
        )
        readings.append(lag.gain * x1)
    return np.array(readings)


def test_the_first_order_lag_has_the_gain_and_the_delay_of_the_sensor(approach):
    landing, dynamics = approach.flight.landing, approach.sensor.dynamics
    simple = first_order_lag(landing, dynamics.b_1_s, dynamics.c_1_s2)
    for lag in (landing.lag, simple):
        assert lagged(lag, lambda t: 1.0, 200)[-1] == pytest.approx(dynamics.gain, rel=1e-6)
        late = dynamics.gain * 0.02 * 199 - lagged(lag, lambda t: t, 200)[-1]
        assert late / dynamics.gain == pytest.approx(dynamics.delay_s, rel=0.03)
    assert lagged(simple, lambda t: 1.0, 3)[0] != pytest.approx(lagged(landing.lag, lambda t: 1.0, 3)[0], rel=0.1)


def test_without_a_lag_the_reading_is_the_velocity_of_now(approach):
    readings = lagged(no_lag(approach.flight.landing), np.sin, 100)
    assert readings == pytest.approx(np.sin(0.02 * np.arange(1, 100)))


def test_the_constant_noise_is_the_schedules_root_mean_square(approach):
    flow = approach.flight.landing.flow
    constant = constant_flow_noise(flow)
    sigma = [flow_noise_sigma(h, constant) for h in (0.3, 1.0, 3.0)]
    assert np.ptp(sigma) == 0.0
    assert flow_noise_sigma(0.6, flow) < sigma[0] < flow_noise_sigma(1.5, flow)
    assert flow_noise_sigma(0.6, approach.flight.sensors.flow) < sigma[0]  # the sensor itself is as it was


def test_without_its_error_states_all_of_the_gps_error_is_white(approach):
    landing = approach.flight.landing
    without = without_gps_states(landing)
    for state in (GPS_SLOW, GPS_FAST, GPS_VELOCITY):
        assert not without.start_variance[state : state + 3].any()
        assert landing.start_variance[state : state + 3].all()
    gps = approach.scenario.gps
    level = gps.slow_sigma_m**2 + gps.fast_sigma_m**2
    assert without.gps_position_variance[0] == pytest.approx(landing.gps_position_variance[0] + level)
    assert without.gps_velocity_variance == pytest.approx(landing.gps_velocity_variance + gps.velocity_sigma_m_s**2)


def test_without_an_imu_the_noise_is_in_the_sensor_and_in_the_filter_alike(approach):
    flight, landing = approach.flight, approach.flight.landing
    coasting = without_imu(flight, landing)
    raised = coasting.landing.settings.accel_noise_m_s2_rt_hz / landing.settings.accel_noise_m_s2_rt_hz
    assert raised > 100.0
    assert coasting.sensors.imu.accel_sigma_m_s2 / flight.sensors.imu.accel_sigma_m_s2 == pytest.approx(raised)


def test_only_the_landing_filter_can_be_taken_apart():
    with pytest.raises(ValueError, match="only the landing filter"):
        ablations(assemble(with_filter(load_scenario("approach"), "paper")))


# -- judged flights ----------------------------------------------------------------------------------------
def test_the_pad_is_noted_at_the_start_or_last_before_take_off(approach, takeoff):
    assert home_epoch(approach.flight) is None
    assert home_epoch(assemble(scenario_of("landing")).flight) == 0
    assert home_epoch(takeoff.flight) == round(takeoff.scenario.flight.takeoff_at_s / 0.02) - 1


def short(scenario, duration_s=8.0):
    return assemble(
        scenario.model_copy(update={"flight": scenario.flight.model_copy(update={"duration_s": duration_s})})
    )


def test_judged_flights_have_the_scores_of_plain_ones_and_no_lane_of_the_last_block_too_many():
    flight = short(scenario_of("landing"), 2.0).flight
    judged = fly_judged(flight, 3, GROUP_FLIGHTS + 5)
    assert np.array_equal(judged.scores, fly_many(flight, 3, GROUP_FLIGHTS + 5), equal_nan=True)
    assert judged.largest_horizontal_m.shape == (GROUP_FLIGHTS + 5,)
    assert judged.sums.flights == GROUP_FLIGHTS + 5
    assert judged.errors.steps.sum() == (GROUP_FLIGHTS + 5) * flight.plan.epochs  # all in flight
    assert [steps for _, steps in judged.groups] == [flight.plan.epochs]  # one whole group; the rest is left out
    few = fly_judged(flight, 3, 5)
    assert [steps for _, steps in few.groups] == [flight.plan.epochs]


# -- the command -------------------------------------------------------------------------------------------
def run(*arguments):
    return CliRunner().invoke(app, ["accuracy", *map(str, arguments)])


def test_the_command_says_every_target_and_writes_what_it_prints(tmp_path):
    out = tmp_path / "accuracy.md"
    done = run("--flights", 32, "--cases", "takeoff, approach", "--ablations", 16, "--out", out)
    assert done.exception is None or isinstance(done.exception, VerdictError)
    assert done.stdout.strip() == out.read_text(encoding="utf-8").strip()
    assert "takeoff without" in done.stdout
    assert "| pad fix " in done.stdout
    for line in done.stdout.splitlines():
        assert line == "" or (line.startswith("| ") and line.endswith(" |"))


def test_json_has_every_figure_and_the_exit_status_follows_the_targets():
    done = run("--flights", 32, "--cases", "landing", "--ablations", 0, "--json")
    facts = json.loads(done.stdout)
    (case,) = facts["cases"]
    assert (case["case"], case["flights"], case["ablations"]) == ("landing", 32, {})
    assert set(case["efficiency"]) == set("xyzuvw")
    assert all(0.5 < ratio < 1.5 for ratio in case["efficiency"].values())
    assert 0.03 < case["p95_largest_axis_m"] < 0.2
    missed = [target for target in case["targets"] if not target["kept"]]
    assert bool(missed) == isinstance(done.exception, VerdictError)
    for target in missed:
        assert f"landing: {target['what']}" in str(done.exception)


def test_a_target_is_kept_on_its_side_and_not_by_nan():
    assert Target("x", 1.0, 1.0).kept
    assert not Target("x", 1.01, 1.0).kept
    assert Target("x", 1.0, 1.0, at_least=True).kept
    assert not Target("x", 0.99, 1.0, at_least=True).kept
    assert not Target("x", np.nan, 1.0).kept
    assert not Target("x", np.nan, 1.0, at_least=True).kept
    assert Target("error [m]", 0.5, 0.4).sentence() == "error [m] 0.500, at most 0.4"


def test_the_progress_bar_knows_how_many_flights_there_are():
    assert flights_of(("pad_return",), 100, 10) == 200 + 10 * 7
    assert flights_of(CASES, 10, 0) == 50


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--cases", "landing,hover"), "--cases hover: no such case; known: takeoff, landing, pad_return, approach"),
        (("--cases", ""), "--cases (empty): no such case"),
        (("--flights", 0), "--flights 0: must be from 1 to"),
        (("--ablations", -1), "--ablations -1: must be from 0 to"),
        (("--seed", -1), "--seed -1: must be from 0 to"),
    ],
)
def test_a_mistake_is_an_input_error(arguments, message):
    done = run(*arguments)
    assert isinstance(done.exception, InputError)
    assert message in str(done.exception)


def test_an_out_file_that_cannot_be_written_is_said_before_anything_flies(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    done = run("--out", tmp_path / "file" / "x.md")
    assert isinstance(done.exception, InputError)
    assert "cannot be written" in str(done.exception)
