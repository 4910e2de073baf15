"""The rangefinder: floor, ceiling, resolution, slant, noise, a stuck value, and the firmware's filter."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.parameter_files import check
from flownav.sensors.range_sensor import (
    PERIOD_S,
    RangefinderParameters,
    RangeReading,
    slant_range,
    start_rangefinder,
    step_rangefinder,
)
from flownav.sensors.settings import RangefinderSettings

start, step = start_rangefinder, step_rangefinder


def read(height: float, cosine: float = 1.0, normal: float = 0.0, **settings: float) -> RangeReading:
    p = RangefinderSettings.model_validate(settings).parameters()
    return step(start(height, cosine, p), height, cosine, normal, p)[1]


def test_nearer_than_30_cm_the_sonar_reports_its_floor() -> None:
    assert [read(h).range_m for h in (-0.1, 0.0, 0.1, 0.3)] == [0.3] * 4
    assert read(0.35).range_m == pytest.approx(0.35)


def test_beyond_its_ceiling_it_reports_the_ceiling_and_says_so() -> None:
    assert read(6.0) == (5.0, 0.0)
    assert read(4.99) == (pytest.approx(4.99), 1.0)


def test_beyond_its_ceiling_is_told_by_the_slant_that_the_echo_travels() -> None:
    cosine = 0.8  # 37 degrees: 4.5 m high is 5.6 m away
    assert read(4.5, cosine) == (5.0, 0.0)
    assert read(3.9, cosine) == (pytest.approx(3.9 / cosine, abs=1e-3), 1.0)


def test_ranges_come_in_whole_millimetres() -> None:
    assert read(1.00049).range_m == pytest.approx(1.000, abs=1e-12)
    assert read(1.00051).range_m == pytest.approx(1.001, abs=1e-12)
    assert read(1.00049, resolution_m=0.0).range_m == 1.00049


def test_a_tilted_sonar_reads_the_slant() -> None:
    assert read(2.0, math.cos(0.3), resolution_m=0.0).range_m == pytest.approx(2.0 / math.cos(0.3))
    assert slant_range(2.0, -0.5) == pytest.approx(20.0)  # upside down: far, and finite


def test_noise_has_its_size() -> None:
    draw = np.random.default_rng(8)
    ranges = [read(1.0, normal=float(n)).range_m for n in draw.standard_normal(4000)]
    sigma = math.hypot(0.005, 0.001 / math.sqrt(12.0))
    assert np.std(ranges) == pytest.approx(sigma, abs=4.0 * sigma / math.sqrt(2.0 * 4000))


@pytest.mark.parametrize("height", [0.1, 1.7, 9.0])
def test_a_stuck_sonar_reports_one_value_whatever_is_below(height: float) -> None:
    assert read(height, normal=3.0, stuck_at_m=0.8) == (0.8, 1.0)


def test_the_firmwares_filter_takes_its_own_shares_of_an_error() -> None:
    """x = x- + 0.8461 e, v = v + 6.2034 e: what px4flow's sonar.c has."""
    p = RangefinderSettings(resolution_m=0.0).parameters()
    state, _ = step(start(2.0, 1.0, p), 2.1, 1.0, 0.0, p)
    assert state == pytest.approx((2.0 + 0.8461 * 0.1, 6.2034 * 0.1))
    state, _ = step(state, 2.1, 1.0, 0.0, p)
    left = 2.1 - (2.0 + 0.8461 * 0.1 + 6.2034 * 0.1 * PERIOD_S)
    assert state.rate_m_s == pytest.approx(6.2034 * (0.1 + left))


def descend(p: RangefinderParameters, speed_m_s: float, seconds: float, from_m: float) -> tuple[list[float], float]:
    """Rates of the firmware's filter during a steady descent, and the last range of the filter."""
    state = start(from_m, 1.0, p)
    rates = []
    for k in range(round(seconds / PERIOD_S)):
        state, _ = step(state, from_m - speed_m_s * (k + 1) * PERIOD_S, 1.0, 0.0, p)
        rates.append(state.rate_m_s)
    return rates, state.range_m


def test_the_firmwares_filter_follows_a_descent_without_lag_and_stops_at_the_floor() -> None:
    p = RangefinderSettings(resolution_m=0.0).parameters()
    rates, last = descend(p, 0.3, 5.0, 3.0)
    assert rates[-1] == pytest.approx(-0.3, abs=1e-6)
    assert last == pytest.approx(1.5, abs=1e-6)
    rates, last = descend(p, 0.3, 12.0, 3.0)
    assert rates[-1] == pytest.approx(0.0, abs=1e-3)  # below 0.3 m it sees no descent
    assert last == pytest.approx(0.3, abs=1e-3)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"floor_m": 1.0, "ceiling_m": 0.5}, "f: ceiling_m: more than floor_m = 1.0 is needed, got 0.5"),
        ({"floor_m": 6.0}, "f: ceiling_m: more than floor_m = 6.0 is needed, got 5.0"),
        ({"stuck_at_m": -1.0}, "f: stuck_at_m: Input should be greater than or equal to 0, got -1.0"),
        ({"sigma_mm": 5.0}, "f: sigma_mm: unknown key; known here: ceiling_m, floor_m"),
    ],
)
def test_a_wrong_setting_is_one_line_with_its_key(entries: dict[str, float], message: str) -> None:
    with pytest.raises(InputError) as error:
        check(entries, RangefinderSettings, "f")
    assert str(error.value).startswith(message)
