"""What surrounds each lane's vehicle in an epoch: the wind at its height, its own wake, the ground under it."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, procedure, replacing
from flownav.frames import Rotation, rotation_from_quaternion, to_earth
from flownav.sensors.beam import Ground, ground_height, roughness, stepped
from flownav.simulation import layout
from flownav.simulation.draws import RECIRCULATION_CHANNEL, draw
from flownav.simulation.ground import under_rotor
from flownav.simulation.layout import (
    ground_as_is,
    load_around,
    load_helicopter,
    load_recirculation,
    load_recirculation_normals,
    load_wind,
    load_wind_normals,
    multirotor_as_is,
    recirculation_as_is,
    store_around,
    store_recirculation,
    store_wind,
    vehicle_as_is,
    wind_as_is,
)
from flownav.simulation.recirculation import recirculated, step_recirculation
from flownav.simulation.wind import WindVelocity, start_wind, step_wind
from flownav.vehicle.around import CALM, Around
from flownav.vehicle.state import HelicopterState

Four = tuple[float, float, float, float]


_in_air = replacing(Around, *WindVelocity._fields, "engine")
_over_ground = replacing(Around, *Around._fields[6:19])


@procedure
def start_surroundings(work: Work, lanes: Lanes, rotors: tuple[int, ...] | None) -> None:
    """Gusts and wake from their stationary distributions, the ground where the vehicle starts; the normals of both lie
    in their rows.
    """
    for lane in range(len(lanes)):
        gusts = start_wind(load_wind_normals(work, lanes, lane), wind_as_is(work, lanes, lane))
        store_wind(work, lanes, lane, gusts)
        store_recirculation(work, lanes, lane, load_recirculation_normals(work, lanes, lane))
        store_around(work, lanes, lane, CALM)
    lay_ground(work, lanes, rotors)


@procedure
def surround(
    work: Work, lanes: Lanes, seed: int, first: int, step: int, rotors: tuple[int, ...] | None, recirculates: bool,
    engine: float,
) -> None:  # fmt: skip
    """The surroundings of this step of the noise counter; engine: 1 runs, 0 is cut."""
    draw_recirculation(work, lanes, seed, first, step, recirculates)
    lay_ground(work, lanes, rotors)
    for lane in range(len(lanes)):
        state, ground = load_helicopter(work, lanes, lane), ground_as_is(work, lanes, lane)
        wind, normals = wind_as_is(work, lanes, lane), load_wind_normals(work, lanes, lane)
        height = -state.pos_d - ground_height(state.pos_n, state.pos_e, ground)
        after, air = step_wind(load_wind(work, lanes, lane), height, normals, wind)
        store_wind(work, lanes, lane, after)
        p, here = recirculation_as_is(work, lanes, lane), load_around(work, lanes, lane)
        wake = step_recirculation(
            load_recirculation(work, lanes, lane), load_recirculation_normals(work, lanes, lane), p
        )
        store_recirculation(work, lanes, lane, wake)
        cosine = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)[8]
        plane = here.slope_n * state.pos_n + here.slope_e * state.pos_e
        hub = p.hub_above_cg_m * cosine - state.pos_d - plane - here.rotor_1_m
        air = recirculated(air, wake, hub, work[layout.THRUST * len(lanes) + lane], p)
        store_around(
            work, lanes, lane,
            _in_air(
                here, wind_n_m_s=air.wind_n_m_s, wind_e_m_s=air.wind_e_m_s, wind_d_m_s=air.wind_d_m_s,
                turn_n_rad_s=air.turn_n_rad_s, turn_e_rad_s=air.turn_e_rad_s, turn_d_rad_s=air.turn_d_rad_s,
                engine=engine,
            ),
        )  # fmt: skip


@equation
def draw_recirculation(work: Work, lanes: Lanes, seed: int, first: int, step: int, recirculates: bool) -> None:
    """The wake's normals of this step."""
    if recirculates:
        draw(work, lanes, layout.RECIRCULATION_NORMALS, 4, seed, first, step, RECIRCULATION_CHANNEL)


@equation
def lay_ground(work: Work, lanes: Lanes, rotors: tuple[int, ...] | None) -> None:
    """The ground's plane, and what lies over it under each foot and each rotor."""
    for lane in range(len(lanes)):
        state, ground = load_helicopter(work, lanes, lane), ground_as_is(work, lanes, lane)
        here = load_around(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        cosine = 1.0 / np.sqrt(1.0 + ground.slope_n * ground.slope_n + ground.slope_e * ground.slope_e)
        if rotors is None:
            vehicle = vehicle_as_is(work, lanes, lane)
            feet = under_feet(
                state, rotation, vehicle.skid_half_length_m, vehicle.skid_half_track_m, vehicle.cg_above_skid_m, ground
            )
            hub = vehicle.hub_above_cg_m
            one = under_place(state, rotation, 0.0, 0.0, -hub, vehicle.main_radius_m, ground)
            under = (one, 0.0, 0.0, 0.0, 0.0, 0.0)
        else:
            x = multirotor_as_is(work, lanes, lane)
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
        store_around(
            work, lanes, lane,
            _over_ground(
                here, slope_n=ground.slope_n, slope_e=ground.slope_e, cosine=cosine, foot_1_m=feet[0], foot_2_m=feet[1],
                foot_3_m=feet[2], foot_4_m=feet[3], rotor_1_m=under[0], rotor_2_m=under[1], rotor_3_m=under[2],
                rotor_4_m=under[3], rotor_5_m=under[4], rotor_6_m=under[5],
            ),
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
