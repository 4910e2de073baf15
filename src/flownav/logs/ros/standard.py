"""Streams and tables from ROS's own messages: ENU and FLU become NED and FRD here, tesla gauss, pascal metres.

Units and axes: the definitions of sensor_msgs, geometry_msgs and nav_msgs (https://github.com/ros2/common_interfaces),
REP 103 and REP 145. `mavros_msgs/OpticalFlowRad` is in base_link (FLU): mavros turns MAVLink's aircraft axes
(mavros_extras/src/plugins/px4flow.cpp, `transform_frame_aircraft_baselink`).
"""

import numpy as np

from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, Table
from flownav.logs.assembly import Origin, counted, gps_streams, pressure_altitude_m, sensor_stream
from flownav.logs.log import frd, in_order, ned, ned_from_frd, state_table
from flownav.logs.ros.topics import POSE, QUATERNION, TARGET, Clock, Gathered

GAUSS_PER_TESLA = 1e4
KNOWN_COVARIANCE = 1  # sensor_msgs/NavSatFix: COVARIANCE_TYPE_APPROXIMATED and above
LEAST_ROWS = 2
LOCAL_NED = 1  # MAV_FRAME, of a PositionTarget


def streams_of(roles: dict[str, Gathered], clock: Clock) -> tuple[list[Stream], Origin | None]:
    """Every sensor's stream, and the origin of the GPS positions."""
    found = [*_imu(roles, clock), *_simple(roles, clock), _flow(roles, clock)]
    fixes, origin = _gps(roles, clock)
    return [stream for stream in (*found, *fixes) if stream is not None], origin


def _imu(roles: dict[str, Gathered], clock: Clock) -> list[Stream | None]:
    """Rates and specific force; the orientation as an attitude, where the message has one."""
    topic = roles.get("imu")
    if topic is None:
        return []
    t_s, delay_s = clock.times(topic), clock.delay_s(topic)
    rates = frd(topic.column("gyro_x", "gyro_y", "gyro_z"))
    force = frd(topic.column("accel_x", "accel_y", "accel_z"))
    absent = topic.column("no_orientation", "no_rates", "no_force") > 0
    measured = ~absent[:, 1] & ~absent[:, 2]
    value = np.column_stack([rates, force])[measured]
    found = [sensor_stream(Sensor.IMU, t_s[measured], value, delay_s=delay_s)]
    turned = topic.column(*QUATERNION)
    there = ~absent[:, 0] & (np.abs(turned).max(axis=1) > 0.0)
    if there.any() and np.ptp(turned[there], axis=0).any():  # a driver without one leaves it at one value
        quaternion = ned_from_frd(turned[there])
        found.append(sensor_stream(Sensor.ATTITUDE, t_s[there], quaternion, delay_s=delay_s))
    return found


def _simple(roles: dict[str, Gathered], clock: Clock) -> list[Stream | None]:
    def _stream(sensor: Sensor, topic: Gathered, value: Array) -> Stream | None:
        return sensor_stream(sensor, clock.times(topic), value, delay_s=clock.delay_s(topic))

    found: list[Stream | None] = []
    if "baro" in roles:
        found.append(_stream(Sensor.BARO, roles["baro"], pressure_altitude_m(roles["baro"].column("pressure")[:, 0])))
    if "mag" in roles:
        found.append(_stream(Sensor.MAG, roles["mag"], GAUSS_PER_TESLA * frd(roles["mag"].column("x", "y", "z"))))
    if "range" in roles:
        range_m, low, high = roles["range"].column("range", "min_range", "max_range").T
        range_m = np.where((range_m >= low) & ((range_m <= high) | (high <= low)), range_m, np.nan)
        found.append(_stream(Sensor.RANGE, roles["range"], range_m))
    elif "flow" in roles:
        distance, quality = roles["flow"].column("distance", "quality").T
        distance = np.where((distance > 0.0) & (quality > 0.0), distance, np.nan)
        if np.isfinite(distance).any():
            found.append(_stream(Sensor.RANGE, roles["flow"], distance))
    return found


def _flow(roles: dict[str, Gathered], clock: Clock) -> Stream | None:
    """Angles accumulated over the integration time, about x and y of base_link: rates about body FRD's."""
    topic = roles.get("flow")
    if topic is None:
        return None
    dt_us, *angles = topic.column("integration_time_us", "integrated_x", "integrated_y", "integrated_xgyro",
                                  "integrated_ygyro").T  # fmt: skip
    quality = topic.column("quality")[:, 0]
    dt_s = np.where((dt_us > 0) & (dt_us <= 1e6), 1e-6 * dt_us, np.nan)
    value = np.column_stack(angles) / dt_s[:, None] * (1.0, -1.0, 1.0, -1.0)
    blind = quality <= 0
    value[blind & ~np.isfinite(value[:, :2]).all(axis=1), :2] = 0.0
    timed = np.isfinite(dt_s) | blind
    delay_s = clock.delay_s(topic) + 0.5 * (float(np.nanmedian(dt_s)) if np.isfinite(dt_s).any() else 0.0)
    return sensor_stream(
        Sensor.FLOW_RATE, clock.times(topic)[timed], value[timed], quality=quality[timed], delay_s=delay_s,
        rejected=counted(no_integration_time=~timed),
    )  # fmt: skip


