"""Block 1, actuators: second-order servos with travel and rate limits, as seen at the blade."""

from __future__ import annotations

from typing import NamedTuple

from flownav.core.compile import clamp, equation
from flownav.vehicle.parameters import VehicleParameters


class Servo(NamedTuple):
    """A servo's constants: natural frequency [rad/s], damping ratio, rate limit [rad/s], travel, dead band [rad]."""

    frequency_rad_s: float
    damping_ratio: float
    rate_limit_rad_s: float
    min_rad: float
    max_rad: float
    dead_band_rad: float


@equation
def cyclic_servo(vehicle: VehicleParameters) -> Servo:
    """The servo of both cyclic channels."""
    return Servo(
        vehicle.cyclic_frequency_rad_s,
        vehicle.cyclic_damping_ratio,
        vehicle.cyclic_rate_limit_rad_s,
        vehicle.cyclic_min_rad,
        vehicle.cyclic_max_rad,
        vehicle.cyclic_dead_band_rad,
    )


@equation
def collective_servo(vehicle: VehicleParameters) -> Servo:
    """The servo of the collective."""
    return Servo(
        vehicle.collective_frequency_rad_s,
        vehicle.collective_damping_ratio,
        vehicle.collective_rate_limit_rad_s,
        vehicle.collective_min_rad,
        vehicle.collective_max_rad,
        vehicle.collective_dead_band_rad,
    )


@equation
def pedal_servo(vehicle: VehicleParameters) -> Servo:
    """The servo of the tail rotor's pitch."""
    return Servo(
        vehicle.pedal_frequency_rad_s,
        vehicle.pedal_damping_ratio,
        vehicle.pedal_rate_limit_rad_s,
        vehicle.pedal_min_rad,
        vehicle.pedal_max_rad,
        vehicle.pedal_dead_band_rad,
    )


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
