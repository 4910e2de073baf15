"""The state of a helicopter and of a multirotor, their controls, what follows from them, and what surrounds a vehicle.

What surrounds it: moving air, the ground under its feet and its rotors, and whether its engine runs. The ground near a
vehicle is a plane, down = -(slope_n·n + slope_e·e), and what each foot and each rotor finds over it.
"""

from typing import Any, NamedTuple

from flownav.core.compile import equation, magnitude, passing, replacing, runge_kutta, stepping
from flownav.core.frames import Quaternion, Rotation, Vector, of_unit_length


class HelicopterState(NamedTuple):
    """The helicopter's state; of its rates where a function states so (then every unit is per second).

    pos: centre of gravity, earth NED [m], level ground at pos_d = 0. u, v, w: velocity, body FRD [m/s]. qw..qz:
    attitude, body to earth. p, q, r: body rates [rad/s]. a1, b1: flapping, back and right [rad]. lon, lat, col,
    ped: servo positions, as blade angles [rad], and their rates [rad/s]. inflow: the main rotor's induced velocity
    [m/s]. speed: of the main rotor [rad/s]; the tail rotor is geared to it. governed: the governor's integral [W].
    """

    pos_n: float
    pos_e: float
    pos_d: float
    u: float
    v: float
    w: float
    qw: float
    qx: float
    qy: float
    qz: float
    p: float
    q: float
    r: float
    a1: float
    b1: float
    lon: float
    lat: float
    col: float
    ped: float
    lon_rate: float
    lat_rate: float
    col_rate: float
    ped_rate: float
    inflow: float
    speed: float
    governed: float


class Controls(NamedTuple):
    """Commanded blade angles [rad]: lon > 0 pitches up, lat > 0 rolls right, col > 0 climbs, ped > 0 yaws right."""

    lon: float
    lat: float
    col: float
    ped: float


class Inflow(NamedTuple):
    """Induced velocities of the main and the tail rotor [m/s]."""

    main: float
    tail: float


class RotorLoads(NamedTuple):
    """Thrust out of ground effect [N] and torque [N m] of the main and the tail rotor."""

    lift_n: float
    torque_n_m: float
    tail_n: float
    tail_torque_n_m: float


class Outputs(NamedTuple):
    """Outputs of a state: main rotor thrust in ground effect, torque, shaft power, inflow; skid normal force."""

    thrust_n: float
    torque_n_m: float
    power_w: float
    induced_velocity_m_s: float
    contact_force_n: float


after_stage, classical_step = runge_kutta(stepping(HelicopterState))


NEGLIGIBLE = 1e-100  # what decays below it is zero: arithmetic on subnormal numbers is a hundred times slower


@equation
def settled(value: float) -> float:
    """A decaying value, zero once it is negligible."""
    return value if magnitude(value) > NEGLIGIBLE else 0.0


@equation
def unit_attitude(state: Any) -> Quaternion:
    """The quaternion of a state, of either kind of vehicle, brought back to unit length."""
    return of_unit_length((state.qw, state.qx, state.qy, state.qz))


_STILL = {"pos_n", "pos_e", "pos_d", "qw", "qx", "qy", "qz", "speed"}  # what does not decay
_settle = passing(HelicopterState, settled, *(name for name in HelicopterState._fields if name not in _STILL))
_turned = replacing(HelicopterState, "qw", "qx", "qy", "qz")


@equation
def normalised(state: HelicopterState) -> HelicopterState:
    """The state with its quaternion brought back to unit length and its dying motions brought to rest."""
    w, x, y, z = unit_attitude(state)
    return _turned(_settle(state), qw=w, qx=x, qy=y, qz=z)


