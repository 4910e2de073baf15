"""Symmetries of either vehicle: mirrors, quarter-turns, the turn of north, motion of a place of the body."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from flownav.core.compile import squared
from flownav.core.frames import quaternion_product, rotation_from_quaternion, to_body
from flownav.vehicle import airframe, helicopter, multirotor
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters
from flownav.vehicle.skids import support
from flownav.vehicle.state import CALM, Around, Controls, HelicopterState, MultirotorState, Six
from flownav.vehicle.trim import trim_multirotor

QUAD: MultirotorParameters = load_vehicle(Path("quad-450"))  # type: ignore[assignment]
HEXA: MultirotorParameters = load_vehicle(Path("hexa-550"))  # type: ignore[assignment]
HELICOPTER: VehicleParameters = load_vehicle()  # type: ignore[assignment]
SQUARE = QUAD._replace(
    inertia_yy_kg_m2=QUAD.inertia_xx_kg_m2, fuselage_area_y_m2=QUAD.fuselage_area_x_m2,
    skid_half_length_m=QUAD.skid_half_track_m, hub_stiffness_n_m_rad=4.0, flap_back_m=0.02, rotors_above_cg_m=0.05,
)  # fmt: skip
TAILLESS = HELICOPTER._replace(
    tail_thrust_slope_n_s_m=0.0, tail_profile_torque_n_m=0.0, vertical_fin_tail_inflow_fraction=0.0,
    main_speed_rad_s=HELICOPTER.main_speed_rad_s,
)  # fmt: skip
SEEDS = pytest.mark.parametrize("seed", range(6))
# how a vehicle's fields change where right and left are exchanged, and where front and rear are
LEFT_RIGHT = {"pos_e", "v", "qx", "qz", "p", "r", "b1", "lat", "lat_rate", "wind_e_m_s", "slope_e", "turn_n_rad_s",
              "turn_d_rad_s"}  # fmt: skip
FRONT_REAR = {"pos_n", "u", "qy", "qz", "q", "r", "wind_n_m_s", "slope_n", "turn_e_rad_s", "turn_d_rad_s"}


def drawn(rng: np.random.Generator, kind, **held):
    """A state of a kind near the ground, of every motion at once; in `Around`, wind, gusts' turning and a slope."""
    q = rng.normal(size=4) * 0.15 + [1.0, 0.0, 0.0, 0.0]
    q /= np.linalg.norm(q)
    values = dict(zip(kind._fields, rng.normal(size=len(kind._fields)), strict=True))
    values |= dict(zip(("qw", "qx", "qy", "qz"), q, strict=True)) | {"pos_d": -0.15}
    return kind(**{**values, **held})


def drawn_around(rng: np.random.Generator) -> Around:
    n, e = rng.normal(size=2) * 0.05
    winds = dict(zip(Around._fields[:6], rng.normal(size=6), strict=True))
    slope = {"slope_n": n, "slope_e": e, "cosine": 1.0 / math.sqrt(1.0 + n * n + e * e)}
    ground = dict(zip(Around._fields[9:19], 0.02 * rng.normal(size=10), strict=True))
    return Around(**winds, **slope, **ground, engine=1.0, motor_out=0.0, tail_stuck=0.0)


def quad_state(rng: np.random.Generator, vehicle: MultirotorParameters) -> MultirotorState:
    count = int(vehicle.rotor_count)
    speeds = {f"speed_{k + 1}": float(rng.uniform(300.0, 600.0)) if k < count else 0.0 for k in range(6)}
    return drawn(rng, MultirotorState, used=100.0, **speeds)


def mirrored(values, flips: set[str], swaps: dict[str, str]):
    """The fields as they are in a mirror: those that flip have the other sign, those that swap each other's value."""
    both = swaps | {other: one for one, other in swaps.items()}
    found = {name: getattr(values, both.get(name, name)) for name in values._fields}
    return type(values)(**{name: -value if name in flips else value for name, value in found.items()})


def swapped(pairs: dict[int, int], *stems: str) -> dict[str, str]:
    return {stem.format(one): stem.format(other) for one, other in pairs.items() for stem in stems}


