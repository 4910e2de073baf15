"""The landing filter's covariance algebra against dense matrices and FilterPy; what is refused leaves no trace."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from flownav.compile import ONE_LANE
from flownav.estimation.gating import Reason
from flownav.estimation.kalman import Work
from flownav.estimation.landing.algebra import add_noise, correct, decay, forget, observe_cross, transform
from flownav.estimation.landing.observe_pad import PAD_STATES, observe_pad
from flownav.estimation.landing.settings import FlowLag, LandingSettings
from flownav.estimation.landing.states import ATTITUDE, LARGEST_TRANSFORM, STATE_NAMES
from landing_filter import READING, ROWS, STATES, Landing, cross_matrix, landing, random_covariance
from places import DOCS

SEEDS = st.integers(0, 2**32 - 1)
OTHERS = [i for i in range(STATES) if not ATTITUDE <= i < ATTITUDE + 3]


def symmetric(p: np.ndarray) -> bool:
    return bool(np.array_equal(p, p.T))


def filter_with_covariance(random: np.random.Generator) -> Landing:
    filter_ = landing(int(random.integers(2**32)), *random.uniform(-0.5, 0.5, 2), random.uniform(-3.0, 3.0), 3.0)
    filter_.p[:] = random_covariance(random)
    return filter_


def some_states(random: np.random.Generator, count: int) -> tuple[int, ...]:
    return tuple(int(i) for i in random.choice(STATES, count, replace=False))


# -- transitions -----------------------------------------------------------------------------------------------
@settings(max_examples=25, deadline=None)
@given(SEEDS, st.integers(1, 3), st.integers(1, 9), st.booleans())
def test_transform_is_a_dense_congruence(seed, targets, sources, overlapping):
    """T P T', T = 1 but for rows `targets`, whether a target stands among its sources or not."""
    random = np.random.default_rng(seed)
    ours = filter_with_covariance(random)
    both = some_states(random, targets + sources)
    chosen = both[:targets]
    read = (both[:sources] if overlapping else both[targets:])[:sources]
    coefficients = random.normal(size=(targets, len(read)))
    dense = np.eye(STATES)
    dense[list(chosen)] = 0.0
    dense[np.ix_(chosen, read)] = coefficients
    expected = dense @ ours.p @ dense.T
    ours.set_coefficients(coefficients)
    transform(ours.work, ONE_LANE, ROWS, chosen, read)
    assert np.allclose(ours.p, expected, rtol=0, atol=1e-12)
    assert symmetric(ours.p)


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.integers(1, 3), st.floats(0.0, 1.0))
def test_decay_scales_state_rows_and_columns(seed, count, factor):
    random = np.random.default_rng(seed)
    ours = filter_with_covariance(random)
    first = int(random.integers(0, STATES - count))
    scale = np.ones(STATES)
    scale[first : first + count] = factor
    x, p = ours.x * scale, np.outer(scale, scale) * ours.p
    decay(ours.work, ONE_LANE, ROWS, first, count, factor)
    assert np.array_equal(ours.x, x)
    assert np.allclose(ours.p, p, rtol=1e-15, atol=0)
    assert symmetric(ours.p)


def test_noise_adds_to_one_variance_and_to_nothing_else():
    random = np.random.default_rng(5)
    for state in range(STATES):
        ours = filter_with_covariance(random)
        before = ours.work.copy()
        add_noise(ours.work, ONE_LANE, ROWS, state, 0.25)
        diagonal = ROWS.covariance + state * (STATES + 1)
        before[diagonal] += 0.25
        assert np.array_equal(ours.work, before)


@pytest.mark.parametrize("where", [1.0, 0.0, -1.0])
def test_a_forgotten_state_keeps_its_variance_alone(where):
    random = np.random.default_rng(6)
    for state in (0, 17, STATES - 1):
        ours = filter_with_covariance(random)
        ours.work[READING] = where
        expected = ours.p.copy()
        if where > 0.0:
            expected[state], expected[:, state], expected[state, state] = 0.0, 0.0, 9.0
        forget(ours.work, ONE_LANE, ROWS, state, 9.0, READING)
        assert np.array_equal(ours.p, expected)


