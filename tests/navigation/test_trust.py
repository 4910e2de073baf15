"""Trust: alike innovations are the accelerometer's, their changes the sensor's own noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.compile import ONE_LANE
from flownav.estimation.states import INNOVATION, INNOVATION_VARIANCE, NOISE
from flownav.navigation.flow_noise import LARGEST_CHANGE, LARGEST_EXCESS, MEAN_CHANGE, SMALLEST_EXCESS, followed_excess
from flownav.navigation.kernel_settings import NO_HEADING, Equipment
from flownav.navigation.memory import MEMORY, REASON, load_whiteness, new_work
from flownav.navigation.reasons import FUSED, INNOVATION_GATE, OUT_OF_RANGE, SILENT
from flownav.navigation.records import EchoMemory, FlowMemory, WhitenessMemory, WitnessMemory
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.trust import (
    FACTOR_PACE,
    FIRST_READINGS,
    LARGEST_FACTOR,
    LARGEST_NOISE,
    LEAST_FACTOR,
    LIKENESS_ALLOWED,
    NOISE_TIME_S,
    OF_BARO,
    OF_RANGE,
    SMALLEST_NOISE,
    SMALLEST_OF_BARO,
    accel_factors,
    block_ended,
    follow_noise,
    followed_noise,
    scale_noise,
    watch_whiteness,
    with_innovation,
)

_, store_echo = MEMORY.access(EchoMemory)
_, store_whiteness = MEMORY.access(WhitenessMemory)
load_noise, store_noise = MEMORY.access(WitnessMemory)

TOLD = NavigatorSettingsFile().settings(Equipment(True, False, NO_HEADING, False, -math.inf))
KNOWN = 1e6  # readings, after which one counts by time alone
FRESH = WhitenessMemory(0.0, 0.0, 0.0, 0.0, 1.0, -math.inf)


# -- likeness ------------------------------------------------------------------------------------------------
def test_a_block_sums_innovations_in_standard_deviations_from_its_first_instant():
    m = with_innovation(3.0, 4.0, 7.0, FRESH)
    m = with_innovation(-1.0, 0.25, 7.5, m)
    assert m == FRESH._replace(since_s=7.0, total=1.5 - 2.0, readings=2.0)


def ended(total: float, before: float, apart_s: float = 0.1, square: float = 1.0, readings: float = 1.0) -> float:
    return block_ended(9.0, WhitenessMemory(8.9, total, readings, before, square, 9.0 - apart_s))[0]


def test_neighbouring_blocks_of_one_sign_are_alike_and_of_two_are_not():
    assert ended(1.0, 1.0) == pytest.approx(1.0)
    assert ended(-1.0, -1.0) == pytest.approx(1.0)
    assert ended(1.0, -1.0) == pytest.approx(-1.0)
    assert ended(0.5, 0.5) == pytest.approx(0.25)  # small ones say little


def test_blocks_more_than_a_second_apart_say_nothing_of_each_other():
    assert ended(1.0, 1.0, apart_s=0.9) > 0.5
    assert ended(1.0, 1.0, apart_s=1.1) == 0.0
    assert ended(1.0, 1.0, apart_s=math.inf) == 0.0


def test_likeness_is_not_size():
    """The same innovations, twenty times as large for long: no more alike."""
    assert ended(4.0, 2.0, square=16.0) == pytest.approx(ended(1.0, 0.5), rel=1e-3)
    assert abs(ended(1e6, 5.0, square=25.0)) <= 1.0


def test_a_block_of_many_readings_has_the_variance_of_one_and_the_next_begins_empty():
    likeness, m = block_ended(9.0, WhitenessMemory(8.9, 6.0, 4.0, 1.0, 2.0, 8.9))
    before = 1.0 + (3.0 - 1.0) / 3.0
    assert m == WhitenessMemory(9.0, 0.0, 0.0, pytest.approx(before), pytest.approx(2.0 + (9.0 - 2.0) / 10.0), 9.0)
    assert likeness == pytest.approx(min(1.0, 3.0 * 1.0 / 2.7))
    assert block_ended(9.0, WhitenessMemory(8.9, -1e9, 4.0, 1.0, 2.0, 8.9))[1].before == 1.0 - 6.0 / 3.0
    assert block_ended(19.0, WhitenessMemory(8.9, -1e9, 4.0, 1.0, 2.0, 8.9))[1].before == -5.0  # long ago


def test_chance_alone_hardly_raises_the_factor():
    """White innovations: with each block held against the one before alone, 1.57 in the mean square."""
    found = np.concatenate([factors(np.random.default_rng(k).normal(size=4000)) for k in range(4)])
    assert np.mean(found**2) < 1.3


def factors(innovations, reason=FUSED, axis=0, stray=0.0, variance=1.0, hz=20.0, start=1.0) -> np.ndarray:
    """The accelerometer's factor along an axis after each innovation."""
    work = new_work(ONE_LANE)
    store_whiteness(work, ONE_LANE, axis, 0, FRESH._replace(factor=start))
    store_echo(work, ONE_LANE, 0, EchoMemory(2.0, 0.0, 2.0, 0.0, stray))
    work[[REASON, INNOVATION_VARIANCE]] = reason, variance
    found = []
    for k, innovation in enumerate(innovations):
        work[INNOVATION] = innovation
        watch_whiteness(work, ONE_LANE, k / hz, axis)
        found.append(load_whiteness(work, ONE_LANE, axis, 0).factor)
    return np.array(found)


