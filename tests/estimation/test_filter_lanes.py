"""The compiled filter: over very many steps, its lanes beside the scalar build, and beside plain Python."""

from __future__ import annotations

import numpy as np
import pytest

import landing_loop
from filters import KEPT, SETTINGS, Filter, N, filter_at, paper_lag, random_covariance
from flownav.core.compile import LANES, ONE_LANE, kernel, pointer
from flownav.core.frames import GRAVITY_M_S2
from flownav.estimation.covariance import (
    add_noise_lane,
    at,
    covariance_of,
    expect,
    forget_lane,
    fuse,
    settle,
    variance_of,
)
from flownav.estimation.error_models import propagate_gauss_markov, propagate_walks
from flownav.estimation.lag import lag_ends, lag_starts
from flownav.estimation.laws.attitude import attitude, bridged_attitude, heading
from flownav.estimation.laws.flow import body_velocity, flow_rate, lagged_flow
from flownav.estimation.laws.gps import gps_position, gps_velocity
from flownav.estimation.laws.height import baro_altitude, range_along_boresight
from flownav.estimation.laws.pad import pad_fix
from flownav.estimation.laws.still import gyro_at_rest, pad_below, position_itself, velocity_itself
from flownav.estimation.motion import hold_still, predict
from flownav.estimation.states import (
    ACCEPTED,
    FLOW_LAG,
    FLOW_SCALE,
    FORCE,
    GROUND,
    IMU,
    INNOVATION,
    INNOVATION_VARIANCE,
    MEASURED,
    MIDDLE,
    NOISE,
    OFFERED,
    PAD,
    POSITION,
    QUATERNION,
    RATE,
    STATE,
    STATES,
    TEST_RATIO,
)
from landing_loop import ARRIVED, ATTITUDE_READ, POSITION_READ, RANGE_READ, ROWS, STEP_S
from packed_covariance import unpack

WIDE = len(LANES)
NUMBERS = SETTINGS._replace(gate_sigma=1e6)  # everything is fused, whatever it says
LAG = paper_lag(STEP_S)
BLOCK = 1000


# -- every step and every law, lanes beside one lane -------------------------------------------------------------
@kernel
def every_step(buffer, lanes, settings, lag):  # type: ignore[no-untyped-def]
    """A prediction, then each law once, some lanes without a reading; a sum of what scalars are read.

    One `fuse` for all laws: where each has its own, most of the suite's compiling is of this kernel.
    """
    work = pointer(buffer)
    n = N
    for lane in range(len(lanes)):
        if lane % 5 == 3:
            hold_still(work, lanes, lane)
    lag_starts(work, lanes, lag)
    predict(work, lanes, n, 0.02, settings)
    lag_ends(work, lanes, lag)
    for seconds in (0.02, 0.3):
        propagate_walks(work, lanes, seconds, settings)
        propagate_gauss_markov(work, lanes, n, seconds, settings)
    for axis in range(3):
        gps_velocity(work, lanes, axis, forward_m=0.1, right_m=0.2, below_m=-0.3)
        expect(work, lanes, n, False)
        settle(work, lanes, n, 3.0)
    for law in range(14):
        for axis in range(3 if law < 9 else 2 if law < 11 else 1):
            if law == 0:
                attitude(work, lanes, axis)
            elif law == 1:
                bridged_attitude(work, lanes, axis)
            elif law == 2:
                gps_position(work, lanes, axis, 0.1, 0.2, -0.3)
            elif law == 3:
                body_velocity(work, lanes, axis, 0.1, 0.0, 0.2)
            elif law == 4:
                pad_fix(work, lanes, axis, 0.1)
            elif law == 5:
                position_itself(work, lanes, axis)
            elif law == 6:
                velocity_itself(work, lanes, axis)
            elif law == 7:
                gyro_at_rest(work, lanes, axis)
            elif law == 8:
                pad_below(work, lanes, axis)
            elif law == 9:
                flow_rate(work, lanes, axis, 0.1, 0.0, 0.2, 0.15)
            elif law == 10:
                lagged_flow(work, lanes, axis, gain=196.9)
            elif law == 11:
                heading(work, lanes, axis)
            elif law == 12:
                range_along_boresight(work, lanes, axis, 0.1, right_m=0.05)
            else:
                baro_altitude(work, lanes, axis)
            fuse(work, lanes, n, 3.0)
    for lane in range(len(lanes)):
        if work[MEASURED * len(lanes) + lane] > 0.0:
            forget_lane(work, lanes, n, GROUND, lane, 1.0)
    total = 0.0
    for lane in range(len(lanes)):
        add_noise_lane(work, lanes, 5, lane, 0.1)
        forget_lane(work, lanes, n, PAD, lane, 4.0)
        total += variance_of(work, lanes, 3, lane) + covariance_of(work, lanes, 7, 2, lane)
    return total


def sixteen() -> list[Filter]:
    """Vehicles at different places, a quarter of them without readings."""
    alone = [filter_at(seed, 0.2, -0.1, 0.3 * seed, 0.5 + seed) for seed in range(WIDE)]
    for lane, filter_ in enumerate(alone):
        filter_.p = random_covariance(np.random.default_rng(lane), 0.05)
        filter_.work[[NOISE, OFFERED]] = 0.5, float(lane % 4 > 0)
        filter_.reading[:] *= 0.3
    return alone