MIRRORS = [
    (QUAD, LEFT_RIGHT, {1: 4, 2: 3}, {1: 2, 3: 4}, "lat"),
    (SQUARE, LEFT_RIGHT, {1: 4, 2: 3}, {1: 2, 3: 4}, "lat"),
    (QUAD, FRONT_REAR, {1: 2, 3: 4}, {1: 3, 2: 4}, "lon"),
    (SQUARE, FRONT_REAR, {1: 2, 3: 4}, {1: 3, 2: 4}, "lon"),
    (HEXA, LEFT_RIGHT, {1: 6, 2: 5, 3: 4}, {1: 2, 3: 4}, "lat"),
]


@SEEDS
@pytest.mark.parametrize(("vehicle", "flips", "rotors", "feet", "channel"), MIRRORS)
def test_in_a_mirror_a_multirotor_flies_the_mirrored_way(seed, vehicle, flips, rotors, feet, channel):
    """Rotors that turn left stand where those that turn right stood: a mirrored spin is the other one."""
    rng = np.random.default_rng(seed)
    state, around, hexa = quad_state(rng, vehicle), drawn_around(rng), vehicle.rotor_count > 4
    controls = Controls(*(0.05 * rng.normal(size=4) + [0.0, 0.0, 0.5, 0.0]))
    rate = multirotor.derivative(state, controls, around, hexa, vehicle)
    swaps = swapped(rotors, "speed_{}")
    other = multirotor.derivative(
        mirrored(state, flips, swaps),
        mirrored(controls, {channel, "ped"}, {}),
        mirrored(around, flips, swapped(rotors, "rotor_{}_m") | swapped(feet, "foot_{}_m")),
        hexa,
        vehicle,
    )
    assert np.array(other) == pytest.approx(np.array(mirrored(rate, flips, swaps)), rel=1e-9, abs=1e-9)


@SEEDS
def test_a_square_quad_that_is_turned_by_a_quarter_feels_the_same(seed):
    """Forces, moments and hub moments turn along; torques change sides: each rotor stands where its neighbour was."""
    rng = np.random.default_rng(seed)
    speeds = Six(*rng.uniform(300.0, 600.0, 4), 0.0, 0.0)
    u, v, w, p, q, r = rng.normal(size=6)
    down = np.array([0.1, -0.2, 1.0]) / np.linalg.norm([0.1, -0.2, 1.0])
    heights = 0.05 * rng.normal(size=4)
    turning, spinning, below = float(rng.normal()) * 300.0, float(rng.normal()) * 50.0, -0.2

    def felt(speeds, velocity, rates, down, heights):
        air = airframe.AirMotion(*velocity, *rates)
        around = CALM._replace(**{f"rotor_{k + 1}_m": heights[k] for k in range(4)})
        loads = multirotor.rotor_loads(speeds, below, tuple(down), tuple(down), air, False, around, SQUARE)
        return loads, multirotor.free_wrench(loads, turning, spinning, tuple(down), air, SQUARE)

    def quarter(vector):  # clockwise from above: what pointed forward points right
        return (-vector[1], vector[0], vector[2])

    loads, wrench = felt(speeds, (u, v, w), (p, q, r), down, heights)
    turned_loads, turned = felt(
        Six(speeds.four, speeds.one, speeds.two, speeds.three, 0.0, 0.0),
        quarter((u, v, w)), quarter((p, q, r)), quarter(down), heights[[3, 0, 1, 2]],
    )  # fmt: skip
    assert turned_loads[:3] == pytest.approx(loads[:3], rel=1e-12)
    assert (turned_loads.roll_n_m, turned_loads.pitch_n_m) == pytest.approx((-loads.pitch_n_m, loads.roll_n_m))
    assert turned_loads.yaw_n_m == pytest.approx(-loads.yaw_n_m)
    assert turned[:3] == pytest.approx(quarter(wrench[:3]), rel=1e-12)
    assert turned[3:5] == pytest.approx(quarter(wrench[3:])[:2], rel=1e-9, abs=1e-12)