def test_innovations_that_are_alike_raise_the_accelerometers_noise_whatever_their_size():
    for size in (1.0, 4.0):
        grown = factors(np.full(400, size))
        assert grown[-1] > 3.0
        assert np.all(np.diff(grown[grown > 1.0]) >= 0.0)
    assert factors(np.full(4000, 1.0)).max() == LARGEST_FACTOR
    assert factors(np.full(20, 1.0))[-1] < 10.0  # and not at once


def test_white_innovations_do_not_raise_it_however_large():
    for sigma in (1.0, 5.0):
        white = np.random.default_rng(3).normal(0.0, sigma, 6000)
        assert np.median(factors(white)) < 1.3
        assert factors(white, start=20.0)[-1] < 2.0  # and lower what was raised


def test_it_falls_by_what_is_allowed_where_nothing_is_alike_and_as_far_as_lets_it_grow_again_soon():
    assert factors([1.0, 0.0, 0.0, 0.0, 0.0], start=10.0)[-1] == pytest.approx(
        10.0 * math.exp(-FACTOR_PACE * LIKENESS_ALLOWED * 2.0)
    )
    assert factors(np.zeros(4000), start=10.0)[-1] == LEAST_FACTOR
    assert factors(np.full(20, 1.0), start=LEAST_FACTOR)[-1] > 1.0


@pytest.mark.parametrize(("reason", "counts"), [(FUSED, 1), (INNOVATION_GATE, 1), (OUT_OF_RANGE, 0), (SILENT, 0)])
def test_what_was_tested_counts_and_what_was_not_does_not(reason, counts):
    assert (factors(np.full(200, 1.0), reason)[-1] > 2.0) == bool(counts)


def test_a_range_among_strays_says_nothing_of_the_accelerometer_and_flow_does():
    assert factors(np.full(200, 1.0), axis=2, stray=0.03)[-1] == 1.0
    assert factors(np.full(200, 1.0), axis=2, stray=0.01)[-1] > 2.0
    assert factors(np.full(200, 1.0), axis=0, stray=0.03)[-1] > 2.0


def test_level_it_is_as_noisy_as_along_the_worse_axis_and_down_by_itself():
    for axis, factors_ in ((0, (7.0, 1.0)), (1, (7.0, 1.0)), (2, (1.0, 7.0))):
        work = new_work(ONE_LANE)
        assert accel_factors(work, ONE_LANE, 0) == (1.0, 1.0)
        store_whiteness(work, ONE_LANE, axis, 0, FRESH._replace(factor=7.0))
        assert accel_factors(work, ONE_LANE, 0) == factors_


