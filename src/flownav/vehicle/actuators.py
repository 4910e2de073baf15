"""Block 1, actuators: second-order servos with travel and rate limits, as seen at the blade."""

from __future__ import annotations

from typing import NamedTuple

from flownav.compile import clamp, equation


class Servo(NamedTuple):
    """A servo's constants: natural frequency [rad/s], damping ratio, rate limit [rad/s], travel, dead band [rad]."""

    frequency_rad_s: float
    damping_ratio: float
    rate_limit_rad_s: float
    min_rad: float
    max_rad: float
    dead_band_rad: float


@equation
def acceleration(position: float, rate: float, command: float, servo: Servo) -> float:
    """Angular acceleration of a servo [rad/s2] towards its command [rad] (reference section 2, block 1).

    y'' = ω²(clip(u) - y) - 2ζω·y', written as a rate loop about a position loop,
    y'' = 2ζω·(clip(ω/(2ζ)·(clip(u) - y)) - y'), so that the rate limit holds without a stop in the equation:
    a rate within the limit stays within it. Slop of servo and linkage is a dead band: an error is answered but for
    its first `dead_band_rad`, either way.
    """
    error = clamp(command, servo.min_rad, servo.max_rad) - position
    answered = error - clamp(error, -servo.dead_band_rad, servo.dead_band_rad)
    position_gain = servo.frequency_rad_s / (2.0 * servo.damping_ratio)
    rate_gain = 2.0 * servo.damping_ratio * servo.frequency_rad_s
    demanded = clamp(position_gain * answered, -servo.rate_limit_rad_s, servo.rate_limit_rad_s)
    return rate_gain * (demanded - rate)


@equation
def blade_angle(position: float, servo: Servo) -> float:
    """The blade angle [rad]: the servo's position up to the mechanical stop."""
    return clamp(position, servo.min_rad, servo.max_rad)