# -- corrections -----------------------------------------------------------------------------------------------
def joseph(p: np.ndarray, h: np.ndarray, gain: np.ndarray, noise: float) -> np.ndarray:
    left = np.eye(STATES) - np.outer(gain, h)
    return left @ p @ left.T + noise * np.outer(gain, gain)


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.integers(1, 9), st.floats(1e-6, 1e3))
def test_a_correction_is_josephs_dense_form(seed, terms, noise):
    random = np.random.default_rng(seed)
    ours = filter_with_covariance(random)
    index = some_states(random, terms)
    ours.set_coefficients(random.normal(size=terms))
    h = ours.jacobian_row(index)
    x, p, nu = ours.x.copy(), ours.p.copy(), random.normal()
    variance = h @ p @ h + noise
    gain = p @ h / variance
    ours.offer(nu, noise)
    assert ours.fuse(index)
    assert ours.work[ROWS.innovation_variance] == pytest.approx(variance, rel=1e-12)
    assert np.allclose(ours.p, joseph(p, h, gain, noise), rtol=0, atol=1e-11)
    assert np.allclose(ours.x[OTHERS], (x + gain * nu)[OTHERS], rtol=0, atol=1e-12)
    assert np.array_equal(ours.x[ATTITUDE : ATTITUDE + 3], np.zeros(3))
    assert symmetric(ours.p)


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.floats(0.2, 5.0))
def test_josephs_form_holds_for_a_gain_that_is_not_kalmans(seed, share):
    """`correct` divides by the variance it is given; one that is not S gives another gain, whose P is S's no longer."""
    random = np.random.default_rng(seed)
    ours = filter_with_covariance(random)
    index, noise = some_states(random, 4), 0.3
    ours.set_coefficients(random.normal(size=4))
    h, p = ours.jacobian_row(index), ours.p.copy()
    observe_cross(ours.work, ONE_LANE, ROWS, index)
    assert np.allclose(ours.rows(ROWS.cross, STATES), p @ h, rtol=0, atol=1e-13)
    variance = share * (h @ p @ h + noise)
    ours.work[[ROWS.innovation, ROWS.innovation_variance, ROWS.accepted]] = 0.0, variance, 1.0
    correct(ours.work, ONE_LANE, ROWS)
    gain = p @ h / variance
    implied_noise = variance - h @ p @ h
    assert np.allclose(ours.p, joseph(p, h, gain, implied_noise), rtol=0, atol=1e-11)
    assert symmetric(ours.p)


def test_sixty_steps_match_filterpy():
    """Transforms, Gauss-Markov noise and corrections in turn, with state and covariance beside FilterPy's."""
    random = np.random.default_rng(11)
    ours = filter_with_covariance(random)
    theirs = KalmanFilter(dim_x=STATES, dim_z=1)
    theirs.x, theirs.P = ours.x[:, None].copy(), ours.p.copy()
    for _ in range(60):
        targets, sources = some_states(random, 2), some_states(random, 5)
        sources = targets + tuple(s for s in sources if s not in targets)
        coefficients = np.hstack([np.eye(2), 0.1 * random.normal(size=(2, len(sources) - 2))])
        state = int(random.choice(OTHERS))
        theirs.F = np.eye(STATES)
        theirs.F[np.ix_(targets, sources)] = coefficients
        theirs.x = theirs.F @ theirs.x  # the error's transition: ours moves its nominal state by the laws themselves
        theirs.P = theirs.F @ theirs.P @ theirs.F.T
        ours.x[:] = theirs.x[:, 0]
        ours.set_coefficients(coefficients)
        transform(ours.work, ONE_LANE, ROWS, targets, sources)
        theirs.F, theirs.Q = np.eye(STATES), np.zeros((STATES, STATES))
        theirs.F[state, state], theirs.Q[state, state] = 0.9, 0.19
        theirs.predict()
        decay(ours.work, ONE_LANE, ROWS, state, 1, 0.9)
        add_noise(ours.work, ONE_LANE, ROWS, state, 0.19)
        index = some_states(random, 4)
        ours.set_coefficients(random.normal(size=4))
        h, noise, nu = ours.jacobian_row(index), random.uniform(0.01, 4.0), random.normal()
        theirs.update(h @ theirs.x + nu, R=noise, H=h[None, :])
        ours.offer(nu, noise)
        assert ours.fuse(index)
        theirs.x[ATTITUDE : ATTITUDE + 3] = 0.0  # folded into the quaternion
    assert np.allclose(ours.x, theirs.x[:, 0], rtol=0, atol=1e-10)
    assert np.allclose(ours.p, theirs.P, rtol=0, atol=1e-10)
    assert symmetric(ours.p)


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