class MultirotorState(NamedTuple):
    """A multirotor's state; of its rates where a function states so (then every unit is per second).

    The first thirteen are those of `state.HelicopterState`, in its order: the sensors look at these alone. speed_1..6:
    the rotors', clockwise from the front right [rad/s], a quad's last two are zero. used: charge taken from the full
    battery [A s].
    """

    pos_n: float
    pos_e: float
    pos_d: float
    u: float
    v: float
    w: float
    qw: float
    qx: float
    qy: float
    qz: float
    p: float
    q: float
    r: float
    speed_1: float
    speed_2: float
    speed_3: float
    speed_4: float
    speed_5: float
    speed_6: float
    used: float


class Six(NamedTuple):
    """A number for each rotor; a quad's last two are zero."""

    one: float
    two: float
    three: float
    four: float
    five: float
    six: float


@equation
def speeds_of(state: MultirotorState) -> Six:
    """The rotors' speeds [rad/s]."""
    return Six(state.speed_1, state.speed_2, state.speed_3, state.speed_4, state.speed_5, state.speed_6)


@equation
def total_of(x: Six) -> float:
    """The sum over the rotors."""
    return ((x.one + x.two) + (x.three + x.four)) + (x.five + x.six)


moved = stepping(MultirotorState)  # state + rate·dt


_settle_multirotor = passing(MultirotorState, settled, "u", "v", "w", "p", "q", "r")
_turn_multirotor = replacing(MultirotorState, "qw", "qx", "qy", "qz")


@equation
def of_unit_attitude(state: MultirotorState) -> MultirotorState:
    """The state with its quaternion brought back to unit length and its dying motions brought to rest."""
    w, x, y, z = unit_attitude(state)
    return _turn_multirotor(_settle_multirotor(state), qw=w, qx=x, qy=y, qz=z)


class Around(NamedTuple):
    """Held over an epoch of the simulation.

    wind: of the air over the ground, NED [m/s], where it goes. turn: gradients of the gusts as the air's own rotation,
    NED [rad/s] (MIL-F-8785C's p_g, q_g, r_g). slope: of the ground, rise over run northwards and eastwards; cosine: of
    the plane's inclination. foot: ground over that plane under the feet [m], front right, front left, rear right, rear
    left; rotor: under the rotors, as ground effect finds it (a helicopter has the first). engine: 1 runs, 0 is cut or
    off. motor_out: that of a multirotor's which gives nothing, 1 to 6; 0: none. tail_stuck: 1, the tail's blades stay.
    """

    wind_n_m_s: float
    wind_e_m_s: float
    wind_d_m_s: float
    turn_n_rad_s: float
    turn_e_rad_s: float
    turn_d_rad_s: float
    slope_n: float
    slope_e: float
    cosine: float
    foot_1_m: float
    foot_2_m: float
    foot_3_m: float
    foot_4_m: float
    rotor_1_m: float
    rotor_2_m: float
    rotor_3_m: float
    rotor_4_m: float
    rotor_5_m: float
    rotor_6_m: float
    engine: float
    motor_out: float
    tail_stuck: float


CALM = Around(**(dict.fromkeys(Around._fields, 0.0) | {"cosine": 1.0, "engine": 1.0}))  # still air over level ground


def in_wind(north_m_s: float, east_m_s: float, down_m_s: float = 0.0) -> Around:
    """Steady wind over level ground."""
    return CALM._replace(wind_n_m_s=north_m_s, wind_e_m_s=east_m_s, wind_d_m_s=down_m_s)


@equation
def below_plane(pos_n: float, pos_e: float, pos_d: float, around: Around) -> float:
    """How far a place lies under the ground's plane [m], straight down: its down coordinate over level ground."""
    return pos_d + (around.slope_n * pos_n + around.slope_e * pos_e)


@equation
def plane_normal(rotation: Rotation, around: Around) -> Vector:
    """The normal into the ground's plane, body axes: over level ground the earth's down axis."""
    n, e, c = around.slope_n, around.slope_e, around.cosine
    return (
        (rotation[6] + (n * rotation[0] + e * rotation[3])) * c,
        (rotation[7] + (n * rotation[1] + e * rotation[4])) * c,
        (rotation[8] + (n * rotation[2] + e * rotation[5])) * c,
    )
