"""The sensors that a vehicle carries for its navigator: coefficients, clocks and places, and what they look at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import Lanes, Work, equation
from flownav.frames import rotation_from_quaternion, to_earth
from flownav.sensors.barometer import BarometerParameters, BarometerTruth
from flownav.sensors.beam import BeamHit, Ground, beam_distance, ground_height
from flownav.sensors.flow import FlowParameters
from flownav.sensors.flow_camera import FlowCameraParameters
from flownav.sensors.gps_receiver import GpsReceiverParameters, GpsReceiverTruth
from flownav.sensors.inertial import InertialParameters
from flownav.sensors.magnetometer import MagnetometerParameters
from flownav.sensors.pad_camera import PadCameraParameters
from flownav.sensors.range_sensor import RangeSensorParameters
from flownav.sensors.skid_switch import SkidSwitchParameters
from flownav.simulation import layout
from flownav.simulation.layout import ground_as_is, load_helicopter
from flownav.vehicle.state import HelicopterState

EPOCH_S = 0.02
PHYSICS_PERIOD_S = 0.002
LEAST_HEIGHT_M = 0.1
PAD_SEEN = 4  # tangents forward and right, distance and reach of the mark that was found [m]; reach 0: none
SETTLED_S = 2.0  # the skids take the weight as the collective goes down


class Clock(NamedTuple):
    """When a sensor reads: every so many epochs from the first on; fitted 0: the vehicle has none."""

    fitted: int
    every: int
    first: int


class Place(NamedTuple):
    """Where a sensor's lens is, from the centre of gravity, body FRD [m]."""

    forward_m: float
    right_m: float
    down_m: float


class Onboard(NamedTuple):
    """Every sensor's coefficients, clock and place."""

    inertial: InertialParameters
    inertial_steps: int  # physics steps an inertial period
    receiver: GpsReceiverParameters
    receiver_clock: Clock
    receiver_offers_velocity: int
    flow: FlowParameters
    camera: FlowCameraParameters
    camera_clock: Clock
    camera_place: Place
    ranger: RangeSensorParameters
    range_clock: Clock
    range_place: Place
    baro: BarometerParameters
    baro_clock: Clock
    mag: MagnetometerParameters
    mag_clock: Clock
    pad: PadCameraParameters
    pad_clock: Clock
    pad_place: Place
    pad_seen: NDArray[np.float64]  # what was seen in rendered frames, rows of PAD_SEEN flattened; empty: by the model
    skid: SkidSwitchParameters
    skid_clock: Clock
    rotor_above_cg_m: float
    texture_everywhere: float  # 0: only the pad has texture
    pad_half_size_m: float


@equation
def earlier(state: HelicopterState, late_s: float) -> HelicopterState:
    """The state with the position that it had `late_s` ago, at the velocity of now: what a late reading shows."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
    return HelicopterState(
        state.pos_n - late_s * vel_n,
        state.pos_e - late_s * vel_e,
        state.pos_d - late_s * vel_d,
        *state[3:],
    )


@equation
def receiver_truth(state: HelicopterState, late_s: float) -> GpsReceiverTruth:
    """How the vehicle moves, as its GPS receiver feels it; late_s: how much older its fixes are than it says."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
    return GpsReceiverTruth(
        state.pos_n - late_s * vel_n, state.pos_e - late_s * vel_e, state.pos_d - late_s * vel_d, vel_n, vel_e, vel_d,
        state.p, state.q, state.r,
    )  # fmt: skip


@equation
def place_of(state: HelicopterState, place: Place) -> tuple[float, float, float]:
    """Where a lens is, NED [m]."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    arm = to_earth(rotation, place.forward_m, place.right_m, place.down_m)
    return state.pos_n + arm[0], state.pos_e + arm[1], state.pos_d + arm[2]


@equation
def beam_of(state: HelicopterState, place: Place, ground: Ground) -> BeamHit:
    """What a lens looks at along body down."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    north, east, down = place_of(state, place)
    return beam_distance(north, east, -down, rotation, ground)


@equation
def baro_truth(work: Work, lanes: Lanes, lane: int, s: Onboard) -> BarometerTruth:
    """Altitude, height of the rotor over the ground, and its thrust."""
    state = load_helicopter(work, lanes, lane)
    over = s.rotor_above_cg_m - state.pos_d - ground_height(state.pos_n, state.pos_e, ground_as_is(work, lanes, lane))
    return BarometerTruth(-state.pos_d, over, work[layout.THRUST * len(lanes) + lane])
