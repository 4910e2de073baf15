"""Made flights as ROS bags: what mavros and motion capture would have recorded (ENU, FLU), or PX4's own messages.

Written apart from the package's reader on purpose: axes are turned here by hand.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROS_1_KINDS = ("sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Range")
START_NS = 1_760_000_000_000_000_000
FLOW_RAD = """std_msgs/Header header
uint32 integration_time_us
float32 integrated_x
float32 integrated_y
float32 integrated_xgyro
float32 integrated_ygyro
float32 integrated_zgyro
int16 temperature
uint8 quality
uint32 time_delta_distance_us
float32 distance
"""
TARGET = """std_msgs/Header header
uint8 coordinate_frame
uint16 type_mask
geometry_msgs/Point position
geometry_msgs/Vector3 velocity
geometry_msgs/Vector3 acceleration_or_force
float32 yaw
float32 yaw_rate
"""
PX4 = {
    "SensorCombined": "uint64 timestamp\nfloat32[3] gyro_rad\nuint32 gyro_integral_dt\n"
    "int32 accelerometer_timestamp_relative\nfloat32[3] accelerometer_m_s2\nuint32 accelerometer_integral_dt\n",
    "VehicleAttitude": "uint64 timestamp\nuint64 timestamp_sample\nfloat32[4] q\n",
    "SensorGps": "uint64 timestamp\nuint64 timestamp_sample\nuint32 device_id\nfloat64 latitude_deg\n"
    "float64 longitude_deg\nfloat64 altitude_msl_m\nfloat32 s_variance_m_s\nuint8 fix_type\nfloat32 eph\n"
    "float32 epv\nfloat32 vel_n_m_s\nfloat32 vel_e_m_s\nfloat32 vel_d_m_s\nbool vel_ned_valid\n",
    "VehicleOpticalFlow": "uint64 timestamp\nuint64 timestamp_sample\nuint32 device_id\nfloat32[2] pixel_flow\n"
    "float32[3] delta_angle\nfloat32 distance_m\nuint32 integration_timespan_us\nuint8 quality\n",
    "DistanceSensor": "uint64 timestamp\nuint32 device_id\nfloat32 min_distance\nfloat32 max_distance\n"
    "float32 current_distance\nfloat32 variance\nint8 signal_quality\nuint8 type\nuint8 orientation\n",
    "VehicleAirData": "uint64 timestamp\nuint64 timestamp_sample\nfloat32 baro_alt_meter\n",
}  # fmt: skip


def typestore() -> Any:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(FLOW_RAD, "mavros_msgs/msg/OpticalFlowRad"))
    store.register(get_types_from_msg(TARGET, "mavros_msgs/msg/PositionTarget"))
    for name, words in PX4.items():
        store.register(get_types_from_msg(words, f"px4_msgs/msg/{name}"))
    return store


class BagMaker:
    """Messages gathered, then written in order of the time at which they were logged."""

    def __init__(self) -> None:
        self.store = typestore()
        self.rows: list[tuple[int, str, str, Any]] = []

    def kind(self, name: str) -> Any:
        return self.store.types[name]

    def header(self, t_s: float, frame: str = "base_link") -> Any:
        ns = START_NS + round(1e9 * t_s)
        time = self.kind("builtin_interfaces/msg/Time")(sec=ns // 10**9, nanosec=ns % 10**9)
        return self.kind("std_msgs/msg/Header")(stamp=time, frame_id=frame)

    def vector(self, x: float, y: float, z: float, name: str = "Vector3") -> Any:
        return self.kind(f"geometry_msgs/msg/{name}")(x=float(x), y=float(y), z=float(z))

    def quaternion(self, w: float, x: float, y: float, z: float) -> Any:
        return self.kind("geometry_msgs/msg/Quaternion")(x=float(x), y=float(y), z=float(z), w=float(w))

    def put(self, t_s: float, topic: str, kind: str, message: Any, late_s: float = 0.0) -> None:
        self.rows.append((START_NS + round(1e9 * (t_s + late_s)), topic, kind, message))

    def write(self, folder: Path, storage: StoragePlugin = StoragePlugin.MCAP) -> Path:
        with Writer(folder, version=9, storage_plugin=storage) as writer:
            connections = {}
            for ns, topic, kind, message in sorted(self.rows, key=lambda row: row[0]):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.store)
                writer.write(connections[topic], ns, self.store.serialize_cdr(message, kind))
        return folder

    def write_ros_1(self, path: Path, kinds: Collection[str] = ROS_1_KINDS) -> Path:
        """The messages of kinds that ROS 1 has, as its bag."""
        from rosbags.rosbag1 import Writer as Writer1

        store = get_typestore(Stores.ROS1_NOETIC)
        with Writer1(path) as writer:
            connections: dict[str, Any] = {}
            for ns, topic, kind, message in sorted(self.rows, key=lambda row: row[0]):
                if kind in kinds:
                    if topic not in connections:
                        connections[topic] = writer.add_connection(topic, kind, typestore=store)
                    message.header = store.types["std_msgs/msg/Header"](
                        seq=0, stamp=message.header.stamp, frame_id="base_link"
                    )
                    writer.write(connections[topic], ns, store.serialize_ros1(message, kind))
        return path


def enu_quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """The attitude of body FLU in ENU by the angles of FRD in NED: REP 103's yaw counts from east, to the left."""
    r, p, y = roll, -pitch, 0.5 * np.pi - yaw
    cr, sr, cp, sp, cy, sy = np.cos(r / 2), np.sin(r / 2), np.cos(p / 2), np.sin(p / 2), np.cos(y / 2), np.sin(y / 2)
    return (cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy)  # fmt: skip


