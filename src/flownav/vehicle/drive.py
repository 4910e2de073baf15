"""Servos, and the drive train: the rotor's speed under motor and governor, the main rotor's inflow, which takes time.

Inflow: the air that a rotor drags along has a mass, m_a·v' = T - 2ρA·η_w·v·D (Carpenter and Fridovich, NACA TN 3044:
m_a = 0.849·ρπR³; Pitt and Peters: 0.543·ρπR³), whose balance is equation 2.2 of the reference. About hover it answers
the collective within m_a/(4ρA·v + thrust slope).

Speed: J·Ω' = P/Ω - Q_main - n·Q_tail. The governor asks for P = K·(Ω0 - Ω) + ∫ K_i·(Ω0 - Ω) and gets between none, for
the freewheel lets the rotor overrun, and what the motor has. The airframe feels the main rotor's torque and what turns
it faster, Q_main + J·Ω': without the engine nothing but the tail's drag is left of it.

Servos (block 1) are of second order with travel and rate limits, as seen at the blade.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, equation, write_function
from flownav.vehicle.airframe import AirMotion
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.rotor import speed_ratio
from flownav.vehicle.state import HelicopterState, RotorLoads


class Servo(NamedTuple):
    """A servo's constants: natural frequency [rad/s], damping ratio, rate limit [rad/s], travel, dead band [rad]."""

    frequency_rad_s: float
    damping_ratio: float
    rate_limit_rad_s: float
    minimum_rad: float
    maximum_rad: float
    dead_band_rad: float


def servo_of(control: str) -> Callable[[VehicleParameters], Servo]:
    """An equation: the servo of a control, of the parameters that begin with its name."""
    arguments = ", ".join(f"vehicle.{control}_{name}" for name in Servo._fields)
    return equation(write_function("servo", f"def servo(vehicle):\n    return Servo({arguments})\n", {"Servo": Servo}))


cyclic_servo, collective_servo, pedal_servo = servo_of("cyclic"), servo_of("collective"), servo_of("pedal")


@equation
def acceleration(position: float, rate: float, command: float, servo: Servo) -> float:
    """Angular acceleration of a servo [rad/s2] towards its command [rad] (reference section 2, block 1).

    y'' = ω²(clip(u) - y) - 2ζω·y', written as a rate loop about a position loop,
    y'' = 2ζω·(clip(ω/(2ζ)·(clip(u) - y)) - y'), so that the rate limit holds without a stop in the equation:
    a rate within the limit stays within it. Slop of servo and linkage is a dead band: an error is answered but for
    its first `dead_band_rad`, either way.
    """
    error = clamp(command, servo.minimum_rad, servo.maximum_rad) - position
    answered = error - clamp(error, -servo.dead_band_rad, servo.dead_band_rad)
    position_gain = servo.frequency_rad_s / (2.0 * servo.damping_ratio)
    rate_gain = 2.0 * servo.damping_ratio * servo.frequency_rad_s
    demanded = clamp(position_gain * answered, -servo.rate_limit_rad_s, servo.rate_limit_rad_s)
    return rate_gain * (demanded - rate)


@equation
def blade_angle(position: float, servo: Servo) -> float:
    """The blade angle [rad]: the servo's position up to the mechanical stop."""
    return clamp(position, servo.minimum_rad, servo.maximum_rad)


class Turning(NamedTuple):
    """How the main rotor changes: inflow [m/s2], speed [rad/s2], governor [W/s]; its torque on the body [N m]."""

    inflow_m_s2: float
    speed_rad_s2: float
    governed_w_s: float
    torque_n_m: float


@equation
def held_turning(loads: RotorLoads) -> Turning:
    """A rotor that keeps its speed whatever it takes, at a given inflow."""
    return Turning(0.0, 0.0, 0.0, loads.torque_n_m)


@equation
def shaft_power(state: HelicopterState, engine: float, vehicle: VehicleParameters) -> float:
    """Power of the motor to both rotors [W]; engine 0: it is cut."""
    asked = vehicle.governor_w_s_rad * (vehicle.main_speed_rad_s - state.speed) + state.governed
    return engine * clamp(asked, 0.0, vehicle.shaft_power_limit_w)


@equation
def inflow_rate(state: HelicopterState, air: AirMotion, lift_n: float, vehicle: VehicleParameters) -> float:
    """v' of the main rotor [m/s2] while its blades carry `lift_n`."""
    through = state.inflow - air.w
    resultant: float = np.sqrt(air.u * air.u + air.v * air.v + through * through + 1e-12)
    return (lift_n - vehicle.main_disc_kg_m * state.inflow * resultant) * vehicle.per_inflow_mass_1_kg


@equation
def turning_of(
    state: HelicopterState, air: AirMotion, loads: RotorLoads, engine: float, vehicle: VehicleParameters
) -> Turning:
    """How the main rotor changes under its loads."""
    ratio = speed_ratio(state.speed, vehicle)
    taken = loads.torque_n_m + vehicle.tail_gear_ratio * loads.tail_torque_n_m
    slow = vehicle.main_speed_rad_s - state.speed
    asked = vehicle.governor_w_s_rad * slow + state.governed
    given = shaft_power(state, engine, vehicle) * (1.0 / (vehicle.main_speed_rad_s * ratio))
    spin = (given - taken) * vehicle.per_rotor_inertia_1_kg_m2
    beyond = asked - clamp(asked, 0.0, vehicle.shaft_power_limit_w)  # where the integral would wind up
    governed = vehicle.governor_integral_w_rad * slow if (beyond * slow).real <= 0.0 else 0.0
    return Turning(
        inflow_rate(state, air, loads.lift_n, vehicle),
        spin,
        governed,
        loads.torque_n_m + vehicle.rotor_inertia_kg_m2 * spin,
    )
