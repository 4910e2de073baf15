"""Ground effect: the values of paper equation 11, its clamp and its fading with airspeed."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.frames import quaternion_from_euler, rotation_from_quaternion, to_body
from flownav.vehicle.helicopter import outputs
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.rotor import multiplier
from flownav.vehicle.state import CALM
from flownav.vehicle.trim import trim

R, V_I = 0.89, 3.57


@pytest.mark.parametrize(("ratio", "expected"), [(0.5, 4 / 3), (1.0, 1.0667), (2.0, 1.0159), (2.5, 1.0101)])
def test_equation_11_in_hover(ratio, expected):
    assert multiplier(ratio * R, 0.0, V_I, R) == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize("ratio", [0.49, 0.3, 0.25, 0.1, 0.0, -1.0])
def test_below_half_a_radius_the_value_there_serves(ratio):
    assert multiplier(ratio * R, 0.0, V_I, R) == pytest.approx(4 / 3, abs=1e-12)


def test_airspeed_of_the_induced_velocity_halves_the_correction():
    def correction(speed):
        return 1.0 - 1.0 / multiplier(R, speed, V_I, R)

    assert correction(V_I) == pytest.approx(correction(0.0) / 2.0, rel=1e-12)


def test_it_falls_steadily_with_height_and_never_jumps():
    gains = np.array([multiplier(z, 0.0, V_I, R) for z in np.linspace(0.0, 8 * R, 2000)])
    assert (np.diff(gains) <= 0.0).all()
    assert np.abs(np.diff(gains)).max() < 0.01
    assert gains[-1] > 1.0


def test_an_unloaded_rotor_near_the_ground_stays_finite():
    assert multiplier(0.5 * R, 5.0, 0.0, R) == pytest.approx(1.0 / (1.0 - 0.25 / (1.0 + (5.0 / 0.3) ** 2)))


def test_the_height_that_counts_is_the_hubs():
    vehicle = load_vehicle()
    hover = trim(vehicle)
    free = outputs(hover.state, CALM, vehicle)
    level = hover.state._replace(qw=1.0, qx=0.0, qy=0.0, qz=0.0)
    near = outputs(level._replace(pos_d=-(R - vehicle.hub_above_cg_m)), CALM, vehicle)
    assert near.thrust_n / free.thrust_n == pytest.approx(1.0667, abs=5e-5)
    assert near.torque_n_m == pytest.approx(free.torque_n_m)


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.3, 0.0), (0.0, -0.3), (0.25, 0.2)])
def test_the_airspeed_that_counts_is_along_the_ground_however_the_body_is_tilted(roll, pitch):
    vehicle = load_vehicle()
    attitude = quaternion_from_euler(roll, pitch, 0.4)
    rotation = rotation_from_quaternion(*attitude)
    turned = trim(vehicle).state._replace(**dict(zip(("qw", "qx", "qy", "qz"), attitude, strict=True)))
    for north, east, down in ((4.0, -3.0, 0.0), (0.0, 0.0, 1.5), (2.0, 1.0, -1.0)):
        u, v, w = to_body(rotation, north, east, down)
        moving = turned._replace(u=u, v=v, w=w)
        free = outputs(moving._replace(pos_d=-1e6), CALM, vehicle)
        near = outputs(moving._replace(pos_d=-0.7), CALM, vehicle)
        hub = 0.7 + vehicle.hub_above_cg_m * rotation[8]
        expected = multiplier(hub, np.hypot(north, east), near.induced_velocity_m_s, vehicle.main_radius_m)
        assert near.thrust_n / free.thrust_n == pytest.approx(expected, rel=1e-9)
