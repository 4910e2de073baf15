"""The search and its intervals on gains whose top is known, and the verdict on gains that are given."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from flownav.core.measurement import COLUMNS, Sensor, Stream
from flownav.logs.log import Log
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.studies.tuning.job import proposals
from flownav.studies.tuning.knobs import KNOBS, MOST_NOISE, knobs_of, limits_of, rounded, turned
from flownav.studies.tuning.scores import Gains
from flownav.studies.tuning.search import (
    ACCEPTED,
    NOT_ACCEPTED,
    Found,
    interval_of,
    judge,
    judged,
    resampled,
    search,
    student_of,
)

SETTINGS = NavigatorSettingsFile()
NOISES = [knob for knob in KNOBS if knob.name in ("gyro noise", "accelerometer noise", "range noise")]


@dataclass
class Hills:
    """Trials whose gains are parabolas: tops (knobs,), worth (knobs,), windows that differ by spread."""

    tops: np.ndarray
    worth: np.ndarray
    spread: float = 0.0
    knobs: list = field(default_factory=lambda: list(NOISES))
    courses: tuple = (None,)
    windows: int = 12

    def gains(self, log_factors):
        drawn = self.spread * np.random.default_rng(0).standard_normal((self.windows, len(self.knobs)))
        drawn -= drawn.mean(axis=0)
        off = np.asarray(log_factors) - self.tops - drawn
        start = 0.0 - self.tops - drawn
        total = (self.worth * (start**2 - off**2)).sum(axis=1)
        return [Gains(total, np.full(self.windows, np.nan))]


def test_the_search_finds_what_the_windows_show_and_leaves_the_rest():
    """At the top itself, which lies between two steps of the search and further from the start than the prior likes."""
    found = search(Hills(np.log([3.0, 1.0, 0.4]), np.array([1.0, 0.0, 1.0]), spread=0.3), SETTINGS)
    assert np.exp(found.log_factors) == pytest.approx([3.0, 1.0, 0.4], rel=1e-3)
    assert found.log_factors[1] == 0.0
    assert found.intervals[1] is None
    for k, top in ((0, np.log(3.0)), (2, np.log(0.4))):
        low, high = found.intervals[k]
        assert low < top < high
        assert 0.15 < high - low < 0.6  # 0.3 over the root of 12 windows, and Student's t


def test_an_interval_lies_about_the_top_and_not_about_a_step_of_the_search():
    """Windows that agree leave no doubt, wherever the steps fall."""
    for factor in (2.2, 2.5, 2.8):
        found = search(Hills(np.log([factor, 1.0, 1.0]), np.array([1.0, 0.0, 0.0]), spread=1e-4), SETTINGS)
        low, high = np.exp(found.intervals[0])
        assert 0.999 * factor < low <= factor <= high < 1.001 * factor


@dataclass
class Ranges:
    """Trials of one knob: logs whose tops are given, each of whose windows agree with one another."""

    tops: np.ndarray
    knobs: list

    @property
    def courses(self):
        return [None] * len(self.tops)

    def gains(self, log_factors):
        (factor,) = log_factors
        return [Gains(np.full(12, top**2 - (factor - top) ** 2), np.full(12, np.nan)) for top in self.tops]


@pytest.mark.parametrize(("tops", "moves"), [
    ((0.9, 1.0, 1.1), True), ((0.4, 1.0, 1.6), False), ((0.2, 1.0, 1.0, 1.8), False), ((0.6, 1.0, 1.0, 1.4), True),
])  # fmt: skip
def test_of_starts_each_log_is_one_sample(tops, moves):
    """However many windows agree: by them, any of these would move."""
    start, noise = (
        next(knob for knob in KNOBS if knob.name == name) for name in ("gyro bias at the start", "gyro noise")
    )
    found = search(Ranges(np.array(tops), [start]), SETTINGS)
    assert bool(found.log_factors[0]) == moves
    assert search(Ranges(np.array(tops), [noise]), SETTINGS).log_factors[0] == pytest.approx(1.0)
    if moves:
        half = {3: 4.303, 4: 3.182}[len(tops)] * np.std(tops, ddof=1) / len(tops) ** 0.5  # Student's t, of a table
        assert found.intervals[0] == pytest.approx((1.0 - half, 1.0 + half), abs=1e-3)


def test_what_chance_could_have_moved_stays():
    tops, worth = np.log([1.5, 1.0, 1.0]), np.array([1.0, 0.0, 0.0])
    assert search(Hills(tops, worth, spread=0.2), SETTINGS).log_factors[0] > 0.0
    assert not search(Hills(tops, worth, spread=1.0), SETTINGS).log_factors.any()


def test_what_is_worth_little_stays():
    found = search(Hills(np.log([3.0, 3.0, 1.0]), np.array([1.0, 0.005, 1.0])), SETTINGS)
    assert found.log_factors[0] > 0.0
    assert found.log_factors[1] == 0.0


def test_limits_hold():
    found = search(Hills(np.log([100.0, 1.0, 1.0]), np.array([1.0, 1.0, 1.0])), SETTINGS)
    assert found.log_factors[0] == pytest.approx(MOST_NOISE)
    assert found.intervals[0][1] <= MOST_NOISE + 1e-12


@pytest.mark.parametrize("knob", KNOBS, ids=lambda knob: knob.name)
def test_every_knob_stays_within_the_schema(knob):
    for settings in (SETTINGS, NavigatorSettingsFile(range_relative_sigma=0.4, baro_sigma_m=90.0, flow_gain_x=9.0)):
        low, high = limits_of(knob, settings)
        assert low < 0.0 < high
        for factor in (low, high):
            NavigatorSettingsFile.model_validate(turned(settings, [knob], [factor * (1.0 - 1e-3)]))


@pytest.mark.parametrize(("sensors", "truth", "gain"), [
    ((Sensor.FLOW_RATE, Sensor.RANGE), None, False),
    ((Sensor.FLOW_RATE, Sensor.RANGE), {}, True),
    ((Sensor.FLOW_VELOCITY, Sensor.GPS_POSITION), None, True),
    ((Sensor.FLOW_RATE, Sensor.POSE), None, True),
])  # fmt: skip
def test_a_gain_is_sought_only_where_something_tells_the_speed(sensors, truth, gain):
    streams = {sensor: Stream.of(sensor, np.zeros(1), np.zeros((1, len(COLUMNS[sensor])))) for sensor in sensors}
    names = [knob.name for knob in knobs_of(Log(Path("made"), streams, truth=truth), SETTINGS)]
    assert ("flow gain" in names) == gain
    assert "flow noise" in names
    assert "barometer noise" not in names


def test_an_imu_that_serves_leaves_no_attitude_to_tune():
    def names(imu_hz: float) -> list[str]:
        t_s = np.arange(0.0, 2.0, 1.0 / imu_hz)
        streams = {sensor: Stream.of(sensor, t_s, np.zeros((len(t_s), len(COLUMNS[sensor]))))
                   for sensor in (Sensor.IMU, Sensor.ATTITUDE)}  # fmt: skip
        return [knob.name for knob in knobs_of(Log(Path("made"), streams), SETTINGS)]

    assert names(100.0) == ["gyro noise", "accelerometer noise"]
    assert names(5.0) == ["attitude noise"]


def test_starts_are_tuned_where_they_are_asked_for_and_heard():
    def names(*sensors: Sensor) -> set[str]:
        streams = {sensor: Stream.of(sensor, 0.01 * np.arange(200), np.zeros((200, len(COLUMNS[sensor]))))
                   for sensor in sensors}  # fmt: skip
        log = Log(Path("made"), streams)
        asked = {knob.name for knob in knobs_of(log, SETTINGS, starts=True)}
        return asked - {knob.name for knob in knobs_of(log, SETTINGS)}

    moved = {"gyro bias at the start", "accelerometer bias at the start", "velocity at the start"}
    assert names(Sensor.IMU) == moved
    assert names(Sensor.IMU, Sensor.FLOW_RATE) == {*moved, "flow scale at the start"}
    assert names(Sensor.IMU, Sensor.MAG) == {*moved, "compass deviation at the start", "heading error at the start"}
    assert names(Sensor.IMU, Sensor.GPS_VELOCITY) == {*moved, "GPS velocity's lag at the start"}
    assert names(Sensor.ATTITUDE) == {"velocity at the start", "heading error at the start"}


def test_factors_make_settings_with_few_digits():
    assert turned(SETTINGS, NOISES, [np.log(3.0), 0.0, 0.0]) == {"gyro_noise_rad_s_rt_hz": 0.012}
    assert rounded(0.123456) == 0.1235


def test_each_key_has_its_own_unit():
    found = Found(np.log([2.0]), [(np.log(1.5), np.log(3.0))])
    rows = proposals(found, [knob for knob in KNOBS if knob.name == "range noise"], SETTINGS)
    assert [(row.key, row.unit, row.default, row.value, row.low, row.high) for row in rows] == [
        ("range_sigma_m", "m", 0.05, 0.1, 0.075, 0.15),
        ("range_relative_sigma", "share of the range", 0.02, 0.04, 0.03, 0.06),
    ]


# -- the verdict ---------------------------------------------------------------------------------------------
def gains(error, prediction=0.0, windows=8, spread=0.05, seed=0):
    """A log's held-out windows about these means."""
    noise = spread * np.random.default_rng(seed).standard_normal(windows)
    return Gains(np.full(windows, prediction), error + noise - noise.mean())


