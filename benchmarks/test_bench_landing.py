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

from flownav.core.compile import LANES, ONE_LANE
from flownav.estimation.lag import FlowLag
from flownav.estimation.states import STATES, STATES_WITH_LAG
from flownav.studies.benchmark.vehicles import SETTINGS, correct_often, offer_nothing, predict_often
from landing_loop import (
    ATTITUDE_VARIANCE,
    SCALARS,
    decay_often,
    expect_often,
    hovering,
    move_covariance,
    observe_often,
    run_landing_filter,
)

GROUP = f"landing filter: predict, and {SCALARS} corrections of {STATES} states"
PARTS = f"landing filter of {STATES} states: its parts"
STEPS = 100  # in one call of the engine
PART_STEPS = 1000
ROUNDS = 200
LAG = FlowLag(0.9654, 0.01709, -3.2798, 0.7124, 1.19e-4, 8.07e-3, 6.2e-5, 9.03e-3, 196.9, 0.3, 0.1)


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
    buffer = hovering(lanes, STATES if lag is None else STATES_WITH_LAG)

    def work() -> None:
        run_landing_filter(buffer, lanes, steps, SETTINGS, lag)

    name = f"flownav, {len(lanes)} lanes, {steps} steps a call{'' if lag is None else ', dynamics'}"
    note(benchmark, name, work, steps * len(lanes))
    benchmark.pedantic(work, rounds=20, warmup_rounds=1)
    assert np.isfinite(buffer).all()


@pytest.mark.benchmark(group=PARTS)
@pytest.mark.parametrize("lanes", [LANES, ONE_LANE], ids=["16 lanes", "scalar"])
@pytest.mark.parametrize(
    "part",
    [expect_often, correct_often, offer_nothing, observe_often, move_covariance, predict_often, decay_often],
    ids=lambda part: part.__doc__.rstrip("."),
)
def test_parts(benchmark, part, lanes):
    start = hovering(lanes)
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
