"""A rotor's own wake near the ground: where it is felt, how much, and that none of it is anywhere else."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.simulation.ground import (
    RecirculationSettings,
    RecirculationState,
    recirculated,
    step_recirculation,
)
from flownav.simulation.wind import WindVelocity
from flownav.vehicle.kinds import disc_of, load_vehicle

VEHICLE = load_vehicle()
DISC = disc_of(VEHICLE)
WEIGHT = VEHICLE.mass_kg * VEHICLE.gravity_m_s2
P = RecirculationSettings().parameters(DISC.diameter_m, DISC.above_cg_m, VEHICLE.air_density_kg_m3, DISC.induced_m_s)
QUIET = RecirculationState(0.0, 0.0, 0.0)
STILL = WindVelocity(*[0.0] * 6)


def down(north_m_s, hub_height_m, state=QUIET, thrust_n=WEIGHT):
    found = recirculated(STILL._replace(wind_n_m_s=north_m_s), state, hub_height_m, thrust_n, P)
    assert found[:2] == (north_m_s, 0.0)
    return found.wind_d_m_s


def test_the_discs_are_the_vehicles():
    assert DISC.diameter_m == pytest.approx(1.78)
    assert DISC.induced_m_s == pytest.approx(3.55, abs=0.05)
    quad = disc_of(load_vehicle("quad-450"))
    assert quad.diameter_m == pytest.approx(0.508)
    assert quad.span_m == pytest.approx(0.704)


def test_lift_is_lost_near_the_ground_in_a_wind_of_some_of_the_induced_velocity():
    winds = np.array([0.0, 0.5, 1.0, 2.0, 2.5, 3.0, 6.0, 12.0])
    lost = np.array([down(v, 0.0) for v in winds])
    assert lost[0] == 0.0
    assert winds[np.argmax(lost)] == 2.5
    assert lost.max() == pytest.approx(0.06 * DISC.induced_m_s, rel=0.02)
    assert lost[-1] < 0.5 * lost.max()


def test_it_fades_to_nothing_at_one_diameter_and_without_thrust():
    heights = np.array([0.0, 0.47, 0.89, 1.5, 1.78, 5.0])
    lost = [down(2.5, z) / down(2.5, 0.0) for z in heights]
    assert lost == pytest.approx([max(1.0 - z / 1.78, 0.0) ** 2 for z in heights])
    assert down(2.5, 0.3, thrust_n=0.0) == 0.0
    assert down(2.5, 0.3, thrust_n=-20.0) == 0.0


def test_the_unsteady_part_has_its_sizes_down_and_across_the_disc():
    shaken = recirculated(STILL, RecirculationState(1.0, -1.0, 2.0), 0.0, WEIGHT, P)
    unsteady = 0.05 * DISC.induced_m_s
    assert shaken.wind_d_m_s == pytest.approx(unsteady, rel=0.02)
    assert shaken.turn_n_rad_s * 0.89 == pytest.approx(-unsteady, rel=0.02)
    assert shaken.turn_e_rad_s * 0.89 == pytest.approx(2.0 * unsteady, rel=0.02)
    assert shaken.turn_d_rad_s == 0.0


def test_it_is_stationary_and_forgets_in_the_time_that_an_eddy_takes():
    generator = np.random.default_rng(2)
    state = RecirculationState(*generator.standard_normal((3, 20000)))
    first = state.down
    tau_s = DISC.diameter_m / DISC.induced_m_s
    for _ in range(round(tau_s / 0.02)):
        state = step_recirculation(state, RecirculationState(*generator.standard_normal((3, 20000))), P)
    assert np.var(state.down) == pytest.approx(1.0, abs=0.04)
    assert np.mean(first * state.down) == pytest.approx(math.exp(-1.0), abs=0.03)