@pytest.mark.parametrize(("held", "whole", "verdict", "why"), [
    ([gains(0.3)], [False], ACCEPTED, "shrinks in the held-out windows"),
    ([gains(0.0)], [False], NOT_ACCEPTED, "does not shrink beyond chance"),
    ([gains(0.3, spread=1.2)], [False], NOT_ACCEPTED, "does not shrink beyond chance"),
    ([gains(0.01, spread=0.001)], [False], NOT_ACCEPTED, "does not shrink beyond chance and 2 %"),
    ([gains(-0.3, prediction=2.0)], [False], NOT_ACCEPTED, "error grows"),
    ([gains(0.3, prediction=-0.5)], [False], NOT_ACCEPTED, "less than the sensors' predictions lose"),
    ([gains(np.nan, prediction=2.0)], [False], NOT_ACCEPTED, "no GPS, truth or flow shows"),
    ([gains(0.3), gains(0.2)], [False, True], ACCEPTED, "shrinks"),
    ([gains(0.3), gains(-0.05)], [False, True], NOT_ACCEPTED, "logs that were held out whole"),
])  # fmt: skip
def test_only_what_helps_is_accepted(held, whole, verdict, why):
    found = judge(held, whole)
    assert found.verdict == verdict
    assert why in found.why


def test_logs_count_alike_and_windows_without_a_figure_do_not():
    known = judged([np.full(4, 1.0), np.full(12, 0.0), np.array([])])
    assert (known.mean, known.windows) == (0.5, 16)
    assert judged([np.array([])]) is None


def test_intervals_of_few_windows_hold_as_often_as_they_say():
    draw = np.random.default_rng(3)
    held = 0
    for trial in range(400):
        low, high = interval_of(resampled([draw.standard_normal(6)], trial)[:, 0], 6)
        held += low <= 0.0 <= high
    assert held / 400 == pytest.approx(0.95, abs=0.035)  # plain percentiles: 0.87


def test_intervals_of_three_logs_hold_as_often_as_they_say():
    draw = np.random.default_rng(4)
    ends = [student_of(draw.standard_normal(3)) for _ in range(2000)]
    assert np.mean([low <= 0.0 <= high for low, high in ends]) == pytest.approx(0.95, abs=0.015)


def test_the_same_draws_each_time():
    values = [np.arange(5.0), np.arange(7.0)]
    assert np.array_equal(resampled(values, 1), resampled(values, 1))
    assert not np.array_equal(resampled(values, 1), resampled(values, 2))