def test_a_square_quad_trims_to_the_right_as_it_trims_forward():
    for speed in (1.0, 5.0, 9.0):
        ahead, aside = trim_multirotor(SQUARE, (speed, 0.0, 0.0)), trim_multirotor(SQUARE, (0.0, speed, 0.0))
        assert aside.roll_rad == pytest.approx(-ahead.pitch_rad, abs=1e-9)
        assert (aside.pitch_rad, ahead.roll_rad) == pytest.approx((0.0, 0.0), abs=1e-9)
        assert aside.controls.lat == pytest.approx(-ahead.controls.lon, abs=1e-9)
        assert aside.power_w == pytest.approx(ahead.power_w, rel=1e-9)
        assert ahead.controls.lon != 0.0


@SEEDS
def test_a_hub_that_holds_its_blades_is_a_hub_that_stands_higher(seed):
    """The tilted disc's thrust T leans by as much as the stiff hub is bent: K is T·h of a hub h higher."""
    rng = np.random.default_rng(seed)
    u, v, w = rng.normal(size=3) * 3.0
    speeds = Six(*(float(x) for x in rng.uniform(450.0, 450.0, 4)), 0.0, 0.0)
    air = airframe.AirMotion(u, v, w, 0.0, 0.0, 0.0)
    level = (0.0, 0.0, 1.0)

    def moments(**changes):
        vehicle = SQUARE._replace(
            inplane_drag_n_s2_m_rad=0.0, fuselage_area_x_m2=0.0, fuselage_area_y_m2=0.0, **changes
        )
        loads = multirotor.rotor_loads(speeds, -1e6, level, level, air, False, CALM, vehicle)
        wrench = multirotor.free_wrench(loads, 0.0, 0.0, level, air, vehicle)
        return loads.thrust_n / 4.0, (wrench.l, wrench.m)

    thrust, stiff = moments()
    higher = SQUARE.rotors_above_cg_m + SQUARE.hub_stiffness_n_m_rad / thrust
    assert stiff == pytest.approx(moments(hub_stiffness_n_m_rad=0.0, rotors_above_cg_m=higher)[1], rel=1e-9)
    assert np.abs(stiff).max() > 1e-3


@SEEDS
def test_what_a_rotor_gives_and_what_it_feels_are_of_one_place(seed):
    """Virtual power: a change of the thrusts has the power of its wrench, and that of each thrust along its own air."""
    rng = np.random.default_rng(seed)
    still = airframe.AirMotion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    moving = airframe.AirMotion(0.0, 0.0, *(float(x) for x in rng.normal(size=3)), 0.0)
    vehicle = QUAD._replace(inplane_n_s2_m2=0.0, axial_n_s2_m=QUAD.axial_n_s2_m)
    level = (0.0, 0.0, 1.0)
    speeds = Six(*(float(x) for x in rng.uniform(300.0, 600.0, 4)), 0.0, 0.0)
    before, after = (
        multirotor.rotor_loads(speeds, -1e6, level, level, air, False, CALM, vehicle) for air in (still, moving)
    )
    lifted = after.thrust_n - before.thrust_n
    rolled, pitched = after.roll_n_m - before.roll_n_m, after.pitch_n_m - before.pitch_n_m
    power = -lifted * moving.w + rolled * moving.p + pitched * moving.q
    places = [(getattr(QUAD, f"x_{k}_m"), getattr(QUAD, f"y_{k}_m")) for k in (1, 2, 3, 4)]
    axial = [moving.w + np.cross((moving.p, moving.q, 0.0), (x, y, 0.0))[2] for x, y in places]
    expected = -sum(QUAD.axial_n_s2_m * speed * squared(a) for speed, a in zip(speeds, axial, strict=False))
    assert power == pytest.approx(expected, rel=1e-9)
    assert power < 0.0  # damped, whichever way it moves


