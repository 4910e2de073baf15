"""Trim: the controls and the attitude in which a vehicle keeps its motion, in the air or on its skids.

Newton's method on the whole equations of motion, with the exact Jacobian of the complex step. A multirotor's trim
finds its rotors' speeds, too.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.frames import Vector, quaternion_from_euler
from flownav.vehicle import airframe, helicopter, multirotor
from flownav.vehicle.complex_step import solve, value
from flownav.vehicle.feasibility import hover_induced_velocity, hover_pitch
from flownav.vehicle.motors import battery_voltage
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters, hover_speed
from flownav.vehicle.state import CALM, Controls, HelicopterState, MultirotorState

OUT_OF_GROUND_EFFECT_M = 1e6
TOLERANCE = 1e-11  # [m/s2, rad/s2, rad/s]
SLIDING = 0.01  # [m/s2, rad/s2] more than friction leaves of what it can hold
HOVER: Vector = (0.0, 0.0, 0.0)


class Trim(NamedTuple):
    """A trimmed flight: angles [rad], induced velocity [m/s], thrust [N], shaft power of either rotor [W].

    `state` and `controls` are what the simulation starts from: heading north over the origin.
    """

    collective_rad: float
    pedal_rad: float
    roll_rad: float
    pitch_rad: float
    a1: float
    b1: float
    lon: float
    lat: float
    induced_velocity_m_s: float
    power_w: float  # the main rotor's
    tail_power_w: float
    thrust_n: float
    state: HelicopterState
    controls: Controls


def settled_state(
    pos_d_m: float, vel_body_m_s: Vector, roll: float, pitch: float, a1: float, b1: float, controls: Controls,
    vehicle: VehicleParameters,
) -> HelicopterState:  # fmt: skip
    """A state over the origin, heading north, without rates, its servos where the controls put them.

    The rotor has its governed speed; its inflow and what the governor gives are still to be found (`with_rotor`).
    """
    u, v, w = vel_body_m_s
    qw, qx, qy, qz = quaternion_from_euler(roll, pitch, 0.0)
    still = (0.0, 0.0, 0.0)
    rotor = (0.0, vehicle.main_speed_rad_s, 0.0)
    return HelicopterState(0.0, 0.0, pos_d_m, u, v, w, qw, qx, qy, qz, *still, a1, b1, *controls, 0.0, *still, *rotor)


def with_rotor(state: HelicopterState, vehicle: VehicleParameters) -> HelicopterState:
    """The state whose main rotor's inflow is in balance, and whose governor gives what both rotors take; still air."""
    air = airframe.air_motion(state, airframe.attitude(state), CALM)
    blades = helicopter.blade_angles(state, vehicle)
    induced = helicopter.inflow(air, blades, 1.0, vehicle)
    loads = helicopter.rotor_loads(state, air, blades, induced, vehicle)
    power = loads.torque_n_m * vehicle.main_speed_rad_s + loads.tail_torque_n_m * vehicle.tail_speed_rad_s
    return state._replace(inflow=float(induced.main), governed=float(power))


def accelerations(rate: HelicopterState) -> tuple[float, ...]:
    """Derivatives that a trim makes vanish: the six accelerations and the two flapping rates."""
    return (rate.u, rate.v, rate.w, rate.p, rate.q, rate.r, rate.a1, rate.b1)


def _flight(
    unknown: Sequence[Any], vel_body_m_s: Vector, pos_d_m: float, vehicle: VehicleParameters
) -> tuple[HelicopterState, Controls]:
    """Unknowns collective, pedal, roll, pitch, a1, b1, lon, lat as state and controls."""
    col, ped, roll, pitch, a1, b1, lon, lat = unknown
    controls = Controls(lon, lat, col, ped)
    return settled_state(pos_d_m, vel_body_m_s, roll, pitch, a1, b1, controls, vehicle), controls


