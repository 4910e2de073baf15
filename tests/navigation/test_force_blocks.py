"""The accelerometer's noise by means over blocks: what readings that a unit smooths do not show of themselves."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.navigation.motion_records import ForceBlocks
from flownav.navigation.records import Reading
from flownav.navigation.vibration import BLOCK_S, followed_blocks

NAN = float("nan")
NOTHING = ForceBlocks()
STEP_S = 1.0 / 128.0  # which floats hold exactly, as their sums
LASTS_S = 60.0


def reading(x: float, y: float) -> Reading:
    return Reading(0.0, 0.0, 0.0, x, y, -9.8, NAN, NAN, NAN, quality=255.0, arrived=1.0, withheld=0.0)


def followed(t_s: np.ndarray, force: np.ndarray, m: ForceBlocks = NOTHING) -> ForceBlocks:
    for now, (x, y) in zip(t_s.tolist(), force.tolist(), strict=True):
        m = followed_blocks(reading(x, y), now, m)
    return m


def density(hz: float, force: np.ndarray) -> float:
    """The mean of what is found after every second from 10 s on [m/s2/sqrt(Hz)]."""
    t_s, m, found = np.arange(len(force)) / hz, NOTHING, []
    for k in range(int(LASTS_S)):
        span = slice(int(k * hz), int((k + 1) * hz))
        m = followed(t_s[span], force[span], m)
        found.append(m.power)
    return float(np.sqrt(np.mean(found[10:])))


@pytest.mark.parametrize("hz", [50.0, 250.0, 1000.0])
def test_white_noise_has_the_density_that_it_has_at_any_rate(hz):
    force = np.random.default_rng(5).normal(0.0, 0.3 * np.sqrt(hz), (int(LASTS_S * hz), 2))
    assert density(hz, force) == pytest.approx(0.3, rel=0.25)


def test_what_a_unit_smooths_over_20_ms_is_seen_where_its_readings_hide_it():
    """Between readings of 1 kHz such noise changes by a hundredth of itself."""
    white = np.random.default_rng(6).normal(0.0, 0.3 * np.sqrt(1000.0), (int(LASTS_S * 1000) + 20, 2))
    kernel = np.full(20, 1.0 / 20.0)
    smooth = np.column_stack([np.convolve(column, kernel, "valid")[: int(LASTS_S * 1000)] for column in white.T])
    bends = np.diff(smooth, 2, axis=0)
    assert np.sqrt(np.mean(bends**2) * 1e-3 / 6.0) < 0.1
    assert density(1000.0, smooth) == pytest.approx(0.3, rel=0.25)


def test_a_force_that_grows_steadily_shows_no_noise_and_one_that_holds_none():
    t_s = np.arange(0.0, 20.0, STEP_S)
    ramp = np.column_stack([0.5 * t_s, -0.2 * t_s])
    assert followed(t_s, ramp).power == pytest.approx(0.0, abs=1e-20)
    assert followed(t_s, 0.0 * ramp + 3.0).power == pytest.approx(0.0, abs=1e-20)


def test_both_level_axes_count_alike_and_signs_and_the_clock_do_not():
    t_s = np.arange(0.0, 20.0, STEP_S)
    force = np.random.default_rng(7).normal(0.0, 1.0, (len(t_s), 2))
    found = followed(t_s, force).power
    assert followed(t_s, force[:, ::-1]).power == pytest.approx(found, rel=1e-12)
    assert followed(t_s, -force).power == pytest.approx(found, rel=1e-12)
    assert followed(t_s + 64.0, force).power == pytest.approx(found, rel=1e-6)


def test_a_pause_begins_anew_and_keeps_what_is_known():
    t_s = np.arange(0.0, 8.0, STEP_S)
    m = followed(t_s, np.random.default_rng(8).normal(0.0, 1.0, (len(t_s), 2)))
    after = followed_blocks(reading(50.0, 0.0), 8.0 + 3.0 * BLOCK_S, m)
    assert (after.power, after.blocks, after.readings) == (m.power, 0.0, 0.0)
    assert followed(12.0 + t_s[:60], np.full((60, 2), 50.0), after).power == m.power
