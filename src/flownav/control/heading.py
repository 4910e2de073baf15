"""The heading that is held: north, until a wind pushes; then the nose goes into it.

A wind from the side costs four times the tilt of one from ahead, and one from behind turns the vehicle about with its
fin, whatever the pedal does. What the wind pushes is felt: the disturbance observer's acceleration, which tilt does not
explain, averaged over PUSH_S. Where that is more than any error of trim or attitude would be, the heading turns towards
where it comes from, at into_wind_rad_s at most; a lighter wind changes nothing. (The same rule is PX4's and ArduPilot's
weathervaning, by the tilt that they need.)
"""

from typing import NamedTuple

from flownav.control.gains import AutopilotGains
from flownav.core.compile import clamp, equation, larger, magnitude
from flownav.core.frames import Rotation, heading_cosine_sine

PUSH_S = 3.0  # chosen: longer than gusts, shorter than a landing
PUSHES_M_S2 = 0.35  # a side wind of 5 m/s, one from behind of 7; trim and attitude err by half of it (control.md)
PUSHES_WELL_M_S2 = 0.6  # from here on it turns as fast as it may
TURN_RAD_S2 = 0.2  # chosen: the turn begins and ends within a second


class Facing(NamedTuple):
    """The heading that is held, as its cosine and sine; how it turns; what pushes, forward and to the right [m/s2]."""

    heading_north: float
    heading_east: float
    turn_rad_s: float
    push_forward: float
    push_right: float


@equation
def wanted_turn(facing: Facing, gains: AutopilotGains) -> float:
    """Rate of the heading into the wind [rad/s], positive to the right; from behind, the way round that it began."""
    aside, behind = how_hard(magnitude(facing.push_right)), how_hard(facing.push_forward)
    side = -1.0 if facing.push_right > 0.0 else 1.0
    begun = 1.0 if facing.turn_rad_s > 0.0 else -1.0
    way = begun if behind > aside and facing.turn_rad_s != 0.0 else side
    return way * larger(aside, behind) * gains.into_wind_rad_s


@equation
def how_hard(push_m_s2: float) -> float:
    """From 0, nothing that counts, to 1."""
    return clamp((push_m_s2 - PUSHES_M_S2) / (PUSHES_WELL_M_S2 - PUSHES_M_S2), 0.0, 1.0)


@equation
def faced(
    before: Facing, gust_forward: float, gust_right: float, in_air: bool, gains: AutopilotGains, dt: float
) -> Facing:
    """One period of the outer loop further; the push turns with the vehicle. Weight on the skids ends a turn."""
    angle, share = before.turn_rad_s * dt, dt / PUSH_S
    forward = before.push_forward + angle * before.push_right
    right = before.push_right - angle * before.push_forward
    wanted = wanted_turn(before, gains)
    turn = before.turn_rad_s + clamp(wanted - before.turn_rad_s, -TURN_RAD_S2 * dt, TURN_RAD_S2 * dt)
    north = before.heading_north - angle * before.heading_east
    east = before.heading_east + angle * before.heading_north
    unit = 1.5 - 0.5 * (north * north + east * east)
    return Facing(
        north * unit,
        east * unit,
        turn if in_air else 0.0,
        forward + share * (gust_forward - forward) if in_air else 0.0,
        right + share * (gust_right - right) if in_air else 0.0,
    )


@equation
def heading_error(rotation: Rotation, north: float, east: float) -> float:
    """Sine of the angle from the heading to the one that is held; beyond a right angle 1, the nearer way."""
    cosine, sine = heading_cosine_sine(rotation)
    along, across = north * cosine + east * sine, east * cosine - north * sine
    beyond = 1.0 if across > 0.0 else -1.0
    return across if along > 0.0 else beyond
