"""The parts of a flight's time: they add up to the whole, and each is the work that it names."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.estimation.states import FILTER_ROWS, MOST_SOURCES, SCRATCH
from flownav.navigation.memory import new_work
from flownav.simulation.engine import buffers_of
from flownav.simulation.history import column
from flownav.studies.benchmark import vehicles as timed
from flownav.studies.benchmark.measures import vehicles
from flownav.studies.benchmark.vehicles import LANES, Parts, fly_untaken, landing_of, parts_of, plant_after
from flownav.vehicle import multirotor
from flownav.vehicle.state import CALM, Controls


@pytest.fixture(scope="module")
def quad():
    flight = landing_of("quad-450")
    return flight._replace(plan=flight.plan._replace(epochs=100))


def test_the_plant_alone_takes_a_flights_steps(quad):
    hover, gains = quad.plan.start, quad.gains
    controls = Controls(gains.lon_trim_rad, gains.lat_trim_rad, gains.collective_trim_rad, gains.pedal_trim_rad)
    state = hover
    for _ in range(100 * 10):
        state = multirotor.step(state, controls, CALM, 0.002, False, quad.vehicle)
    assert plant_after(quad) == pytest.approx(np.tile(np.array(state)[:, None], len(LANES)), abs=1e-9)


def test_readings_that_nobody_takes_leave_the_navigator_where_it_was(quad):
    buffers = buffers_of(quad, LANES, quad.plan.epochs, written=False)
    fly_untaken(quad._replace(plan=quad.plan._replace(fly_on_truth=True)), buffers)
    truth = buffers.history[:, column("truth", "pos_d_m")]
    assert np.ptp(truth) < 0.5
    assert np.isfinite(truth).all()
    beyond = np.arange(len(LANES), FILTER_ROWS * len(LANES))
    scratch = (beyond >= SCRATCH * len(LANES)) & (beyond < (SCRATCH + MOST_SOURCES**2) * len(LANES))
    kept = beyond[~scratch]  # the normalised error is computed in the filter's scratch
    np.testing.assert_array_equal(buffers.nav[kept], new_work(LANES, faults=False)[kept])
    assert buffers.nav[len(LANES) - 1] > 1.0  # but the readings were offered, each with its instant


@pytest.mark.real_time
def test_the_parts_are_parts_of_the_whole(quad):
    parts = parts_of(quad)
    assert 0.0 < parts.plant_s < parts.whole_s
    assert 0.0 < parts.navigator_s < parts.whole_s


def test_what_is_saved_when_nobody_takes_the_readings_is_the_navigators(quad, monkeypatch):
    """Each part is worked, in times that are given: the whole, the plant alone on the truth, and readings untaken."""
    given = iter((10.0, 3.0, 7.0, 2.5))
    monkeypatch.setattr(timed, "processor_s", lambda work: (work(), next(given))[1])
    parts = parts_of(quad)
    assert parts == Parts(10.0, 3.0, 4.5)
    assert parts.rest_s == 2.5


def test_the_quad_is_held_against_the_helicopter(monkeypatch):
    times = {"quad-450": Parts(10.0, 2.0, 5.0), "maxi-joker-3": Parts(20.0, 12.0, 5.0)}
    monkeypatch.setattr(timed, "landing_of", lambda name: name)
    monkeypatch.setattr(timed, "rate_of", lambda name, flights: {"quad-450": 900.0, "maxi-joker-3": 300.0}[name])
    monkeypatch.setattr(timed, "parts_of", times.__getitem__)
    figures = {figure.name: figure for figure in vehicles(16)}
    ratio = figures["quad-450's rate over maxi-joker-3's"]
    assert (ratio.value, ratio.asked, ratio.unit) == (3.0, 2.0, "x")
    assert figures["16 flights on one core, quad-450: rest"].value == pytest.approx(3000.0)
    assert figures["the rate's ratio if the quad's plant cost nothing"].value == pytest.approx(1.0 + 12.0 / 8.0)


@pytest.mark.real_time
def test_the_bench_measures_the_quad_and_the_helicopter():
    figures = {figure.name: figure for figure in vehicles(16)}
    ratio = figures["quad-450's rate over maxi-joker-3's"]
    assert ratio.value > 0.0
    assert figures["16 flights on one core, quad-450"].value > figures["16 flights on one core, quad-450: plant"].value
