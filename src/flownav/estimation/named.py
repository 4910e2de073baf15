"""Arguments of laws, as records: their fields are names of states and rows, or of numbers that a caller passes."""

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.core.frames import Rotation, rotation_from_quaternion


class PositionNed(NamedTuple):
    """Position [m], or its error."""

    pos_n: float
    pos_e: float
    pos_d: float


class VelocityNed(NamedTuple):
    """Velocity [m/s], or its error."""

    vel_n: float
    vel_e: float
    vel_d: float


class Attitude(NamedTuple):
    """The attitude, body to earth."""

    qw: float
    qx: float
    qy: float
    qz: float


class Tilt(NamedTuple):
    """The attitude's error about north, east and down [rad]."""

    tilt_n: float
    tilt_e: float
    heading: float


class Inertial(NamedTuple):
    """Reading of the IMU, body FRD: body rate [rad/s] and specific force [m/s2]."""

    gyro_x: float
    gyro_y: float
    gyro_z: float
    accel_x: float
    accel_y: float
    accel_z: float


class GyroBias(NamedTuple):
    """The gyro's bias, body FRD [rad/s], or its error."""

    gyro_bias_x: float
    gyro_bias_y: float
    gyro_bias_z: float


class AccelBias(NamedTuple):
    """The accelerometer's bias, body FRD [m/s2], or its error."""

    accel_bias_x: float
    accel_bias_y: float
    accel_bias_z: float


class BodyRate(NamedTuple):
    """The body rate in the last step, the gyro's bias taken off [rad/s]."""

    rate_x: float
    rate_y: float
    rate_z: float


class ForceNed(NamedTuple):
    """The specific force in the last step, bias taken off [m/s2]."""

    force_n: float
    force_e: float
    force_d: float


class Middle(NamedTuple):
    """R_EB in the middle of the last step, row by row."""

    middle_0: float
    middle_1: float
    middle_2: float
    middle_3: float
    middle_4: float
    middle_5: float
    middle_6: float
    middle_7: float
    middle_8: float


class Height(NamedTuple):
    """Down coordinates of the vehicle and of the ground below it [m], or their errors."""

    pos_d: float
    ground: float


class PadNed(NamedTuple):
    """Where the pad's centre lies [m]."""

    pad_n: float
    pad_e: float
    pad_d: float


class InsError(NamedTuple):
    """Tilt of an external attitude about body x and y, and its heading error [rad]."""

    ins_roll: float
    ins_pitch: float
    ins_heading: float


class ReadAttitude(NamedTuple):
    """A quaternion that was read."""

    measured_0: float
    measured_1: float
    measured_2: float
    measured_3: float


class ReadSight(NamedTuple):
    """Tangents forward and right of a line of sight that was read, and the distance [m]."""

    measured_0: float
    measured_1: float
    measured_2: float


class GyroLeft(NamedTuple):
    """The gyro's bias about an axis [rad/s], and by how much it is in a flow reading whose turning it took off."""

    gyro_bias: float
    gyro_share: float


class Lever(NamedTuple):
    """Where a sensor sits from the IMU, body FRD [m]."""

    forward_m: float
    right_m: float
    below_m: float


class Beam(NamedTuple):
    """Where a sensor that looks down sits from the IMU, body FRD [m], the depth first."""

    below_m: float
    forward_m: float = 0.0
    right_m: float = 0.0


class FlowMount(NamedTuple):
    """The flow sensor's lever from the IMU, body FRD (0 where no gyro measures its turning), and its lens's depth
    [m].
    """

    forward_m: float
    right_m: float
    below_m: float
    lens_below_m: float


@equation
def rotation_by(q: Attitude) -> Rotation:
    """R_EB."""
    return rotation_from_quaternion(q.qw, q.qx, q.qy, q.qz)
