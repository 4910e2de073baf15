"""The paper's filter against FilterPy's joint form of the same equations, and on many lanes at once."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from flownav.core.compile import LANES, ONE_LANE, kernel
from flownav.estimation import paper_filter
from flownav.estimation.paper_filter import PaperModel
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario

ROWS = paper_filter.kalman_rows(0, 6)
INPUT = paper_filter.kalman_row_count(6)
MEASURED, ARRIVED, SEEN, END = INPUT + 4, INPUT + 10, INPUT + 16, INPUT + 28


@kernel
def begin(work, lanes, variance):
    paper_filter.start(work, lanes, ROWS, 6, variance)


@kernel
def step(work, lanes, model):
    paper_filter.predict(work, lanes, ROWS, INPUT, model)
    paper_filter.update(work, lanes, ROWS, MEASURED, ARRIVED, SEEN, model)


@pytest.fixture(scope="module")
def model() -> PaperModel:
    scenario = load_scenario("landing")
    flown = scenario.filter.model_copy(update={"name": "paper"})
    return assemble(scenario.model_copy(update={"filter": flown})).flight.paper


def run(model, inputs, readings, arrived, lanes=ONE_LANE):
    """Trajectories of x (n, 6) and P (n, 6, 6) of the last lane."""
    count = len(lanes)
    work = np.zeros(END * count)
    begin(work, lanes, np.full(6, 0.5))
    rows = work.reshape(-1, count)
    states, covariances = [], []
    for u, z, here in zip(inputs, readings, arrived, strict=True):
        rows[INPUT:MEASURED] = u[:, None]
        rows[MEASURED:ARRIVED] = z[:, None]
        rows[ARRIVED:SEEN] = here[:, None]
        step(work, lanes, model)
        states.append(rows[ROWS.state : ROWS.state + 6, -1].copy())
        covariances.append(rows[ROWS.covariance : ROWS.covariance + 36, -1].reshape(6, 6).copy())
    return np.array(states), np.array(covariances)


def filterpy_run(model, inputs, readings, arrived):
    """FilterPy corrects P by Joseph's form, the paper by equation 30: the same for the optimal gain."""
    oracle = KalmanFilter(dim_x=6, dim_z=6, dim_u=4)
    oracle.F, oracle.B, oracle.Q = model.transition, model.input_matrix, np.diag(model.process_noise)
    oracle.P = 0.5 * np.eye(6)
    states, covariances = [], []
    for u, z, here in zip(inputs, readings, arrived, strict=True):
        oracle.predict(u=u[:, None])
        keep = here > 0
        oracle.update(z[keep][:, None], H=np.eye(6)[keep], R=np.diag(model.measurement_noise[keep]))
        states.append(oracle.x[:, 0].copy())
        covariances.append(oracle.P.copy())
    return np.array(states), np.array(covariances)


@pytest.fixture(scope="module")
def flight_data():
    generator = np.random.default_rng(3)
    n = 200
    inputs, readings = 0.01 * generator.standard_normal((n, 4)), generator.standard_normal((n, 6))
    arrived = np.ones((n, 6))
    arrived[generator.random(n) < 0.4, 3:] = 0.0  # flow not engaged
    return inputs, readings, arrived


def test_components_one_by_one_are_the_joint_update_of_filterpy(model, flight_data):
    ours, theirs = run(model, *flight_data), filterpy_run(model, *flight_data)
    assert np.allclose(ours[0], theirs[0], rtol=0, atol=1e-11)
    assert np.allclose(ours[1], theirs[1], rtol=0, atol=1e-12)


def test_every_lane_is_the_single_filter_bit_for_bit(model, flight_data):
    one, sixteen = run(model, *flight_data), run(model, *flight_data, lanes=LANES)
    assert np.array_equal(one[0], sixteen[0])
    assert np.array_equal(one[1], sixteen[1])


def test_covariance_stays_symmetric_and_positive(model, flight_data):
    _, covariances = run(model, *flight_data)
    assert np.array_equal(covariances, covariances.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(covariances).min() > 0


def test_steady_gains_are_those_of_reading_the_printed_numbers_as_variances(model):
    """The steady gains of the printed matrices: 0.095 (position), 0.144 (u, v), 0.103 (w)."""
    n = 500
    _, covariances = run(model, np.zeros((n, 4)), np.zeros((n, 6)), np.ones((n, 6)))
    gains = np.diag(covariances[-1]) / model.measurement_noise
    assert gains == pytest.approx([0.095, 0.095, 0.095, 0.144, 0.144, 0.103], abs=0.002)


def test_a_reading_that_is_not_offered_may_be_anything(model, flight_data):
    inputs, readings, arrived = flight_data
    poisoned = np.where(arrived > 0, readings, np.nan)
    assert np.array_equal(run(model, inputs, readings, arrived)[0], run(model, inputs, poisoned, arrived)[0])
