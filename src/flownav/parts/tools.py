"""Functions that most own filters need: rotations, a level start, the heading of a field, the velocity that flow shows.

Plain NumPy on arrays of three and four; the equations are those of `flownav.core.frames` and of the sensors'
conventions.
"""

import math

import numpy as np

from flownav.core.frames import GRAVITY_M_S2, quaternion_product, rotation_from_quaternion, velocity_from_flow
from flownav.core.measurement import Array
from flownav.navigation.kernel_settings import FlowSettings, GpsSettings, NavigatorSettings
from flownav.parts.protocols import Imu, Reading

LEAST_GPS_M = 0.3
LONGEST_WAIT_S = 10.0  # for a fix, where the log has GPS that finds none
GRAVITY_NED = np.array([0.0, 0.0, GRAVITY_M_S2])


def matrix(quaternion: Array) -> Array:
    """R_EB (3, 3), body FRD to earth NED, of (w, x, y, z)."""
    return np.reshape(rotation_from_quaternion(*quaternion), (3, 3))


def turned(quaternion: Array, angle_frd_rad: Array) -> Array:
    """The attitude turned on by a rotation vector (3,) in body axes [rad], of unit length."""
    angle = float(np.linalg.norm(angle_frd_rad))
    scale = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    turn = (math.cos(0.5 * angle), *(scale * np.asarray(angle_frd_rad)))
    after = np.array(quaternion_product(tuple(quaternion), turn))
    return np.asarray(after / np.linalg.norm(after))


def level_attitude(force_frd_m_s2: Array, heading_rad: float) -> Array:
    """The attitude (w, x, y, z) of a vehicle at rest that feels this specific force (3,), with this heading."""
    fx, fy, fz = force_frd_m_s2
    roll, pitch = math.atan2(-fy, -fz), math.atan2(fx, math.hypot(fy, fz))
    about = [(heading_rad, 2), (pitch, 1), (roll, 0)]
    quaternion = np.array([1.0, 0.0, 0.0, 0.0])
    for angle, axis in about:
        quaternion = turned(quaternion, angle * np.eye(3)[axis])
    return quaternion


def heading_off(quaternion: Array, field_frd: Array, declination_rad: float) -> float:
    """How far the heading by a magnetic field (3,), body FRD, lies from that of the attitude [rad], -pi to pi."""
    north, east, _ = matrix(quaternion) @ field_frd
    return float(math.remainder(declination_rad - math.atan2(east, north), 2.0 * math.pi))


def flow_velocity(reading: Reading, range_m: float, s: FlowSettings, turning_rad_s: Array) -> Array:
    """Velocity of the lens over the ground, forward and right (2,) [m/s], of a FLOW_RATE reading.

    flow_x = w_x - v_y/r and flow_y = w_y + v_x/r (PX4's convention), gains of the datasheet taken off. turning_rad_s
    (2,): the vehicle's rates about x and y over the exposure, where the reading does not carry them.
    """
    gyro_rad_s = reading.value[4:6] if len(reading.value) > 4 else np.full(2, np.nan)
    turning = np.where(np.isfinite(gyro_rad_s), gyro_rad_s, turning_rad_s)
    seen_x, seen_y = reading.value[:2] - turning
    forward_m_s, right_m_s = velocity_from_flow(seen_x, seen_y, range_m)
    return np.array([forward_m_s / s.flow_gain_x, right_m_s / s.flow_gain_y])


class AttitudeFollower:
    """Attitude (w, x, y, z) by gyro, leaning on the specific force and on a compass, each with a time constant [s].

    An explicit complementary filter (Mahony, Hamel and Pflimlin 2008) without its bias: what many small vehicles fly.
    """

    def __init__(self, tilt_s: float = 5.0, heading_s: float = 5.0) -> None:
        self.tilt_s, self.heading_s = tilt_s, heading_s
        self.quaternion, self.rate_rad_s = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
        self.started, self.since_s, self._field_s = False, math.nan, -math.inf

    def predict(self, dt_s: float, imu: Imu) -> Array:
        """Turn on by an inertial reading over dt; the acceleration NED (3,) that it implies [m/s2]."""
        if not self.started:
            self.quaternion, self.started = level_attitude(imu.force_frd_m_s2, heading_rad=0.0), True
        down = matrix(self.quaternion).T @ GRAVITY_NED
        lean = np.cross(down, imu.force_frd_m_s2) / GRAVITY_M_S2**2 / self.tilt_s
        self.rate_rad_s = imu.rate_frd_rad_s
        self.quaternion = turned(self.quaternion, (imu.rate_frd_rad_s + lean) * dt_s)
        return np.asarray(matrix(self.quaternion) @ imu.force_frd_m_s2 + GRAVITY_NED)

    def compass(self, reading: Reading, declination_rad: float) -> None:
        """Lean on a magnetic field; the first one is believed whole."""
        share = min((reading.t_s - self._field_s) / self.heading_s, 1.0)
        self._field_s = reading.t_s
        off = share * heading_off(self.quaternion, reading.value, declination_rad)
        self.quaternion = turned(self.quaternion, matrix(self.quaternion).T @ np.array([0.0, 0.0, off]))


def gps_variance(s: GpsSettings, alike: float = 10.0) -> Array:
    """Variances NED (3,) [m2] for a filter that takes GPS fixes for white, of a receiver whose errors last.

    This number of fixes in a row are `alike`: together they count as one fix. The white part is no smaller than 0.3 m.
    """
    level = s.gps_slow_sigma_m**2 + s.gps_fast_sigma_m**2
    down = s.gps_slow_sigma_down_m**2 + s.gps_fast_sigma_down_m**2
    white = np.array([s.gps_white_sigma_m, s.gps_white_sigma_m, s.gps_white_sigma_down_m])
    return np.asarray(np.fmax(white, LEAST_GPS_M) ** 2 + alike * np.array([level, level, down]))


def fix_is_overdue(t_s: float, attitude: AttitudeFollower, s: NavigatorSettings) -> bool:
    """Whether a filter that has had no fix for as long as ours would wait may begin at the local origin."""
    if not attitude.started:
        return False
    if not math.isfinite(attitude.since_s):
        attitude.since_s = t_s
    return t_s - attitude.since_s >= min(s.equipment.deadline_s, LONGEST_WAIT_S)
