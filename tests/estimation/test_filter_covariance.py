"""The packed covariance against dense matrices and FilterPy; what is refused leaves no trace."""

from __future__ import annotations

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from filters import Filter, N, cross_matrix, filter_at, random_covariance
from flownav.core.compile import LANES, ONE_LANE
from flownav.estimation.covariance import (
    HUBER_SIGMAS,
    add_noise,
    add_noise_lane,
    at,
    correct,
    covariance_of,
    decay,
    expect,
    forget_lane,
    place,
    settle,
    variance_of,
)
from flownav.estimation.error_models import FilterSettings
from flownav.estimation.gating import Reason
from flownav.estimation.lag import FlowLag
from flownav.estimation.laws.pad import pad_fix
from flownav.estimation.states import (
    ACCEPTED,
    ATTITUDE,
    COVARIANCE,
    CROSS,
    FILTER_ROWS,
    HYPOTHESES,
    INNOVATION_VARIANCE,
    NOISE,
    OFFERED,
    PLACES,
    QUATERNION,
    SHORT_NAMES,
    STATE,
    STATE_NAMES,
    STATES,
    STATES_WITH_LAG,
    TEST_RATIO,
    VECTORS,
    VELOCITY,
    fold_attitude,
)
from packed_covariance import pack, unpack
from places import DOCS

SEEDS = st.integers(0, 2**32 - 1)
OTHERS = [i for i in range(N) if not ATTITUDE <= i < ATTITUDE + 3]
WIDE = len(LANES)


def filter_with_covariance(random: np.random.Generator) -> Filter:
    filter_ = filter_at(int(random.integers(2**32)), *random.uniform(-0.5, 0.5, 2), random.uniform(-3.0, 3.0), 3.0)
    filter_.p = random_covariance(random)
    return filter_


def some_states(random: np.random.Generator, count: int) -> list[int]:
    return [int(i) for i in random.choice(N, count, replace=False)]


