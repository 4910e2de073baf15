"""Observation laws of each sensor over named states: its prediction and its Jacobian, a file a sensor.

Here stands the code that the laws share: body axes in the earth frame, levers, the distance to level ground.
"""

from flownav.core.compile import equation, larger
from flownav.core.frames import Rotation, Vector

LEAST_RANGE_M = 0.05  # chosen: no flow is fused nearer to the ground (flow_min_height_m)
LEAST_UPRIGHT = 0.1  # 84 deg, which only keeps a division finite: from 46 on no flow or range is fused (tilt_limit_rad)


@equation
def component(vector: Vector, axis: int) -> float:
    """One of three."""
    return vector[0] if axis == 0 else (vector[1] if axis == 1 else vector[2])


@equation
def body_axis(rotation: Rotation, axis: int) -> Vector:
    """The body's forward, right or down axis in earth NED: a column of R_EB."""
    return (
        rotation[0] if axis == 0 else (rotation[1] if axis == 1 else rotation[2]),
        rotation[3] if axis == 0 else (rotation[4] if axis == 1 else rotation[5]),
        rotation[6] if axis == 0 else (rotation[7] if axis == 1 else rotation[8]),
    )


@equation
def cross(a: Vector, b: Vector) -> Vector:
    """a x b.

    The derivative of `axis . v` on the attitude error, for a body axis in earth NED and a vector v that does not turn
    with the body, is `axis x v`: (I + [theta]x) axis . v = axis . v + theta . (axis x v).
    """
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@equation
def along_axis(rotation: Rotation, axis: int, velocity: Vector, swing_m_s: float) -> tuple[Vector, float, Vector]:
    """A body axis, a velocity NED [m/s] along it with what turning adds there, and its slope on the attitude error."""
    direction = body_axis(rotation, axis)
    along_m_s = direction[0] * velocity[0] + direction[1] * velocity[1] + direction[2] * velocity[2] + swing_m_s
    return direction, along_m_s, cross(direction, velocity)


@equation
def turning(arm: Vector, axis: int) -> Vector:
    """The derivative on the attitude error of one earth component of a vector that turns with the body.

    (theta x arm)_i = theta . (arm x e_i).
    """
    return (
        0.0 if axis == 0 else (-arm[2] if axis == 1 else arm[1]),
        arm[2] if axis == 0 else (0.0 if axis == 1 else -arm[0]),
        -arm[1] if axis == 0 else (arm[0] if axis == 1 else 0.0),
    )


@equation
def lens_range(rotation: Rotation, height_m: float, lens: Vector) -> tuple[float, float, float, float]:
    """r = (h - R_31 x - R_32 y)/R_33 - z, its slope on the height h, and on the attitude error about north and east.

    The distance [m] along body down to level ground from a lens at (x, y, z), body FRD from the vehicle's reference
    point, which is h above ground. theta turns R_3j by theta_n R_2j - theta_e R_1j. At least LEAST_RANGE_M, where the
    slopes are 0.
    """
    upright = larger(rotation[8], LEAST_UPRIGHT)
    drop = height_m - rotation[6] * lens[0] - rotation[7] * lens[1]
    free = drop / upright - lens[2]
    slope = 1.0 / upright if free.real > LEAST_RANGE_M else 0.0
    by_tilt = slope * drop / upright
    by_north = -by_tilt * rotation[5] - slope * (rotation[3] * lens[0] + rotation[4] * lens[1])
    by_east = by_tilt * rotation[2] + slope * (rotation[0] * lens[0] + rotation[1] * lens[1])
    return larger(free, LEAST_RANGE_M), slope, by_north, by_east