@SEEDS
def test_without_its_tail_rotor_a_helicopter_flies_the_mirrored_way_in_a_mirror(seed):
    """But for the main rotor's torque, which turns the nose left in either world, and gusts' turning of its blades."""
    rng = np.random.default_rng(seed)
    held = {"col": 0.07, "ped": 0.0, "ped_rate": 0.0, "inflow": 3.0, "speed": TAILLESS.main_speed_rad_s,
            "governed": 900.0, "lon": 0.02, "lat": -0.01, "a1": 0.03, "b1": -0.02, "lon_rate": 0.1, "lat_rate": 0.3,
            "col_rate": 0.0}  # fmt: skip
    state = drawn(rng, HelicopterState, pos_d=-float(rng.uniform(0.4, 2.0)), **held)
    around = drawn_around(rng)._replace(turn_n_rad_s=0.0, turn_e_rad_s=0.0, turn_d_rad_s=0.0)
    controls = Controls(0.01, -0.02, 0.07, 0.0)
    rate = helicopter.derivative(state, controls, around, TAILLESS)
    feet = swapped({1: 2, 3: 4}, "foot_{}_m")
    other = helicopter.derivative(
        mirrored(state, LEFT_RIGHT, {}), mirrored(controls, {"lat"}, {}), mirrored(around, LEFT_RIGHT, feet), TAILLESS
    )
    expected = mirrored(rate, LEFT_RIGHT, {})
    torque = helicopter.outputs(state, around, TAILLESS).torque_n_m + TAILLESS.rotor_inertia_kg_m2 * rate.speed
    twice = -2.0 * torque / TAILLESS.inertia_zz_kg_m2
    assert np.array(other) == pytest.approx(np.array(expected._replace(r=expected.r + twice)), rel=1e-9, abs=1e-9)


@SEEDS
def test_the_tail_feels_the_air_of_its_own_place(seed):
    u, v, w, p, q, r = np.random.default_rng(seed).normal(size=6)
    arm = (-HELICOPTER.tail_behind_cg_m, 0.0, -HELICOPTER.tail_above_cg_m)
    seen = np.array([u, v, w]) + np.cross((p, q, r), arm)
    air = airframe.AirMotion(u, v, w, p, q, r)
    assert airframe.tail_sideslip(air, HELICOPTER) == pytest.approx(seen[1], rel=1e-12)
    moment = np.cross(arm, (0.0, 1.0, 0.0))
    nothing, none = airframe.Wrench(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    wrench = airframe.flight_wrench(nothing, 1.0, 0.0, none, none, HELICOPTER)
    assert wrench[3:] == pytest.approx(moment)


@SEEDS
def test_a_foot_sinks_as_its_own_place_does(seed):
    """A slope, every rate and every velocity at once: what each foot feels is normal·(v + w × r)."""
    rng = np.random.default_rng(seed)
    normal = np.array([0.15, -0.1, 1.0]) / np.linalg.norm([0.15, -0.1, 1.0])
    velocity, rates = 0.1 * rng.normal(size=3), rng.normal(size=3)
    x, y, z = QUAD.skid_half_length_m, QUAD.skid_half_track_m, QUAD.cg_above_skid_m
    below = -0.3
    around = CALM._replace(cosine=1.0)
    vehicle = QUAD._replace(skid_stiffness_n_m=2000.0, skid_damping_n_s_m=50.0, skid_friction_coefficient=0.5)
    low = 0.4  # deep enough that every foot presses in full
    found = support(below + low, tuple(normal), tuple(velocity), tuple(rates), around, vehicle)
    forces = {}
    for name, place in {"fr": (x, y, z), "fl": (x, -y, z), "rr": (-x, y, z), "rl": (-x, -y, z)}.items():
        depth, sink = below + low + normal @ place, normal @ (velocity + np.cross(rates, place))
        forces[name] = 2000.0 * depth + 50.0 * sink
    assert min(forces.values()) > 0.0
    assert found.normal_n == pytest.approx(sum(forces.values()), rel=1e-9)
    assert found.forward_n_m == pytest.approx((forces["fr"] + forces["fl"] - forces["rr"] - forces["rl"]) * x, rel=1e-9)
    assert found.right_n_m == pytest.approx((forces["fr"] + forces["rr"] - forces["fl"] - forces["rl"]) * y, rel=1e-9)


@SEEDS
@pytest.mark.parametrize("kind", ["helicopter", "multirotor"])
def test_where_north_is_matters_to_nobody(seed, kind):
    """Vehicle, wind, gusts and slope turned about down: every rate is as it was, and the way over the ground turns."""
    rng = np.random.default_rng(seed)
    angle = float(rng.uniform(-math.pi, math.pi))
    cosine, sine = math.cos(angle), math.sin(angle)

    def turned(pair):
        return cosine * pair[0] - sine * pair[1], sine * pair[0] + cosine * pair[1]

    around = drawn_around(rng)
    if kind == "multirotor":
        state = quad_state(rng, QUAD)
    else:
        state = drawn(rng, HelicopterState, pos_d=-0.4, col=0.07, ped=0.05, inflow=3.0, speed=160.0, governed=900.0)
    wind, turn, slope = (
        turned(pair) for pair in (
            (around.wind_n_m_s, around.wind_e_m_s), (around.turn_n_rad_s, around.turn_e_rad_s),
            (around.slope_n, around.slope_e),
        )
    )  # fmt: skip
    elsewhere = around._replace(
        wind_n_m_s=wind[0], wind_e_m_s=wind[1], turn_n_rad_s=turn[0], turn_e_rad_s=turn[1], slope_n=slope[0],
        slope_e=slope[1],
    )  # fmt: skip
    place = turned((state.pos_n, state.pos_e))
    half = (math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle))
    q = quaternion_product(half, (state.qw, state.qx, state.qy, state.qz))
    other = state._replace(pos_n=place[0], pos_e=place[1], qw=q[0], qx=q[1], qy=q[2], qz=q[3])

    def rate(state, around):
        if kind == "multirotor":
            return multirotor.derivative(state, Controls(0.02, -0.03, 0.5, 0.04), around, False, QUAD)
        return helicopter.derivative(state, Controls(0.01, 0.02, 0.07, 0.05), around, HELICOPTER)

    before, after = rate(state, around), rate(other, elsewhere)
    assert after[:2] == pytest.approx(turned(before[:2]), rel=1e-9, abs=1e-9)
    assert after[2:6] == pytest.approx(before[2:6], rel=1e-9, abs=1e-7)
    assert after[10:] == pytest.approx(before[10:], rel=1e-9, abs=1e-6)
    assert after[6:10] == pytest.approx(quaternion_product(half, before[6:10]), rel=1e-9, abs=1e-9)


