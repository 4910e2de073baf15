"""GPS, inertial, attitude, air, magnetic and landing topics of a ULog as streams."""

import numpy as np

from flownav.core.frames import rotation_from_quaternion, to_body
from flownav.core.measurement import Array, Sensor, Stream
from flownav.logs import assembly
from flownav.logs.log import attitude_at
from flownav.logs.ulog_topics import Topic, Topics

LEAST_IMU_HZ = 20.0  # slower, an inertial reading does not show the motion between two
FASTEST_M_S = 150.0
QUATERNION_FIELDS = tuple(f"q[{k}]" for k in range(4))
IMU_FIELDS = tuple(f"imu[{k}]" for k in range(6))
VELOCITY_FIELDS = ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")
LARGEST_HECTOPASCAL = 2000.0
LARGEST_RELATIVE_US = 1e6  # RELATIVE_TIMESTAMP_INVALID is far above
YAW_90 = 2.0  # PX4's rotation of an IR-LOCK unless a parameter gives another


def attitude_stream(topics: Topics) -> tuple[Stream | None, str]:
    """Body FRD to NED, and the topic: the autopilot's, or where it is not logged that of the visual odometry."""
    for name in ("vehicle_attitude", "vehicle_visual_odometry"):
        topic = topics.fullest(name, needs=QUATERNION_FIELDS)
        rejected = topic.rejected if topic and name == "vehicle_attitude" else {}
        stream = _fields(Sensor.ATTITUDE, topic, QUATERNION_FIELDS, rejected) if topic else None
        if stream is not None and len(stream):
            return stream, name
    return None, ""


def _fields(sensor: Sensor, topic: Topic, names: tuple[str, ...], rejected: dict[str, int] | None = None) -> Stream:
    """Fields of a topic as they stand; rejected: what is counted already, the topic's own where it is not given."""
    counts = topic.rejected if rejected is None else rejected
    rows = assembly.Rows(topic.t_s, {name: topic.columns[name] for name in names}, dict(counts))
    return assembly.stream_of_rows(sensor, rows, names, topic.delay_s)


# -- inertial ----------------------------------------------------------------------------------------------
def imu_stream(topics: Topics) -> Stream | None:
    """Rates and specific force from the fastest source; None where none is fast enough to integrate."""
    sources = [*map(_combined, topics.of("sensor_combined")), *map(_delta, topics.of("vehicle_imu"))]
    rates = topics.fullest("vehicle_angular_velocity", needs=("xyz[0]",))
    force = topics.fullest("vehicle_acceleration", needs=("xyz[0]",))
    if rates is not None and force is not None and force.rate_hz >= LEAST_IMU_HZ:
        sources.append(_joined(rates, force))
    for source in sources:
        assembly.keep_possible(source, Sensor.IMU, IMU_FIELDS)
    fast = [source for source in sources if source.rate_hz >= LEAST_IMU_HZ]
    if not fast:
        return None
    best = max(fast, key=lambda source: source.rate_hz)
    return Stream.of(Sensor.IMU, best.t_s, best.matrix(*IMU_FIELDS), delay_s=best.delay_s, rejected=best.rejected)


def fastest_imu(topics: Topics) -> tuple[str, float, int]:
    """Label, rate [Hz] and readings of the fastest inertial topic, fast enough or not; "", 0, 0 without."""
    present = topics.of("sensor_combined", "vehicle_imu", "vehicle_angular_velocity")
    best = max(present, key=lambda topic: topic.rate_hz, default=None)
    return (best.label, best.rate_hz, len(best)) if best is not None else ("", 0.0, 0)


def _inertial(topic: Topic, parts: list[Array]) -> Topic:
    columns = dict(zip(IMU_FIELDS, parts, strict=True))
    if "sample_s" in topic.columns:
        columns["sample_s"] = topic.columns["sample_s"]
    return Topic(topic.t_s, columns, dict(topic.rejected), topic.name, topic.instance)


def _combined(topic: Topic) -> Topic:
    return _inertial(topic, [*topic.parts("gyro_rad", 3), *topic.parts("accelerometer_m_s2", 3)])


def _delta(topic: Topic) -> Topic:
    """vehicle_imu: turn and velocity accumulated over times in microseconds."""
    with np.errstate(divide="ignore", invalid="ignore"):
        turned_s, pushed_s = (1e-6 * topic.column(name) for name in ("delta_angle_dt", "delta_velocity_dt"))
        rates = [turn / turned_s for turn in topic.parts("delta_angle", 3)]
        force = [push / pushed_s for push in topic.parts("delta_velocity", 3)]
    return _inertial(topic, [*rates, *force])


def _joined(rates: Topic, force: Topic) -> Topic:
    """Rates with the specific force between its two nearest readings."""
    between = [np.interp(rates.t_s, force.t_s, column) for column in force.parts("xyz", 3)]
    return _inertial(rates, [*rates.parts("xyz", 3), *between])


# -- GPS ---------------------------------------------------------------------------------------------------
def gps_streams(topics: Topics) -> tuple[list[Stream], assembly.Origin | None]:
    """Velocity, then position, and the origin of the local frame; nothing where no fix is 3-D."""
    candidates = topics.of("vehicle_gps_position", "sensor_gps")
    if not candidates:
        return [], None
    most = max(candidates, key=lambda topic: int(np.count_nonzero(topic.columns.get("fix_type", np.zeros(1)) >= 3)))
    fixes = _fixes(most)
    sigma = fixes.matrix("s_variance_m_s", "eph", "epv")  # accuracies [m/s, m], in spite of the first one's name
    sigma[~(sigma > 0)] = np.nan
    velocity = fixes.matrix(*VELOCITY_FIELDS)
    return assembly.streams_of_fixes(fixes, velocity, sigma[:, [0, 0, 0]] ** 2, sigma[:, [1, 1, 2]] ** 2, fixes.delay_s)


