"""Forces and moments of the airframe against the reference's formulas, component by component."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.vehicle import airframe
from flownav.vehicle.airframe import AirMotion, Wrench
from flownav.vehicle.helicopter import tail_inplane_sq
from flownav.vehicle.kinds import load_vehicle

VEHICLE = load_vehicle()
RHO = VEHICLE.air_density_kg_m3
AIR = AirMotion(u=4.0, v=-3.0, w=1.0, p=0.2, q=-0.3, r=0.5)
ARM, ABOVE = VEHICLE.tail_behind_cg_m, VEHICLE.tail_above_cg_m


def test_fuselage_drag_opposes_the_motion_through_air_and_wake():
    force = airframe.fuselage_drag(3.5, AIR, VEHICLE)
    relative = np.array([AIR.u, AIR.v, AIR.w - 3.5])
    areas = [VEHICLE.fuselage_area_x_m2, VEHICLE.fuselage_area_y_m2, VEHICLE.fuselage_area_z_m2]
    assert force == pytest.approx(-RHO / 2 * np.array(areas) * relative * np.linalg.norm(relative))


def test_the_tail_pushes_left_and_the_fin_in_its_wake_takes_some_back():
    thrust, induced = 8.0, 6.0
    sideslip = AIR.v - ARM * AIR.r + ABOVE * AIR.p - VEHICLE.vertical_fin_tail_inflow_fraction * induced
    lift = VEHICLE.vertical_fin_lift_slope_per_rad * abs(AIR.u) + abs(sideslip)
    expected = -RHO / 2 * VEHICLE.vertical_fin_area_m2 * lift * sideslip - VEHICLE.tail_fin_blockage * thrust
    side = airframe.tail_side_force
    assert side(thrust, induced, AIR, VEHICLE) == pytest.approx(expected)
    still = AirMotion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert -thrust < side(thrust, induced, still, VEHICLE) < -0.95 * thrust


def test_the_tail_plane_is_pushed_down_by_the_wake_and_lifts_with_speed():
    plane = airframe.tail_plane_force
    w = AIR.w + VEHICLE.horizontal_fin_behind_cg_m * AIR.q - VEHICLE.horizontal_fin_main_inflow_fraction * 3.5
    lift = VEHICLE.horizontal_fin_lift_slope_per_rad * abs(AIR.u) + abs(w)
    assert plane(3.5, AIR, VEHICLE) == pytest.approx(-RHO / 2 * VEHICLE.horizontal_fin_area_m2 * lift * w)
    assert plane(3.5, AirMotion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), VEHICLE) > 0.0


def test_the_main_rotor_tilts_its_thrust_drags_its_blades_and_bends_its_hub():
    thrust, torque, a1, b1 = 77.0, 8.5, 0.03, -0.02
    wrench = airframe.main_rotor_wrench(thrust, torque, a1, b1, AIR, 0.9, VEHICLE)
    drag = 0.9 * VEHICLE.main_inplane_drag_n_s_m
    x, y = -thrust * np.sin(a1) - drag * AIR.u, thrust * np.sin(b1) - drag * AIR.v
    assert wrench.x == pytest.approx(x)
    assert wrench.y == pytest.approx(y)
    assert wrench.z == pytest.approx(-thrust * np.cos(a1) * np.cos(b1))
    at_hub = np.cross([0.0, 0.0, -VEHICLE.hub_above_cg_m], [x, y, wrench.z])
    stiffness = VEHICLE.hub_stiffness_n_m_rad
    assert (wrench.l, wrench.m) == pytest.approx((stiffness * b1 + at_hub[0], stiffness * a1 + at_hub[1]))
    assert wrench.n == -torque


def test_forces_turn_about_the_centre_of_gravity_where_they_act():
    rotor = Wrench(1.0, 2.0, -70.0, 3.0, -4.0, -8.0)
    down = (-0.1, 0.2, 0.97)
    tail, plane, fuselage = -7.5, 0.4, (-1.0, 2.0, 0.5)
    total = airframe.flight_wrench(rotor, tail, plane, fuselage, down, VEHICLE)
    weight = VEHICLE.mass_kg * VEHICLE.gravity_m_s2 * np.array(down)
    force = np.array(rotor[:3]) + fuselage + weight + [0.0, tail, plane]
    moment = (
        np.array(rotor[3:])
        + np.cross([-ARM, 0.0, -ABOVE], [0.0, tail, 0.0])
        + np.cross([-VEHICLE.horizontal_fin_behind_cg_m, 0.0, 0.0], [0.0, 0.0, plane])
    )
    assert total[:3] == pytest.approx(force)
    assert total[3:] == pytest.approx(moment)


def test_a_fin_before_the_tail_rotor_leaves_its_share_of_the_thrust():
    still = AirMotion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for share in (1.0, 0.83, 0.5):
        blocked = VEHICLE._replace(tail_fin_blockage=share, vertical_fin_area_m2=0.0)
        assert airframe.tail_side_force(8.0, 6.0, still, blocked) == pytest.approx(-8.0 * share)


def test_a_body_that_pitches_about_its_tail_rotor_leaves_that_rotor_at_rest():
    """Its velocity is v + ω × r at r = (-l, 0, ·): a turn about the place where it stands moves it not."""
    turning = AIR._replace(w=-ARM * AIR.q)
    assert tail_inplane_sq(turning, VEHICLE) == pytest.approx(AIR.u**2)
    assert tail_inplane_sq(AIR._replace(q=0.0), VEHICLE) == pytest.approx(AIR.u**2 + AIR.w**2)