def test_a_rotor_is_the_nearer_to_the_ground_the_lower_its_side_is():
    """The ground under each rotor is seen along the plane's normal, whichever way the vehicle leans."""
    speeds, air = Six(400.0, 400.0, 400.0, 400.0, 0.0, 0.0), airframe.AirMotion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for roll, pitch in ((0.2, 0.0), (-0.2, 0.0), (0.0, 0.2), (0.0, -0.2)):
        q = (math.cos(0.5 * (roll + pitch)), math.sin(0.5 * roll), math.sin(0.5 * pitch), 0.0)
        down = to_body(rotation_from_quaternion(*q), 0.0, 0.0, 1.0)
        loads = multirotor.rotor_loads(speeds, -0.25, down, down, air, False, CALM, QUAD)
        # rolled right, the right rotors are low, lift more, and roll it back to the left
        assert loads.roll_n_m * roll + loads.pitch_n_m * pitch < -1e-4, (roll, pitch)


@SEEDS
def test_a_rotor_s_disc_does_not_tell_back_from_right(seed):
    """Quarter-turns of speed, cyclic, rates, and of gusts that turn the air: flapping back becomes flapping right."""
    rng = np.random.default_rng(seed)
    u, v, w, p, q, a1, b1, lon, lat, turn_x, turn_y = (float(x) for x in 0.1 * rng.normal(size=11))
    held = dict.fromkeys(HelicopterState._fields, 0.0) | {
        "qw": 1.0, "pos_d": -50.0, "col": 0.07, "ped": 0.1, "inflow": 3.5, "speed": 150.0, "w": w, "r": 0.3,
    }  # fmt: skip

    def flapping(**motion) -> tuple[float, float]:
        around = CALM._replace(turn_n_rad_s=motion.pop("turn_x"), turn_e_rad_s=motion.pop("turn_y"))
        state = HelicopterState(**(held | motion))
        rate = helicopter.derivative(state, Controls(0.0, 0.0, 0.07, 0.1), around, HELICOPTER)
        return rate.a1, rate.b1

    back, right = flapping(u=u, v=v, p=p, q=q, a1=a1, b1=b1, lon=lon, lat=lat, turn_x=turn_x, turn_y=turn_y)
    turned = flapping(u=-v, v=u, p=-q, q=p, a1=b1, b1=-a1, lon=lat, lat=-lon, turn_x=-turn_y, turn_y=turn_x)
    assert turned == pytest.approx((right, -back), rel=1e-9, abs=1e-12)
