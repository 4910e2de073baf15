"""A complementary filter as equations: compiled into the loop, sixteen flights side by side.

Attitude by gyro, leaning on the specific force and on the compass; velocity on GPS or flow; position on GPS and range.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import arctan2, cos, equation, replacing, sin
from flownav.core.frames import GRAVITY_M_S2, quaternion_product, rotation_from_quaternion, to_body, to_earth
from flownav.core.measurement import Sensor
from flownav.navigation.records import Reading
from flownav.parts.equations import EquationEstimate, EquationFilter

TILT_S, HEADING_S, GPS_S, VELOCITY_S, FLOW_S, RANGE_S = 5.0, 5.0, 2.0, 0.5, 0.3, 0.3
LONGEST_S = 0.1  # a gap in the inertial readings is no longer than this


class Memory(NamedTuple):
    """The state, and the time of each sensor's last reading [s]. known: 1 with a fix, grounded: with a range."""

    pos_n: float = 0.0
    pos_e: float = 0.0
    pos_d: float = 0.0
    vel_n: float = 0.0
    vel_e: float = 0.0
    vel_d: float = 0.0
    qw: float = 1.0
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    imu_s: float = -1e9
    gps_s: float = -1e9
    velocity_s: float = -1e9
    flow_s: float = -1e9
    range_s: float = -1e9
    compass_s: float = -1e9
    range_m: float = 0.0
    ground_d: float = 0.0
    known: float = 0.0
    grounded: float = 0.0


with_motion = replacing(Memory, "pos_n", "pos_e", "pos_d", "vel_n", "vel_e", "vel_d", "qw", "qx", "qy", "qz", "imu_s")
with_fix = replacing(Memory, "pos_n", "pos_e", "pos_d", "gps_s", "known")
with_velocity = replacing(Memory, "vel_n", "vel_e", "vel_d", "velocity_s")
with_flow = replacing(Memory, "vel_n", "vel_e", "flow_s")
with_range = replacing(Memory, "pos_d", "vel_d", "range_s", "range_m", "ground_d", "grounded")
with_heading = replacing(Memory, "qw", "qx", "qy", "qz", "compass_s")


