"""Signs on readings made here: what is one, and what only looks like one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.logs.happened import VIBRATION, Happened
from flownav.logs.log import Log
from flownav.studies.explain import body_signs, height_signs, place_signs, sight_signs
from flownav.studies.explain.case import Case
from flownav.studies.explain.judge import explain
from flownav.studies.explain.sign import Sign
from planted_logs import fault, log_of


def gps(t_s: np.ndarray, north_m: np.ndarray, north_m_s: np.ndarray) -> Case:
    zeros = np.zeros((len(t_s), 2))
    return Case(
        Log(
            Path("log"),
            {
                Sensor.GPS_POSITION: Stream.of(Sensor.GPS_POSITION, t_s, np.column_stack([north_m, zeros])),
                Sensor.GPS_VELOCITY: Stream.of(Sensor.GPS_VELOCITY, t_s, np.column_stack([north_m_s, zeros])),
            },
        )
    )


def glitch(case: Case) -> Sign:
    found = place_signs.glitch(case)
    assert isinstance(found, Sign)
    return found


def test_what_happened_in_a_gap_of_gps_is_no_glitch():
    t_s = np.concatenate([np.arange(0.0, 30.0, 0.2), np.arange(60.0, 90.0, 0.2)])
    late = t_s >= 60.0
    assert glitch(gps(t_s, np.where(late, 80.0, 0.0), np.zeros(len(t_s)))).strength < 0.1
    moving = np.where(late, 80.0 + 2.0 * (t_s - 60.0), 0.0)
    assert glitch(gps(t_s, moving, np.where(late, 2.0, 0.0))).strength < 0.1


@pytest.mark.parametrize(("jump_m", "is_one"), [(25.0, True), (1.5, False)])
def test_a_jump_away_from_its_own_velocity_is_one(jump_m, is_one):
    t_s = np.arange(0.0, 90.0, 0.2)
    away = (t_s > 40.0) & (t_s < 48.0)
    found = glitch(gps(t_s, np.where(away, jump_m, 0.0), np.zeros(len(t_s))))
    assert (found.strength > 1.0) == is_one
    if is_one:
        assert found.figures["how"] == "jumped"
        assert found.window_s == pytest.approx((40.2, 47.8), abs=0.3)


def climb(range_m: np.ndarray, t_s: np.ndarray, height_m: np.ndarray) -> Sign:
    streams = {
        Sensor.RANGE: Stream.of(Sensor.RANGE, t_s, range_m[:, None]),
        Sensor.BARO: Stream.of(Sensor.BARO, t_s, height_m[:, None]),
    }
    found = height_signs.stuck(Case(Log(Path("log"), streams)))
    assert isinstance(found, Sign)
    return found


def test_a_range_that_repeats_while_it_climbs_is_stuck_and_the_longest_one_without_an_echo_is_not():
    t_s = np.arange(0.0, 60.0, 0.05)
    height_m = np.clip(0.3 * (t_s - 5.0), 0.0, 6.0) * (t_s < 50.0) + 0.1 + 0.01 * np.sin(7.0 * t_s)
    hung = np.where((t_s > 12.0) & (t_s < 20.0), 2.0, height_m)
    assert climb(hung, t_s, height_m).strength > 2.0
    silent = np.where(height_m > 4.5, 12.0, height_m)
    assert climb(silent, t_s, height_m).strength < 0.5


def test_a_factor_that_is_off_for_a_part_of_the_flight_is_no_scale(tmp_path):
    planted = fault("unseen", "lidar covered by its cap's edge")
    explained = explain(log_of(replace(planted, seed=planted.seed + 2000), tmp_path))
    assert [one.name for one in explained.findings] == ["range_stuck"]


def test_axes_scaled_apart_are_told_apart(tmp_path):
    first = explain(log_of(fault("unseen", "one axis scaled by a typing error"), tmp_path)).first
    assert first is not None
    assert first.name == "flow_scale"
    assert first.figures["x"] == pytest.approx(0.7, abs=0.08)
    assert first.figures["y"] == pytest.approx(1.0, abs=0.15)


# -- flow noise ----------------------------------------------------------------------------------------------------
FLOW_S = np.arange(0.0, 60.0, 0.05)


def jumping(flow: np.ndarray, t_s: np.ndarray = FLOW_S, **parameters: float) -> Sign:
    """Of flow (n, 2) in flight all along, two metres up."""
    readings = np.column_stack([flow, np.full((len(flow), 2), np.nan)])
    quality = np.full(len(t_s), 200.0)
    streams = {
        Sensor.FLOW_RATE: Stream.of(Sensor.FLOW_RATE, t_s, readings, quality=quality),
        Sensor.RANGE: Stream.of(Sensor.RANGE, t_s, np.full((len(t_s), 1), 2.0)),
    }
    found = sight_signs.noise(Case(Log(Path("log"), streams, parameters=parameters)))
    assert isinstance(found, Sign)
    return found


def white(size: float, t_s: np.ndarray = FLOW_S) -> np.ndarray:
    return size * np.random.default_rng(8).standard_normal((len(t_s), 2))


def test_noise_is_what_it_is_made_of_and_lies_where_it_was_put():
    part = (FLOW_S > 20.0) & (FLOW_S < 35.0)
    found = jumping(white(0.05) + part[:, None] * white(0.8))
    assert found.figures["noise_rad_s"] == pytest.approx(0.8, rel=0.25)
    assert found.window_s == pytest.approx((20.0, 35.0), abs=1.5)
    assert found.strength > 2.0


@pytest.mark.parametrize(
    "flow",
    [white(0.1), 3.0 * np.column_stack([np.sin(2.0 * FLOW_S), np.cos(3.0 * FLOW_S)])],
    ids=["usual noise", "brisk motion"],
)
def test_what_a_vehicle_does_is_no_noise(flow):
    assert jumping(flow).strength < 0.5


def test_a_filter_that_was_told_of_the_noise_is_not_harmed_by_it():
    assert jumping(white(0.6)).strength > 1.5
    assert jumping(white(0.6), EK3_FLOW_M_NSE=0.9).strength < 0.9


def test_readings_that_a_link_tells_twice_hide_no_noise():
    twice = np.repeat(white(0.8, FLOW_S[::2]), 2, axis=0)
    assert jumping(twice).strength > 2.0


# -- heights and heading -------------------------------------------------------------------------------------------
def up_and_down(range_m: np.ndarray, t_s: np.ndarray, baro_m: np.ndarray) -> Case:
    streams = {
        Sensor.RANGE: Stream.of(Sensor.RANGE, t_s[range_m > 0.05], range_m[range_m > 0.05, None]),
        Sensor.BARO: Stream.of(Sensor.BARO, t_s, baro_m[:, None]),
    }
    return Case(Log(Path("log"), streams))


def test_a_range_that_ends_near_the_ground_was_too_near_and_not_out_of_reach():
    t_s = np.arange(0.0, 90.0, 0.05)
    knots_s, knots_m = [10.0, 14.0, 30.0, 34.0, 60.0, 64.0, 80.0, 84.0], [0.0, 5.0, 5.0, 0.0, 0.0, 1.0, 1.0, 0.0]
    height_m = np.interp(t_s, knots_s, knots_m)
    fooled = height_m + np.interp(t_s, [30.0, 34.0], [0.0, 5.0])  # the barometer led it down
    found = height_signs.reach(up_and_down(height_m, t_s, fooled))
    assert isinstance(found, Sign)
    assert found.strength < 0.2
    short = np.where(height_m > 3.0, 0.0, height_m)
    beyond = height_signs.reach(up_and_down(short, t_s, height_m))
    assert isinstance(beyond, Sign)
    assert beyond.strength > 2.0


@pytest.mark.parametrize(("pushed_m", "is_one"), [(3.0, True), (0.2, False)])
def test_wash_is_seen_where_the_range_says_nothing_on_the_ground(pushed_m, is_one):
    t_s = np.arange(0.0, 75.0, 0.05)
    height_m = np.interp(t_s, [15.0, 25.0, 45.0, 55.0], [0.0, 3.0, 3.0, 0.0])
    aloft = (height_m > 0.0).astype(float)
    found = height_signs.wash(up_and_down(height_m, t_s, height_m + pushed_m * aloft))
    assert isinstance(found, Sign)
    assert (found.strength > 1.0) == is_one
    assert found.figures["metres"] == pytest.approx(pushed_m, abs=0.3)


@pytest.mark.parametrize(("turn_deg", "is_one"), [(90.0, True), (-70.0, True), (12.0, False)])
def test_a_compass_that_goes_off_in_flight_is_told_from_one_that_does_not(turn_deg, is_one):
    t_s = np.arange(0.0, 80.0, 0.1)
    off = np.radians(np.where(t_s > 40.0, turn_deg, 0.0))
    field = np.column_stack([0.2 * np.cos(off), 0.2 * np.sin(off), np.full(len(t_s), 0.4)])
    level = np.tile([1.0, 0.0, 0.0, 0.0], (len(t_s), 1))
    streams = {
        Sensor.MAG: Stream.of(Sensor.MAG, t_s, field),
        Sensor.ATTITUDE: Stream.of(Sensor.ATTITUDE, t_s, level),
        Sensor.RANGE: Stream.of(Sensor.RANGE, t_s, np.interp(t_s, [5.0, 8.0], [0.1, 2.0])[:, None]),
    }
    found = place_signs.compass(Case(Log(Path("log"), streams)))
    assert isinstance(found, Sign)
    assert (found.strength > 1.0) == is_one
    assert found.figures["turn_deg"] == pytest.approx(turn_deg, abs=1.0)
    if is_one:
        assert found.window_s == pytest.approx((40.0, 80.0), abs=3.0)


def test_vibration_is_also_what_the_vehicle_says_itself():
    t_s = np.arange(0.0, 60.0, 0.02)
    calm = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, -9.8], (len(t_s), 1))
    streams = {Sensor.IMU: Stream.of(Sensor.IMU, t_s, calm)}
    for level, strength in ((15.0, 0.5), (45.0, 1.5)):
        told = tuple(Happened(at_s, VIBRATION, "", value) for at_s, value in ((0.0, 0.0), (20.0, level), (40.0, 0.0)))
        found = body_signs.vibration(Case(Log(Path("log"), streams, happened=told)))
        assert isinstance(found, Sign)
        assert found.strength == pytest.approx(strength)


@pytest.mark.parametrize(("wash_m", "serves"), [(0.0, True), (2.0, True), (-2.0, True), (5.0, False), (-5.0, False)])
def test_a_barometer_that_left_the_range_at_take_off_does_not_show_later_that_the_range_is_stuck(wash_m, serves):
    t_s = np.arange(0.0, 60.0, 0.05)
    range_m = 0.06 + np.clip(0.5 * (t_s - 10.0), 0.0, 1.5)
    washed = np.where(t_s > 10.0, wash_m, 0.0)
    case = up_and_down(range_m, t_s, range_m - 0.06 + washed)
    assert height_signs._rose_with_it(case, case.other_heights["barometer"]) == serves
    aloft = up_and_down(range_m + 2.0, t_s, range_m + washed)  # a log that begins in flight shows no take-off
    assert height_signs._rose_with_it(aloft, aloft.other_heights["barometer"])
