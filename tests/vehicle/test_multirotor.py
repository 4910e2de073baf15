"""The multirotor's equations: hover, motors, battery, mixer, momentum, ground; a quad and a hexa of the same schema."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from flownav.core.errors import InputError
from flownav.core.parameter_files import read_toml
from flownav.vehicle import airframe, multirotor
from flownav.vehicle.feasibility import require_multirotor
from flownav.vehicle.kinds import flattened, load_vehicle, read_kind, vehicle_file
from flownav.vehicle.motors import battery_voltage, commanded_speed, mixed, propeller_load, root_of_share
from flownav.vehicle.parameters import (
    MultirotorParameters,
    VehicleParameters,
    full_thrust,
    hover_speed,
    with_inflow_held,
)
from flownav.vehicle.rotor import multiplier
from flownav.vehicle.state import CALM, Controls, HelicopterState, MultirotorState, in_wind
from flownav.vehicle.trim import parked_multirotor, settled, trim_multirotor

NAME = Path("quad-450")
QUAD: MultirotorParameters = load_vehicle(NAME)  # type: ignore[assignment]
HIGH_M = 1e6


def changed(**tables) -> MultirotorParameters:
    """The shipped quad with other numbers, given as table={key: value}."""
    contents = read_toml(vehicle_file(NAME))
    for table, numbers in tables.items():
        contents[table] = contents[table] | numbers
    return flattened(read_kind(contents, "changed"))  # type: ignore[return-value]


HEXA: MultirotorParameters = load_vehicle(Path("hexa-550"))  # type: ignore[assignment]
VEHICLES = pytest.mark.parametrize("vehicle", [QUAD, HEXA], ids=["quad", "hexa"])


def rates(state, controls, vehicle=QUAD, wind=(0.0, 0.0, 0.0)):
    return multirotor.derivative(state, controls, in_wind(*wind), vehicle.rotor_count > 4, vehicle)


@VEHICLES
def test_in_hover_the_rotors_carry_the_weight_at_the_speed_of_their_static_thrust(vehicle):
    hover = trim_multirotor(vehicle)
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    assert hover.thrust_n == pytest.approx(weight, rel=1e-9)
    n = math.sqrt(weight / vehicle.rotor_count / (0.117 * 1.225 * 0.254**4))  # T = C_T·rho·n²·D⁴
    assert hover.speed_rad_s == pytest.approx(2.0 * math.pi * n, rel=1e-6)
    assert (hover.roll_rad, hover.pitch_rad) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert hover.power_w == pytest.approx(vehicle.rotor_count * 0.047 * 1.225 * n**3 * 0.254**5, rel=1e-6)


@pytest.mark.parametrize("velocity", [(3.0, 0.0, 0.0), (-4.0, 0.0, 0.0), (0.0, 6.0, 0.0), (2.0, 1.0, -1.0)])
@VEHICLES
def test_every_trim_is_at_rest_and_leans_into_the_wind(vehicle, velocity):
    found = trim_multirotor(vehicle, velocity, 3.0)
    rate = rates(found.state, found.controls, vehicle)
    assert max(abs(x) for x in (rate.u, rate.v, rate.w, rate.p, rate.q, rate.r, rate.speed_1)) < 1e-6
    assert found.pitch_rad * velocity[0] <= 0.0
    assert found.roll_rad * velocity[1] >= 0.0


def test_each_control_moves_what_its_name_says():
    hover = trim_multirotor(QUAD)
    for name, channel, settle in (("lat", "p", 0.1), ("lon", "q", 0.1), ("ped", "r", 0.1), ("col", "w", 0.1)):
        controls = hover.controls._replace(**{name: getattr(hover.controls, name) + 0.02})
        state = hover.state
        for _ in range(round(settle / 0.002)):
            state = multirotor.step(state, controls, CALM, 0.002, False, QUAD)
        moved = getattr(state, channel)
        assert (moved < -0.01) if channel == "w" else (moved > 0.01), name
        others = {"p", "q", "r"} - {channel}
        assert all(abs(getattr(state, other)) < 0.1 * abs(moved) for other in others), name


def test_a_motor_follows_its_command_as_a_first_order_lag():
    vehicle = QUAD._replace(resistance_ohm=0.0)  # else the voltage sags as it speeds up
    start = settled(-HIGH_M, (0.0, 0.0, 0.0), 0.0, 0.0, [300.0] * 4)
    told = commanded_speed(root_of_share(0.5), battery_voltage(0.0, 0.0, vehicle), vehicle)
    state, dt = start, 0.0005
    for _ in range(100):
        state = multirotor.step(state, Controls(0.0, 0.0, 0.5, 0.0), CALM, dt, False, vehicle)
    expected = told + (300.0 - told) * math.exp(-0.05 / 0.035)
    assert state.speed_1 == pytest.approx(expected, rel=1e-4)


@given(st.floats(0.0, 400.0), st.floats(0.0, 18000.0))
def test_the_battery_gives_what_the_motors_take(power_w, used_as):
    voltage = battery_voltage(power_w, used_as, QUAD)
    rest = 16.8 - 2.8 * used_as / 18000.0
    current = power_w / (0.75 * voltage)
    assert voltage == pytest.approx(rest - 0.040 * current, rel=1e-9)


def test_an_emptied_battery_asks_for_more_of_the_throttle():
    hover = trim_multirotor(QUAD)
    state = hover.state._replace(used=0.8 * 18000.0)
    shares = np.linspace(hover.controls.col, 0.7, 2000)
    needed = next(share for share in shares if rates(state, hover.controls._replace(col=share)).speed_1 >= 0.0)
    assert needed / hover.controls.col == pytest.approx((16.47 / (16.47 - 0.8 * 2.8)) ** 2, rel=0.02)


@given(*[st.floats(-2.0, 2.0) for _ in range(4)])
@settings(max_examples=200)
@VEHICLES
def test_the_mixer_keeps_every_rotor_in_its_range_and_tilt_before_yaw(vehicle, lon, lat, col, ped):
    hexa = vehicle.rotor_count > 4
    shares = np.array(mixed(Controls(lon, lat, col, ped), hexa, vehicle))[: int(vehicle.rotor_count)]
    assert shares.min() > QUAD.idle_share - 1e-9
    assert shares.max() < 1.0 + 1e-9
    calm = np.array(mixed(Controls(lon, lat, col, 0.0), hexa, vehicle))[: int(vehicle.rotor_count)]
    y = np.array([getattr(vehicle, f"y_{i + 1}_m") for i in range(len(shares))])
    assert -(shares * y).sum() == pytest.approx(-(calm * y).sum(), abs=1e-9)  # yaw never costs roll


def test_the_mixer_gives_what_is_asked_where_it_fits():
    shares = np.array(mixed(Controls(0.02, -0.03, 0.4, 0.01), False, QUAD))[:4]
    half = math.sqrt(0.5)
    places = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    sense = np.array([1, -1, 1, -1])
    assert shares == pytest.approx(0.4 + 0.02 * places[:, 0] + 0.03 * places[:, 1] + 0.01 * sense)


def test_axial_damping_translational_lift_and_their_torque_are_momentum_theory_s():
    blade = {"a": 5.0, "chord": 0.020, "radius": 0.127}
    speed, rho = hover_speed(QUAD), 1.225
    slope = rho * blade["a"] * 2 * blade["chord"] * blade["radius"] ** 2 / 4.0 * speed
    disc = 2.0 * rho * math.pi * blade["radius"] ** 2
    hover = full_thrust(QUAD) * (speed / QUAD.full_speed_rad_s) ** 2
    at_rest = hover / slope + math.sqrt(hover / disc)
    pitch = 1.5 * at_rest / (blade["radius"] * speed)

    def thrust(inplane, axial):
        free = at_rest + axial + pitch * inplane**2 / (blade["radius"] * speed)
        v = brentq(lambda v: disc * v * math.hypot(inplane, v - axial) - slope * (free - v), 0.0, free)
        return slope * (free - v), (v - axial) / speed

    hover_torque = propeller_load(speed, 0.0, 0.0, 0.0, HIGH_M, QUAD).torque_n_m
    still_n, still_arm = thrust(0.0, 0.0)
    for inplane, axial in ((0.0, 1.0), (0.0, -1.0), (2.0, 0.0), (4.0, 0.0), (8.0, 0.0)):
        torque_n_m = propeller_load(speed, inplane**2, axial, 0.0, HIGH_M, QUAD).torque_n_m
        pushed_n, arm = thrust(inplane, axial)
        asked = pushed_n * arm - still_n * still_arm
        assert torque_n_m - hover_torque == pytest.approx(asked, rel=0.2, abs=0.006 * hover_torque), (inplane, axial)
    for inplane, axial in ((0.0, 0.5), (0.0, -0.5), (2.0, 0.0), (4.0, 0.0), (8.0, 0.0), (3.0, -0.5)):
        ours = propeller_load(speed, inplane**2, axial, 0.0, HIGH_M, QUAD).thrust_n
        assert ours == pytest.approx(thrust(inplane, axial)[0], rel=0.03), (inplane, axial)
    held = propeller_load(speed, 0.0, 0.1, 0.0, HIGH_M, with_inflow_held(QUAD)).thrust_n - hover
    assert held == pytest.approx(slope * 0.1, rel=1e-6)


@given(st.floats(0.0, 900.0), st.floats(0.0, 200.0), st.floats(-5.0, 5.0), st.floats(0.01, 30.0))
def test_a_propellers_three_quotients_are_those_of_its_formulas(speed, inplane_sq, axial, height_m):
    load = propeller_load(speed, inplane_sq, axial, inplane_sq, height_m, QUAD)
    twice_sq = 4.0 * (QUAD.hover_inflow_m * speed) ** 2 + 1e-9
    lifted = QUAD.inplane_n_s2_m2 * inplane_sq / (1.0 + inplane_sq / twice_sq)
    free = QUAD.thrust_n_s2 * speed**2 + QUAD.axial_n_s2_m * speed * axial + lifted
    near_ground = multiplier(height_m, math.sqrt(inplane_sq), QUAD.hover_inflow_m * speed, QUAD.radius_m)
    tilt = QUAD.flap_back_m / (QUAD.radius_m**2 * max(speed, 1.0))
    assert load.thrust_n == pytest.approx(near_ground * free, rel=1e-9, abs=1e-9)
    assert load.drag_n_s_m == pytest.approx(
        QUAD.inplane_drag_n_s2_m_rad * speed + near_ground * free * tilt, rel=1e-9, abs=1e-9
    )
    assert load.hub_n_s == pytest.approx(QUAD.hub_stiffness_n_m_rad * tilt, rel=1e-9)
    changed = QUAD.torque_of_thrust_m * (free - QUAD.thrust_n_s2 * speed**2)
    assert load.torque_n_m == pytest.approx(QUAD.torque_n_m_s2 * speed**2 + changed, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(("ratio", "expected"), [(0.5, 4.0 / 3.0), (1.0, 16.0 / 15.0), (2.0, 64.0 / 63.0)])
def test_near_the_ground_a_rotor_lifts_as_cheeseman_and_bennett_say(ratio, expected):
    speed = hover_speed(QUAD)
    free = propeller_load(speed, 0.0, 0.0, 0.0, HIGH_M, QUAD).thrust_n
    assert propeller_load(speed, 0.0, 0.0, 0.0, ratio * 0.127, QUAD).thrust_n / free == pytest.approx(
        expected, rel=1e-9
    )


def test_a_tilted_quad_is_righted_by_the_ground_under_its_lower_rotors():
    hover = trim_multirotor(QUAD, height_m=0.17)
    tilted = settled(-0.2, (0.0, 0.0, 0.0), 0.1, 0.0, [hover.speed_rad_s] * 4)
    assert rates(tilted, hover.controls).p < rates(tilted._replace(pos_d=-50.0), hover.controls).p - 0.1


def test_in_free_space_angular_momentum_is_kept():
    """Without air, gravity and drag the body gives what spin the rotors take up."""
    vacuum = QUAD._replace(
        thrust_n_s2=0.0, torque_n_m_s2=1e-30, axial_n_s2_m=0.0, inplane_n_s2_m2=0.0, inplane_drag_n_s2_m_rad=0.0,
        flap_back_m=0.0, gravity_m_s2=0.0, fuselage_area_x_m2=0.0, fuselage_area_y_m2=0.0, fuselage_area_z_m2=0.0,
        resistance_ohm=0.0,
    )  # fmt: skip
    state = settled(-HIGH_M, (0.0, 0.0, 0.0), 0.0, 0.0, [400.0] * 4)._replace(p=0.8, q=-0.5, r=0.3)

    def momentum(state: MultirotorState):
        turning = state.speed_1 - state.speed_2 + state.speed_3 - state.speed_4
        body = np.array([0.0126 * state.p, 0.0130 * state.q, 0.0240 * state.r - 7e-5 * turning])
        rotation = np.array(airframe.attitude(state)).reshape(3, 3)
        return rotation @ body

    before = momentum(state)
    for _ in range(2000):
        state = multirotor.step(state, Controls(0.0, 0.0, 0.3, 0.05), CALM, 0.0005, False, vacuum)
    assert abs(state.speed_1 - state.speed_2) > 30.0  # the pedal has spun them apart
    assert momentum(state) == pytest.approx(before, abs=2e-6)


def test_drag_takes_energy_out_whichever_way_it_drifts():
    hover = trim_multirotor(QUAD)
    for wind in ((3.0, 0.0, 0.0), (0.0, -5.0, 0.0), (-2.0, 2.0, 0.0)):
        rate = rates(hover.state, hover.controls, wind=wind)
        assert rate.u * wind[0] + rate.v * wind[1] > 0.0  # pushed along with the air


def test_a_parked_multirotor_stays():
    state = parked_multirotor(QUAD)
    start = state
    for _ in range(500):
        state = multirotor.step(state, Controls(0.0, 0.0, 0.0, 0.0), CALM, 0.002, False, QUAD)
    assert np.abs(np.array(state) - np.array(start))[:13].max() < 1e-6


def test_the_midpoint_rule_has_converged_at_two_milliseconds():
    hover = trim_multirotor(QUAD, height_m=1.0)
    controls = hover.controls._replace(lat=0.02, lon=-0.03, ped=0.01, col=0.42)

    def flown(dt):
        state = hover.state
        for _ in range(round(0.4 / dt)):
            state = multirotor.step(state, controls, in_wind(1.0, -2.0, 0.2), dt, False, QUAD)
        return np.array(state)

    fine = flown(0.0005)
    assert np.abs(flown(0.002) - fine)[:13].max() < 2e-4 * np.abs(fine[:13]).max()


def test_kernels_find_the_same_first_fields_in_either_kind():
    assert MultirotorState._fields[:13] == HelicopterState._fields[:13]
    assert len(MultirotorState._fields) <= len(HelicopterState._fields)
    assert MultirotorParameters._fields[:6] == VehicleParameters._fields[:6]
    assert len(MultirotorParameters._fields) <= len(VehicleParameters._fields)


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"body": {"mass_kg": 4.0}}, "cannot hover"),
        ({"frame": {"arm_m": 0.15}}, "strike each other"),
        ({"body": {"inertia_zz_kg_m2": 0.1}}, "no rigid body"),
        ({"battery": {"empty_v": 17.0}}, "empty_v must be less"),
        ({"battery": {"resistance_ohm": 1.0}}, "cannot hover"),
    ],
)
def test_a_multirotor_that_cannot_be_is_refused(tables, words):
    with pytest.raises(InputError, match=words):
        require_multirotor(changed(**tables), "quad.toml")


def test_a_kind_or_a_count_that_is_not_known_is_refused():
    contents = read_toml(vehicle_file(NAME))
    with pytest.raises(InputError, match='kind = "airship"'.replace('"', "'") + "|airship"):
        read_kind(contents | {"kind": "airship"}, "x.toml")
    with pytest.raises(InputError, match="4 or 6 rotors"):
        changed(frame={"rotor_count": 5})
