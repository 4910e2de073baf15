"""A PX4 ULog file as a Log: topics of every age of PX4, in the units and frames of `measurement`.

PX4's values in float or integer, degrees or 1e-7 degrees, accumulated radians or rates, have one form here. Message
definitions: PX4-Autopilot, msg/. The page is docs/reference/logs.md.
"""

from collections.abc import Iterator
from pathlib import Path

from flownav.core.measurement import Sensor, Stream
from flownav.core.record import Table
from flownav.logs import ulog_sensors as sensed
from flownav.logs.log import SIMULATOR, VISUAL_ODOMETRY, Absence, Log, absences_of
from flownav.logs.plausible import of_one_clock
from flownav.logs.ulog_events import ASKED, EVENT_TOPICS, battery, happened, setpoints
from flownav.logs.ulog_events import FIELDS as EVENT_FIELDS
from flownav.logs.ulog_flow import FLOW_TOPICS, flow_stream, flow_topic, range_stream, reading_limits
from flownav.logs.ulog_references import autopilot_estimate, pose_stream, truth_of
from flownav.logs.ulog_topics import Topic, Topics, read_topics

STATES = ("vehicle_land_detected",)
TOPICS = (
    *FLOW_TOPICS,
    *STATES,
    "distance_sensor",
    "sensor_combined",
    "vehicle_imu",
    "vehicle_acceleration",
    "vehicle_angular_velocity",
    "vehicle_gps_position",
    "sensor_gps",
    "vehicle_attitude",
    "vehicle_air_data",
    "sensor_baro",
    "vehicle_magnetometer",
    "sensor_mag",
    "vehicle_local_position",
    "vehicle_visual_odometry",
    "vehicle_local_position_groundtruth",
    "vehicle_attitude_groundtruth",
    "landing_target_pose",
    "irlock_report",
    *EVENT_TOPICS,
)
FIELDS = frozenset(
    (
        # flow, new and old
        "pixel_flow", "delta_angle", "delta_angle_available", "integration_timespan_us", "distance_m", "quality",
        "pixel_flow_x_integral", "pixel_flow_y_integral", "gyro_x_rate_integral", "gyro_y_rate_integral",
        "integration_timespan", "ground_distance_m", "max_flow_rate", "min_ground_distance", "max_ground_distance",
        # range
        "current_distance", "min_distance", "max_distance", "variance", "signal_quality", "orientation",
        # inertial
        "gyro_rad", "accelerometer_m_s2", "accelerometer_timestamp_relative", "delta_velocity", "delta_angle_dt",
        "delta_velocity_dt", "xyz",
        # GPS, new and old
        "latitude_deg", "longitude_deg", "altitude_msl_m", "lat", "lon", "alt", "vel_n_m_s", "vel_e_m_s", "vel_d_m_s",
        "vel_ned_valid", "fix_type", "eph", "epv", "s_variance_m_s",
        # attitude, odometry, estimates
        "q", "x", "y", "z", "vx", "vy", "vz", "heading", "yaw", "xy_valid", "z_valid", "v_xy_valid", "v_z_valid",
        "position", "velocity", "pose_frame", "velocity_frame", "local_frame", "pose_covariance",
        "position_variance",
        # air and field
        "baro_alt_meter", "baro_timestamp_relative", "pressure", "altitude", "magnetometer_ga",
        "magnetometer_timestamp_relative",
        # landing
        "landed", "x_rel", "y_rel", "z_rel", "rel_pos_valid", "pos_x", "pos_y",
        *EVENT_FIELDS,
    )
)  # fmt: skip


def read_ulog(path: Path, *, flow_instance: int | None = None) -> Log:
    """Read a ULog file; times are seconds since its first reading.

    flow_instance: which of several flow sensors, by PX4's instance number; None takes the one that saw most. What the
    log lacks stands in `Log.absences`, what was thrown away in `Stream.rejected`, damage of the file in `Log.notes`.
    InputError where the file cannot be read, is no ULog, holds no known sensor, or lacks that flow instance.
    """
    topics = read_topics(path, TOPICS, FIELDS, (*STATES, *EVENT_TOPICS))
    return log_of_topics(path, topics, flow_instance, inputs={path.name: topics.sha256})


