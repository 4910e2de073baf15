"""The helicopter as one set of differential equations: the four blocks put together.

Straight-line scalar equations, so that lanes vectorise: 23 states in, 23 rates out.
"""

from __future__ import annotations

from flownav.compile import equation
from flownav.frames import Rotation, Vector, quaternion_rate, rotation_from_quaternion, to_body, to_earth
from flownav.vehicle.actuators import Servo, acceleration, blade_angle
from flownav.vehicle.airframe import (
    AirMotion,
    Wrench,
    flight_wrench,
    fuselage_drag,
    main_rotor_wrench,
    tail_plane_force,
    tail_side_force,
    tail_sideslip,
)
from flownav.vehicle.ground_effect import multiplier_of_squares
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.rigid_body import angular_acceleration, linear_acceleration
from flownav.vehicle.rotor import blowback, induced_velocity, main_rotor, tail_rotor, thrust, torque
from flownav.vehicle.skids import support, with_friction, with_support
from flownav.vehicle.state import Controls, HelicopterState, Inflow, Outputs, add_scaled, normalised

__all__ = [
    "Controls",
    "HelicopterState",
    "Inflow",
    "Outputs",
    "add_scaled",
    "derivative",
    "derivative_at_inflow",
    "inflow",
    "normalised",
    "outputs",
    "step",
    "tail_power",
]


@equation
def cyclic_servo(vehicle: VehicleParameters) -> Servo:
    """The servo of both cyclic channels."""
    return Servo(
        vehicle.cyclic_frequency_rad_s,
        vehicle.cyclic_damping_ratio,
        vehicle.cyclic_rate_limit_rad_s,
        vehicle.cyclic_min_rad,
        vehicle.cyclic_max_rad,
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
    )


@equation
def blade_angles(state: HelicopterState, vehicle: VehicleParameters) -> Controls:
    """Where the servos hold the blades [rad]."""
    cyclic = cyclic_servo(vehicle)
    return Controls(
        blade_angle(state.lon, cyclic),
        blade_angle(state.lat, cyclic),
        blade_angle(state.col, collective_servo(vehicle)),
        blade_angle(state.ped, pedal_servo(vehicle)),
    )


@equation
def attitude(state: HelicopterState) -> Rotation:
    """R_EB of the state."""
    return rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)


@equation
def air_motion(state: HelicopterState, rotation: Rotation, wind_n: float, wind_e: float, wind_d: float) -> AirMotion:
    """Motion through the air; wind in earth NED [m/s], where the air goes."""
    wind = to_body(rotation, wind_n, wind_e, wind_d)
    return AirMotion(state.u - wind[0], state.v - wind[1], state.w - wind[2], state.p, state.q, state.r)


@equation
def tail_inplane_sq(air: AirMotion, vehicle: VehicleParameters) -> float:
    """The square of the airspeed in the tail rotor's plane [m2/s2]."""
    w = air.w + vehicle.tail_behind_cg_m * air.q
    return air.u * air.u + w * w


@equation
def inflow(air: AirMotion, blades: Controls, vehicle: VehicleParameters) -> Inflow:
    """Both rotors' induced velocities, in balance with the present motion (quasi-steady)."""
    return Inflow(
        induced_velocity(blades.col, air.u * air.u + air.v * air.v, air.w, main_rotor(vehicle)),
        induced_velocity(blades.ped, tail_inplane_sq(air, vehicle), tail_sideslip(air, vehicle), tail_rotor(vehicle)),
    )


@equation
def main_rotor_load(
    state: HelicopterState,
    down: Vector,
    air: AirMotion,
    blades: Controls,
    induced: Inflow,
    vehicle: VehicleParameters,
) -> tuple[float, float]:
    """Main rotor thrust in ground effect [N] and torque [N m].

    Ground effect multiplies the thrust at constant power (equation 11), so the torque is that of free air.
    """
    rotor = main_rotor(vehicle)
    inplane_sq = air.u * air.u + air.v * air.v
    free = thrust(blades.col, inplane_sq, air.w, induced.main, rotor)
    sinking = air.u * down[0] + air.v * down[1] + air.w * down[2]
    horizontal_sq = inplane_sq + air.w * air.w - sinking * sinking
    hub_height = vehicle.hub_above_cg_m * down[2] - state.pos_d
    near_ground = multiplier_of_squares(hub_height, horizontal_sq, induced.main, vehicle.main_radius_m)
    return near_ground * free, torque(free, inplane_sq, air.w, induced.main, rotor)


@equation
def forces_and_moments(
    state: HelicopterState,
    down: Vector,
    air: AirMotion,
    blades: Controls,
    induced: Inflow,
    vehicle: VehicleParameters,
) -> Wrench:
    """All forces and moments about the centre of gravity (block 3), the ground's last: friction answers the rest."""
    lift, drag_torque = main_rotor_load(state, down, air, blades, induced, vehicle)
    tail_thrust = thrust(
        blades.ped, tail_inplane_sq(air, vehicle), tail_sideslip(air, vehicle), induced.tail, tail_rotor(vehicle)
    )
    free = flight_wrench(
        main_rotor_wrench(lift, drag_torque, state.a1, state.b1, air, vehicle),
        tail_side_force(tail_thrust, induced.tail, air, vehicle),
        tail_plane_force(induced.main, air, vehicle),
        fuselage_drag(induced.main, air, vehicle),
        down,
        vehicle,
    )
    velocity, rates = (state.u, state.v, state.w), (state.p, state.q, state.r)
    feet = support(state.pos_d, down, velocity, rates, vehicle)
    return with_friction(with_support(free, feet, down, vehicle), feet, velocity, rates, vehicle)