def _gps(roles: dict[str, Gathered], clock: Clock) -> tuple[list[Stream], Origin | None]:
    topic = roles.get("gps")
    if topic is None:
        return [], None
    status, lat, lon, alt, var_e, var_n, var_u, known = topic.column(
        "status", "lat", "lon", "alt", "var_e", "var_n", "var_u", "covariance_type"
    ).T
    t_s = clock.times(topic)
    variance = np.column_stack([var_n, var_e, var_u])
    variance[known < KNOWN_COVARIANCE] = np.nan
    velocity = np.full((len(topic), 3), np.nan)
    if "gps_velocity" in roles:
        velocity = _nearest(roles["gps_velocity"], clock, t_s)
    fix_type = np.where(status >= 0, 3.0, 0.0)
    return gps_streams(
        t_s, fix_type, (lat, lon, alt), velocity, position_variance=variance, delay_s=clock.delay_s(topic)
    )


def _nearest(topic: Gathered, clock: Clock, t_s: Array) -> Array:
    """The velocity (NED) nearest in time to each fix, NaN where none is within half the usual step."""
    stated_s = clock.times(topic)
    order = np.argsort(stated_s, kind="stable")
    stated_s, velocity = stated_s[order], ned(topic.column("vx", "vy", "vz"))[order]
    after = np.clip(np.searchsorted(stated_s, t_s), 1, max(len(stated_s) - 1, 1))
    if len(stated_s) < LEAST_ROWS:
        return np.full((len(t_s), 3), np.nan)
    row = np.where(t_s - stated_s[after - 1] < stated_s[after] - t_s, after - 1, after)
    near = np.abs(stated_s[row] - t_s) <= max(0.5 * float(np.median(np.diff(stated_s))), 0.02)
    return np.where(near[:, None], velocity[row], np.nan)


def limits_of(roles: dict[str, Gathered]) -> dict[str, tuple[float, float]]:
    """The range limits that the rangefinder states of itself [m]."""
    if "range" not in roles:
        return {}
    low, high = np.median(roles["range"].column("min_range", "max_range"), axis=0).tolist()
    return {"range_m": (low, high)} if 0.0 <= low < high < np.inf else {}


def asked_table(topic: Gathered, t_s: Array) -> Table:
    """Positions that the autopilot was to hold, as its local frame has them; a component that was left open is NaN.

    mavros_msgs/PositionTarget: ENU, since mavros turns MAVLink's (setpoint_raw.cpp); a bit of `type_mask` means:
    ignore.
    """
    place = topic.column("x", "y", "z")
    if topic.kind == TARGET:
        mask = topic.column("mask").astype(np.int64)
        place[(mask & (1, 2, 4)) > 0] = np.nan
        place[topic.column("frame")[:, 0] != LOCAL_NED] = np.nan
    place[~(np.abs(place) < 1e6)] = np.nan
    kept = np.isfinite(place).any(axis=1) & np.isfinite(t_s)
    order = np.argsort(t_s[kept], kind="stable")
    return {"t_s": t_s[kept][order], **dict(zip(POSITION_NED, ned(place[kept][order]).T, strict=True))}


def battery_table(topic: Gathered, t_s: Array) -> Table | None:
    """Voltage, current (BatteryState's is negative where it flows out) and what is left; None without a voltage."""
    voltage, current, share = topic.column("voltage", "current", "percentage").T
    kept = (voltage > 0.0) & np.isfinite(t_s)
    order = np.argsort(t_s[kept], kind="stable")
    columns = {"voltage_v": voltage, "current_a": -current, "remaining_percent": 100.0 * share}
    return {"t_s": t_s[kept][order]} | {name: x[kept][order] for name, x in columns.items()} if kept.any() else None


def path_table(topic: Gathered, t_s: Array) -> Table | None:
    """Positions, and attitude and body velocity where they are given, in NED and FRD; None without two rows.

    Odometry's velocity is in its child frame, the body (nav_msgs/Odometry).
    """
    pose = topic.column(*POSE)
    good = np.isfinite(pose[:, :3]).all(axis=1) & np.isfinite(t_s) & (np.abs(pose[:, :3]) < 1e6).all(axis=1)
    if np.count_nonzero(good) < LEAST_ROWS:
        return None
    t_s, pose = t_s[good], pose[good]
    order = np.argsort(t_s, kind="stable")
    t_s, pose = t_s[order], pose[order]
    position = ned(pose[:, :3])
    length = np.linalg.norm(pose[:, 3:], axis=1)
    if not np.all(np.abs(length - 1.0) < 0.1):
        return {"t_s": t_s, **dict(zip(POSITION_NED, position.T, strict=True))}
    quaternion = ned_from_frd(pose[:, 3:] / length[:, None])
    if "vx" in topic.names:
        body = frd(topic.column("vx", "vy", "vz"))[good][order]
        table = state_table(t_s, position, np.zeros_like(position), quaternion)
        return table | dict(zip(("vel_u_m_s", "vel_v_m_s", "vel_w_m_s"), body.T, strict=True))
    distinct = np.append(True, np.diff(t_s) > 0)
    t_s, position, quaternion = t_s[distinct], position[distinct], quaternion[distinct]
    if len(t_s) < LEAST_ROWS:
        return None
    return in_order(state_table(t_s, position, np.gradient(position, t_s, axis=0), quaternion))
