"""The sensors that a vehicle carries for its navigator: coefficients, clocks and places, and what they look at."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import equation
from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.sensors.flow import FlowParameters
from flownav.sensors.geometry import BeamHit, Ground, beam_distance
from flownav.vehicle.state import HelicopterState

EPOCH_S = 0.02
PHYSICS_PERIOD_S = 0.002
LEAST_HEIGHT_M = 0.1
PAD_SEEN = 4  # tangents forward and right, distance and reach of the mark that was found [m]; reach 0: none
SETTLED_S = 2.0  # the skids take the weight as the collective goes down


class Clock(NamedTuple):
    """When a sensor reads: every so many epochs from the first on; fitted: how many readings it then gives, or none."""

    fitted: int
    every: int
    first: int


ALWAYS, NEVER = Clock(fitted=1, every=1, first=0), Clock(fitted=0, every=1, first=0)


class Place(NamedTuple):
    """Where a sensor's lens is, from the centre of gravity, body FRD [m]."""

    forward_m: float
    right_m: float
    down_m: float


class Fitting(NamedTuple):
    """One sensor as it is carried. p: coefficients by its datasheet; place: of its lens, None where it has none."""

    p: Any
    clock: Clock
    place: Place | None


class Onboard(NamedTuple):
    """Every sensor as it is carried, and what they look at. carried: a `Fitting` by each sensor's name."""

    carried: Any
    inertial_steps: int  # physics steps an inertial period
    flow: FlowParameters
    pad_seen: NDArray[np.float64]  # what was seen in rendered frames, rows of PAD_SEEN flattened; empty: by the model
    rotor_above_cg_m: float
    texture_everywhere: float  # 0: only the pad has texture
    pad_half_size_m: float


def without(onboard: Onboard, *names: str) -> Onboard:
    """The same vehicle that does not carry these sensors."""
    fittings = {name: getattr(onboard.carried, name) for name in names}
    gone = {name: one._replace(clock=one.clock._replace(fitted=0)) for name, one in fittings.items()}
    return onboard._replace(carried=onboard.carried._replace(**gone))


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
