"""Surroundings of each lane's vehicle in an epoch: the wind at its height, its own wake, the ground under it."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, procedure, replacing
from flownav.core.frames import Rotation, rotation_from_quaternion, to_earth
from flownav.sensors.geometry import Ground, ground_height, roughness, stepped
from flownav.simulation import calls, layout
from flownav.simulation.block import RECIRCULATION_CHANNEL, draw
from flownav.simulation.ground import (
    RecirculationParameters,
    RecirculationState,
    recirculated,
    step_recirculation,
    under_rotor,
    vortex_ring,
)
from flownav.simulation.plan import SLOW
from flownav.simulation.records import Loads
from flownav.simulation.wind import WindNormals, WindParameters, WindState, WindVelocity, start_wind, step_wind
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters
from flownav.vehicle.state import CALM, Around, HelicopterState

Four = tuple[float, float, float, float]
CYCLIC = layout.AS_IS["vehicle"] + VehicleParameters._fields.index("cyclic_frequency_rad_s")


_in_air = replacing(Around, *WindVelocity._fields)
_running = replacing(Around, "engine", "motor_out", "tail_stuck")
_over_ground = replacing(Around, *Around._fields[6:19])


class Runs(NamedTuple):
    """Running parts of the vehicle, as `Around` has them."""

    engine: float
    motor_out: float
    tail_stuck: float


@procedure
def slow_servos(work: Work, lanes: Lanes) -> None:
    """From now on the cyclic's servos have SLOW of their frequency."""
    for lane in range(len(lanes)):
        work[CYCLIC * len(lanes) + lane] *= SLOW


@procedure
def start_surroundings(work: Work, lanes: Lanes, rotors: tuple[int, ...] | None) -> None:
    """Gusts and wake from their stationary distributions, the ground where the vehicle starts; the normals of both lie
    in their rows.
    """
    for lane in range(len(lanes)):
        layout.store_recirculation(work, lanes, lane, layout.load_recirculation_normals(work, lanes, lane))
        layout.store_around(work, lanes, lane, CALM)
    first_gusts(work, lanes)
    lay_ground(work, lanes, rotors)


@layout.PLANT.on_lanes(calls.first_gusts)
def first_gusts(normals: WindNormals, wind: WindParameters) -> WindState:
    """Gusts from their stationary distribution."""
    return start_wind(normals, wind)


@procedure
def surround(
    work: Work, lanes: Lanes, seed: int, first: int, step: int, rotors: tuple[int, ...] | None, recirculates: bool,
    now: Runs,
) -> None:  # fmt: skip
    """The surroundings of this step of the noise counter, and what of the vehicle runs."""
    draw_recirculation(work, lanes, seed, first, step, recirculates)
    lay_ground(work, lanes, rotors)
    blow(work, lanes, now)
    for lane in range(len(lanes)):
        normals, wake = (
            layout.load_recirculation_normals(work, lanes, lane),
            layout.load_recirculation(work, lanes, lane),
        )
        p = layout.recirculation_as_is(work, lanes, lane)
        layout.store_recirculation(work, lanes, lane, step_recirculation(wake, normals, p))
    come_back(work, lanes)


class Air(NamedTuple):
    """The gusts, and the air that they leave around the vehicle."""

    gusts: WindState
    around: Around


@layout.PLANT.on_lanes(calls.blow)
def blow(
    state: HelicopterState, ground: Ground, gusts: WindState, normals: WindNormals, wind: WindParameters,
    p: RecirculationParameters, here: Around, *, now: Runs,
) -> Air:  # fmt: skip
    """The wind at the height of the rotor, which feels the most of it, and what of the vehicle runs."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    hub = p.hub_above_cg_m * rotation[8] - state.pos_d - ground_height(state.pos_n, state.pos_e, ground)
    after, air = step_wind(gusts, hub, normals, wind)
    around = _running(here, engine=now.engine, motor_out=now.motor_out, tail_stuck=now.tail_stuck)
    return Air(after, in_air(around, air))


@layout.PLANT.on_lanes(calls.come_back)
def come_back(
    state: HelicopterState, wake: RecirculationState, p: RecirculationParameters, here: Around, loads: Loads
) -> Around:
    """The air with what comes back of the vehicle's own wake."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    cosine = rotation[8]
    plane = here.slope_n * state.pos_n + here.slope_e * state.pos_e
    hub = p.hub_above_cg_m * cosine - state.pos_d - plane - here.rotor_1_m
    air = WindVelocity(
        here.wind_n_m_s, here.wind_e_m_s, here.wind_d_m_s, here.turn_n_rad_s, here.turn_e_rad_s, here.turn_d_rad_s
    )
    returned = recirculated(air, wake, hub, loads.thrust_n, p)
    _, _, sink = to_earth(rotation, state.u, state.v, state.w)
    return in_air(here, vortex_ring(returned, wake, sink, _across(state, rotation, air), loads.thrust_n, p))


