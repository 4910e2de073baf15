"""The plant on lanes is the vehicle's own equations: its Runge-Kutta step, and the paper's linear truth."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.compile import LANES, kernel
from flownav.simulation import layout
from flownav.simulation.assemble import assemble
from flownav.simulation.ensemble import believed
from flownav.simulation.layout import store_around, store_controls, store_helicopter
from flownav.simulation.plan import PHYSICS_S
from flownav.simulation.plant import linear_step, place, runge_kutta_step
from flownav.simulation.scenario import Scenario, load_scenario
from flownav.simulation.truth import packed_truth
from flownav.vehicle import helicopter
from flownav.vehicle.state import CALM, Controls, HelicopterState


@kernel
def put(work, lanes, lane, state, controls):
    store_helicopter(work, lanes, lane, state)
    store_controls(work, lanes, lane, controls)
    store_around(work, lanes, lane, CALM)


@kernel
def begin(work, lanes, state, rotors):
    for lane in range(len(lanes)):
        place(work, lanes, lane, state, rotors)


ANY_SENSORS = 0.0  # only whether there are any is asked: without, it is the paper's helicopter


@kernel
def step(work, lanes, dt):
    runge_kutta_step(work, lanes, dt, ANY_SENSORS)


@kernel
def step_linear(work, lanes, model):
    linear_step(work, lanes, model)


@pytest.fixture(scope="module")
def flight():
    return assemble(load_scenario("landing")).flight


def states_about_hover(flight, count):
    """States and controls about hover, near the ground and high, moving and turning, one a lane."""
    generator = np.random.default_rng(4)
    scale = HelicopterState(1, 1, 1, 2, 2, 1, 0.05, 0.05, 0.05, 0.05, 0.4, 0.4, 0.4, 0.02, 0.02, 0.02, 0.02, 0.02, 0.05,
                            0.2, 0.2, 0.2, 0.2, 0.5, 3.0, 200.0)  # fmt: skip
    for k in range(count):
        moved = np.array(flight.plan.start) + np.array(scale) * generator.standard_normal(26)
        moved[2] = -0.23 - 0.2 * k
        moved[6:10] /= np.linalg.norm(moved[6:10])
        controls = np.array([0.0, 0.0, flight.gains.collective_trim_rad, flight.gains.pedal_trim_rad])
        yield HelicopterState(*map(float, moved)), Controls(*map(float, controls + 0.01 * generator.standard_normal(4)))


def test_refining_the_inflow_between_stages_is_solving_it_in_each(flight):
    """At 16 moving, turning states, some on their skids, a step differs by less than 1e-8."""
    work = np.zeros(layout.ROWS * len(LANES))
    work[: layout.AS_IS_END * len(LANES)] = packed_truth([believed(flight)] * len(LANES))
    pairs = list(states_about_hover(flight, len(LANES)))
    for lane, (state, controls) in enumerate(pairs):
        put(work, LANES, lane, state, controls)
    step(work, LANES, PHYSICS_S)
    rows = work.reshape(-1, len(LANES))[layout.HELICOPTER : layout.HELICOPTER + 26]
    for lane, (state, controls) in enumerate(pairs):
        exact = helicopter.step(state, controls, CALM, PHYSICS_S, flight.vehicle)
        assert rows[:, lane] == pytest.approx(np.array(exact, float), rel=1e-8, abs=1e-8)


def test_each_lane_flies_the_vehicle_of_its_own_rows(flight):
    """Sixteen vehicles of sixteen masses, inertias and servos side by side, each as its own step has it."""
    work = np.zeros(layout.ROWS * len(LANES))
    vehicles = [
        flight.vehicle._replace(
            mass_kg=7.0 + 0.1 * lane, inertia_xx_kg_m2=0.15 + 0.01 * lane, cyclic_frequency_rad_s=36.0 + lane
        )
        for lane in range(len(LANES))
    ]
    truth = believed(flight)
    work[: layout.AS_IS_END * len(LANES)] = packed_truth([truth._replace(vehicle=vehicle) for vehicle in vehicles])
    pairs = list(states_about_hover(flight, len(LANES)))
    for lane, (state, controls) in enumerate(pairs):
        put(work, LANES, lane, state, controls)
    step(work, LANES, PHYSICS_S)
    rows = work.reshape(-1, len(LANES))[layout.HELICOPTER : layout.HELICOPTER + 26]
    for lane, (state, controls) in enumerate(pairs):
        exact = helicopter.step(state, controls, CALM, PHYSICS_S, vehicles[lane])
        assert rows[:, lane] == pytest.approx(np.array(exact, float), rel=1e-8, abs=1e-8)


def test_a_helicopter_starts_with_its_own_rotor_speed_and_a_quad_as_it_is_told(flight):
    work = np.zeros(layout.ROWS * len(LANES))
    speeds = 150.0 + np.arange(len(LANES))
    truths = [
        believed(flight)._replace(vehicle=flight.vehicle._replace(main_speed_rad_s=float(speed))) for speed in speeds
    ]
    work[: layout.AS_IS_END * len(LANES)] = packed_truth(truths)
    begin(work, LANES, flight.plan.start, None)
    rows = work.reshape(-1, len(LANES))
    at = HelicopterState._fields.index("speed")
    assert (rows[layout.HELICOPTER + at] == speeds).all()
    others = [i for i in range(len(HelicopterState._fields)) if i != at]
    assert (np.array(flight.plan.start)[others] == rows[layout.HELICOPTER + np.array(others)].T).all()
    begin(work, LANES, flight.plan.start, (0, 0, 0, 0))
    assert (rows[layout.HELICOPTER + at] == flight.plan.start.speed).all()


def test_linear_truth_is_the_matrix_equation():
    entries = load_scenario("takeoff").model_dump(exclude_unset=True) | {"truth": "linear", "filter": {"name": "paper"}}
    flight = assemble(Scenario.model_validate(entries)).flight
    model = flight.linear
    work = np.zeros(layout.ROWS * len(LANES))
    generator = np.random.default_rng(1)
    state = flight.plan.start._replace(
        **dict(zip(HelicopterState._fields[:6], generator.standard_normal(6), strict=True))
    )
    controls = Controls(*(model.trim + 0.01 * generator.standard_normal(4)))
    put(work, LANES, 5, state, controls)
    step_linear(work, LANES, model)
    moved = work.reshape(-1, len(LANES))[layout.HELICOPTER : layout.HELICOPTER + 6, 5]
    wanted = model.transition @ np.array(state[:6]) + model.input_matrix @ (np.array(controls) - model.trim)
    assert moved == pytest.approx(wanted, abs=1e-12)
