"""One prediction and twelve scalar corrections of the landing filter, beside FilterPy doing the same; and its parts.

`python -m pytest benchmarks/test_bench_landing.py --benchmark-only`. The engine's cases advance sixteen flights, so
their time over sixteen is one flight's (`us_per_flight`, shown with `--benchmark-json` and printed with `-s`).
Compilation is not in any figure.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from flownav.benchmark.landing_loop import (
    ARRIVED,
    ATTITUDE_READ,
    ATTITUDE_VARIANCE,
    POSITION_READ,
    RANGE_READ,
    ROWS,
    SCALARS,
    run_landing_filter,
)
from flownav.compile import LANES, ONE_LANE, kernel, pointer
from flownav.estimation.covariance import at, correct, expect, settle
from flownav.estimation.error_models import FilterSettings, propagate_gauss_markov, propagate_walks
from flownav.estimation.lag import FlowLag
from flownav.estimation.laws.flow import flow_rate
from flownav.estimation.motion import errors_in_motion, predict
from flownav.estimation.states import (
    ACCEL_NOISE,
    ACCEPTED,
    COEFFICIENT,
    CROSS,
    GYRO_NOISE,
    IMU,
    INNOVATION_VARIANCE,
    NOISE,
    OBSERVED,
    OFFERED,
    POSITION,
    QUATERNION,
    STATE,
    STATES,
    STATES_WITH_LAG,
)
from flownav.frames import GRAVITY_M_S2

GROUP = f"landing filter: predict, and {SCALARS} corrections of {STATES} states"
PARTS = f"landing filter of {STATES} states: its parts"
STEPS = 100  # in one call of the engine
PART_STEPS = 1000
ROUNDS = 200
SETTINGS = FilterSettings(
    accel_noise_m_s2_rt_hz=0.05, gyro_noise_rad_s_rt_hz=0.004, accel_walk_m_s2_rt_s=0.003, gyro_walk_rad_s_rt_s=1e-4,
    position_walk_m_rt_s=0.01,
    gps_slow_sigma_m=1.5, gps_slow_sigma_down_m=2.5, gps_slow_tau_s=300.0,
    gps_fast_sigma_m=0.5, gps_fast_sigma_down_m=1.0, gps_fast_tau_s=20.0,
    gps_velocity_sigma_m_s=0.1, gps_velocity_sigma_down_m_s=0.1, gps_velocity_tau_s=5.0,
    ins_tilt_sigma_rad=0.01, ins_tilt_tau_s=30.0, ins_heading_sigma_rad=0.15, ins_heading_tau_s=3e4,
    ground_walk_m_rt_s=0.05, baro_walk_m_rt_s=0.1, pad_walk_m_rt_s=0.0, flow_scale_sigma=0.03,
    gate_sigma=5.0, accel_bias_limit_m_s2=0.6, gyro_bias_limit_rad_s=0.15,
)  # fmt: skip
LAG = FlowLag(0.9654, 0.01709, -3.2798, 0.7124, 1.19e-4, 8.07e-3, 6.2e-5, 9.03e-3, 196.9, 0.3, 0.1)


def standing(lanes: tuple[int, ...], n: int = STATES) -> np.ndarray:
    """A buffer of filters that hover 5 m above the ground, with readings that agree."""
    rows = np.zeros((ROWS, len(lanes)))
    rows[QUATERNION] = rows[ATTITUDE_READ] = rows[ARRIVED] = rows[OFFERED] = rows[INNOVATION_VARIANCE] = 1.0
    rows[IMU + 5] = -GRAVITY_M_S2
    rows[STATE + POSITION + 2] = rows[POSITION_READ + 2] = -5.0
    rows[RANGE_READ] = 4.9
    rows[ACCEL_NOISE], rows[GYRO_NOISE] = SETTINGS.accel_noise_m_s2_rt_hz**2, SETTINGS.gyro_noise_rad_s_rt_hz**2
    for i in range(n):
        rows[at(i, i)] = 0.01
    rows[OBSERVED : OBSERVED + 10] = np.array([9, 3, 4, 5, 6, 7, 8, 29, 2, 27])[:, None]  # as a flow rate
    rows[COEFFICIENT : COEFFICIENT + 9], rows[CROSS : CROSS + n], rows[NOISE] = 0.1, 1e-8, 1.0
    return rows.reshape(-1)


def note(benchmark, name: str, work: Callable[[], None], flight_steps: int) -> float:  # type: ignore[no-untyped-def]
    """Microseconds of processor time for one flight's step: the least of several rounds, others' work left out."""
    work()  # compiles
    best = np.inf
    for _ in range(ROUNDS):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    us = 1e6 * best / flight_steps
    benchmark.extra_info["us_per_flight"] = round(us, 3)
    print(f"\n{name}: {us:.3f} us")
    return us


@pytest.mark.benchmark(group=GROUP)
@pytest.mark.parametrize("lag", [None, LAG], ids=["without the sensor's dynamics", "with them"])
@pytest.mark.parametrize(("lanes", "steps"), [(LANES, STEPS), (ONE_LANE, STEPS), (ONE_LANE, 1)],
                         ids=["engine, 16 lanes", "scalar, inside one call", "scalar, called from Python"])  # fmt: skip
def test_flownav(benchmark, lanes, steps, lag):
    buffer = standing(lanes, STATES if lag is None else STATES_WITH_LAG)

    def work() -> None:
        run_landing_filter(buffer, lanes, steps, SETTINGS, lag)

    name = f"flownav, {len(lanes)} lanes, {steps} steps a call{'' if lag is None else ', dynamics'}"
    note(benchmark, name, work, steps * len(lanes))
    benchmark.pedantic(work, rounds=20, warmup_rounds=1)
    assert np.isfinite(buffer).all()


# -- its parts ------------------------------------------------------------------------------------------------
@kernel
def expect_often(buffer, lanes, steps, settings):
    """P h' and S of a law that reads nine states."""
    work = pointer(buffer)
    for _ in range(steps):
        expect(work, lanes, STATES, True)


