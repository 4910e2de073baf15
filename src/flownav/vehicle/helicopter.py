"""The helicopter as one set of differential equations: the four blocks put together.

Straight-line scalar equations, so that lanes vectorise: 26 states in, 26 rates out. `derivative` is the helicopter as
it flies; in `derivative_in_balance`, the paper's, the rotor keeps its speed and its inflow is in balance at once.
"""

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.core.frames import Rotation, Vector, quaternion_rate, to_earth
from flownav.vehicle import airframe, drive, rotor
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.skids import support, with_friction, with_support
from flownav.vehicle.state import (
    Around,
    Controls,
    HelicopterState,
    Inflow,
    Outputs,
    RotorLoads,
    below_plane,
    classical_step,
    normalised,
    plane_normal,
)


class Rotors(NamedTuple):
    """How both rotors work: angles of the blades, induced velocities, loads, and what these make of the main one."""

    blades: Controls
    induced: Inflow
    loads: RotorLoads
    turning: drive.Turning


@equation
def blade_angles(state: HelicopterState, vehicle: VehicleParameters) -> Controls:
    """Where the servos hold the blades [rad]."""
    cyclic = drive.cyclic_servo(vehicle)
    return Controls(
        drive.blade_angle(state.lon, cyclic),
        drive.blade_angle(state.lat, cyclic),
        drive.blade_angle(state.col, drive.collective_servo(vehicle)),
        drive.blade_angle(state.ped, drive.pedal_servo(vehicle)),
    )


@equation
def tail_inplane_sq(air: airframe.AirMotion, vehicle: VehicleParameters) -> float:
    """The square of the airspeed in the tail rotor's plane [m2/s2]."""
    w = air.w + vehicle.tail_behind_cg_m * air.q
    return air.u * air.u + w * w


@equation
def inflow(air: airframe.AirMotion, blades: Controls, ratio: float, vehicle: VehicleParameters) -> Inflow:
    """Both rotors' induced velocities, in balance with the present motion (quasi-steady); ratio: `speed_ratio`."""
    return Inflow(
        rotor.induced_velocity(blades.col, air.u * air.u + air.v * air.v, air.w, rotor.main_rotor(vehicle, ratio)),
        tail_inflow(air, blades, ratio, vehicle),
    )


@equation
def tail_inflow(air: airframe.AirMotion, blades: Controls, ratio: float, vehicle: VehicleParameters) -> float:
    """The tail rotor's induced velocity, in balance with the present motion: it lags by 10 ms only."""
    inplane_sq, sideslip = tail_inplane_sq(air, vehicle), airframe.tail_sideslip(air, vehicle)
    return rotor.induced_velocity(blades.ped, inplane_sq, sideslip, rotor.tail_rotor(vehicle, ratio))


@equation
def inflow_of(state: HelicopterState, around: Around, vehicle: VehicleParameters) -> Inflow:
    """Both rotors' induced velocities as they are: the main rotor's is a state."""
    air, ratio = airframe.air_motion(state, airframe.attitude(state), around), rotor.speed_ratio(state.speed, vehicle)
    return Inflow(state.inflow, tail_inflow(air, blade_angles(state, vehicle), ratio, vehicle))


@equation
def rotor_loads(
    state: HelicopterState, air: airframe.AirMotion, blades: Controls, induced: Inflow, vehicle: VehicleParameters
) -> RotorLoads:
    """Thrust out of ground effect and torque of both rotors."""
    ratio = rotor.speed_ratio(state.speed, vehicle)
    main, tail = rotor.main_rotor(vehicle, ratio), rotor.tail_rotor(vehicle, ratio)
    inplane_sq = air.u * air.u + air.v * air.v
    tail_sq, sideslip = tail_inplane_sq(air, vehicle), airframe.tail_sideslip(air, vehicle)
    lift = rotor.thrust(blades.col, inplane_sq, air.w, induced.main, main)
    aside = rotor.thrust(blades.ped, tail_sq, sideslip, induced.tail, tail)
    return RotorLoads(
        lift,
        rotor.torque(lift, inplane_sq, air.w, induced.main, main),
        aside,
        rotor.torque(aside, tail_sq, sideslip, induced.tail, tail),
    )