# -- the triangle ----------------------------------------------------------------------------------------------
def test_the_triangle_lies_column_by_column_and_every_element_once():
    rows = [at(i, j) for j in range(N) for i in range(j + 1)]
    assert rows == list(range(COVARIANCE, COVARIANCE + N * (N + 1) // 2))
    assert rows[-1] < FILTER_ROWS
    assert all(place(i, j) == place(j, i) == at(min(i, j), max(i, j)) for i in range(N) for j in range(N))


@pytest.mark.parametrize("n", [STATES, STATES_WITH_LAG])
def test_what_is_packed_comes_out_again_lane_by_lane(n):
    random = np.random.default_rng(0)
    work = random.normal(size=FILTER_ROWS * WIDE)
    before = work.copy()
    p = random_covariance(random)[:n, :n]
    pack(work, LANES, 5, n, p)
    assert np.array_equal(unpack(work, LANES, 5, n), p)
    changed = np.flatnonzero(work != before)
    assert set(changed % WIDE) == {5}
    assert len(changed) == n * (n + 1) // 2
    for i, j in ((0, 0), (3, 17), (n - 1, 2)):
        assert covariance_of(work, LANES, i, j, 5) == p[i, j]
    assert variance_of(work, LANES, 9, 5) == p[9, 9]


def test_every_state_has_its_names():
    assert len(STATE_NAMES) == len(set(STATE_NAMES)) == STATES_WITH_LAG == len(set(SHORT_NAMES))
    for short, long in zip(SHORT_NAMES, STATE_NAMES, strict=True):
        assert long.startswith(short)
    for vector, first in VECTORS.items():
        assert all(0 <= first + axis < STATES for axis in range(3))
        assert vector not in PLACES


# -- single states ---------------------------------------------------------------------------------------------
@settings(max_examples=20, deadline=None)
@given(SEEDS, st.integers(0, N - 1), st.floats(0.0, 1.0))
def test_decay_scales_a_state_its_row_and_its_column(seed, state, factor):
    ours = filter_with_covariance(np.random.default_rng(seed))
    scale = np.ones(N)
    scale[state] = factor
    x, p = ours.x * scale, np.outer(scale, scale) * ours.p
    decay(ours.work, ONE_LANE, N, state, factor)
    assert np.array_equal(ours.x, x)
    assert np.allclose(ours.p, p, rtol=1e-15, atol=0)


def test_noise_adds_to_one_variance_and_to_nothing_else():
    random = np.random.default_rng(5)
    for state in range(N):
        for add in (add_noise, lambda work, lanes, state, variance: add_noise_lane(work, lanes, state, 0, variance)):
            ours = filter_with_covariance(random)
            before = ours.work.copy()
            add(ours.work, ONE_LANE, state, 0.25)
            before[at(state, state)] += 0.25
            assert np.array_equal(ours.work, before)


def test_a_forgotten_state_keeps_its_variance_alone():
    random = np.random.default_rng(6)
    for state in (0, 17, N - 1):
        ours = filter_with_covariance(random)
        expected = ours.p
        expected[state], expected[:, state], expected[state, state] = 0.0, 0.0, 9.0
        forget_lane(ours.work, ONE_LANE, N, state, 0, 9.0)
        assert np.array_equal(ours.p, expected)


def test_one_lane_forgets_and_the_others_keep_every_bit():
    random = np.random.default_rng(3)
    work = random.normal(size=FILTER_ROWS * WIDE)
    work[HYPOTHESES * WIDE] = 0.0
    before = work.copy()
    forget_lane(work, LANES, STATES, 4, 7, 2.0)
    changed = np.flatnonzero(work != before)
    assert set(changed % WIDE) == {7}
    p = unpack(work, LANES, 7, STATES)
    assert np.count_nonzero(p[4]) == 1
    assert p[4, 4] == 2.0


# -- corrections -----------------------------------------------------------------------------------------------
def joseph(p: np.ndarray, h: np.ndarray, gain: np.ndarray, noise: float) -> np.ndarray:
    left = np.eye(N) - np.outer(gain, h)
    return left @ p @ left.T + noise * np.outer(gain, gain)


def robust(gain: np.ndarray, nu: float, variance: float) -> np.ndarray:
    """The gain of an innovation that counts as no more than HUBER_SIGMAS."""
    return gain * min(1.0, HUBER_SIGMAS / (abs(nu) / math.sqrt(variance)))


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.integers(1, 12), st.floats(1e-6, 1e3))
def test_a_correction_is_josephs_dense_form(seed, terms, noise):
    random = np.random.default_rng(seed)
    ours = filter_with_covariance(random)
    ours.observe(some_states(random, terms), random.normal(size=terms))
    h, x, p, nu = ours.jacobian, ours.x.copy(), ours.p, random.normal()
    variance = h @ p @ h + noise
    gain = robust(p @ h / variance, nu, variance)
    ours.offer(nu, noise)
    assert ours.fuse()
    assert ours.work[INNOVATION_VARIANCE] == pytest.approx(variance, rel=1e-12)
    assert np.allclose(ours.p, joseph(p, h, gain, noise), rtol=0, atol=1e-11)
    assert np.allclose(ours.x[OTHERS], (x + gain * nu)[OTHERS], rtol=0, atol=1e-12)
    assert np.array_equal(ours.x[ATTITUDE : ATTITUDE + 3], np.zeros(3))


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.floats(0.2, 5.0))
def test_josephs_form_holds_for_a_gain_that_is_not_kalmans(seed, share):
    """`correct` divides by the variance it is given; one that is not S gives another gain, whose P is S's no longer."""
    random = np.random.default_rng(seed)
    ours = filter_with_covariance(random)
    noise = 0.3
    ours.observe(some_states(random, 4), random.normal(size=4))
    h, p = ours.jacobian, ours.p
    ours.offer(0.0, noise)
    expect(ours.work, ONE_LANE, N, True)
    assert np.allclose(ours.rows(CROSS, N), p @ h, rtol=0, atol=1e-13)
    variance = share * (h @ p @ h + noise)
    ours.work[[INNOVATION_VARIANCE, ACCEPTED]] = variance, 1.0
    correct(ours.work, ONE_LANE, N)
    gain = p @ h / variance
    assert np.allclose(ours.p, joseph(p, h, gain, variance - h @ p @ h), rtol=0, atol=1e-11)


def test_a_small_filter_leaves_the_states_that_it_has_not():
    """With 36 states the four of the flow sensor's dynamics stay as they are."""
    ours = filter_with_covariance(np.random.default_rng(2))
    before = ours.copy()
    ours.observe([0, 30], [1.0, 1.0])
    ours.offer(0.3, 0.5)
    expect(ours.work, ONE_LANE, STATES, True)
    settle(ours.work, ONE_LANE, STATES, 5.0)
    assert np.array_equal(ours.p[STATES:], before.p[STATES:])
    assert np.array_equal(ours.x[STATES:], before.x[STATES:])
    assert not np.array_equal(ours.p[:STATES, :STATES], before.p[:STATES, :STATES])