def ros_flight(tables: dict[str, dict[str, np.ndarray]], truth: dict[str, np.ndarray] | None = None,
               late_s: float = 0.0) -> BagMaker:  # fmt: skip
    """The tables of `replay_logs.log_of_flight` as mavros records them. truth: t_s, n, e, d of motion capture."""
    bag, unknown = BagMaker(), np.full(9, 0.0)
    imu, attitude, gps, flow = (tables[name] for name in ("imu", "attitude", "gps", "flow"))
    angles = [np.interp(imu["t_s"], attitude["t_s"], np.unwrap(attitude[f"{a}_rad"])) for a in ("roll", "pitch", "yaw")]
    for k, t in enumerate(imu["t_s"]):
        message = bag.kind("sensor_msgs/msg/Imu")(
            header=bag.header(t), orientation=bag.quaternion(*enu_quaternion(*(angle[k] for angle in angles))),
            orientation_covariance=unknown,
            angular_velocity=bag.vector(imu["gyro_x_rad_s"][k], -imu["gyro_y_rad_s"][k], -imu["gyro_z_rad_s"][k]),
            angular_velocity_covariance=unknown,
            linear_acceleration=bag.vector(imu["accel_x_m_s2"][k], -imu["accel_y_m_s2"][k], -imu["accel_z_m_s2"][k]),
            linear_acceleration_covariance=unknown,
        )  # fmt: skip
        bag.put(t, "/mavros/imu/data", "sensor_msgs/msg/Imu", message, late_s)
    for k, t in enumerate(gps["t_s"]):
        status = bag.kind("sensor_msgs/msg/NavSatStatus")(status=0, service=1)
        fix = bag.kind("sensor_msgs/msg/NavSatFix")(
            header=bag.header(t), status=status, latitude=gps["lat_deg"][k], longitude=gps["lon_deg"][k],
            altitude=gps["alt_m"][k], position_covariance=unknown, position_covariance_type=0,
        )  # fmt: skip
        bag.put(t, "/mavros/global_position/raw/fix", "sensor_msgs/msg/NavSatFix", fix, late_s)
        linear = bag.vector(gps["vel_e_m_s"][k], gps["vel_n_m_s"][k], -gps["vel_d_m_s"][k])
        twist = bag.kind("geometry_msgs/msg/Twist")(linear=linear, angular=bag.vector(0, 0, 0))
        speed = bag.kind("geometry_msgs/msg/TwistStamped")(header=bag.header(t), twist=twist)
        bag.put(t, "/mavros/global_position/raw/gps_vel", "geometry_msgs/msg/TwistStamped", speed, late_s)
    dt_s = float(np.median(np.diff(flow["t_s"])))
    for k, t in enumerate(flow["t_s"]):
        message = bag.kind("mavros_msgs/msg/OpticalFlowRad")(
            header=bag.header(t), integration_time_us=round(1e6 * dt_s),
            integrated_x=flow["flow_x_rad_s"][k] * dt_s, integrated_y=-flow["flow_y_rad_s"][k] * dt_s,
            integrated_xgyro=flow["gyro_x_rad_s"][k] * dt_s, integrated_ygyro=-flow["gyro_y_rad_s"][k] * dt_s,
            integrated_zgyro=0.0, temperature=0, quality=int(flow["quality"][k]), time_delta_distance_us=0,
            distance=-1.0,
        )  # fmt: skip
        bag.put(t, "/mavros/px4flow/raw/optical_flow_rad", "mavros_msgs/msg/OpticalFlowRad", message, late_s)
    for k, t in enumerate(tables["range"]["t_s"]):
        message = bag.kind("sensor_msgs/msg/Range")(
            header=bag.header(t), radiation_type=1, field_of_view=0.1, min_range=0.1, max_range=12.0,
            range=tables["range"]["range_m"][k],
        )  # fmt: skip
        bag.put(t, "/mavros/rangefinder/rangefinder", "sensor_msgs/msg/Range", message, late_s)
    for k, t in enumerate(tables["baro"]["t_s"]):
        pascal = 101325.0 * (1.0 - tables["baro"]["alt_m"][k] / 44330.77) ** (1.0 / 0.1902632)
        message = bag.kind("sensor_msgs/msg/FluidPressure")(header=bag.header(t), fluid_pressure=pascal, variance=0.0)
        bag.put(t, "/mavros/imu/static_pressure", "sensor_msgs/msg/FluidPressure", message, late_s)
    for k, t in enumerate(tables["mag"]["t_s"]):
        x, y, z = (1e-7 * tables["mag"][f"mag_{axis}_mgauss"][k] for axis in "xyz")
        message = bag.kind("sensor_msgs/msg/MagneticField")(
            header=bag.header(t), magnetic_field=bag.vector(x, -y, -z), magnetic_field_covariance=unknown
        )
        bag.put(t, "/mavros/imu/mag", "sensor_msgs/msg/MagneticField", message, late_s)
    if truth is not None:
        for t, n, e, d in zip(*(truth[name] for name in ("t_s", "n", "e", "d")), strict=True):
            pose = bag.kind("geometry_msgs/msg/Pose")(
                position=bag.vector(e, n, -d, "Point"), orientation=bag.quaternion(1.0, 0.0, 0.0, 0.0)
            )
            stamped = bag.kind("geometry_msgs/msg/PoseStamped")(header=bag.header(t, "map"), pose=pose)
            bag.put(t, "/vrpn/vehicle/pose", "geometry_msgs/msg/PoseStamped", stamped, late_s)
    return bag