@equation
def near_ground(
    state: HelicopterState,
    down: Vector,
    air: airframe.AirMotion,
    induced_m_s: float,
    around: Around,
    vehicle: VehicleParameters,
) -> float:
    """The main rotor's thrust in ground effect over that in free air, at constant power (equation 11)."""
    sinking = air.u * down[0] + air.v * down[1] + air.w * down[2]
    horizontal_sq = air.u * air.u + air.v * air.v + air.w * air.w - sinking * sinking
    below = below_plane(state.pos_n, state.pos_e, state.pos_d, around)
    hub_height = vehicle.hub_above_cg_m * down[2] - below - around.rotor_1_m
    return rotor.multiplier_of_squares(hub_height, horizontal_sq, induced_m_s, vehicle.main_radius_m)


@equation
def forces_and_moments(
    state: HelicopterState, rotation: Rotation, air: airframe.AirMotion, rotors: Rotors, around: Around,
    vehicle: VehicleParameters,
) -> airframe.Wrench:  # fmt: skip
    """All forces and moments about the centre of gravity (block 3), the ground's last: friction answers the rest."""
    down = (rotation[6], rotation[7], rotation[8])
    induced = rotors.induced
    lift = near_ground(state, down, air, induced.main, around, vehicle) * rotors.loads.lift_n
    ratio = rotor.speed_ratio(state.speed, vehicle)
    free = airframe.flight_wrench(
        airframe.main_rotor_wrench(lift, rotors.turning.torque_n_m, state.a1, state.b1, air, ratio, vehicle),
        airframe.tail_side_force(rotors.loads.tail_n, induced.tail, air, vehicle),
        airframe.tail_plane_force(induced.main, air, vehicle),
        airframe.fuselage_drag(induced.main, air, vehicle),
        down,
        vehicle,
    )
    velocity, rates, normal = (state.u, state.v, state.w), (state.p, state.q, state.r), plane_normal(rotation, around)
    feet = support(below_plane(state.pos_n, state.pos_e, state.pos_d, around), normal, velocity, rates, around, vehicle)
    return with_friction(with_support(free, feet, normal, vehicle), feet, velocity, rates, vehicle)


@equation
def rates_of(
    state: HelicopterState, controls: Controls, air: airframe.AirMotion, rotation: Rotation, rotors: Rotors,
    around: Around, vehicle: VehicleParameters,
) -> HelicopterState:  # fmt: skip
    """The rates of the state while the rotors work like this.

    A gradient of the gusts acts on the blades as cyclic does: p_g/Ω tilts the disc back, q_g/Ω to the left.
    """
    velocity, rates = (state.u, state.v, state.w), (state.p, state.q, state.r)
    blades, induced, _, turning = rotors
    total = forces_and_moments(state, rotation, air, rotors, around, vehicle)
    main = rotor.main_rotor(vehicle, rotor.speed_ratio(state.speed, vehicle))
    tilt = vehicle.flap_response * rotor.blowback(
        blades.col, air.u * air.u + air.v * air.v, air.w, induced.main, vehicle.main_lift_solidity, main.tip_speed_m_s
    )
    per_tip, per_turn = 1.0 / main.tip_speed_m_s, 1.0 / main.speed_rad_s
    back = blades.lon + tilt * air.u * per_tip + (state.p - air.p) * per_turn
    right = blades.lat - tilt * air.v * per_tip - (state.q - air.q) * per_turn
    flap_rate = vehicle.flap_rate_1_s * rotor.speed_ratio(state.speed, vehicle)
    cyclic = drive.cyclic_servo(vehicle)
    return HelicopterState(
        *to_earth(rotation, state.u, state.v, state.w),
        *airframe.linear_acceleration(velocity, rates, (total.x, total.y, total.z), vehicle.mass_kg),
        *quaternion_rate(state.qw, state.qx, state.qy, state.qz, state.p, state.q, state.r),
        *airframe.angular_acceleration(rates, (total.l, total.m, total.n), vehicle),
        flap_rate * (back - state.a1) - state.q,
        flap_rate * (right - state.b1) - state.p,
        state.lon_rate,
        state.lat_rate,
        state.col_rate,
        state.ped_rate,
        drive.acceleration(state.lon, state.lon_rate, controls.lon, cyclic),
        drive.acceleration(state.lat, state.lat_rate, controls.lat, cyclic),
        drive.acceleration(state.col, state.col_rate, controls.col, drive.collective_servo(vehicle)),
        drive.acceleration(state.ped, state.ped_rate, controls.ped, drive.pedal_servo(vehicle)),
        turning.inflow_m_s2,
        turning.speed_rad_s2,
        turning.governed_w_s,
    )


