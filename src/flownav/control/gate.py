"""The last metres of a precision landing: what is brought over the pad, and the gate before the touchdown."""

from __future__ import annotations

from flownav.control.gains import AutopilotGains
from flownav.core.compile import clamp, equation, smaller
from flownav.core.frames import Rotation, heading_cosine_sine

FORESEEN_S = 1.0  # how far ahead the last metre's gate looks


@equation
def skids_beside(rotation: Rotation, gains: AutopilotGains) -> tuple[float, float]:
    """How far the middle of the skids hangs north and east of the centre of gravity in trimmed hover [m].

    A helicopter hovers with a roll against its tail rotor and stands level: what touches the ground first, and where it
    comes to rest, is the skids.
    """
    forward = gains.skids_below_cg_m * gains.pitch_trim_sine
    left = gains.skids_below_cg_m * gains.roll_trim_sine
    cos_heading, sin_heading = heading_cosine_sine(rotation)
    return cos_heading * forward + sin_heading * left, sin_heading * forward - cos_heading * left


@equation
def misaligned(
    off_n: float, off_e: float, vel_n: float, vel_e: float, height_m: float, waited_s: float, gains: AutopilotGains
) -> bool:
    """Whether the last metre's gate is shut: the skids would not touch near enough to the pad's middle.

    off_n, off_e: from the middle of the skids to the reference [m]; vel_n, vel_e: over the ground [m/s]; height_m: of
    the skids. What counts is where the skids will be when they touch, a second ahead at most. What is near enough grows
    with the time waited, for no wind lets a vehicle wait for ever.
    """
    until_s = smaller(height_m / gains.land_speed_m_s, FORESEEN_S)
    beside_n, beside_e = off_n - until_s * vel_n, off_e - until_s * vel_e
    patience = 1.0 + waited_s / gains.align_patience_s
    radius, speed = gains.align_radius_m * patience, gains.align_speed_m_s * patience
    far = beside_n * beside_n + beside_e * beside_e > radius * radius
    fast = vel_n * vel_n + vel_e * vel_e > speed * speed
    return (far or fast) and height_m < gains.align_height_m and height_m > gains.commit_height_m


@equation
def descent_limit(waiting: bool, gate_m: float, height_m: float, vel_d: float, gains: AutopilotGains) -> float:
    """How fast the vehicle may descend [m/s]: slowly near the pad, and not at all while it waits at the gate.

    It climbs back to the height of the gate, gate_m, and waits there: gusts would else sink it through. vel_d: the
    reference's.
    """
    slow = gains.land_speed_m_s if height_m < gains.land_height_m else gains.climb_limit_m_s + vel_d
    back = clamp(gains.height_gain * (height_m - gate_m), -gains.land_speed_m_s, 0.0)
    return back if waiting else slow