def px4_flight(tables: dict[str, dict[str, np.ndarray]], boot_s: float = 40.0) -> BagMaker:
    """The same flight as the messages of PX4's uXRCE-DDS client, stamped in microseconds since the boot."""
    bag = BagMaker()

    def put(t: float, topic: str, name: str, **fields: Any) -> None:
        message = bag.kind(f"px4_msgs/msg/{name}")(timestamp=round(1e6 * (boot_s + t)), **fields)
        bag.put(t, f"/fmu/out/{topic}", f"px4_msgs/msg/{name}", message, 0.003)

    imu, attitude, gps, flow = (tables[name] for name in ("imu", "attitude", "gps", "flow"))

    def f32(*values: float) -> np.ndarray:
        return np.array(values, np.float32)

    for k, t in enumerate(imu["t_s"]):
        put(t, "sensor_combined", "SensorCombined", gyro_rad=f32(*(imu[f"gyro_{a}_rad_s"][k] for a in "xyz")),
            gyro_integral_dt=5000, accelerometer_timestamp_relative=0, accelerometer_integral_dt=5000,
            accelerometer_m_s2=f32(*(imu[f"accel_{a}_m_s2"][k] for a in "xyz")))  # fmt: skip
    from flownav.core.frames import quaternion_from_euler

    for k, t in enumerate(attitude["t_s"]):
        q = quaternion_from_euler(*(attitude[f"{a}_rad"][k] for a in ("roll", "pitch", "yaw")))
        put(t, "vehicle_attitude", "VehicleAttitude", timestamp_sample=round(1e6 * (boot_s + t)), q=f32(*q))
    for k, t in enumerate(gps["t_s"]):
        put(t, "vehicle_gps_position", "SensorGps", timestamp_sample=round(1e6 * (boot_s + t)), device_id=0,
            latitude_deg=gps["lat_deg"][k], longitude_deg=gps["lon_deg"][k], altitude_msl_m=gps["alt_m"][k],
            s_variance_m_s=0.0, fix_type=3, eph=0.0, epv=0.0, vel_n_m_s=gps["vel_n_m_s"][k],
            vel_e_m_s=gps["vel_e_m_s"][k], vel_d_m_s=gps["vel_d_m_s"][k], vel_ned_valid=True)  # fmt: skip
    dt_s = float(np.median(np.diff(flow["t_s"])))
    for k, t in enumerate(flow["t_s"]):
        put(t, "vehicle_optical_flow", "VehicleOpticalFlow", timestamp_sample=round(1e6 * (boot_s + t)),
            device_id=0, pixel_flow=f32(flow["flow_x_rad_s"][k] * dt_s, flow["flow_y_rad_s"][k] * dt_s),
            delta_angle=f32(flow["gyro_x_rad_s"][k] * dt_s, flow["gyro_y_rad_s"][k] * dt_s, 0.0), distance_m=np.nan,
            integration_timespan_us=round(1e6 * dt_s), quality=int(flow["quality"][k]))  # fmt: skip
    for k, t in enumerate(tables["range"]["t_s"]):
        put(t, "distance_sensor", "DistanceSensor", device_id=0, min_distance=0.1, max_distance=12.0, variance=0.0,
            current_distance=tables["range"]["range_m"][k], signal_quality=100, type=0, orientation=25)  # fmt: skip
    for k, t in enumerate(tables["baro"]["t_s"]):
        put(t, "vehicle_air_data", "VehicleAirData", timestamp_sample=round(1e6 * (boot_s + t)),
            baro_alt_meter=tables["baro"]["alt_m"][k])  # fmt: skip
    return bag
