"""What surrounds a vehicle: moving air, the ground under its feet and its rotors, and whether its engine runs.

The ground near a vehicle is a plane, down = -(slope_n·n + slope_e·e), and what each foot and each rotor finds over it.
"""

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.core.frames import Rotation, Vector


class Around(NamedTuple):
    """Held over an epoch of the simulation.

    wind: of the air over the ground, NED [m/s], where it goes. turn: gradients of the gusts as the air's own rotation,
    NED [rad/s] (MIL-F-8785C's p_g, q_g, r_g). slope: of the ground, rise over run northwards and eastwards; cosine: of
    the plane's inclination. foot: ground over that plane under the feet [m], front right, front left, rear right, rear
    left; rotor: under the rotors, as ground effect finds it (a helicopter has the first). engine: 1 runs, 0 is cut.
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