def touched(ours: Landing, before: Work) -> list[int]:
    """Rows of state, covariance and attitude that changed in any bit."""
    kept = [*range(ROWS.state, ROWS.covariance + STATES**2), *range(ROWS.attitude, ROWS.attitude + 4)]
    return [row for row in kept if ours.work[row] != before[row]]


@pytest.mark.parametrize("case", REFUSED)
def test_a_refused_reading_changes_no_bit(case):
    random = np.random.default_rng(7)
    for _ in range(10):
        ours = filter_with_covariance(random)
        before = ours.work.copy()
        ours.set_coefficients(random.normal(size=4))
        ours.offer(*REFUSED[case])
        assert not ours.fuse(some_states(random, 4), gate=5.0)
        assert touched(ours, before) == []


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("offered", [0.0, 1.0])
def test_a_law_whose_jacobian_is_not_finite_changes_no_bit(value, offered):
    """A pad fix puts what it read into its own Jacobian."""
    with np.errstate(invalid="ignore"):
        for component in range(3):
            ours = filter_with_covariance(np.random.default_rng(8))
            before = ours.work.copy()
            ours.reading[:3] = value
            observe_pad(ours.work, ONE_LANE, ROWS, component, READING, 0.1)
            ours.work[[ROWS.noise, ROWS.offered]] = 1.0, offered
            assert not ours.fuse(PAD_STATES, gate=5.0)
            assert touched(ours, before) == []


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.floats(0.5, 8.0), st.sampled_from([-1.0, 1.0]))
def test_the_gate_lies_where_it_is_set(seed, gate, sign):
    random = np.random.default_rng(seed)
    ours = filter_with_covariance(random)
    index = some_states(random, 3)
    ours.set_coefficients(random.normal(size=3))
    h = ours.jacobian_row(index)
    sigma = np.sqrt(h @ ours.p @ h + 0.2)
    for share, fused in ((0.999, True), (1.001, False)):
        run = ours.copy()
        run.offer(sign * share * gate * sigma, 0.2)
        assert run.fuse(index, gate) == fused
        assert run.work[ROWS.test_ratio] == pytest.approx(share**2, rel=1e-9)
        assert run.work[ROWS.innovation_variance] == pytest.approx(sigma**2, rel=1e-12)


def test_a_state_known_exactly_and_read_exactly_is_left_alone():
    """S = 0: there is nothing to learn and nothing to divide by."""
    ours = Landing()
    ours.set_coefficients([1.0])
    ours.offer(0.0, 0.0)
    before = ours.work.copy()
    with np.errstate(invalid="ignore"):
        assert not ours.fuse((3,))
    assert touched(ours, before) == []


# -- the attitude error folds into the quaternion ----------------------------------------------------------------
def test_an_attitude_correction_turns_the_quaternion_in_the_earth_frame():
    """A heading error of a vehicle that is rolled and pitched is corrected about earth down."""
    random = np.random.default_rng(9)
    ours = filter_with_covariance(random)
    before = ours.rotation
    nu, noise = 0.01, 0.5
    ours.set_coefficients([1.0])
    theta = (ours.p[:, ATTITUDE + 2] * nu / (ours.p[ATTITUDE + 2, ATTITUDE + 2] + noise))[ATTITUDE : ATTITUDE + 3]
    ours.offer(nu, noise)
    assert ours.fuse((ATTITUDE + 2,))
    turn = np.eye(3) + cross_matrix(theta)
    assert np.allclose(ours.rotation @ before.T, turn, rtol=0, atol=2.0 * (theta @ theta))
    assert np.linalg.norm(ours.q) == pytest.approx(1.0, abs=1e-15)


def test_every_state_has_a_name_and_every_row_a_place():
    assert len(STATE_NAMES) == len(set(STATE_NAMES)) == STATES
    assert list(ROWS) == sorted(ROWS)
    assert ROWS.innovation - ROWS.coefficient == LARGEST_TRANSFORM


# -- what is written about it --------------------------------------------------------------------------------------
def test_the_documentation_names_every_setting_and_every_reason():
    page = (DOCS / "landing-filter.md").read_text(encoding="utf-8")
    for name in (*LandingSettings._fields, *FlowLag._fields, *(reason.label for reason in Reason)):
        assert f"`{name}`" in page or name in {"f12", "f21"}, name