@equation
def derivative_at_inflow(
    state: HelicopterState,
    controls: Controls,
    air: AirMotion,
    rotation: Rotation,
    induced: Inflow,
    vehicle: VehicleParameters,
) -> HelicopterState:
    """The rates of the state at given induced velocities (held ones give the paper's frozen-inflow model)."""
    down = (rotation[6], rotation[7], rotation[8])
    velocity, rates = (state.u, state.v, state.w), (state.p, state.q, state.r)
    blades = blade_angles(state, vehicle)
    total = forces_and_moments(state, down, air, blades, induced, vehicle)
    pos_rate = to_earth(rotation, state.u, state.v, state.w)
    accel = linear_acceleration(velocity, rates, (total.x, total.y, total.z), vehicle.mass_kg)
    spin = angular_acceleration(rates, (total.l, total.m, total.n), vehicle)
    turn = quaternion_rate(state.qw, state.qx, state.qy, state.qz, state.p, state.q, state.r)
    # first-order flapping: the disc follows the cyclic, blows back from the airspeed and lags the body's rates
    tilt = vehicle.flap_response * blowback(
        blades.col,
        air.u * air.u + air.v * air.v,
        air.w,
        induced.main,
        vehicle.main_lift_solidity,
        vehicle.main_tip_speed_m_s,
    )
    per_tip = 1.0 / vehicle.main_tip_speed_m_s
    a1_rate = vehicle.flap_rate_1_s * (blades.lon + tilt * air.u * per_tip - state.a1) - state.q
    b1_rate = vehicle.flap_rate_1_s * (blades.lat - tilt * air.v * per_tip - state.b1) - state.p
    cyclic = cyclic_servo(vehicle)
    return HelicopterState(
        *pos_rate,
        *accel,
        *turn,
        *spin,
        a1_rate,
        b1_rate,
        state.lon_rate,
        state.lat_rate,
        state.col_rate,
        state.ped_rate,
        acceleration(state.lon, state.lon_rate, controls.lon, cyclic),
        acceleration(state.lat, state.lat_rate, controls.lat, cyclic),
        acceleration(state.col, state.col_rate, controls.col, collective_servo(vehicle)),
        acceleration(state.ped, state.ped_rate, controls.ped, pedal_servo(vehicle)),
    )


@equation
def derivative(
    state: HelicopterState,
    controls: Controls,
    wind_n: float,
    wind_e: float,
    wind_d: float,
    vehicle: VehicleParameters,
) -> HelicopterState:
    """The rates of the state, paper equations 1-11; wind in earth NED [m/s]; inflow re-solved at every call."""
    rotation = attitude(state)
    air = air_motion(state, rotation, wind_n, wind_e, wind_d)
    induced = inflow(air, blade_angles(state, vehicle), vehicle)
    return derivative_at_inflow(state, controls, air, rotation, induced, vehicle)


@equation
def outputs(state: HelicopterState, wind_n: float, wind_e: float, wind_d: float, vehicle: VehicleParameters) -> Outputs:
    """What the state implies (see Outputs); wind in earth NED [m/s]."""
    rotation = attitude(state)
    down = (rotation[6], rotation[7], rotation[8])
    air = air_motion(state, rotation, wind_n, wind_e, wind_d)
    blades = blade_angles(state, vehicle)
    induced = inflow(air, blades, vehicle)
    lift, drag_torque = main_rotor_load(state, down, air, blades, induced, vehicle)
    feet = support(state.pos_d, down, (state.u, state.v, state.w), (state.p, state.q, state.r), vehicle)
    return Outputs(lift, drag_torque, drag_torque * vehicle.main_speed_rad_s, induced.main, feet.normal_n)


@equation
def tail_power(
    state: HelicopterState, wind_n: float, wind_e: float, wind_d: float, vehicle: VehicleParameters
) -> float:
    """Shaft power of the tail rotor [W]; wind in earth NED [m/s]."""
    rotation = attitude(state)
    air = air_motion(state, rotation, wind_n, wind_e, wind_d)
    rotor = tail_rotor(vehicle)
    pitch = blade_angles(state, vehicle).ped
    inplane_sq, sideslip = tail_inplane_sq(air, vehicle), tail_sideslip(air, vehicle)
    induced = induced_velocity(pitch, inplane_sq, sideslip, rotor)
    load = thrust(pitch, inplane_sq, sideslip, induced, rotor)
    return torque(load, inplane_sq, sideslip, induced, rotor) * rotor.speed_rad_s


@equation
def step(
    state: HelicopterState,
    controls: Controls,
    wind_n: float,
    wind_e: float,
    wind_d: float,
    dt: float,
    vehicle: VehicleParameters,
) -> HelicopterState:
    """The state `dt` seconds later by the classical Runge-Kutta method, controls and wind held."""
    first = derivative(state, controls, wind_n, wind_e, wind_d, vehicle)
    second = derivative(add_scaled(state, first, 0.5 * dt), controls, wind_n, wind_e, wind_d, vehicle)
    third = derivative(add_scaled(state, second, 0.5 * dt), controls, wind_n, wind_e, wind_d, vehicle)
    fourth = derivative(add_scaled(state, third, dt), controls, wind_n, wind_e, wind_d, vehicle)
    middle = add_scaled(add_scaled(state, first, dt / 6.0), second, dt / 3.0)
    return normalised(add_scaled(add_scaled(middle, third, dt / 3.0), fourth, dt / 6.0))