# -- a sensor's own noise ------------------------------------------------------------------------------------
def follow(innovations, noise: float, smallest: float = SMALLEST_NOISE, hz: float = 10.0) -> float:
    """The mean factor of a component of stated noise, after 100 s."""
    m, seen = WitnessMemory(1.0, 0.0, -math.inf), []
    for k, innovation in enumerate(innovations):
        m = followed_noise(innovation, 2.0 * noise * m.factor, noise * m.factor, smallest, 5.0, k / hz, m)
        seen.append(m.factor)
    return float(np.mean(seen[len(seen) // 2 :]))


@pytest.mark.parametrize("times", [0.1, 1.0, 9.0])
def test_a_noise_goes_to_the_variance_of_what_changes_from_reading_to_reading(times):
    white = np.random.default_rng(5).normal(0.0, math.sqrt(times * 0.04), 8000)
    assert follow(white, 0.04) == pytest.approx(times, rel=0.15)
    slow = 3.0 * np.sin(np.arange(8000) / 300.0)  # what lasts is of the motion
    assert follow(white + slow, 0.04) == pytest.approx(times, rel=0.15)


def test_the_first_readings_teach_a_noise_sooner():
    sooner, later = (
        followed_noise(0.9, 9.0, 0.5, 0.02, 5.0, 5.2, WitnessMemory(2.0, 0.3, 5.0, n)) for n in (0.0, KNOWN)
    )
    assert (sooner.factor - 2.0) / (later.factor - 2.0) == pytest.approx(NOISE_TIME_S / 0.2 / FIRST_READINGS)


def test_one_reading_moves_a_noise_by_its_share_of_twenty_seconds():
    m = WitnessMemory(2.0, 0.3, 5.0, KNOWN)
    after = followed_noise(0.9, 9.0, 0.5, 0.02, 5.0, 5.2, m)
    assert after == WitnessMemory(pytest.approx(2.0 + 0.01 * (0.5 * 0.36 / 0.5 - 1.0) * 2.0), 0.9, 5.2, KNOWN + 1.0)
    assert followed_noise(1e3, 0.5, 0.5, 0.02, 5.0, 5.2, m).factor == pytest.approx(2.0 + 0.01 * (25.0 - 1.0) * 2.0)


def test_readings_more_than_a_second_apart_say_nothing_of_the_noise():
    assert followed_noise(9.0, 1.0, 0.5, 0.02, 5.0, 6.1, WitnessMemory(2.0, 0.0, 5.0)) == WitnessMemory(
        2.0, 9.0, 6.1, 1.0
    )
    assert followed_noise(9.0, 1.0, 0.5, 0.02, 5.0, 6.1, WitnessMemory(1.0, 0.0, -math.inf)).factor == 1.0


def test_a_noise_stays_between_a_fiftieth_and_twenty_five_times_what_is_said():
    assert follow(np.zeros(3000), 0.04) == pytest.approx(SMALLEST_NOISE, rel=1e-6)
    assert follow(np.zeros(3000), 0.04, SMALLEST_OF_BARO) == pytest.approx(SMALLEST_OF_BARO, rel=1e-6)
    assert follow(np.tile([-9.0, 9.0], 4000), 0.04) <= LARGEST_NOISE


def heard(place: int, reason: int = FUSED, stray: float = 0.0, change: float = 0.0) -> WitnessMemory:
    """The noise of a component after one reading, half a second after the one before."""
    work = new_work(ONE_LANE)
    store_noise(work, ONE_LANE, place, 0, WitnessMemory(0.1, 0.0, 0.5, KNOWN))
    store_echo(work, ONE_LANE, 0, EchoMemory(2.0, 0.0, 2.0, 0.0, stray))
    work[[REASON, INNOVATION, INNOVATION_VARIANCE, NOISE]] = reason, change, 2.0, 1.0
    scale_noise(work, ONE_LANE, place)
    assert work[NOISE] == pytest.approx(0.1)
    follow_noise(work, ONE_LANE, 1.0, place, gate_sigma=5.0)
    return load_noise(work, ONE_LANE, place, 0)


def test_what_is_fused_teaches_its_noise_and_a_stray_or_what_is_refused_does_not():
    taught = heard(OF_RANGE)
    assert taught == WitnessMemory(pytest.approx(0.1 - 0.025 * 0.1), 0.0, 1.0, KNOWN + 1.0)
    untaught = WitnessMemory(0.1, 0.0, 0.5, KNOWN)
    assert heard(OF_RANGE, INNOVATION_GATE) == untaught
    assert heard(OF_RANGE, stray=0.03) == untaught
    assert heard(OF_RANGE, stray=0.01) == taught
    assert heard(OF_BARO) == WitnessMemory(SMALLEST_OF_BARO, 0.0, 1.0, KNOWN + 1.0)  # wash and gusts last
    assert heard(OF_BARO, stray=0.03, change=1.0).factor > 0.1  # strays are the range's


# -- the flow's ----------------------------------------------------------------------------------------------
FLOW = FlowMemory(1.0, 4.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -math.inf, 0.0)
SHARE = 0.5 * 0.1 / 10.0


def test_excess_noise_is_what_changes_in_the_flows_innovation():
    s = TOLD.flow
    as_said = 3.0 + 4.0 * math.sqrt(MEAN_CHANGE)
    assert followed_excess(as_said, 3.0, 8.0, 1.1, FLOW, s) == pytest.approx(4.0)  # half of 16 is the noise
    noisier = followed_excess(9.0, 3.0, 8.0, 1.1, FLOW, s)
    assert noisier == pytest.approx(4.0 + SHARE * (0.5 * 36.0 * 4.0 / 8.0 / MEAN_CHANGE - 4.0))
    assert followed_excess(1e3, 3.0, 8.0, 1.1, FLOW, s) == followed_excess(1e6, 3.0, 8.0, 1.1, FLOW, s)
    spike = followed_excess(1e3, 3.0, 8.0, 1.1, FLOW, s)
    assert spike == pytest.approx(4.0 + SHARE * (LARGEST_CHANGE * 4.0 / MEAN_CHANGE - 4.0))


def test_a_flow_innovation_that_lasts_is_not_its_noise():
    assert followed_excess(9.0, 9.0, 8.0, 1.1, FLOW, TOLD.flow) == pytest.approx(4.0 - SHARE * 4.0)


def settled(times: float, drift: float = 0.0, spikes: float = 0.0) -> float:
    """The mean excess of a flow whose noise is `times` times its model of 0.01, and of which a share `spikes` are
    spikes.
    """
    random, m, before, seen = np.random.default_rng(6), FLOW._replace(taken_s=0.0, excess=1.0), 0.0, []
    for k in range(12000):
        t_s = 0.05 * (k + 1)
        innovation = float(random.normal(0.0, math.sqrt(0.01 * times))) + drift * math.sin(0.1 * t_s)
        innovation += 100.0 if random.random() < spikes else 0.0
        excess = followed_excess(innovation, before, 0.01 * m.excess, t_s, m, TOLD.flow)
        m, before = m._replace(taken_s=t_s, excess=excess), innovation
        seen.append(excess)
    return float(np.mean(seen[6000:]))


@pytest.mark.parametrize("times", [0.5, 1.0, 30.0])
def test_the_excess_goes_to_how_many_times_noisier_the_flow_is_and_a_good_lens_shows_too(times):
    assert settled(times) == pytest.approx(times, rel=0.1)
    assert settled(times, drift=1.0) == pytest.approx(times, rel=0.1)


def test_spikes_hardly_count_as_noise():
    """One reading in 20 is far off, and so two changes in 20: by Huber's proposal R is 2.6 times as large at most."""
    assert 1.0 < settled(1.0, spikes=0.05) < 3.0


def test_the_excess_is_bounded():
    assert settled(0.01) == pytest.approx(SMALLEST_EXCESS, rel=1e-3)
    assert settled(1e4) == pytest.approx(LARGEST_EXCESS, rel=1e-3)
    assert (SMALLEST_EXCESS, LARGEST_EXCESS) == (0.25, 400.0)
