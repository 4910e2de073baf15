"""One prediction and twelve scalar corrections of the landing filter's 34 states, beside FilterPy doing the same.

`python -m pytest benchmarks/test_bench_landing.py --benchmark-only`. The engine's case advances sixteen flights, so its
time over sixteen is one flight's (`us_per_flight`, shown with `--benchmark-json` and printed with `-s`). Compilation is
not in any figure.
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
    FILTER,
    POSITION_READ,
    RANGE_READ,
    ROWS,
    SCALARS,
    STEP_S,
    run_landing_filter,
)
from flownav.compile import LANES, ONE_LANE
from flownav.estimation.landing.states import POSITION, STATES
from flownav.frames import GRAVITY_M_S2
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario

GROUP = f"landing filter: predict, and {SCALARS} corrections of {STATES} states"
STEPS = 100  # in one call of the engine
ROUNDS = 200


@pytest.fixture(scope="module")
def setup():
    return assemble(load_scenario("landing")).flight.landing


def standing(lanes: tuple[int, ...]) -> np.ndarray:
    """A buffer of filters that hover 5 m above the ground, with readings that agree."""
    rows = np.zeros((ROWS, len(lanes)))
    rows[FILTER.attitude] = rows[ATTITUDE_READ] = rows[ARRIVED] = 1.0
    rows[FILTER.imu + 5] = rows[FILTER.imu_before + 5] = -GRAVITY_M_S2
    rows[FILTER.state + POSITION + 2] = rows[POSITION_READ + 2] = -5.0
    rows[RANGE_READ] = 4.9
    rows[FILTER.covariance : FILTER.covariance + STATES**2] = 0.01 * np.eye(STATES).reshape(-1, 1)
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
    benchmark.extra_info["us_per_flight"] = round(us, 2)
    print(f"\n{name}: {us:.2f} us")
    return us


@pytest.mark.benchmark(group=GROUP)
@pytest.mark.parametrize(("lanes", "steps"), [(LANES, STEPS), (ONE_LANE, STEPS), (ONE_LANE, 1)],
                         ids=["engine, 16 lanes", "scalar, inside one call", "scalar, called from Python"])  # fmt: skip
def test_flownav(benchmark, setup, lanes, steps):
    buffer = standing(lanes)

    def work() -> None:
        run_landing_filter(buffer, lanes, steps, STEP_S, setup.settings, setup.lag)

    note(benchmark, f"flownav, {len(lanes)} lanes, {steps} steps a call", work, steps * len(lanes))
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