def trim(vehicle: VehicleParameters, vel_body_m_s: Vector = HOVER, height_m: float = OUT_OF_GROUND_EFFECT_M) -> Trim:
    """Straight flight at a constant body velocity [m/s], the centre of gravity at a height [m], in still air.

    Accelerations and flapping rates are below 1e-9. InputError where the controls cannot hold that flight.
    """

    def residual(unknown: Sequence[Any]) -> tuple[float, ...]:
        state, controls = _flight(unknown, vel_body_m_s, -height_m, vehicle)
        return accelerations(helicopter.derivative_in_balance(state, controls, CALM, vehicle))

    wanted = f"trim at u, v, w = {vel_body_m_s[0]:g}, {vel_body_m_s[1]:g}, {vel_body_m_s[2]:g} m/s"
    failure = f"{wanted}: the controls' travel or the blades do not allow it; ask for a slower or higher flight"
    solution = [float(x) for x in solve(residual, _first_guess(vehicle), TOLERANCE, failure)]
    state, controls = _flight(solution, vel_body_m_s, -height_m, vehicle)
    state = with_rotor(_as_floats(state), vehicle)
    out = helicopter.outputs(state, CALM, vehicle)
    col, ped, roll, pitch, a1, b1, lon, lat = solution
    return Trim(
        collective_rad=col,
        pedal_rad=ped,
        roll_rad=roll,
        pitch_rad=pitch,
        a1=a1,
        b1=b1,
        lon=lon,
        lat=lat,
        induced_velocity_m_s=float(out.induced_velocity_m_s),
        power_w=float(out.power_w),
        tail_power_w=float(helicopter.tail_power(state, CALM, vehicle)),
        thrust_n=float(out.thrust_n),
        state=state,
        controls=controls,
    )


def _first_guess(vehicle: VehicleParameters) -> NDArray[np.float64]:
    """Hover by momentum theory: weight on the main rotor, its torque on the tail rotor, level but for the roll."""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    inflow = hover_induced_velocity(weight, vehicle.main_thrust_slope_n_s_m, vehicle.main_inflow_speed_m_s)
    torque = vehicle.main_profile_torque_n_m + weight * inflow / vehicle.main_speed_rad_s
    side = torque / vehicle.tail_behind_cg_m / vehicle.tail_fin_blockage
    tail_inflow = hover_induced_velocity(side, vehicle.tail_thrust_slope_n_s_m, vehicle.tail_inflow_speed_m_s)
    collective = hover_pitch(weight, inflow, vehicle.main_thrust_slope_n_s_m, vehicle.main_tip_speed_m_s)
    pedal = hover_pitch(side, tail_inflow, vehicle.tail_thrust_slope_n_s_m, vehicle.tail_tip_speed_m_s)
    return np.array([collective, pedal, side / weight, 0.0, 0.0, 0.0, 0.0, 0.0])


def parked(vehicle: VehicleParameters, controls: Controls) -> HelicopterState:
    """The state at rest on the skids over the origin, rotors turning, with these controls held; still air.

    InputError where it does not stay: too much lift, or more side force or torque than the skids' friction holds.
    """

    def state_of(unknown: Sequence[Any]) -> HelicopterState:
        pos_d, roll, pitch, a1, b1 = unknown
        return settled_state(pos_d, HOVER, roll, pitch, a1, b1, controls, vehicle)

    def rate_of(unknown: Sequence[Any]) -> HelicopterState:
        return helicopter.derivative_in_balance(state_of(unknown), controls, CALM, vehicle)

    def residual(unknown: Sequence[Any]) -> tuple[float, ...]:
        rate = rate_of(unknown)
        return (rate.w, rate.p, rate.q, rate.a1, rate.b1)

    sag = vehicle.mass_kg * vehicle.gravity_m_s2 / (4.0 * vehicle.skid_stiffness_n_m)
    start = np.array([sag - vehicle.cg_above_skid_m, 0.0, 0.0, 0.0, 0.0])
    failure = "parked: with these controls it lifts, tips or slides on its skids; lower the collective or the pedal"
    solution = solve(residual, start, TOLERANCE, failure)
    state = with_rotor(_as_floats(state_of([float(x) for x in solution])), vehicle)
    if np.abs(value(lambda x: accelerations(rate_of(x)), solution)).max() > SLIDING:
        raise InputError(failure)
    return state


def _as_floats(state: HelicopterState) -> HelicopterState:
    return HelicopterState(*(float(complex(x).real) for x in state))


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
        return multirotor_accelerations(_rate(*flight(unknown), hexa, vehicle), count)

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


def multirotor_accelerations(rate: MultirotorState, count: int) -> tuple[Any, ...]:
    """Derivatives that a trim makes vanish: the six accelerations and the rotors'."""
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
    if np.abs(value(lambda x: multirotor_accelerations(rate_of(x), count), found)).max() > SLIDING:
        raise InputError(failure)
    return settled(float(found[0]), HOVER, 0.0, 0.0, [float(found[1])] * count)
