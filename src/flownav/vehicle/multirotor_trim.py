"""Trim of a multirotor: the controls, the attitude and the rotors' speeds in which it keeps its motion.

Newton's method on the whole equations of motion, with the exact Jacobian of the complex step (as `trim`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.frames import Vector, quaternion_from_euler
from flownav.vehicle import multirotor
from flownav.vehicle.around import CALM
from flownav.vehicle.complex_step import solve, value
from flownav.vehicle.motors import battery_voltage
from flownav.vehicle.multirotor_parameters import MultirotorParameters, hover_speed
from flownav.vehicle.multirotor_state import MultirotorState
from flownav.vehicle.state import Controls
from flownav.vehicle.trim import HOVER, OUT_OF_GROUND_EFFECT_M, SLIDING, TOLERANCE


class MultirotorTrim(NamedTuple):
    """A trimmed flight on a full battery, heading north over the origin: what the simulation starts from."""

    roll_rad: float
    pitch_rad: float
    speed_rad_s: float  # mean of the rotors
    induced_velocity_m_s: float
    power_w: float  # shaft
    current_a: float
    voltage_v: float
    thrust_n: float
    state: MultirotorState
    controls: Controls


def trim_multirotor(
    vehicle: MultirotorParameters, vel_body_m_s: Vector = HOVER, height_m: float = OUT_OF_GROUND_EFFECT_M
) -> MultirotorTrim:
    """Straight flight at a constant body velocity [m/s], the centre of gravity at a height [m], in still air.

    InputError where the rotors cannot hold that flight.
    """
    hexa = is_hexa(vehicle)
    count = int(vehicle.rotor_count)

    def flight(unknown: Sequence[Any]) -> tuple[MultirotorState, Controls]:
        controls, (roll, pitch), speeds = Controls(*unknown[:4]), unknown[4:6], unknown[6:]
        return settled(-height_m, vel_body_m_s, roll, pitch, list(speeds)), controls

    def residual(unknown: Sequence[Any]) -> tuple[Any, ...]:
        return accelerations(_rate(*flight(unknown), hexa, vehicle), count)

    speed = hover_speed(vehicle)
    share = (speed / vehicle.full_speed_rad_s) ** 2
    start = np.array([0.0, 0.0, share, 0.0, 0.0, 0.0, *[speed] * count])
    wanted = f"trim at u, v, w = {vel_body_m_s[0]:g}, {vel_body_m_s[1]:g}, {vel_body_m_s[2]:g} m/s"
    found = solve(residual, start, 1e2 * TOLERANCE, f"{wanted}: the rotors do not allow it; ask for a slower flight")
    state, controls = flight([float(x) for x in found])
    out = multirotor.outputs(state, CALM, hexa, vehicle)
    rate = multirotor.derivative(state, controls, CALM, hexa, vehicle)
    return MultirotorTrim(
        roll_rad=float(found[4]),
        pitch_rad=float(found[5]),
        speed_rad_s=float(np.mean(found[6:])),
        induced_velocity_m_s=float(out.induced_velocity_m_s),
        power_w=float(out.power_w),
        current_a=float(rate.used),
        voltage_v=float(battery_voltage(out.power_w, 0.0, vehicle)),
        thrust_n=float(out.thrust_n),
        state=state,
        controls=controls,
    )


def is_hexa(vehicle: MultirotorParameters) -> bool:
    """Whether it has six rotors."""
    return vehicle.rotor_count > 4.0


def settled(pos_d_m: float, vel_body_m_s: Vector, roll: float, pitch: float, speeds: list[Any]) -> MultirotorState:
    """A state over the origin, heading north, without rates, on a full battery."""
    u, v, w = vel_body_m_s
    six = speeds + [0.0] * (6 - len(speeds))
    qw, qx, qy, qz = quaternion_from_euler(roll, pitch, 0.0)
    return MultirotorState(
        0.0, 0.0, pos_d_m, u, v, w, qw, qx, qy, qz, 0.0, 0.0, 0.0, six[0], six[1], six[2], six[3], six[4], six[5], 0.0
    )  # fmt: skip


def accelerations(rate: MultirotorState, count: int) -> tuple[Any, ...]:
    """What a trim makes vanish: the six accelerations and the rotors'."""
    spins = (rate.speed_1, rate.speed_2, rate.speed_3, rate.speed_4, rate.speed_5, rate.speed_6)
    return (rate.u, rate.v, rate.w, rate.p, rate.q, rate.r, *spins[:count])


def _rate(state: MultirotorState, controls: Controls, hexa: bool, vehicle: MultirotorParameters) -> MultirotorState:
    return multirotor.derivative(state, controls, CALM, hexa, vehicle)


def parked_multirotor(vehicle: MultirotorParameters) -> MultirotorState:
    """The state at rest on the ground over the origin, rotors idling; still air. InputError where it does not stay."""
    hexa, controls = is_hexa(vehicle), Controls(0.0, 0.0, 0.0, 0.0)
    count = int(vehicle.rotor_count)

    def rate_of(unknown: Sequence[Any]) -> MultirotorState:
        return _rate(settled(unknown[0], HOVER, 0.0, 0.0, [unknown[1]] * count), controls, hexa, vehicle)

    def residual(unknown: Sequence[Any]) -> tuple[Any, ...]:
        rate = rate_of(unknown)
        return (rate.w, rate.speed_1)

    sag = vehicle.mass_kg * vehicle.gravity_m_s2 / (4.0 * vehicle.skid_stiffness_n_m)
    idle = vehicle.full_speed_rad_s * math.sqrt(vehicle.idle_share)
    failure = "parked: at idle it lifts; lower motor.idle_share"
    found = solve(residual, np.array([sag - vehicle.cg_above_skid_m, idle]), 1e2 * TOLERANCE, failure)
    if np.abs(value(lambda x: accelerations(rate_of(x), count), found)).max() > SLIDING:
        raise InputError(failure)
    return settled(float(found[0]), HOVER, 0.0, 0.0, [float(found[1])] * count)