def test_sixty_steps_match_filterpy():
    """Gauss-Markov steps and corrections in turn, with state and covariance beside FilterPy's: within HUBER_SIGMAS."""
    random = np.random.default_rng(11)
    ours = filter_with_covariance(random)
    theirs = KalmanFilter(dim_x=N, dim_z=1)
    theirs.x, theirs.P = ours.x[:, None].copy(), ours.p
    for _ in range(60):
        state = int(random.choice(OTHERS))
        theirs.F, theirs.Q = np.eye(N), np.zeros((N, N))
        theirs.F[state, state], theirs.Q[state, state] = 0.9, 0.19
        theirs.predict()
        decay(ours.work, ONE_LANE, N, state, 0.9)
        add_noise(ours.work, ONE_LANE, state, 0.19)
        ours.observe(some_states(random, 4), random.normal(size=4))
        h, noise, nu = ours.jacobian, random.uniform(0.01, 4.0), random.normal()
        nu = np.clip(nu, -math.sqrt(noise), math.sqrt(noise))  # S is larger than R: within one sigma
        theirs.update(h @ theirs.x + nu, R=noise, H=h[None, :])
        ours.offer(nu, noise)
        assert ours.fuse()
        theirs.x[ATTITUDE : ATTITUDE + 3] = 0.0  # folded into the quaternion
    assert np.allclose(ours.x, theirs.x[:, 0], rtol=0, atol=1e-10)
    assert np.allclose(ours.p, theirs.P, rtol=0, atol=1e-10)


def test_an_innovation_counts_as_no_more_than_two_sigma_and_tells_less_of_the_covariance():
    """Twice as far moves the state no further, and leaves it less sure than a reading that fits."""
    moved, left = [], []
    for sigmas in (1.0, 2.0, 3.0, 4.5):
        ours = filter_with_covariance(np.random.default_rng(6))
        ours.observe([VELOCITY], [1.0])
        before = ours.x[VELOCITY]
        ours.offer(sigmas * math.sqrt(ours.p[VELOCITY, VELOCITY] + 0.3), 0.3)
        assert ours.fuse()
        moved.append(ours.x[VELOCITY] - before)
        left.append(ours.p[VELOCITY, VELOCITY])
    assert moved[1:] == pytest.approx([2.0 * moved[0]] * 3)
    assert left[0] == pytest.approx(left[1])
    assert left[1] < left[2] < left[3]


# -- what is refused ---------------------------------------------------------------------------------------------
REFUSED = {
    "not offered": (0.1, 1.0, 0.0),
    "offered as NaN": (0.1, 1.0, np.nan),
    "innovation NaN": (np.nan, 1.0, 1.0),
    "innovation infinite": (np.inf, 1.0, 1.0),
    "innovation minus infinite": (-np.inf, 1.0, 1.0),
    "variance NaN": (0.1, np.nan, 1.0),
    "variance infinite": (0.1, np.inf, 1.0),
    "variance negative": (0.1, -1e-3, 1.0),
    "beyond the gate": (1e4, 1.0, 1.0),
}


def with_signed_zeros(filter_: Filter) -> Filter:
    """Zeros whose sign is a bit too: of a state, of an element of P, of the quaternion."""
    filter_.work[[STATE + 5, STATE + 20, at(3, 9), at(0, 30), QUATERNION + 2]] = -0.0
    return filter_


@pytest.mark.parametrize("case", REFUSED)
def test_a_refused_reading_changes_no_bit(case):
    random = np.random.default_rng(7)
    for _ in range(10):
        ours = with_signed_zeros(filter_with_covariance(random))
        before = ours.kept
        ours.observe(some_states(random, 4), random.normal(size=4))
        ours.offer(*REFUSED[case])
        assert not ours.fuse(gate=5.0)
        assert ours.kept == before


@pytest.mark.parametrize("case", REFUSED)
def test_beside_lanes_that_accept_a_lane_that_refuses_changes_no_bit(case):
    random = np.random.default_rng(8)
    alone = [with_signed_zeros(filter_with_covariance(random)) for _ in range(WIDE)]
    index, coefficients = some_states(random, 5), random.normal(size=5)
    for filter_ in alone:
        filter_.observe(index, coefficients)
        filter_.offer(0.01, 1.0)
    alone[9].offer(*REFUSED[case])
    together = np.stack([filter_.work for filter_ in alone], axis=1).ravel()
    expect(together, LANES, N, True)
    settle(together, LANES, N, 5.0)
    for lane, filter_ in enumerate(alone):
        after = Filter()
        after.work[:] = together.reshape(-1, WIDE)[:, lane]
        assert (after.kept == filter_.kept) == (lane == 9)
        filter_.fuse(gate=5.0)
        assert after.kept == filter_.kept


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("offered", [0.0, 1.0])
def test_a_law_whose_jacobian_is_not_finite_changes_no_bit(value, offered):
    """A pad fix puts what it read into its own Jacobian."""
    with np.errstate(invalid="ignore"):
        for axis in range(3):
            ours = filter_with_covariance(np.random.default_rng(8))
            before = ours.kept
            ours.reading[:3] = value
            pad_fix(ours.work, ONE_LANE, axis, below_m=0.1)
            ours.work[[NOISE, OFFERED]] = 1.0, offered
            assert not ours.fuse(gate=5.0)
            assert ours.kept == before


