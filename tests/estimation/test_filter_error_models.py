"""Random walks and Gauss-Markov errors: their stated sizes and paces, together or late."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters import SETTINGS, Filter, N, filter_at, random_covariance
from flownav.core.compile import ONE_LANE
from flownav.estimation.error_models import (
    FilterSettings,
    propagate_gauss_markov,
    propagate_walks,
)
from flownav.estimation.motion import predict
from flownav.estimation.states import (
    ACCEL_BIAS,
    BARO,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GROUND,
    GYRO_BIAS,
    INNOVATION,
    INS_ERROR,
    NOISE,
    PAD,
    STATES,
)

EXAMPLES = settings(max_examples=8, deadline=None)


def stationary(numbers: FilterSettings) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviation and time constant of every Gauss-Markov state; 0 elsewhere."""
    sigma, tau_s = np.zeros(N), np.zeros(N)
    n = numbers
    level_and_down = (
        (GPS_SLOW, n.gps_slow_sigma_m, n.gps_slow_sigma_down_m, n.gps_slow_tau_s, n.gps_slow_tau_s),
        (GPS_FAST, n.gps_fast_sigma_m, n.gps_fast_sigma_down_m, n.gps_fast_tau_s, n.gps_fast_tau_s),
        (GPS_VELOCITY, n.gps_velocity_sigma_m_s, n.gps_velocity_sigma_down_m_s, *[n.gps_velocity_tau_s] * 2),
        (INS_ERROR, n.ins_tilt_sigma_rad, n.ins_heading_sigma_rad, n.ins_tilt_tau_s, n.ins_heading_tau_s),
    )
    for first, level, down, tau_level, tau_down in level_and_down:
        sigma[first : first + 3], tau_s[first : first + 3] = (level, level, down), (tau_level, tau_level, tau_down)
    return sigma, tau_s


def walks(numbers: FilterSettings) -> np.ndarray:
    """Of every state, what it walks in the square root of a second; position, motion and ground are no part of this."""
    found = np.zeros(N)
    for first, count, walk in (
        (GYRO_BIAS, 3, numbers.gyro_walk_rad_s_rt_s),
        (ACCEL_BIAS, 3, numbers.accel_walk_m_s2_rt_s),
        (PAD, 3, numbers.pad_walk_m_rt_s),
        (BARO, 1, numbers.baro_walk_m_rt_s),
    ):
        found[first : first + count] = walk
    return found


@EXAMPLES
@given(st.integers(0, 2**32 - 1), st.floats(0.001, 5.0))
def test_the_errors_of_one_step_are_a_diagonal_transition_and_a_diagonal_noise(seed, dt_s):
    filter_ = filter_at(seed, 0.1, 0.2, 0.3, 4.0)
    filter_.p = random_covariance(np.random.default_rng(seed))
    sigma, tau_s = stationary(SETTINGS)
    markov = tau_s > 0.0
    factor = np.ones(N)
    factor[markov] = np.exp(-dt_s / tau_s[markov])
    noise = walks(SETTINGS) ** 2 * dt_s + sigma**2 * (1.0 - factor**2)
    x, p = factor * filter_.x, np.outer(factor, factor) * filter_.p + np.diag(noise)
    propagate_walks(filter_.work, ONE_LANE, dt_s, SETTINGS)
    propagate_gauss_markov(filter_.work, ONE_LANE, N, dt_s, SETTINGS)
    assert filter_.x == pytest.approx(x, rel=1e-14)
    assert np.allclose(filter_.p, p, rtol=1e-12, atol=1e-15)


def test_gauss_markov_errors_stay_at_their_stated_size_and_forget_at_their_stated_pace():
    sigma, tau_s = stationary(SETTINGS)
    markov = tau_s > 0.0
    filter_ = filter_at(1, 0.1, 0.1, 0.0, 3.0)
    filter_.p = np.diag(sigma**2)
    x = filter_.x[markov].copy()
    for _ in range(50):
        propagate_gauss_markov(filter_.work, ONE_LANE, N, 0.1, SETTINGS)
    assert np.diag(filter_.p)[markov] == pytest.approx(sigma[markov] ** 2, rel=1e-12)
    assert filter_.x[markov] == pytest.approx(x * np.exp(-5.0 / tau_s[markov]), rel=1e-12)


@EXAMPLES
@given(st.integers(0, 2**32 - 1))
def test_gauss_markov_errors_may_wait_until_something_reads_them(seed):
    """Ten steps of motion with a correction of velocity in between, the errors' steps taken one by one or at once."""
    prompt = filter_at(seed, 0.2, -0.1, 1.0, 5.0)
    prompt.p = random_covariance(np.random.default_rng(seed), 0.1)
    late = prompt.copy()
    for k in range(10):
        for filter_ in (prompt, late):
            predict(filter_.work, ONE_LANE, STATES, 0.01, SETTINGS)
            propagate_walks(filter_.work, ONE_LANE, 0.01, SETTINGS)
        propagate_gauss_markov(prompt.work, ONE_LANE, STATES, 0.01, SETTINGS)
        if k in (4, 7):
            for filter_ in (prompt, late):
                filter_.observe([3, 4, 29], [1.0, 0.5, -0.3])
                filter_.work[[INNOVATION, NOISE]] = 0.2, 0.04
                assert filter_.fuse()
    propagate_gauss_markov(late.work, ONE_LANE, STATES, 0.1, SETTINGS)
    assert late.x == pytest.approx(prompt.x, rel=1e-10, abs=1e-12)
    assert late.q == pytest.approx(prompt.q, rel=1e-12)
    assert np.allclose(late.p[:STATES, :STATES], prompt.p[:STATES, :STATES], rtol=1e-10, atol=1e-12)


def test_a_pad_that_does_not_move_gains_nothing():
    filter_ = Filter()
    propagate_walks(filter_.work, ONE_LANE, 10.0, SETTINGS._replace(pad_walk_m_rt_s=0.0))
    assert np.all(np.diag(filter_.p)[PAD : PAD + 3] == 0.0)
    assert filter_.p[GROUND, GROUND] == 0.0
