"""A multirotor as one set of differential equations: the four blocks put together (the helicopter's: `helicopter`).

Straight-line scalar equations, so that lanes vectorise: 20 states in, 20 rates out. Whether there are six rotors is
known when a kernel is compiled; four leave the work of the other two out.
"""

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.core.frames import Vector, quaternion_rate, to_earth
from flownav.vehicle import airframe, motors
from flownav.vehicle.parameters import MultirotorParameters
from flownav.vehicle.skids import support, with_friction, with_support
from flownav.vehicle.state import (
    Around,
    Controls,
    MultirotorState,
    Outputs,
    Six,
    below_plane,
    moved,
    of_unit_attitude,
    plane_normal,
    speeds_of,
    total_of,
)


class RotorLoads(NamedTuple):
    """All rotors' loads on the body: thrust, drag per airspeed, hub moment per airspeed; moments; torque of the air."""

    thrust_n: float
    drag_n_s_m: float
    hub_n_s: float
    roll_n_m: float
    pitch_n_m: float
    yaw_n_m: float  # of torques, which turn against each rotor's sense


NO_LOADS = RotorLoads(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Rotor(NamedTuple):
    """One rotor: speed; place forward and right of the centre of gravity; sense 1: it turns to the left; the ground
    under it over the centre of gravity, normal to the ground's plane.
    """

    speed: float
    x_m: float
    y_m: float
    sense: float
    ground_m: float


class RotorAir(NamedTuple):
    """The air that all rotors have: its motion, and squares of its speed in the rotors' plane and level."""

    motion: airframe.AirMotion
    inplane_sq: float
    horizontal_sq: float


@equation
def with_rotor(
    loads: RotorLoads, rotor: Rotor, air: RotorAir, normal: Vector, vehicle: MultirotorParameters
) -> RotorLoads:
    """The loads and one rotor's. Each has its own air and its own ground."""
    speed, x_m, y_m, sense, ground_m = rotor
    axial = air.motion.w + air.motion.p * y_m - air.motion.q * x_m
    height = vehicle.rotors_above_cg_m * normal[2] - ground_m - normal[0] * x_m - normal[1] * y_m
    one = motors.propeller_load(speed, air.inplane_sq, axial, air.horizontal_sq, height, vehicle)
    return RotorLoads(
        loads.thrust_n + one.thrust_n,
        loads.drag_n_s_m + one.drag_n_s_m,
        loads.hub_n_s + one.hub_n_s,
        loads.roll_n_m - y_m * one.thrust_n,
        loads.pitch_n_m + x_m * one.thrust_n,
        loads.yaw_n_m + sense * one.torque_n_m,
    )


@equation
def rotor_loads(
    speeds: Six, below_m: float, down: Vector, normal: Vector, air: airframe.AirMotion, hexa: bool, around: Around,
    vehicle: MultirotorParameters,
) -> RotorLoads:  # fmt: skip
    """All rotors' loads; below_m: of the centre of gravity under the ground's plane."""
    inplane_sq = air.u * air.u + air.v * air.v
    sinking = air.u * down[0] + air.v * down[1] + air.w * down[2]
    flat_sq = inplane_sq + air.w * air.w - sinking * sinking
    x, a, c = vehicle, around, around.cosine
    one, two, three, four = below_m + a.rotor_1_m, below_m + a.rotor_2_m, below_m + a.rotor_3_m, below_m + a.rotor_4_m
    loads, flow = NO_LOADS, RotorAir(air, inplane_sq, flat_sq)
    loads = with_rotor(loads, Rotor(speeds.one, x.x_1_m, x.y_1_m, 1.0, c * one), flow, normal, x)
    loads = with_rotor(loads, Rotor(speeds.two, x.x_2_m, x.y_2_m, -1.0, c * two), flow, normal, x)
    loads = with_rotor(loads, Rotor(speeds.three, x.x_3_m, x.y_3_m, 1.0, c * three), flow, normal, x)
    loads = with_rotor(loads, Rotor(speeds.four, x.x_4_m, x.y_4_m, -1.0, c * four), flow, normal, x)
    if hexa:
        five, six = below_m + a.rotor_5_m, below_m + a.rotor_6_m
        loads = with_rotor(loads, Rotor(speeds.five, x.x_5_m, x.y_5_m, 1.0, c * five), flow, normal, x)
        loads = with_rotor(loads, Rotor(speeds.six, x.x_6_m, x.y_6_m, -1.0, c * six), flow, normal, x)
    return loads


@equation
def free_wrench(
    loads: RotorLoads,
    turning: float,
    spinning_up: float,
    down: Vector,
    air: airframe.AirMotion,
    vehicle: MultirotorParameters,
) -> airframe.Wrench:
    """All forces and moments but the ground's (block 3).

    turning: Σ of the speeds of the rotors that turn left less those that turn right [rad/s]: they are gyroscopes;
    spinning_up: its rate [rad/s2], whose reaction turns the body.
    """
    x, y = -loads.drag_n_s_m * air.u, -loads.drag_n_s_m * air.v
    drag = airframe.fuselage_drag(0.0, air, vehicle)
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    spin = vehicle.rotor_inertia_kg_m2 * turning
    return airframe.Wrench(
        x + drag[0] + weight * down[0],
        y + drag[1] + weight * down[1],
        drag[2] + weight * down[2] - loads.thrust_n,
        loads.roll_n_m - loads.hub_n_s * air.v + vehicle.rotors_above_cg_m * y + spin * air.q,
        loads.pitch_n_m + loads.hub_n_s * air.u - vehicle.rotors_above_cg_m * x - spin * air.p,
        loads.yaw_n_m + vehicle.rotor_inertia_kg_m2 * spinning_up,
    )


@equation
def to_the_left(x: Six) -> float:
    """Σ over the rotors that turn left less Σ over those that turn right."""
    return ((x.one - x.two) + (x.three - x.four)) + (x.five - x.six)


@equation
def total_power(speeds: Six, vehicle: MultirotorParameters) -> float:
    """Shaft power of all rotors [W]."""
    return (
        (motors.shaft_power(speeds.one, vehicle) + motors.shaft_power(speeds.two, vehicle))
        + (motors.shaft_power(speeds.three, vehicle) + motors.shaft_power(speeds.four, vehicle))
    ) + (motors.shaft_power(speeds.five, vehicle) + motors.shaft_power(speeds.six, vehicle))


@equation
def driven(voltage_v: float, motor_out: float) -> Six:
    """The voltage at each motor, none at the one that is out (its number; 0: all run)."""
    return Six(
        0.0 if motor_out == 1.0 else voltage_v,
        0.0 if motor_out == 2.0 else voltage_v,
        0.0 if motor_out == 3.0 else voltage_v,
        0.0 if motor_out == 4.0 else voltage_v,
        0.0 if motor_out == 5.0 else voltage_v,
        0.0 if motor_out == 6.0 else voltage_v,
    )


@equation
def derivative_at_roots(
    state: MultirotorState, roots: Six, around: Around, hexa: bool, vehicle: MultirotorParameters
) -> MultirotorState:
    """The rates of the state while the mixer commands each rotor a share of its full thrust; cut, the motors stop.

    roots: `roots_of_shares`.
    """
    rotation = airframe.attitude(state)
    down = (rotation[6], rotation[7], rotation[8])
    velocity, rates = (state.u, state.v, state.w), (state.p, state.q, state.r)
    air = airframe.air_motion(state, rotation, around)
    speeds = speeds_of(state)
    power = total_power(speeds, vehicle)
    voltage = motors.battery_voltage(power, state.used, vehicle)
    drive = driven(voltage * around.engine, around.motor_out)
    spins = Six(
        motors.speed_rate(speeds.one, motors.commanded_speed(roots.one, drive.one, vehicle), vehicle),
        motors.speed_rate(speeds.two, motors.commanded_speed(roots.two, drive.two, vehicle), vehicle),
        motors.speed_rate(speeds.three, motors.commanded_speed(roots.three, drive.three, vehicle), vehicle),
        motors.speed_rate(speeds.four, motors.commanded_speed(roots.four, drive.four, vehicle), vehicle),
        motors.speed_rate(speeds.five, motors.commanded_speed(roots.five, drive.five, vehicle), vehicle)
        if hexa
        else 0.0,
        motors.speed_rate(speeds.six, motors.commanded_speed(roots.six, drive.six, vehicle), vehicle) if hexa else 0.0,
    )
    normal = plane_normal(rotation, around)
    below = below_plane(state.pos_n, state.pos_e, state.pos_d, around)
    loads = rotor_loads(speeds, below, down, normal, air, hexa, around, vehicle)
    free = free_wrench(loads, to_the_left(speeds), to_the_left(spins), down, air, vehicle)
    feet = support(below, normal, velocity, rates, around, vehicle)
    total = with_friction(with_support(free, feet, normal, vehicle), feet, velocity, rates, vehicle)
    return MultirotorState(
        *to_earth(rotation, state.u, state.v, state.w),
        *airframe.linear_acceleration(velocity, rates, (total.x, total.y, total.z), vehicle.mass_kg),
        *quaternion_rate(state.qw, state.qx, state.qy, state.qz, state.p, state.q, state.r),
        *airframe.angular_acceleration(rates, (total.l, total.m, total.n), vehicle),
        spins.one,
        spins.two,
        spins.three,
        spins.four,
        spins.five,
        spins.six,
        power / (vehicle.efficiency * voltage),
    )


@equation
def derivative(
    state: MultirotorState, controls: Controls, around: Around, hexa: bool, vehicle: MultirotorParameters
) -> MultirotorState:
    """The rates of the state."""
    return derivative_at_roots(
        state, motors.roots_of_shares(motors.mixed(controls, hexa, vehicle), hexa), around, hexa, vehicle
    )


@equation
def outputs(state: MultirotorState, around: Around, hexa: bool, vehicle: MultirotorParameters) -> Outputs:
    """Outputs of the state: all rotors' thrust in ground effect, torque on the body, shaft power; feet's force."""
    rotation = airframe.attitude(state)
    down = (rotation[6], rotation[7], rotation[8])
    air = airframe.air_motion(state, rotation, around)
    speeds = speeds_of(state)
    normal = plane_normal(rotation, around)
    below = below_plane(state.pos_n, state.pos_e, state.pos_d, around)
    loads = rotor_loads(speeds, below, down, normal, air, hexa, around, vehicle)
    feet = support(below, normal, (state.u, state.v, state.w), (state.p, state.q, state.r), around, vehicle)
    induced = vehicle.hover_inflow_m * total_of(speeds) / vehicle.rotor_count
    return Outputs(loads.thrust_n, loads.yaw_n_m, total_power(speeds, vehicle), induced, feet.normal_n)


@equation
def middle_of_step(
    state: MultirotorState, roots: Six, around: Around, dt: float, hexa: bool, vehicle: MultirotorParameters
) -> MultirotorState:
    """The state half a step on, at the rate of its start."""
    return moved(state, derivative_at_roots(state, roots, around, hexa, vehicle), 0.5 * dt)


@equation
def end_of_step(
    state: MultirotorState, middle: MultirotorState, roots: Six, around: Around, dt: float, hexa: bool,
    vehicle: MultirotorParameters,
) -> MultirotorState:  # fmt: skip
    """The state a step on, at the rate of the step's middle."""
    return of_unit_attitude(moved(state, derivative_at_roots(middle, roots, around, hexa, vehicle), dt))


@equation
def step(
    state: MultirotorState, controls: Controls, around: Around, dt: float, hexa: bool, vehicle: MultirotorParameters
) -> MultirotorState:
    """The state `dt` seconds later by the midpoint rule, controls and surroundings held."""
    roots = motors.roots_of_shares(motors.mixed(controls, hexa, vehicle), hexa)
    middle = middle_of_step(state, roots, around, dt, hexa, vehicle)
    return end_of_step(state, middle, roots, around, dt, hexa, vehicle)
