"""The engine's hot paths, timed side by side with peers in one run: `make bench`."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from flownav.core.compile import LANES, ONE_LANE
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import buffers_of, fly_into
from flownav.simulation.scenario import load_scenario, with_filter
from flownav.studies.benchmark.vehicles import PAPER_ROWS, run_paper_filter

STEPS = 1000


@pytest.fixture(scope="module")
def flight():
    """The paper's landing on the paper's filter."""
    return assemble(with_filter(load_scenario("landing"), "paper")).flight


@pytest.mark.benchmark(group="one 50 s landing (divide the lanes' time by 16)")
@pytest.mark.parametrize("lanes", [ONE_LANE, LANES], ids=["scalar", "16 lanes"])
@pytest.mark.parametrize("name", ["paper", "landing"], ids=["the paper's filter", "the navigator"])
def test_flight(benchmark, name, lanes):
    flown = assemble(with_filter(load_scenario("landing"), name)).flight
    buffers = buffers_of(flown, lanes, flown.plan.epochs, written=False)
    fly_into(flown, 1, 0, lanes, buffers)
    benchmark(fly_into, flown, 1, 0, lanes, buffers)


@pytest.mark.benchmark(group=f"{STEPS} predict+update of six states")
def test_paper_filter(benchmark, flight):
    benchmark(run_paper_filter, np.zeros(PAPER_ROWS), ONE_LANE, STEPS, flight.paper)


@pytest.mark.benchmark(group=f"{STEPS} predict+update of six states")
def test_filterpy(benchmark, flight):
    model = flight.paper
    other = KalmanFilter(dim_x=6, dim_z=6, dim_u=4)
    other.F, other.B, other.H = model.transition, model.input_matrix, np.eye(6)
    other.Q, other.R = np.diag(model.process_noise), np.diag(model.measurement_noise)
    inputs, measured = np.zeros((4, 1)), np.zeros((6, 1))

    def steps():
        for _ in range(STEPS):
            other.predict(u=inputs)
            other.update(measured)

    benchmark(steps)
