"""Considered states (Schmidt): no correction moves them, and what is not known of them counts in every other's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters import Filter, N, filter_at, random_covariance
from flownav.core.compile import LANES, ONE_LANE
from flownav.estimation.covariance import consider, consider_none, correct, fuse
from flownav.estimation.states import (
    ACCEPTED,
    ATTITUDE,
    COEFFICIENT,
    CONSIDERED,
    CONSIDERS,
    CROSS,
    FILTER_ROWS,
    GAIN,
    GYRO_BIAS,
    HELD_BACK,
    HYPOTHESES,
    INNOVATION,
    INNOVATION_VARIANCE,
    MIDDLE,
    MOST_CONSIDERED,
    NOISE,
    OBSERVED,
    OFFERED,
    QUATERNION,
    STATE,
    STATES,
)
from flownav.navigation.flow import consider_others
from flownav.navigation.kernel_settings import FROM_MAG, NO_HEADING, Equipment
from flownav.navigation.memory import HEADING_SOUGHT, new_work
from flownav.navigation.take import consider_datum
from packed_covariance import pack, unpack

SEEDS = st.integers(0, 2**32 - 1)
HEADING = ATTITUDE + 2


def observing(seed: int, count: int) -> tuple[Filter, np.ndarray, float, list[int]]:
    """A filter with a dense covariance and six states observed; h, R, states to consider, some of them observed."""
    random = np.random.default_rng(seed)
    ours = filter_at(seed, 0.1, -0.2, 0.5, 3.0)
    ours.p = random_covariance(random)
    seen = [int(i) for i in random.choice(N, 6, replace=False)]
    ours.observe(seen, random.normal(size=6))
    noise = float(random.uniform(0.01, 4.0))
    ours.offer(float(random.normal()), noise)
    both = {*seen[: count // 2], *(int(i) for i in random.choice(N, count, replace=False))}
    return ours, ours.jacobian, noise, sorted(both)[:MOST_CONSIDERED]


def joseph(p: np.ndarray, h: np.ndarray, noise: float, considered: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Gain with the considered rows 0, and (I - K h) P (I - K h)' + K R K'."""
    gain = p @ h / (h @ p @ h + noise)
    gain[considered] = 0.0
    left = np.eye(N) - np.outer(gain, h)
    return gain, left @ p @ left.T + noise * np.outer(gain, gain)


def consider_all(ours: Filter, states: list[int]) -> None:
    for state in states:
        consider(ours.work, ONE_LANE, state)


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.integers(1, MOST_CONSIDERED))
def test_the_covariance_is_josephs_with_their_gain_zero_and_no_variance_is_negative(seed, count):
    ours, h, noise, considered = observing(seed, count)
    before, x = ours.p, ours.x.copy()
    gain, after = joseph(before, h, noise, considered)
    consider_all(ours, considered)
    assert ours.fuse()
    assert np.allclose(ours.p, after, rtol=1e-12, atol=1e-13)
    assert np.linalg.eigvalsh(ours.p).min() > 0.0
    moved = x + gain * ours.work[INNOVATION]
    moved[ATTITUDE : ATTITUDE + 3] = 0.0  # folded into the quaternion
    assert np.allclose(np.delete(ours.x, considered), np.delete(moved, considered), rtol=1e-12, atol=1e-13)


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.integers(1, MOST_CONSIDERED))
def test_considered_states_keep_every_bit_and_so_does_their_own_block_of_the_covariance(seed, count):
    ours, _, _, considered = observing(seed, count)
    states = [state for state in considered if not ATTITUDE <= state < ATTITUDE + 3]
    x, p = ours.x[states].tobytes(), ours.p[np.ix_(considered, considered)].tobytes()
    consider_all(ours, considered)
    assert ours.fuse()
    assert ours.x[states].tobytes() == x
    assert ours.p[np.ix_(considered, considered)].tobytes() == p
    assert not ours.rows(GAIN, N)[considered].any()


def test_a_considered_attitude_keeps_its_quaternion_bit_by_bit():
    ours, _, _, _ = observing(3, 1)
    before = ours.q.tobytes()
    consider_all(ours, [ATTITUDE, ATTITUDE + 1, HEADING])
    assert ours.fuse()
    assert ours.q.tobytes() == before


def test_a_considered_heading_lets_the_tilt_be_corrected_and_turns_about_no_vertical():
    ours, _, _, _ = observing(4, 1)
    ours.q[:] = [1.0, 0.0, 0.0, 0.0]
    consider_all(ours, [HEADING])
    assert ours.fuse()
    assert abs(ours.q[1]) + abs(ours.q[2]) > 1e-3
    assert ours.q[3] == 0.0


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.integers(1, MOST_CONSIDERED))
def test_what_considering_costs_is_never_less_than_nothing(seed, count):
    """No gain beats the optimal one: P with considered states less P without is positive semi-definite."""
    free, _, _, considered = observing(seed, count)
    ours = free.copy()
    assert free.fuse()
    consider_all(ours, considered)
    assert ours.fuse()
    assert np.linalg.eigvalsh(ours.p - free.p).min() > -1e-12


def test_what_is_not_known_of_them_counts_in_the_others():
    """Two states observed as their sum: the worse the considered one is known, the less the other learns."""
    left = []
    for variance in (0.0, 1.0, 1e6):
        ours = Filter()
        spread = np.zeros(N)
        spread[[3, 20]] = 1.0, variance
        ours.p = np.diag(spread)
        ours.observe([3, 20], [1.0, 1.0])
        ours.offer(0.5, 1.0)
        consider_all(ours, [20])
        assert ours.fuse()
        left.append(ours.p[3, 3])
    assert left == pytest.approx([0.5, 2.0 / 3.0, 1.0], rel=1e-5)