@equation
def _across(state: HelicopterState, rotation: Rotation, air: WindVelocity) -> float:
    """Horizontal speed through the air [m/s]."""
    north, east, _ = to_earth(rotation, state.u, state.v, state.w)
    north, east = north - air.wind_n_m_s, east - air.wind_e_m_s
    speed: float = np.sqrt(north * north + east * east)
    return speed


@equation
def in_air(here: Around, air: WindVelocity) -> Around:
    """The surroundings with this air."""
    return _in_air(
        here, wind_n_m_s=air.wind_n_m_s, wind_e_m_s=air.wind_e_m_s, wind_d_m_s=air.wind_d_m_s,
        turn_n_rad_s=air.turn_n_rad_s, turn_e_rad_s=air.turn_e_rad_s, turn_d_rad_s=air.turn_d_rad_s,
    )  # fmt: skip


@equation
def draw_recirculation(work: Work, lanes: Lanes, seed: int, first: int, step: int, recirculates: bool) -> None:
    """The wake's normals of this step."""
    if recirculates:
        draw(work, lanes, layout.RECIRCULATION_NORMALS, 4, seed, first, step, RECIRCULATION_CHANNEL)


@layout.PLANT.on_lanes(calls.lay_ground)
def lay_ground(
    state: HelicopterState, ground: Ground, here: Around, vehicle: VehicleParameters, x: MultirotorParameters, *,
    rotors: tuple[int, ...] | None,
) -> Around:  # fmt: skip
    """The ground's plane, and what lies over it under each foot and each rotor. rotors: of a multirotor, x."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    cosine = 1.0 / np.sqrt(1.0 + ground.slope_n * ground.slope_n + ground.slope_e * ground.slope_e)
    if rotors is None:
        feet = under_feet(
            state, rotation, vehicle.skid_half_length_m, vehicle.skid_half_track_m, vehicle.cg_above_skid_m, ground
        )
        hub = vehicle.hub_above_cg_m
        one = under_place(state, rotation, 0.0, 0.0, -hub, vehicle.main_radius_m, ground)
        under = (one, 0.0, 0.0, 0.0, 0.0, 0.0)
    else:
        feet = under_feet(state, rotation, x.skid_half_length_m, x.skid_half_track_m, x.cg_above_skid_m, ground)
        up, r = -x.rotors_above_cg_m, x.radius_m
        under = (
            under_place(state, rotation, x.x_1_m, x.y_1_m, up, r, ground),
            under_place(state, rotation, x.x_2_m, x.y_2_m, up, r, ground),
            under_place(state, rotation, x.x_3_m, x.y_3_m, up, r, ground),
            under_place(state, rotation, x.x_4_m, x.y_4_m, up, r, ground),
            under_place(state, rotation, x.x_5_m, x.y_5_m, up, r, ground),
            under_place(state, rotation, x.x_6_m, x.y_6_m, up, r, ground),
        )
    return _over_ground(
        here, slope_n=ground.slope_n, slope_e=ground.slope_e, cosine=cosine, foot_1_m=feet[0], foot_2_m=feet[1],
        foot_3_m=feet[2], foot_4_m=feet[3], rotor_1_m=under[0], rotor_2_m=under[1], rotor_3_m=under[2],
        rotor_4_m=under[3], rotor_5_m=under[4], rotor_6_m=under[5],
    )  # fmt: skip


@equation
def under_feet(
    state: HelicopterState, rotation: Rotation, length_m: float, track_m: float, below_m: float, ground: Ground
) -> Four:
    """The ground over its plane [m] under four feet: front right, front left, rear right, rear left."""
    return (
        under_foot(state, rotation, length_m, track_m, below_m, ground),
        under_foot(state, rotation, length_m, -track_m, below_m, ground),
        under_foot(state, rotation, -length_m, track_m, below_m, ground),
        under_foot(state, rotation, -length_m, -track_m, below_m, ground),
    )


@equation
def under_foot(
    state: HelicopterState, rotation: Rotation, forward_m: float, right_m: float, below_m: float, ground: Ground
) -> float:
    """The ground over its plane [m] under one foot: a step, a stone."""
    arm = to_earth(rotation, forward_m, right_m, below_m)
    north, east = state.pos_n + arm[0], state.pos_e + arm[1]
    return stepped(north, east, ground) + roughness(north, east, ground)


@equation
def under_place(
    state: HelicopterState, rotation: Rotation, forward_m: float, right_m: float, down_m: float, radius_m: float,
    ground: Ground,
) -> float:  # fmt: skip
    """The ground over its plane [m] as a rotor's disc at this place finds it."""
    arm = to_earth(rotation, forward_m, right_m, down_m)
    north, east = state.pos_n + arm[0], state.pos_e + arm[1]
    over = -(state.pos_d + arm[2]) - (ground.slope_n * north + ground.slope_e * east)
    return under_rotor(north, east, over, radius_m, ground)