SEEN = [*KEPT, *range(RATE, RATE + 3), *range(FORCE, FORCE + 3), *range(MIDDLE, MIDDLE + 9), INNOVATION,
        INNOVATION_VARIANCE, TEST_RATIO, ACCEPTED]  # fmt: skip


def test_sixteen_vehicles_side_by_side_are_each_as_alone_to_the_last_bit():
    alone = sixteen()
    together = np.stack([filter_.work for filter_ in alone], axis=1).ravel()
    total = every_step(together, LANES, SETTINGS, LAG)
    sums = 0.0
    for lane, filter_ in enumerate(alone):
        start, plain = filter_.p, filter_.work.copy()
        if lane % 5 == 3:  # alone, every vehicle is lane 0, which is not held
            hold_still(filter_.work, ONE_LANE, 0)
            hold_still(plain, ONE_LANE, 0)
        sums += every_step(filter_.work, ONE_LANE, SETTINGS, LAG)
        assert filter_.work[SEEN].tobytes() == together.reshape(-1, WIDE)[SEEN, lane].tobytes()
        assert not np.array_equal(filter_.p, start)
        if lane < 3:
            every_step.py_func(plain, ONE_LANE, SETTINGS, LAG)
            assert np.allclose(plain[SEEN], filter_.work[SEEN], rtol=1e-9, atol=1e-12)
    assert total == pytest.approx(sums)


# -- very long runs ------------------------------------------------------------------------------------------------
def started(lanes: tuple[int, ...], n: int) -> np.ndarray:
    """Rows of filters that stand on level ground 5 m below."""
    sigma = np.full(n, 0.1)
    sigma[POSITION : POSITION + 3] = 10.0
    sigma[FLOW_SCALE], sigma[FLOW_LAG:] = 0.02, 1e-4
    rows = np.zeros((ROWS, len(lanes)))
    rows[QUATERNION] = rows[ARRIVED] = 1.0
    rows[STATE + POSITION + 2] = -5.0
    for i in range(n):
        rows[at(i, i)] = sigma[i] ** 2
    return rows


def readings(random: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """A rough hover (*shape, 19): the IMU, then the rows from ATTITUDE_READ to ARRIVED."""
    imu = random.normal(size=(*shape, 6)) * [0.4, 0.4, 0.4, 2.0, 2.0, 2.0] + [0, 0, 0, 0, 0, -GRAVITY_M_S2]
    attitude_read = np.concatenate([np.ones((*shape, 1)), 0.1 * random.normal(size=(*shape, 3))], axis=-1)
    attitude_read /= np.linalg.norm(attitude_read, axis=-1, keepdims=True)
    rest = 0.3 * random.normal(size=(*shape, ARRIVED - POSITION_READ))
    rest[..., 2] -= 5.0
    rest[..., RANGE_READ - POSITION_READ] += 5.0
    return np.concatenate([imu, attitude_read, rest], axis=-1)


def read(rows: np.ndarray, values: np.ndarray) -> None:
    rows[IMU : IMU + 6] = values[:6]
    rows[ATTITUDE_READ:ARRIVED] = values[6:]


def smallest_eigenvalue(p: np.ndarray) -> float:
    """Of the correlation: P is positive definite exactly where that is, and it has no units."""
    sigma = np.sqrt(np.diag(p))
    return float(np.linalg.eigvalsh(p / np.outer(sigma, sigma))[0])


@pytest.mark.parametrize("lag", [None, LAG], ids=["36 states", "40 states"])
@pytest.mark.parametrize(
    "steps", [pytest.param(50_000, id="5e4 steps"), pytest.param(1_000_000, id="1e6 steps", marks=pytest.mark.slow)]
)
def test_the_covariance_stays_positive(steps, lag):
    """Twelve corrections a step, with readings that come and go."""
    random, n = np.random.default_rng(2), STATES if lag is None else N
    rows = started(ONE_LANE, n)
    work = rows.reshape(-1)
    for block in range(steps // BLOCK):
        rows[ARRIVED] = float(block % 5 != 4)  # every fifth block, 20 s, without any
        for values in readings(random, (BLOCK, 1)).transpose(0, 2, 1):
            read(rows, values)
            landing_loop.run_landing_filter(work, ONE_LANE, 1, NUMBERS, lag)
        assert smallest_eigenvalue(unpack(work, ONE_LANE, 0, n)) >= 0.0
    assert np.isfinite(rows).all()
    assert np.linalg.norm(rows[QUATERNION : QUATERNION + 4]) == pytest.approx(1.0, abs=1e-12)


def test_over_five_hundred_steps_sixteen_lanes_are_each_the_scalar_builds_bytes():
    random = np.random.default_rng(4)
    together = started(LANES, STATES)
    series = readings(random, (500, WIDE)).transpose(0, 2, 1)
    arrived = (random.uniform(size=(500, WIDE)) > 0.3).astype(float)
    for values, here in zip(series, arrived, strict=True):
        read(together, values)
        together[ARRIVED] = here
        landing_loop.run_landing_filter(together.reshape(-1), LANES, 1, NUMBERS, None)
    for lane in range(WIDE):
        alone = started(ONE_LANE, STATES)
        for values, here in zip(series, arrived, strict=True):
            read(alone, values[:, lane : lane + 1])
            alone[ARRIVED] = here[lane]
            landing_loop.run_landing_filter(alone.reshape(-1), ONE_LANE, 1, NUMBERS, None)
        assert alone[list(KEPT), 0].tobytes() == together[list(KEPT), lane].tobytes()