def test_after_consider_none_corrections_concern_all_states():
    ours, _, _, considered = observing(5, 4)
    plain = ours.copy()
    consider_all(ours, considered)
    consider_none(ours.work, ONE_LANE)
    assert ours.fuse()
    assert plain.fuse()
    assert ours.kept == plain.kept


def test_where_nothing_is_to_be_considered_corrections_concern_all_states():
    """A smoother's run."""
    ours, _, _, considered = observing(10, 4)
    plain = ours.copy()
    ours.work[CONSIDERS] = 0.0
    consider_all(ours, considered)
    assert ours.fuse()
    assert plain.fuse()
    assert ours.kept == plain.kept


def test_a_state_that_is_considered_twice_is_considered_once():
    ours, _, _, considered = observing(6, 3)
    twice = ours.copy()
    consider_all(ours, considered)
    consider_all(twice, [*considered, *considered])
    assert ours.fuse()
    assert twice.fuse()
    assert ours.kept == twice.kept


def test_what_is_refused_or_silent_leaves_every_bit():
    for offered, gate in ((0.0, 1e6), (1.0, 1e-9)):
        ours, _, _, considered = observing(7, 4)
        ours.work[OFFERED] = offered
        consider_all(ours, considered)
        before = ours.kept
        assert not ours.fuse(gate)
        assert ours.kept == before


def test_lanes_that_accept_consider_and_the_others_keep_every_bit():
    random, wide = np.random.default_rng(8), len(LANES)
    work = random.normal(size=FILTER_ROWS * wide)
    rows = work.reshape(FILTER_ROWS, wide)
    rows[QUATERNION : QUATERNION + 4] = np.array([1.0, 0.0, 0.0, 0.0])[:, None]
    rows[STATE + ATTITUDE : STATE + ATTITUDE + 3] = 0.0
    covariances = [random_covariance(random)[:STATES, :STATES] for _ in LANES]
    for lane, p in enumerate(covariances):
        pack(work, LANES, lane, STATES, p)
    seen, considered = [4, 9, 21], [9, 30]
    rows[OBSERVED, 0], rows[OBSERVED + 1 : OBSERVED + 4, 0] = 3, seen
    rows[CONSIDERED, 0], rows[CONSIDERED + 1 : CONSIDERED + 5, 0] = 2, [9, 0, 30, MIDDLE]
    rows[MIDDLE] = np.arange(wide) % 4 == 1  # the second is considered in every other lane of those that accept
    rows[NOISE], rows[INNOVATION], rows[OFFERED] = 0.5, 0.1, np.arange(wide) % 2
    rows[HYPOTHESES] = rows[HELD_BACK] = 0.0
    before = work.copy().reshape(FILTER_ROWS, wide)
    fuse(work, LANES, STATES, 1e6)
    for lane in range(wide):
        if lane % 2 == 0:
            assert np.array_equal(unpack(work, LANES, lane, STATES), covariances[lane])
            assert np.array_equal(rows[STATE : QUATERNION + 4, lane], before[STATE : QUATERNION + 4, lane])
            continue
        h = np.zeros(N)
        h[seen] = before[COEFFICIENT : COEFFICIENT + 3, lane]
        p = np.eye(N)
        p[:STATES, :STATES] = covariances[lane]
        left = considered if lane % 4 == 1 else considered[:1]
        _, after = joseph(p, h, 0.5, left)
        assert np.allclose(unpack(work, LANES, lane, STATES), after[:STATES, :STATES], rtol=1e-12, atol=1e-13)
        kept = [rows[STATE + i, lane] == before[STATE + i, lane] for i in considered]
        assert kept == [True, lane % 4 == 1]


def test_correct_alone_considers_too():
    """It is what follows `expect` where the test is not the gate's."""
    ours, h, noise, considered = observing(9, 4)
    p = ours.p
    consider_all(ours, considered)
    ours.rows(CROSS, N)[:] = p @ h
    ours.work[[INNOVATION_VARIANCE, ACCEPTED]] = h @ p @ h + noise, 1.0
    correct(ours.work, ONE_LANE, N)
    assert np.allclose(ours.p, joseph(p, h, noise, considered)[1], rtol=1e-12, atol=1e-13)


def test_a_flow_without_heading_considers_no_more_than_there_is_room_for():
    work = new_work(ONE_LANE)
    consider_datum(work, ONE_LANE, Equipment(True, False, NO_HEADING, False, -np.inf))
    assert work[CONSIDERED : CONSIDERED + 5].tolist() == [2, HEADING, 0, GYRO_BIAS + 2, 0]
    consider_others(work, ONE_LANE)
    assert work[CONSIDERED] < MOST_CONSIDERED
    consider_none(work, ONE_LANE)
    for heading in (NO_HEADING, FROM_MAG):  # sought from the course, whatever was to tell it
        consider_datum(work, ONE_LANE, Equipment(True, False, heading, False, 10.0))
        assert work[CONSIDERED] == 0.0
        work[HEADING_SOUGHT] = 1.0
        consider_datum(work, ONE_LANE, Equipment(True, False, heading, False, 10.0))
        assert work[CONSIDERED : CONSIDERED + 3].tolist() == [9, HEADING, HEADING_SOUGHT]
        consider_others(work, ONE_LANE)
        assert work[CONSIDERED] < MOST_CONSIDERED
        consider_none(work, ONE_LANE)
        work[HEADING_SOUGHT] = 0.0
    consider_datum(work, ONE_LANE, Equipment(False, True, NO_HEADING, False, -np.inf))  # an attitude tells it
    assert work[CONSIDERED] == 0.0