@equation
def derivative_at_inflow(
    state: HelicopterState, controls: Controls, air: airframe.AirMotion, rotation: Rotation, induced: Inflow,
    around: Around, vehicle: VehicleParameters,
) -> HelicopterState:  # fmt: skip
    """The rates at given induced velocities while the rotor keeps its speed (held ones: the paper's frozen inflow)."""
    blades = blade_angles(state, vehicle)
    loads = rotor_loads(state, air, blades, induced, vehicle)
    rotors = Rotors(blades, induced, loads, drive.held_turning(loads))
    return rates_of(state, controls, air, rotation, rotors, around, vehicle)


@equation
def derivative_in_balance(
    state: HelicopterState, controls: Controls, around: Around, vehicle: VehicleParameters
) -> HelicopterState:
    """The rates of the paper's helicopter, its equations 1-11: inflow re-solved at every call, rotor speed constant."""
    rotation = airframe.attitude(state)
    air = airframe.air_motion(state, rotation, around)
    induced = inflow(air, blade_angles(state, vehicle), rotor.speed_ratio(state.speed, vehicle), vehicle)
    return derivative_at_inflow(state, controls, air, rotation, induced, around, vehicle)


@equation
def derivative_at_tail(
    state: HelicopterState, controls: Controls, air: airframe.AirMotion, rotation: Rotation, tail_m_s: float,
    around: Around, vehicle: VehicleParameters,
) -> HelicopterState:  # fmt: skip
    """The rates of the state at the tail rotor's induced velocity."""
    blades, induced = blade_angles(state, vehicle), Inflow(state.inflow, tail_m_s)
    loads = rotor_loads(state, air, blades, induced, vehicle)
    rotors = Rotors(blades, induced, loads, drive.turning_of(state, air, loads, around.engine, vehicle))
    return rates_of(state, controls, air, rotation, rotors, around, vehicle)


@equation
def derivative(
    state: HelicopterState, controls: Controls, around: Around, vehicle: VehicleParameters
) -> HelicopterState:
    """The rates of the state: inflow lags, the rotor's speed droops, the governor answers up to the power limit."""
    rotation = airframe.attitude(state)
    air = airframe.air_motion(state, rotation, around)
    tail_m_s = tail_inflow(air, blade_angles(state, vehicle), rotor.speed_ratio(state.speed, vehicle), vehicle)
    return derivative_at_tail(state, controls, air, rotation, tail_m_s, around, vehicle)


@equation
def outputs(state: HelicopterState, around: Around, vehicle: VehicleParameters) -> Outputs:
    """Outputs of the vehicle in this state (see Outputs)."""
    return outputs_at_inflow(state, inflow_of(state, around, vehicle), around, vehicle)


@equation
def outputs_at_inflow(state: HelicopterState, induced: Inflow, around: Around, vehicle: VehicleParameters) -> Outputs:
    """Outputs of the vehicle in this state at given induced velocities."""
    rotation = airframe.attitude(state)
    air = airframe.air_motion(state, rotation, around)
    loads = rotor_loads(state, air, blade_angles(state, vehicle), induced, vehicle)
    down, normal = (rotation[6], rotation[7], rotation[8]), plane_normal(rotation, around)
    lift = near_ground(state, down, air, induced.main, around, vehicle) * loads.lift_n
    velocity, rates = (state.u, state.v, state.w), (state.p, state.q, state.r)
    feet = support(below_plane(state.pos_n, state.pos_e, state.pos_d, around), normal, velocity, rates, around, vehicle)
    power = loads.torque_n_m * rotor.main_rotor(vehicle, rotor.speed_ratio(state.speed, vehicle)).speed_rad_s
    return Outputs(lift, loads.torque_n_m, power, induced.main, feet.normal_n)


@equation
def tail_power(state: HelicopterState, around: Around, vehicle: VehicleParameters) -> float:
    """Shaft power of the tail rotor [W]."""
    air = airframe.air_motion(state, airframe.attitude(state), around)
    loads = rotor_loads(state, air, blade_angles(state, vehicle), inflow_of(state, around, vehicle), vehicle)
    return loads.tail_torque_n_m * rotor.tail_rotor(vehicle, rotor.speed_ratio(state.speed, vehicle)).speed_rad_s


@equation
def step(
    state: HelicopterState, controls: Controls, around: Around, dt: float, vehicle: VehicleParameters
) -> HelicopterState:
    """The state `dt` seconds later by the classical Runge-Kutta method, controls and surroundings held."""
    return normalised(classical_step(derivative, state, dt, controls, around, vehicle))
