"""The compiled landing filter over very many steps, and its lanes beside the scalar build and plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.benchmark.landing_loop import (
    ARRIVED,
    ATTITUDE_READ,
    FILTER,
    POSITION_READ,
    RANGE_READ,
    ROWS,
    STEP_S,
    run_landing_filter,
)
from flownav.compile import LANES, ONE_LANE
from flownav.estimation.landing.states import FLOW_LAG, FLOW_SCALE, POSITION
from flownav.frames import GRAVITY_M_S2
from landing_filter import SETTINGS, STATES, paper_lag

NUMBERS = SETTINGS._replace(gate_sigma=1e6, imu_lag=0.3)  # everything is fused, whatever it says
LAG = paper_lag(STEP_S)
START_SIGMA = np.full(STATES, 0.1)
START_SIGMA[POSITION : POSITION + 3] = 10.0
START_SIGMA[FLOW_SCALE], START_SIGMA[FLOW_LAG : FLOW_LAG + 4] = 0.02, 1e-4
BLOCK = 1000


def started(lanes: tuple[int, ...]) -> np.ndarray:
    """Rows of filters that stand on level ground 5 m below."""
    rows = np.zeros((ROWS, len(lanes)))
    rows[FILTER.attitude] = 1.0
    rows[FILTER.state + POSITION + 2] = -5.0
    rows[FILTER.covariance : FILTER.covariance + STATES**2] = np.diag(START_SIGMA**2).reshape(-1, 1)
    rows[ARRIVED] = 1.0
    return rows


def readings(random: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """A rough hover (*shape, 19): the IMU, then the rows from ATTITUDE_READ to ARRIVED."""
    imu = random.normal(size=(*shape, 6)) * [0.4, 0.4, 0.4, 2.0, 2.0, 2.0] + [0, 0, 0, 0, 0, -GRAVITY_M_S2]
    attitude = np.concatenate([np.ones((*shape, 1)), 0.1 * random.normal(size=(*shape, 3))], axis=-1)
    attitude /= np.linalg.norm(attitude, axis=-1, keepdims=True)
    rest = 0.3 * random.normal(size=(*shape, ARRIVED - POSITION_READ))
    rest[..., 2] -= 5.0
    rest[..., RANGE_READ - POSITION_READ] += 5.0
    return np.concatenate([imu, attitude, rest], axis=-1)


def read(rows: np.ndarray, values: np.ndarray) -> None:
    rows[FILTER.imu : FILTER.imu + 6] = values[:6]
    rows[ATTITUDE_READ:ARRIVED] = values[6:]


def smallest_eigenvalue(p: np.ndarray) -> float:
    """Of the correlation: P is positive definite exactly where that is, and it has no units."""
    sigma = np.sqrt(np.diag(p))
    return float(np.linalg.eigvalsh(p / np.outer(sigma, sigma))[0])


@pytest.mark.parametrize(
    "steps", [pytest.param(100_000, id="1e5 steps"), pytest.param(1_000_000, id="1e6 steps", marks=pytest.mark.slow)]
)
def test_the_covariance_stays_symmetric_to_the_bit_and_positive(steps):
    """Twelve corrections a step, with readings that come and go."""
    random = np.random.default_rng(2)
    rows = started(ONE_LANE)
    work = rows.reshape(-1)
    p = rows[FILTER.covariance : FILTER.covariance + STATES**2].reshape(STATES, STATES)
    for block in range(steps // BLOCK):
        rows[ARRIVED] = float(block % 5 != 4)  # every fifth block, 20 s, without any
        for values in readings(random, (BLOCK, 1)).transpose(0, 2, 1):
            read(rows, values)
            run_landing_filter(work, ONE_LANE, 1, STEP_S, NUMBERS, LAG)
        assert np.array_equal(p, p.T)
        assert smallest_eigenvalue(p) >= 0.0
    assert np.isfinite(rows).all()
    assert np.linalg.norm(rows[FILTER.attitude : FILTER.attitude + 4]) == pytest.approx(1.0, abs=1e-12)


def test_the_compiled_filter_is_the_plain_one():
    """To rounding: NumPy's exponential and the compiler's may differ in the last bit."""
    from flownav.benchmark import landing_loop

    plain = landing_loop.run_landing_filter.py_func
    random, compiled = np.random.default_rng(3), started(ONE_LANE)
    python = compiled.copy()
    for values in readings(random, (20, 1)).transpose(0, 2, 1):
        for rows, run in ((compiled, run_landing_filter), (python, plain)):
            read(rows, values)
            run(rows.reshape(-1), ONE_LANE, 1, STEP_S, NUMBERS, LAG)
    whole = slice(0, FILTER.cross)
    assert np.allclose(compiled[whole], python[whole], rtol=1e-11, atol=1e-13)


@pytest.mark.slow
def test_sixteen_compiled_lanes_are_each_the_scalar_builds_bytes():
    random, wide = np.random.default_rng(4), len(LANES)
    together = started(LANES)
    series = readings(random, (500, wide)).transpose(0, 2, 1)
    arrived = (random.uniform(size=(500, wide)) > 0.3).astype(float)
    for values, here in zip(series, arrived, strict=True):
        read(together, values)
        together[ARRIVED] = here
        run_landing_filter(together.reshape(-1), LANES, 1, STEP_S, NUMBERS, LAG)
    for lane in range(wide):
        alone = started(ONE_LANE)
        for values, here in zip(series, arrived, strict=True):
            read(alone, values[:, lane : lane + 1])
            alone[ARRIVED] = here[lane]
            run_landing_filter(alone.reshape(-1), ONE_LANE, 1, STEP_S, NUMBERS, LAG)
        assert alone[:, 0].tobytes() == together[:, lane].tobytes()
