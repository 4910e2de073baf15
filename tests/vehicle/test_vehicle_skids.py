"""Skid contact: it carries, never pulls, comes to rest, and holds the parked helicopter where it stands."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.frames import quaternion_from_euler
from flownav.vehicle import helicopter, skids
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.state import CALM, Controls, in_wind
from flownav.vehicle.trim import parked, trim

VEHICLE = load_vehicle()
HOVER = trim(VEHICLE)
WEIGHT = VEHICLE.mass_kg * VEHICLE.gravity_m_s2
IDLE = Controls(0.0, 0.0, 0.0, HOVER.pedal_rad)
step = helicopter.step
outputs = helicopter.outputs


def march(state, controls, seconds, dt=0.002, wind=(0.0, 0.0, 0.0)):
    """The last state and every contact force on the way."""
    forces = []
    for _ in range(round(seconds / dt)):
        state = step(state, controls, in_wind(*wind), dt, VEHICLE)
        forces.append(outputs(state, in_wind(*wind), VEHICLE).contact_force_n)
    return state, np.array(forces)


def above_ground(height, roll=0.0, **changes):
    attitude = dict(zip(("qw", "qx", "qy", "qz"), quaternion_from_euler(roll, 0.0, 0.0), strict=True))
    low = VEHICLE.skid_half_track_m * abs(np.sin(roll)) + VEHICLE.cg_above_skid_m * np.cos(roll)
    return parked(VEHICLE, IDLE)._replace(pos_d=-height - low, **attitude, **changes)


def test_at_rest_the_feet_carry_what_the_rotor_does_not():
    for collective in (0.0, 0.01, 0.02):
        state = parked(VEHICLE, IDLE._replace(col=collective))
        out = outputs(state, CALM, VEHICLE)
        assert out.contact_force_n + out.thrust_n == pytest.approx(WEIGHT, rel=2e-3)
    assert outputs(parked(VEHICLE, IDLE), CALM, VEHICLE).contact_force_n == pytest.approx(WEIGHT, rel=1e-3)


def test_parked_is_the_stance_less_the_springs_sag():
    sag = WEIGHT / 4.0 / VEHICLE.skid_stiffness_n_m
    assert parked(VEHICLE, IDLE).pos_d == pytest.approx(-VEHICLE.cg_above_skid_m + sag, abs=2e-4)


@pytest.mark.parametrize("pedal", [0.0, HOVER.pedal_rad, 0.2])
def test_a_parked_helicopter_does_not_creep(pedal):
    controls = IDLE._replace(ped=pedal)
    start = parked(VEHICLE, controls)
    end, _ = march(start, controls, 10.0, dt=0.004)
    assert np.hypot(end.pos_n - start.pos_n, end.pos_e - start.pos_e) < 1e-6
    assert abs(2.0 * np.arctan2(end.qz, end.qw)) < 1e-6


def test_a_parked_helicopter_holds_in_a_breeze():
    end, _ = march(parked(VEHICLE, IDLE), IDLE, 5.0, wind=(0.0, 4.0, 0.0))
    assert np.hypot(end.pos_n, end.pos_e) < 0.01


def test_a_drop_comes_to_rest_without_ever_pulling():
    end, forces = march(above_ground(0.1, roll=0.09, v=0.1), IDLE, 2.5)
    assert forces.min() >= 0.0
    assert forces.max() > 1.5 * WEIGHT
    assert forces[-1] == pytest.approx(WEIGHT, rel=1e-3)
    assert max(abs(x) for x in (end.u, end.v, end.w, end.p, end.q, end.r)) < 1e-4
    assert end.pos_d == pytest.approx(parked(VEHICLE, IDLE).pos_d, abs=1e-5)


def test_a_landing_at_the_papers_sink_rate_is_the_same_at_half_the_step():
    start = above_ground(0.005, roll=HOVER.roll_rad, w=0.3)
    coarse, _ = march(start, IDLE, 1.0, dt=0.002)
    fine, _ = march(start, IDLE, 1.0, dt=0.001)
    assert np.hypot(coarse.pos_n - fine.pos_n, coarse.pos_e - fine.pos_e) < 1e-3


def test_the_contact_force_begins_without_a_jump_and_never_pulls():
    foot = skids.foot_force
    depths = np.linspace(-0.001, 0.02, 2101)
    for sink in (-1.0, -0.1, 0.0, 0.3, 1.0):
        forces = np.array([foot(depth, sink, VEHICLE) for depth in depths])
        assert forces.min() == 0.0
        assert (forces[depths <= 0.0] == 0.0).all()
        assert np.abs(np.diff(forces)).max() < 2.0
    assert foot(0.01, 0.2, VEHICLE) == pytest.approx(30.0 + 30.0)


def test_sliding_is_braked_by_mu_g_and_then_stops():
    start = parked(VEHICLE, IDLE)._replace(u=1.0)
    rate = helicopter.derivative(start, IDLE, CALM, VEHICLE)
    assert rate.u == pytest.approx(-VEHICLE.skid_friction_coefficient * VEHICLE.gravity_m_s2, rel=0.05)
    end, _ = march(start, IDLE, 1.5)
    assert np.hypot(end.u, end.v) < 1e-3
    assert 0.05 < np.hypot(end.pos_n, end.pos_e) < 0.2


def test_off_the_ground_nothing_touches():
    state = above_ground(0.001)
    assert outputs(state, CALM, VEHICLE).contact_force_n == 0.0
    stiff = VEHICLE._replace(skid_stiffness_n_m=3e5, skid_friction_coefficient=1.0)
    rate = helicopter.derivative
    assert rate(state, IDLE, CALM, stiff) == rate(state, IDLE, CALM, VEHICLE)


def test_controls_that_will_not_stay_parked_are_refused():
    for too_much in (IDLE._replace(col=0.09), IDLE._replace(col=np.radians(3.0))):
        with pytest.raises(InputError, match="lifts, tips or slides"):
            parked(VEHICLE, too_much)
    with pytest.raises(InputError, match="lifts, tips or slides"):
        parked(VEHICLE._replace(skid_friction_coefficient=0.02), IDLE)
