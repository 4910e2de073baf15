"""The rigid body and its integration: conservation, order of the method, the quaternion's length, free fall."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion
from flownav.vehicle import helicopter
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.parameters import without_slop
from flownav.vehicle.state import CALM, Controls, HelicopterState, in_wind
from flownav.vehicle.trim import trim

VEHICLE = load_vehicle()
INERTIA = np.diag([VEHICLE.inertia_xx_kg_m2, VEHICLE.inertia_yy_kg_m2, VEHICLE.inertia_zz_kg_m2])
step = helicopter.step
NO_CONTROLS = Controls(0.0, 0.0, 0.0, 0.0)


def without_air(**changes):
    """The helicopter as a bare rigid body: no lift, no drag, no torque, no hub stiffness."""
    nothing = dict.fromkeys(
        (
            "main_thrust_slope_n_s_m",
            "main_disc_kg_m",
            "main_profile_torque_n_m",
            "main_inplane_drag_n_s_m",
            "hub_stiffness_n_m_rad",
            "tail_thrust_slope_n_s_m",
            "tail_profile_torque_n_m",
            "fuselage_area_x_m2",
            "fuselage_area_y_m2",
            "fuselage_area_z_m2",
            "vertical_fin_area_m2",
            "horizontal_fin_area_m2",
        ),
        0.0,
    )
    return VEHICLE._replace(**nothing, **changes)


def tumbling(**changes):
    zeros = dict.fromkeys(HelicopterState._fields, 0.0) | {"speed": VEHICLE.main_speed_rad_s}
    attitude = dict(zip(("qw", "qx", "qy", "qz"), quaternion_from_euler(0.3, -0.4, 1.0), strict=True))
    motion = {"pos_d": -100.0, "u": 3.0, "v": -1.0, "w": 0.5, "p": 1.0, "q": 2.0, "r": -1.5}
    return HelicopterState(**{**zeros, **attitude, **motion, **changes})


def march(state, vehicle, dt, count, controls=NO_CONTROLS, wind=(0.0, 0.0, 0.0)):
    for _ in range(count):
        state = step(state, controls, in_wind(*wind), dt, vehicle)
    return state


def rotation(state):
    return np.reshape(rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz), (3, 3))


def angular_momentum_earth(state):
    return rotation(state) @ INERTIA @ np.array([state.p, state.q, state.r])


def spin_energy(state):
    rates = np.array([state.p, state.q, state.r])
    return 0.5 * rates @ INERTIA @ rates


def test_a_torque_free_body_keeps_its_energy_and_momentum():
    start = tumbling()
    end = march(start, without_air(gravity_m_s2=0.0), 0.002, 1000)
    assert spin_energy(end) == pytest.approx(spin_energy(start), rel=1e-10)
    assert np.allclose(angular_momentum_earth(end), angular_momentum_earth(start), rtol=0.0, atol=1e-9)
    velocity = [np.array([s.u, s.v, s.w]) for s in (start, end)]
    assert np.linalg.norm(velocity[1]) == pytest.approx(np.linalg.norm(velocity[0]), rel=1e-10)
    assert np.allclose(rotation(end) @ velocity[1], rotation(start) @ velocity[0], atol=1e-9)
    assert abs(end.p - start.p) > 0.1


def test_free_fall_is_a_parabola_whatever_the_tumbling():
    start = tumbling()
    end = march(start, without_air(), 0.002, 500)
    earth = rotation(start) @ [start.u, start.v, start.w]
    fall = np.array([0.0, 0.0, 0.5 * VEHICLE.gravity_m_s2])
    fallen = np.array([end.pos_n, end.pos_e, end.pos_d]) - [0.0, 0.0, -100.0]
    assert np.allclose(fallen, earth + fall, atol=1e-8)


def test_the_quaternion_keeps_its_length_and_turns_at_the_body_rate():
    start = tumbling(p=0.0, q=0.0, r=2.0, qw=1.0, qx=0.0, qy=0.0, qz=0.0)
    end = march(start, without_air(gravity_m_s2=0.0), 0.002, 500)
    assert np.linalg.norm([end.qw, end.qx, end.qy, end.qz]) == pytest.approx(1.0, abs=1e-15)
    assert 2.0 * np.arctan2(end.qz, end.qw) == pytest.approx(2.0, abs=1e-9)


def test_runge_kutta_converges_at_fourth_order_on_the_whole_helicopter():
    hover = trim(VEHICLE, (3.0, 0.5, 0.2), height_m=5.0)
    start = hover.state._replace(p=0.3, q=-0.2, r=0.4, u=3.5)
    controls = hover.controls._replace(lat=hover.lat + 0.01, col=hover.collective_rad + 0.005)

    def end(dt):
        state = march(start, without_slop(VEHICLE), dt, round(0.4 / dt), controls, (1.0, -2.0, 0.3))
        return np.array(state[:-1])  # the governor's integral is in watts

    exact = end(0.0005)
    errors = [np.abs(end(dt) - exact).max() for dt in (0.01, 0.005, 0.0025)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 3.6).all()
    assert (orders < 4.6).all()
    assert errors[-1] < 1e-6


def test_wind_acts_as_the_opposite_motion():
    hover = trim(VEHICLE, (4.0, 0.0, 0.0))
    rate = helicopter.derivative
    moving = rate(hover.state, hover.controls, CALM, VEHICLE)
    wind = rotation(hover.state) @ [-4.0, 0.0, 0.0]
    held = rate(hover.state._replace(u=0.0), hover.controls, in_wind(*wind), VEHICLE)
    same = ("u", "v", "w", "p", "q", "r", "a1", "b1", "inflow", "speed", "governed")
    assert np.allclose([getattr(held, f) for f in same], [getattr(moving, f) for f in same], atol=1e-12)
    assert held.pos_n == 0.0
