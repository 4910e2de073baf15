"""Messages of one topic as columns of numbers: what is kept of each type, by name, in the message's own units."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array

QUATERNION = ("qw", "qx", "qy", "qz")
POSE = ("x", "y", "z", *QUATERNION)
NAMES: dict[str, tuple[str, ...]] = {
    "sensor_msgs/msg/Imu": (
        "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z", *QUATERNION, "no_orientation", "no_rates",
        "no_force",
    ),
    "sensor_msgs/msg/NavSatFix": ("status", "lat", "lon", "alt", "var_e", "var_n", "var_u", "covariance_type"),
    "sensor_msgs/msg/FluidPressure": ("pressure", "variance"),
    "sensor_msgs/msg/MagneticField": ("x", "y", "z"),
    "sensor_msgs/msg/Range": ("range", "min_range", "max_range"),
    "geometry_msgs/msg/TwistStamped": ("vx", "vy", "vz"),
    "geometry_msgs/msg/PoseStamped": POSE,
    "geometry_msgs/msg/PoseWithCovarianceStamped": POSE,
    "geometry_msgs/msg/TransformStamped": POSE,
    "nav_msgs/msg/Odometry": (*POSE, "vx", "vy", "vz"),
    "mavros_msgs/msg/OpticalFlowRad": (
        "integration_time_us", "integrated_x", "integrated_y", "integrated_xgyro", "integrated_ygyro", "quality",
        "distance",
    ),
}  # fmt: skip


@dataclass
class Gathered:
    """One topic's messages: when each was logged and what its header says [ns], and its numbers."""

    topic: str
    kind: str
    log_ns: array[int] = field(default_factory=lambda: array("q"))
    stamp_ns: array[int] = field(default_factory=lambda: array("q"))
    rows: array[float] = field(default_factory=lambda: array("d"))
    names: tuple[str, ...] = ()
    frame: str = ""

    def __len__(self) -> int:
        return len(self.log_ns)

    @property
    def logged(self) -> NDArray[np.int64]:
        """Times of logging [ns]."""
        return np.frombuffer(self.log_ns, np.int64) if len(self.log_ns) else np.zeros(0, np.int64)

    @property
    def stamped(self) -> NDArray[np.int64]:
        """Times in the headers [ns], 0 where there is none."""
        return np.frombuffer(self.stamp_ns, np.int64) if len(self.stamp_ns) else np.zeros(0, np.int64)

    def column(self, *names: str) -> Array:
        """Columns side by side (n, len(names))."""
        table = np.frombuffer(self.rows, float).reshape(len(self), len(self.names))
        return np.array(table[:, [self.names.index(name) for name in names]])

    def take(self, log_ns: int, stamp_ns: int, names: tuple[str, ...], values: tuple[float, ...]) -> None:
        """One message more; one of another shape than the first is left out."""
        if not self.names:
            self.names = names
        if len(values) == len(self.names) and abs(log_ns) < 1 << 62 and abs(stamp_ns) < 1 << 62:
            self.log_ns.append(log_ns)
            self.stamp_ns.append(stamp_ns)
            self.rows.extend(values)


def stamp_of(message: Any) -> int:
    """The time in a message's header [ns]; 0 without one."""
    header = getattr(message, "header", None)
    if header is None:
        return 0
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def values_of(kind: str, message: Any) -> tuple[float, ...]:
    """What is kept of a message, in the order of NAMES[kind]."""
    return tuple(map(float, VALUES[kind](message)))


def _imu(m: Any) -> tuple[Any, ...]:
    turn, push, q = m.angular_velocity, m.linear_acceleration, m.orientation
    absent = (m.orientation_covariance[0], m.angular_velocity_covariance[0], m.linear_acceleration_covariance[0])
    return (turn.x, turn.y, turn.z, push.x, push.y, push.z, q.w, q.x, q.y, q.z, *(each == -1.0 for each in absent))


def _fix(m: Any) -> tuple[Any, ...]:
    c = m.position_covariance
    return m.status.status, m.latitude, m.longitude, m.altitude, c[0], c[4], c[8], m.position_covariance_type


def _pose(p: Any, q: Any) -> tuple[Any, ...]:
    return p.x, p.y, p.z, q.w, q.x, q.y, q.z


def _odometry(m: Any) -> tuple[Any, ...]:
    speed = m.twist.twist.linear
    return (*_pose(m.pose.pose.position, m.pose.pose.orientation), speed.x, speed.y, speed.z)


VALUES: dict[str, Callable[[Any], tuple[Any, ...]]] = {
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/NavSatFix": _fix,
    "sensor_msgs/msg/FluidPressure": lambda m: (m.fluid_pressure, m.variance),
    "sensor_msgs/msg/MagneticField": lambda m: (m.magnetic_field.x, m.magnetic_field.y, m.magnetic_field.z),
    "sensor_msgs/msg/Range": lambda m: (m.range, m.min_range, m.max_range),
    "geometry_msgs/msg/TwistStamped": lambda m: (m.twist.linear.x, m.twist.linear.y, m.twist.linear.z),
    "geometry_msgs/msg/PoseStamped": lambda m: _pose(m.pose.position, m.pose.orientation),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: _pose(m.pose.pose.position, m.pose.pose.orientation),
    "geometry_msgs/msg/TransformStamped": lambda m: _pose(m.transform.translation, m.transform.rotation),
    "nav_msgs/msg/Odometry": _odometry,
    "mavros_msgs/msg/OpticalFlowRad": lambda m: (
        m.integration_time_us, m.integrated_x, m.integrated_y, m.integrated_xgyro, m.integrated_ygyro, m.quality,
        m.distance,
    ),
}  # fmt: skip
