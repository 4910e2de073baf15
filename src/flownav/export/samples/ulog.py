"""A log as PX4 would have written it: today's topics, in PX4's frames and units."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, Table
from flownav.export.samples.flight import changes, fixes_of, velocities_ned
from flownav.export.trajectory import Stamps, stamps
from flownav.export.ulog_topics import Field, Topic, assembled, logged
from flownav.logs.happened import FUSES_FLOW, MESSAGE
from flownav.logs.log import Log

BOOT_S = 20.0  # the vehicle's time since boot when the log's time 0 is
US_PER_S = 1e6
DOWNWARD_ROTATION = 25  # MAV_SENSOR_ROTATION_PITCH_270
SYSTEM = "flownav simulator"


def write_ulog(log: Log, path: Path, system: str = SYSTEM) -> None:
    """Write a log as a ULog file, with its parameters and messages."""
    strings = [logged(int(_us(np.array([row.t_s]))[0]), row.text) for row in log.happened if row.kind == MESSAGE]
    path.write_bytes(assembled(topics_of(log), strings, {"sys_name": system}, log.parameters))


def topics_of(log: Log) -> list[Topic]:
    """The topics of the sensors that a log has, of its truth and of the estimate that the vehicle flew on."""
    topics = [write(log) for sensor, write in TOPICS.items() if sensor in log.streams]
    for table, suffix in ((log.autopilot, ""), (log.truth, "_groundtruth")):
        if table is not None:
            topics += _state(table, suffix)
    fused = [(row.t_s, row.value) for row in log.happened if row.kind == FUSES_FLOW]
    if fused:
        t_s, value = np.array(fused).T
        topics.append(Topic("estimator_status_flags", _us(t_s), [Field("bool", "cs_opt_flow", value)]))
    return topics


def _us(t_s: Array) -> Stamps:
    return stamps(t_s, US_PER_S, BOOT_S)


def _sampled(stream: Stream) -> Field:
    return Field("uint64_t", "timestamp_sample", _us(stream.t_s - stream.delay_s))


def _inertial(log: Log) -> Topic:
    stream = log.streams[Sensor.IMU]
    parts = zip(("gyro_rad", "accelerometer_m_s2"), (stream.value[:, :3], stream.value[:, 3:]), strict=True)
    return Topic("sensor_combined", _us(stream.t_s), [Field("float", name, value) for name, value in parts])


def _flow(log: Log) -> Topic:
    """Angles over the time since the last reading; the camera's gyro has no third axis."""
    stream, limits = log.streams[Sensor.FLOW_RATE], log.limits
    span_us = np.rint(US_PER_S * np.median(np.diff(stream.t_s))) * np.ones(len(stream))
    seen = stream.value * (span_us / US_PER_S)[:, None]
    none = np.full(len(stream), np.nan)
    fixed = {
        "max_flow_rate": limits["flow_rad_s"][1],
        "min_ground_distance": limits["flow_height_m"][0],
        "max_ground_distance": limits["flow_height_m"][1],
    }
    return Topic("vehicle_optical_flow", _us(stream.t_s), [
        _sampled(stream),
        Field("float", "pixel_flow", seen[:, :2]),
        Field("float", "delta_angle", np.column_stack([seen[:, 2:4], none])),
        Field("uint32_t", "integration_timespan_us", span_us),
        Field("uint8_t", "quality", np.rint(stream.quality)),
        *(Field("float", name, np.full(len(stream), value)) for name, value in fixed.items()),
    ])  # fmt: skip


def _range(log: Log) -> Topic:
    stream = log.streams[Sensor.RANGE]
    least, most = (np.full(len(stream), limit) for limit in log.limits["range_m"])
    return Topic("distance_sensor", _us(stream.t_s), [
        Field("float", "current_distance", stream.value[:, 0]),
        Field("float", "min_distance", least),
        Field("float", "max_distance", most),
        Field("float", "variance", np.nan_to_num(stream.variance[:, 0])),
        Field("int8_t", "signal_quality", np.where(stream.quality > 0.0, 100, 0)),
        Field("uint8_t", "orientation", np.full(len(stream), DOWNWARD_ROTATION)),
    ])  # fmt: skip


def _gps(log: Log) -> Topic:
    fixes = fixes_of(log)
    count = len(fixes.t_s)
    velocity = zip((f"vel_{axis}_m_s" for axis in "ned"), fixes.velocity_ned_m_s.T, strict=True)
    return Topic("sensor_gps", _us(fixes.t_s), [
        Field("uint64_t", "timestamp_sample", _us(fixes.t_s - fixes.age_s)),
        Field("double", "latitude_deg", fixes.lat_deg),
        Field("double", "longitude_deg", fixes.lon_deg),
        Field("double", "altitude_msl_m", fixes.alt_m),
        *(Field("float", name, value) for name, value in velocity),
        Field("float", "s_variance_m_s", fixes.sigma_m_s),
        Field("float", "eph", fixes.sigma_m[:, 0]),
        Field("float", "epv", fixes.sigma_m[:, 1]),
        Field("uint8_t", "fix_type", np.full(count, 3)),
        Field("bool", "vel_ned_valid", np.ones(count)),
    ])  # fmt: skip


def _values(name: str, stream: Stream, field: str) -> Topic:
    value = stream.value[:, 0] if stream.value.shape[1] == 1 else stream.value
    return Topic(name, _us(stream.t_s), [_sampled(stream), Field("float", field, value)])


def _landed(log: Log) -> Topic:
    t_s, landed = changes(log)
    return Topic("vehicle_land_detected", _us(t_s), [Field("bool", "landed", landed)])


def _state(table: Table, suffix: str) -> list[Topic]:
    """Position and velocity NED, and attitude, under PX4's names."""
    time_us = _us(np.asarray(table["t_s"], float))
    quaternion = np.column_stack([table[name] for name in QUATERNION])
    velocity = velocities_ned(table)
    fields = [Field("float", axis, table[name]) for axis, name in zip("xyz", POSITION_NED, strict=True)]
    fields += [Field("float", f"v{axis}", velocity[:, k]) for k, axis in enumerate("xyz")]
    fields += [Field("bool", f"{what}_valid", np.ones(len(time_us))) for what in ("xy", "z", "v_xy", "v_z")]
    return [
        Topic(f"vehicle_local_position{suffix}", time_us, fields),
        Topic(f"vehicle_attitude{suffix}", time_us, [Field("float", "q", quaternion)]),
    ]


TOPICS: dict[Sensor, Callable[[Log], Topic]] = {
    Sensor.IMU: _inertial,
    Sensor.FLOW_RATE: _flow,
    Sensor.RANGE: _range,
    Sensor.GPS_POSITION: _gps,
    Sensor.BARO: lambda log: _values("vehicle_air_data", log.streams[Sensor.BARO], "baro_alt_meter"),
    Sensor.MAG: lambda log: _values("vehicle_magnetometer", log.streams[Sensor.MAG], "magnetometer_ga"),
    Sensor.LANDED: _landed,
}