def log_of_topics(
    path: Path, topics: Topics, flow_instance: int | None, *, inputs: dict[str, str], notes: tuple[str, ...] = (),
    reference: Table | None = None, reference_name: str = "",
) -> Log:  # fmt: skip
    """A Log from PX4's topics, wherever they were recorded.

    inputs: SHA-256 by file. notes: those of the file's reader. reference: a path that somebody else recorded, in
    NED about a frame of its own, instead of PX4's ground truth. InputError as of `read_ulog`.
    """
    flow = flow_topic(path, topics, flow_instance)
    flows = [f"{topic.label} ({len(topic)} readings)" for topic in topics.of(*FLOW_TOPICS) if topic is not flow]
    slow_imu = _slow_imu(topics)
    attitude, source = sensed.attitude_stream(topics)
    sensors = list(_sensors(topics, flow, attitude))
    gps, origin = sensed.gps_streams(topics)
    streams = {stream.sensor: stream for stream in (*sensors, *gps) if len(stream)}
    odometry_serves = bool(streams.keys() & {Sensor.FLOW_RATE, Sensor.GPS_POSITION})
    truth, truth_note = truth_of(topics, odometry_serves) if reference is None else (reference, "")
    pose, pose_note = (None, "") if truth_note else pose_stream(topics, attitude)
    if pose is not None:
        streams[Sensor.POSE] = pose
    autopilot, autopilot_note = autopilot_estimate(topics, attitude, source)
    why = "; ".join(_unusable(topics)) or "every row is invalid"
    streams, strays = of_one_clock(path, streams.values(), f"no usable reading of any sensor ({why}); give another log")
    flow_note = f"flow is {flow.label}; not used: {', '.join(flows)}" if flow is not None and flows else ""
    known = {"attitude": "no attitude (vehicle_attitude, or vehicle_visual_odometry with one)"}
    known |= {"imu": slow_imu} if slow_imu else {}
    absences = [*absences_of(streams, **known)]
    if source == "vehicle_visual_odometry":
        absences.append(
            Absence("no vehicle_attitude", "attitude is the visual odometry's, its heading from its own start")
        )
    all_notes = (*topics.notes, *notes, flow_note, truth_note, pose_note, autopilot_note, *strays)
    return Log(
        path, streams, origin, truth, inputs, (*filter(None, all_notes), *_unusable(topics)),
        autopilot, _estimator(topics) if autopilot is not None else "", reading_limits(topics, flow),
        tuple(absences), clock_start_s=topics.start_s,
        truth_name=reference_name or (VISUAL_ODOMETRY if truth_note else SIMULATOR),
        parameters=dict(topics.parameters), happened=happened(topics), setpoints=setpoints(topics),
        battery=battery(topics),
    )  # fmt: skip


def _sensors(topics: Topics, flow: Topic | None, attitude: Stream | None) -> Iterator[Stream]:
    """Every stream but GPS and odometry, where the log has it."""
    found = (
        attitude,
        sensed.imu_stream(topics),
        flow_stream(topics, flow) if flow is not None else None,
        range_stream(topics, flow),
        sensed.baro_stream(topics),
        sensed.mag_stream(topics),
        sensed.landed_stream(topics),
        sensed.pad_stream(topics, attitude),
    )
    return (stream for stream in found if stream is not None)


def _slow_imu(topics: Topics) -> str:
    """The note on the inertial readings, where they come too slowly to be used; "" without any."""
    label, rate_hz, count = sensed.fastest_imu(topics)
    if not label or rate_hz >= sensed.LEAST_IMU_HZ:
        return ""
    return f"inertial readings at {rate_hz:.0f} Hz only ({label}, {count} readings, left out)"


def _unusable(topics: Topics) -> list[str]:
    """The topics of which no row was left, with the reasons."""
    return [
        f"{topic.label}: no usable row ({', '.join(f'{count} {reason}' for reason, count in topic.rejected.items())})"
        for topic in topics.found
        if not len(topic) and topic.name not in ASKED
    ]


def _estimator(topics: Topics) -> str:
    """Which of PX4's estimators wrote the estimate: SYS_MC_EST_GROUP, on old firmware, chose another than EKF2.

    A system that is not PX4 by its own word is called by its name.
    """
    if topics.system and "px4" not in topics.system.lower():
        return topics.system
    return {1: "PX4 LPE", 3: "PX4 Q estimator"}.get(int(topics.parameters.get("SYS_MC_EST_GROUP", 2)), "PX4 EKF2")