@kernel
def correct_often(buffer, lanes, steps, settings):
    """State and covariance corrected."""
    work = pointer(buffer)
    for _ in range(steps):
        for lane in range(len(lanes)):
            work[ACCEPTED * len(lanes) + lane] = 1.0
        correct(work, lanes, STATES)


@kernel
def offer_nothing(buffer, lanes, steps, settings):
    """A reading that no lane offers."""
    work = pointer(buffer)
    for lane in range(len(lanes)):
        work[OFFERED * len(lanes) + lane] = 0.0
    for _ in range(steps):
        expect(work, lanes, STATES, False)
        settle(work, lanes, STATES, 5.0)


@kernel
def observe_often(buffer, lanes, steps, settings):
    """The law of a flow rate."""
    work = pointer(buffer)
    for step in range(steps):
        flow_rate(work, lanes, step % 2, 0.1, 0.0, 0.1, 0.1)


@kernel
def move_covariance(buffer, lanes, steps, settings):
    """The covariance of one prediction."""
    work = pointer(buffer)
    for _ in range(steps):
        errors_in_motion(work, lanes, STATES, 1e-4)


@kernel
def predict_often(buffer, lanes, steps, settings):
    """A prediction with its random walks."""
    work = pointer(buffer)
    for _ in range(steps):
        predict(work, lanes, STATES, 1e-4, settings)
        propagate_walks(work, lanes, 1e-4, settings)


@kernel
def decay_often(buffer, lanes, steps, settings):
    """The Gauss-Markov errors, of which one step serves for several predictions."""
    work = pointer(buffer)
    for _ in range(steps):
        propagate_gauss_markov(work, lanes, STATES, 1e-4, settings)


@pytest.mark.benchmark(group=PARTS)
@pytest.mark.parametrize("lanes", [LANES, ONE_LANE], ids=["16 lanes", "scalar"])
@pytest.mark.parametrize(
    "part",
    [expect_often, correct_often, offer_nothing, observe_often, move_covariance, predict_often, decay_often],
    ids=lambda part: part.__doc__.rstrip("."),
)
def test_parts(benchmark, part, lanes):
    start = standing(lanes)
    buffer = start.copy()

    def work() -> None:
        buffer[:] = start
        part(buffer, lanes, PART_STEPS, SETTINGS)

    note(benchmark, f"{part.__doc__} {len(lanes)} lanes", work, PART_STEPS * len(lanes))
    benchmark.pedantic(work, rounds=20, warmup_rounds=1)
    assert np.isfinite(buffer).all()


@pytest.mark.benchmark(group=GROUP)
def test_filterpy(benchmark):
    """The same dimensions with dense matrices that someone else has filled: no strapdown, no Jacobians, no gate."""
    other = KalmanFilter(dim_x=STATES, dim_z=1)
    other.P *= 0.01
    other.F = np.eye(STATES) + 0.001 * np.eye(STATES, k=3)
    other.Q = 1e-6 * np.eye(STATES)
    rows = [np.eye(STATES)[k : k + 1] for k in range(SCALARS)]
    noise, zero = np.array([[ATTITUDE_VARIANCE]]), np.zeros((1, 1))

    def work() -> None:
        other.predict()
        for row in rows:
            other.update(zero, R=noise, H=row)

    note(benchmark, "FilterPy", work, 1)
    benchmark.pedantic(work, rounds=20, iterations=5)