def test_what_nobody_offers_is_computed_only_where_it_is_wanted_always():
    ours = filter_with_covariance(np.random.default_rng(12))
    ours.observe([3, 7], [1.0, -2.0])
    ours.offer(0.3, 0.5, offered=0.0)
    ours.work[CROSS : CROSS + N] = 7.0
    before = ours.kept
    expect(ours.work, ONE_LANE, N, False)
    settle(ours.work, ONE_LANE, N, 5.0)
    assert np.all(ours.rows(CROSS, N) == 7.0)
    assert ours.work[ACCEPTED] == 0.0
    assert ours.kept == before
    expect(ours.work, ONE_LANE, N, True)
    settle(ours.work, ONE_LANE, N, 5.0)
    h = ours.jacobian
    assert ours.work[INNOVATION_VARIANCE] == pytest.approx(h @ ours.p @ h + 0.5)
    assert ours.work[TEST_RATIO] == pytest.approx(0.09 / (25.0 * ours.work[INNOVATION_VARIANCE]))
    assert ours.work[ACCEPTED] == 0.0
    assert ours.kept == before


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.floats(0.5, 8.0), st.sampled_from([-1.0, 1.0]))
def test_the_gate_lies_where_it_is_set(seed, gate, sign):
    random = np.random.default_rng(seed)
    ours = filter_with_covariance(random)
    ours.observe(some_states(random, 3), random.normal(size=3))
    h = ours.jacobian
    sigma = np.sqrt(h @ ours.p @ h + 0.2)
    for share, fused in ((0.999, True), (1.001, False)):
        run = ours.copy()
        run.offer(sign * share * gate * sigma, 0.2)
        assert run.fuse(gate) == fused
        assert run.work[TEST_RATIO] == pytest.approx(share**2, rel=1e-9)
        assert run.work[INNOVATION_VARIANCE] == pytest.approx(sigma**2, rel=1e-12)


def test_a_state_known_exactly_and_read_exactly_is_left_alone():
    """S = 0: there is nothing to learn and nothing to divide by."""
    ours = Filter()
    ours.observe([3], [1.0])
    ours.offer(0.0, 0.0)
    before = ours.kept
    with np.errstate(invalid="ignore"):
        assert not ours.fuse()
    assert ours.kept == before


# -- the attitude error folds into the quaternion ----------------------------------------------------------------
def test_an_attitude_correction_turns_the_quaternion_in_the_earth_frame():
    """A heading error of a vehicle that is rolled and pitched is corrected about earth down."""
    ours = filter_with_covariance(np.random.default_rng(9))
    before, nu, noise = ours.rotation, 0.01, 0.5
    ours.observe([ATTITUDE + 2], [1.0])
    theta = (ours.p[:, ATTITUDE + 2] * nu / (ours.p[ATTITUDE + 2, ATTITUDE + 2] + noise))[ATTITUDE : ATTITUDE + 3]
    ours.offer(nu, noise)
    assert ours.fuse()
    turn = np.eye(3) + cross_matrix(theta)
    assert np.allclose(ours.rotation @ before.T, turn, rtol=0, atol=2.0 * (theta @ theta))
    assert np.linalg.norm(ours.q) == pytest.approx(1.0, abs=1e-15)


def test_without_an_attitude_error_nothing_is_folded():
    ours = with_signed_zeros(filter_with_covariance(np.random.default_rng(10)))
    ours.q[:] *= 1.0 + 1e-9  # which a fold would make of unit length
    before = ours.kept
    fold_attitude(ours.work, ONE_LANE)
    assert ours.kept == before


# -- what is written about it --------------------------------------------------------------------------------------
def test_the_documentation_names_every_setting_and_every_reason():
    page = (DOCS / "explanation" / "landing-filter.md").read_text(encoding="utf-8")
    for name in (*FilterSettings._fields, *FlowLag._fields, *(reason.label for reason in Reason)):
        assert f"`{name}`" in page or name in {"f12", "f21"}, name