def _fixes(topic: Topic) -> Topic:
    """3-D fixes in degrees and metres; velocity NaN where the receiver has none."""
    if topic.has("latitude_deg", "longitude_deg", "altitude_msl_m"):
        place = topic.matrix("latitude_deg", "longitude_deg", "altitude_msl_m")
    else:
        place = topic.matrix("lat", "lon", "alt") * (1e-7, 1e-7, 1e-3)
    velocity = topic.matrix(*VELOCITY_FIELDS)
    known = (abs(velocity) < FASTEST_M_S).all(axis=1) & (topic.columns.get("vel_ned_valid", np.ones(len(topic))) > 0)
    velocity[~known] = np.nan
    topic.columns |= dict(zip((*assembly.PLACE, *VELOCITY_FIELDS), (*place.T, *velocity.T), strict=True))
    assembly.keep_fixes(topic, topic.columns.get("fix_type", np.zeros(len(topic))))
    return topic


# -- air, field, landing -----------------------------------------------------------------------------------
def baro_stream(topics: Topics) -> Stream | None:
    """Pressure altitude [m]."""
    topic = topics.fullest("vehicle_air_data", "sensor_combined", needs=("baro_alt_meter",))
    if topic is not None:
        return _fields(Sensor.BARO, _at_relative(topic, "baro"), ("baro_alt_meter",))
    topic = topics.fullest("sensor_baro", needs=("altitude",)) or topics.fullest("sensor_baro", needs=("pressure",))
    if topic is not None and not topic.has("altitude"):
        pressure = topic.columns["pressure"]
        pressure_pa = np.where(pressure < LARGEST_HECTOPASCAL, 100.0, 1.0) * np.maximum(pressure, 0.0)
        topic.columns["altitude"] = assembly.SCALE_HEIGHT_M * (
            1.0 - (pressure_pa / assembly.SEA_LEVEL_PA) ** assembly.ALTITUDE_EXPONENT
        )
    return None if topic is None else _fields(Sensor.BARO, topic, ("altitude",))


def mag_stream(topics: Topics) -> Stream | None:
    """Field in body axes [gauss]."""
    names = tuple(f"magnetometer_ga[{k}]" for k in range(3))
    topic = topics.fullest("vehicle_magnetometer", "sensor_combined", needs=names)
    if topic is not None:
        return _fields(Sensor.MAG, _at_relative(topic, "magnetometer"), names)
    topic = topics.fullest("sensor_mag", needs=("x", "y", "z"))
    return None if topic is None else _fields(Sensor.MAG, topic, ("x", "y", "z"))


def landed_stream(topics: Topics) -> Stream | None:
    """1 on the ground, 0 in flight."""
    topic = topics.fullest("vehicle_land_detected", needs=("landed",))
    return None if topic is None else _fields(Sensor.LANDED, topic, ("landed",))


def _at_relative(topic: Topic, what: str) -> Topic:
    """The slower sensor inside an old sensor_combined: its own times, each of its readings once."""
    column = f"{what}_timestamp_relative"
    if not topic.has(column):
        return topic
    relative_us = topic.columns[column]
    stated = abs(relative_us) < LARGEST_RELATIVE_US
    t_s = np.maximum(topic.t_s + 1e-6 * relative_us, 0.0)[stated]
    fresh = np.diff(t_s, prepend=-1.0) > 1e-6
    columns = {name: values[stated][fresh] for name, values in topic.columns.items()}
    return Topic(t_s[fresh], columns, {}, topic.name, topic.instance)


def pad_stream(topics: Topics, attitude: Stream | None) -> Stream | None:
    """The landing pad: an IR-LOCK's own reading, without distance, or else the precision landing's estimate."""
    topic = topics.fullest("irlock_report", needs=("pos_x", "pos_y"))
    if topic is not None:
        scale = [topics.parameters.get(f"LTEST_SCALE_{axis}", 1.0) for axis in "XY"]
        angle = 0.25 * np.pi * topics.parameters.get("LTEST_SENS_ROT", YAW_90)
        x, y = (topic.matrix("pos_x", "pos_y") * scale).T
        forward, right = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y
        value = np.column_stack([forward, right, np.full(len(topic), np.nan)])
        return _pad(topic, value)
    topic = topics.fullest("landing_target_pose", needs=("x_rel", "y_rel", "z_rel"))
    if topic is None or attitude is None:
        return None
    topic.keep(topic.columns.get("rel_pos_valid", np.ones(len(topic))) > 0, "invalid")
    away = topic.matrix("x_rel", "y_rel", "z_rel")
    rotation = rotation_from_quaternion(*attitude_at(attitude, topic.t_s).T)
    forward, right, down = np.asarray(to_body(rotation, *away.T))
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.column_stack([forward / down, right / down, np.linalg.norm(away, axis=1)])
    value[down <= 0] = np.nan
    return _pad(topic, value)


def _pad(topic: Topic, value: Array) -> Stream:
    names = ("forward", "right", "distance")
    rows = assembly.Rows(topic.t_s, dict(zip(names, value.T, strict=True)), dict(topic.rejected))
    return assembly.stream_of_rows(Sensor.PAD, rows, names, topic.delay_s)
