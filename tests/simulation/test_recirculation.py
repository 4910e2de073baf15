"""A rotor's own wake near the ground: where it is felt, how much, and that none of it is anywhere else."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.simulation.ground import (
    RecirculationSettings,
    RecirculationState,
    recirculated,
    ringed,
    step_recirculation,
    vortex_ring,
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


# -- the vortex ring ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("descent", "across", "share"),
    [
        (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.45, 0.0, 0.0), (0.675, 0.0, 0.5), (0.9, 0.0, 1.0), (1.3, 0.0, 1.0),
        (1.55, 0.0, 0.5), (1.8, 0.0, 0.0), (3.0, 0.0, 0.0), (1.0, 0.475, 0.75), (1.0, 0.95, 0.0), (1.0, 3.0, 0.0),
    ],
)  # fmt: skip
def test_a_rotor_is_in_a_ring_while_it_sinks_with_its_wake_and_is_not_blown_out_of_it(descent, across, share):
    assert ringed(descent, across) == pytest.approx(share)


def test_a_ring_pulls_the_air_down_through_the_rotor_and_shakes_it():
    vi = DISC.induced_m_s
    held = vortex_ring(STILL, QUIET, vi, 0.0, WEIGHT, P)
    assert held.wind_d_m_s == pytest.approx(0.25 * vi, rel=0.02)
    assert held._replace(wind_d_m_s=0.0) == STILL
    shaken = vortex_ring(STILL, RecirculationState(1.0, -1.0, 2.0), vi, 0.0, WEIGHT, P)
    assert shaken.wind_d_m_s == pytest.approx(0.45 * vi, rel=0.02)
    assert (shaken.turn_n_rad_s, shaken.turn_e_rad_s) == (
        pytest.approx(-0.2 * vi / 0.89, rel=0.02), pytest.approx(0.4 * vi / 0.89, rel=0.02),
    )  # fmt: skip


def test_an_updraught_is_a_descent_and_without_thrust_or_sinking_slowly_there_is_no_ring():
    vi = DISC.induced_m_s
    rising = vortex_ring(STILL._replace(wind_d_m_s=-vi), QUIET, 0.0, 0.0, WEIGHT, P)
    assert rising.wind_d_m_s + vi == pytest.approx(0.25 * vi, rel=0.02)
    assert vortex_ring(STILL, QUIET, vi, 0.0, 0.0, P) == STILL
    for slow in (-2.0, 0.0, 0.44 * vi):
        assert vortex_ring(STILL, RecirculationState(1.0, 1.0, 1.0), slow, 0.0, WEIGHT, P) == STILL