@equation
def turned(m: Memory, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """The attitude turned on by a small rotation vector in body axes [rad], of unit length."""
    half = 0.5 * np.sqrt(x * x + y * y + z * z) + 1e-12
    s = 0.5 * sin(half) / half
    return quaternion_product((m.qw, m.qx, m.qy, m.qz), (cos(half), s * x, s * y, s * z))


@equation
def by_imu(m: Memory, t_s: float, r: Reading) -> Memory:
    """Strapdown over one inertial reading, with a tilt that leans on the specific force."""
    dt = min(max(t_s - m.imu_s, 0.0), LONGEST_S) if m.imu_s > -1e8 else 0.0
    fx, fy, fz = r.value_3, r.value_4, r.value_5
    dx, dy, dz = to_body(rotation_from_quaternion(m.qw, m.qx, m.qy, m.qz), 0.0, 0.0, GRAVITY_M_S2)
    lean = 1.0 / (GRAVITY_M_S2 * GRAVITY_M_S2 * TILT_S)
    q = turned(
        m,
        dt * (r.value_0 + lean * (dy * fz - dz * fy)),
        dt * (r.value_1 + lean * (dz * fx - dx * fz)),
        dt * (r.value_2 + lean * (dx * fy - dy * fx)),
    )
    a_n, a_e, a_d = to_earth(rotation_from_quaternion(q[0], q[1], q[2], q[3]), fx, fy, fz)
    vel_n, vel_e, vel_d = m.vel_n + a_n * dt, m.vel_e + a_e * dt, m.vel_d + (a_d + GRAVITY_M_S2) * dt
    return with_motion(
        m, pos_n=m.pos_n + vel_n * dt, pos_e=m.pos_e + vel_e * dt, pos_d=m.pos_d + vel_d * dt, vel_n=vel_n,
        vel_e=vel_e, vel_d=vel_d, qw=q[0], qx=q[1], qy=q[2], qz=q[3], imu_s=t_s,
    )  # fmt: skip


@equation
def share_of(since_s: float, t_s: float, time_s: float) -> float:
    """The weight of a sensor's reading, by the time since its last one."""
    return min((t_s - since_s) / time_s, 1.0)


@equation
def by_gps(m: Memory, t_s: float, r: Reading) -> Memory:
    """Level position; height from the first fix alone, then the range has it."""
    k = share_of(m.gps_s, t_s, GPS_S)
    down = m.pos_d if m.known > 0.0 else r.value_2
    return with_fix(
        m, pos_n=m.pos_n + k * (r.value_0 - m.pos_n), pos_e=m.pos_e + k * (r.value_1 - m.pos_e), pos_d=down,
        gps_s=t_s, known=1.0,
    )  # fmt: skip


@equation
def by_gps_velocity(m: Memory, t_s: float, r: Reading) -> Memory:
    """Correct the velocity by GPS, where there is no flow."""
    k = share_of(m.velocity_s, t_s, VELOCITY_S) if t_s - m.flow_s > 1.0 else 0.0
    off_d = r.value_2 - m.vel_d if np.isfinite(r.value_2) else 0.0
    return with_velocity(
        m, vel_n=m.vel_n + k * (r.value_0 - m.vel_n), vel_e=m.vel_e + k * (r.value_1 - m.vel_e),
        vel_d=m.vel_d + k * off_d, velocity_s=t_s,
    )  # fmt: skip


@equation
def by_flow(m: Memory, t_s: float, r: Reading) -> Memory:
    """Level velocity: flow_x = w_x - v_y/r, flow_y = w_y + v_x/r, with the turning that the reading carries."""
    k = share_of(m.flow_s, t_s, FLOW_S) if m.grounded > 0.0 else 0.0
    rotation = rotation_from_quaternion(m.qw, m.qx, m.qy, m.qz)
    u, v, _ = to_body(rotation, m.vel_n, m.vel_e, m.vel_d)
    off_u, off_v = (r.value_1 - r.value_5) * m.range_m - u, (r.value_4 - r.value_0) * m.range_m - v
    off_n, off_e, _ = to_earth(rotation, off_u, off_v, 0.0)
    fixed = np.isfinite(off_n + off_e)
    return with_flow(
        m, vel_n=m.vel_n + k * off_n if fixed else m.vel_n, vel_e=m.vel_e + k * off_e if fixed else m.vel_e, flow_s=t_s
    )


@equation
def by_range(m: Memory, t_s: float, r: Reading) -> Memory:
    """Height over the ground that the first range has found."""
    k = share_of(m.range_s, t_s, RANGE_S)
    height_m = r.value_0 * rotation_from_quaternion(m.qw, m.qx, m.qy, m.qz)[8]
    ground_d = m.ground_d if m.grounded > 0.0 else m.pos_d + height_m
    off = k * (ground_d - height_m - m.pos_d)
    return with_range(
        m, pos_d=m.pos_d + off, vel_d=m.vel_d + 0.5 * off, range_s=t_s, range_m=r.value_0, ground_d=ground_d,
        grounded=m.known,
    )  # fmt: skip


@equation
def by_compass(m: Memory, t_s: float, r: Reading) -> Memory:
    """Heading from magnetic north, for a place without declination."""
    k = share_of(m.compass_s, t_s, HEADING_S)
    rotation = rotation_from_quaternion(m.qw, m.qx, m.qy, m.qz)
    north, east, _ = to_earth(rotation, r.value_0, r.value_1, r.value_2)
    x, y, z = to_body(rotation, 0.0, 0.0, -k * arctan2(east, north))
    q = turned(m, x, y, z)
    return with_heading(m, qw=q[0], qx=q[1], qy=q[2], qz=q[3], compass_s=t_s)


@equation
def step(m: Memory, t_s: float, sensor: int, r: Reading) -> Memory:
    """Each sensor's own way; what is withheld or silent, or carries no data, is left alone."""
    if r.arrived == 0.0 or r.withheld > 0.0 or r.quality == 0.0 or not np.isfinite(r.value_0):
        return m
    if sensor == Sensor.IMU:
        return by_imu(m, t_s, r)
    if sensor == Sensor.GPS_POSITION:
        return by_gps(m, t_s, r)
    if sensor == Sensor.GPS_VELOCITY:
        return by_gps_velocity(m, t_s, r)
    if sensor == Sensor.FLOW_RATE:
        return by_flow(m, t_s, r)
    if sensor == Sensor.RANGE:
        return by_range(m, t_s, r)
    if sensor == Sensor.MAG:
        return by_compass(m, t_s, r)
    return m


@equation
def say(m: Memory) -> EquationEstimate:
    """The state as it stands; this filter states no uncertainty."""
    return EquationEstimate(
        m.known, m.pos_n, m.pos_e, m.pos_d, m.vel_n, m.vel_e, m.vel_d, m.qw, m.qx, m.qy, m.qz,
        np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, m.grounded, m.ground_d,
    )  # fmt: skip


equation_filter = EquationFilter("equations", Memory(), step, say)
