"""Conservation laws of energy and forces that act at a place: drag and friction take, moments are arms times forces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flownav.core.frames import rotation_from_quaternion
from flownav.vehicle import airframe, drive, helicopter, multirotor
from flownav.vehicle.airframe import angular_acceleration, linear_acceleration
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.motors import battery_voltage, propeller_load, shaft_power
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters
from flownav.vehicle.skids import Support, with_friction, with_support
from flownav.vehicle.state import CALM, Controls, RotorLoads
from flownav.vehicle.trim import settled, trim

QUAD: MultirotorParameters = load_vehicle(Path("quad-450"))  # type: ignore[assignment]
HELICOPTER: VehicleParameters = load_vehicle()  # type: ignore[assignment]
SEEDS = pytest.mark.parametrize("seed", range(6))
NOTHING = airframe.Wrench(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def floats(rng: np.random.Generator, count: int, size: float = 1.0) -> tuple[float, ...]:
    return tuple(float(x) for x in size * rng.normal(size=count))


@SEEDS
def test_no_turning_frame_does_any_work(seed):
    """Body axes turn: neither the velocity's nor the rates' own terms change the energy."""
    rng = np.random.default_rng(seed)
    velocity, rates = floats(rng, 3), floats(rng, 3)
    assert np.dot(linear_acceleration(velocity, rates, (0.0, 0.0, 0.0), 2.0), velocity) == pytest.approx(0.0, abs=1e-12)
    inertia = (QUAD.inertia_xx_kg_m2, QUAD.inertia_yy_kg_m2, QUAD.inertia_zz_kg_m2)
    turned = np.multiply(inertia, angular_acceleration(rates, (0.0, 0.0, 0.0), QUAD))
    assert turned @ rates == pytest.approx(0.0, abs=1e-12)
    assert turned == pytest.approx(-np.cross(rates, np.multiply(inertia, rates)), abs=1e-12)


@SEEDS
def test_spinning_rotors_turn_the_body_as_gyroscopes_and_do_no_work(seed):
    """Rotors that turn left have their spin upwards, J·Ω·(0, 0, -1): the body feels -w × h."""
    rng = np.random.default_rng(seed)
    rates, turning = floats(rng, 3), 300.0
    still = airframe.AirMotion(0.0, 0.0, 0.0, *rates)
    wrench = multirotor.free_wrench(multirotor.NO_LOADS, turning, 0.0, (0.0, 0.0, 0.0), still, QUAD)
    spin = np.array([0.0, 0.0, -QUAD.rotor_inertia_kg_m2 * turning])
    assert wrench[3:] == pytest.approx(-np.cross(rates, spin), abs=1e-12)
    assert np.dot(wrench[3:], rates) == pytest.approx(0.0, abs=1e-12)


@SEEDS
def test_a_falling_tumbling_multirotor_without_air_keeps_its_energy(seed):
    vacuum = QUAD._replace(
        thrust_n_s2=0.0, torque_n_m_s2=1e-30, axial_n_s2_m=0.0, inplane_n_s2_m2=0.0, inplane_drag_n_s2_m_rad=0.0,
        flap_back_m=0.0, fuselage_area_x_m2=0.0, fuselage_area_y_m2=0.0, fuselage_area_z_m2=0.0, motor_rate_1_s=0.0,
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    state = settled(-500.0, floats(rng, 3, 3.0), 0.3, -0.2, [400.0, 300.0, 500.0, 200.0])  # type: ignore[arg-type]
    state = state._replace(**dict(zip("pqr", floats(rng, 3, 2.0), strict=True)))
    inertia = (QUAD.inertia_xx_kg_m2, QUAD.inertia_yy_kg_m2, QUAD.inertia_zz_kg_m2)

    def energy(s):
        moving = 0.5 * QUAD.mass_kg * (s.u**2 + s.v**2 + s.w**2)
        return moving + 0.5 * np.dot(inertia, np.square((s.p, s.q, s.r))) - QUAD.mass_kg * QUAD.gravity_m_s2 * s.pos_d

    before = energy(state)
    for _ in range(200):
        state = multirotor.step(state, Controls(0.0, 0.0, 0.3, 0.0), CALM, 0.001, False, vacuum)
    assert energy(state) == pytest.approx(before, abs=2e-3)
    assert abs(QUAD.mass_kg * QUAD.gravity_m_s2 * (state.pos_d + 500.0)) > 0.1  # it has come to be another one


@SEEDS
def test_what_air_does_to_a_body_takes_energy(seed):
    """Fuselage, blades, disc and both fins: their force against the motion through air that is still."""
    rng = np.random.default_rng(seed)
    u, v, w = floats(rng, 3, 4.0)
    air = airframe.AirMotion(u, v, w, 0.0, 0.0, 0.0)
    assert np.dot(airframe.fuselage_drag(0.0, air, HELICOPTER), (u, v, w)) < 0.0
    blades = airframe.main_rotor_wrench(0.0, 0.0, 0.0, 0.0, air, 1.0, HELICOPTER)
    assert blades.x * u < 0.0
    assert blades.y * v < 0.0
    assert airframe.tail_side_force(0.0, 0.0, air, HELICOPTER) * v < 0.0
    assert airframe.tail_plane_force(0.0, air, HELICOPTER) * w < 0.0
    assert propeller_load(500.0, u * u + v * v, w, 0.0, 1e6, QUAD).drag_n_s_m > QUAD.inplane_drag_n_s2_m_rad * 500.0


@SEEDS
def test_the_main_rotor_s_forces_act_at_its_hub(seed):
    rng = np.random.default_rng(seed)
    air = airframe.AirMotion(*floats(rng, 6))
    a1, b1 = floats(rng, 2, 0.05)
    wrench = airframe.main_rotor_wrench(60.0, 4.0, a1, b1, air, 1.1, HELICOPTER)
    arm = (0.0, 0.0, -HELICOPTER.hub_above_cg_m)
    stiff = HELICOPTER.hub_stiffness_n_m_rad
    assert wrench[3:] == pytest.approx(np.cross(arm, wrench[:3]) + np.array([stiff * b1, stiff * a1, -4.0]))


@SEEDS
def test_the_feet_push_out_of_the_ground_at_their_own_places(seed):
    rng = np.random.default_rng(seed)
    normal = np.array([*floats(rng, 2, 0.1), 1.0])
    normal /= np.linalg.norm(normal)
    forces = rng.uniform(1.0, 5.0, 4)
    x, y, z = QUAD.skid_half_length_m, QUAD.skid_half_track_m, QUAD.cg_above_skid_m
    places = [(x, y, z), (x, -y, z), (-x, y, z), (-x, -y, z)]
    feet = Support(
        float(forces.sum()),
        float(sum(f * place[0] for f, place in zip(forces, places, strict=True))),
        float(sum(f * place[1] for f, place in zip(forces, places, strict=True))),
    )
    wrench = with_support(NOTHING, feet, tuple(normal), QUAD)
    moment = sum(np.cross(place, -f * normal) for f, place in zip(forces, places, strict=True))
    assert wrench[:3] == pytest.approx(-forces.sum() * normal)
    assert wrench[3:] == pytest.approx(moment)


@SEEDS
def test_friction_acts_below_the_centre_of_gravity_and_takes_energy(seed):
    """Of a vehicle that slides and turns: a force at (0, 0, z), its moment about the centre of gravity, and no more."""
    rng = np.random.default_rng(seed)
    velocity, rates = floats(rng, 3), floats(rng, 3, 3.0)
    z, feet = QUAD.cg_above_skid_m, Support(QUAD.mass_kg * 9.8, 0.0, 0.0)
    wrench = with_friction(NOTHING, feet, velocity, rates, QUAD)
    force = np.array(wrench[:3])
    assert wrench[3:5] == pytest.approx(np.cross((0.0, 0.0, z), force)[:2], abs=1e-12)
    sliding = np.add(velocity, np.cross(rates, (0.0, 0.0, z)))
    assert force[:2] @ sliding[:2] + wrench.n * rates[2] < 0.0
    assert force[0] * sliding[0] <= 0.0
    assert force[1] * sliding[1] <= 0.0


def test_what_a_battery_loses_warms_its_resistance():
    """Ohm and energy: rest voltage times current is what the motors take and R·I², at any power it can give."""
    for power in (0.0, 50.0, 200.0, 400.0):
        voltage = battery_voltage(power, 1000.0, QUAD)
        rest = QUAD.full_v - QUAD.volt_per_as * 1000.0
        current = power / (QUAD.efficiency * voltage)
        assert rest * current == pytest.approx(power / QUAD.efficiency + QUAD.resistance_ohm * current**2)


def test_a_propeller_that_stands_takes_nothing_and_one_as_fast_again_takes_eight_times():
    assert shaft_power(0.0, QUAD) == 0.0
    assert shaft_power(800.0, QUAD) == pytest.approx(8.0 * shaft_power(400.0, QUAD))


@pytest.mark.parametrize(("slow", "governed", "moves"), [
    (1.0, 0.0, True), (-1.0, 500.0, True),  # within what the motor has
    (1.0, 1e6, False), (-1.0, 1e6, True),  # beyond it: not further, and back at once
    (-1.0, -1e6, False), (1.0, -1e6, True),  # below none alike
])  # fmt: skip
def test_the_governor_s_integral_does_not_wind_up_and_comes_back_at_once(slow, governed, moves):
    state = trim(HELICOPTER).state
    state = state._replace(speed=HELICOPTER.main_speed_rad_s - slow, governed=governed)
    air = airframe.air_motion(state, rotation_from_quaternion(1.0, 0.0, 0.0, 0.0), CALM)
    loads = RotorLoads(60.0, 4.0, 5.0, 0.1)
    rate = drive.turning_of(state, air, loads, 1.0, HELICOPTER).governed_w_s
    assert rate == pytest.approx(HELICOPTER.governor_integral_w_rad * slow if moves else 0.0)


def test_a_helicopter_s_tail_costs_power_whichever_way_it_blows():
    hover = trim(HELICOPTER)
    assert helicopter.tail_power(hover.state, CALM, HELICOPTER) > 0.0
