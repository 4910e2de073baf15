"""Log: what every reader yields and replay takes, in the project's frames; what it lacks, in any format's words.

ROS, Crazyflie, Betaflight and INAV have axes forward-left-up. A vector changes the signs of y and z. A rotation of body
FLU to an earth with z up becomes one of body FRD to NED: from east-north-up both sides are turned, from north-west-up
(a heading counted from x) both are half-turned about x. REP 103 (https://www.ros.org/reps/rep-0103.html) has ROS's.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.frames import quaternion_product, rotation_from_quaternion, to_body
from flownav.core.measurement import Array, EventQueue, Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Table
from flownav.logs.happened import Happened

TRUTH_FILE, SIMULATOR, VISUAL_ODOMETRY = "truth.csv", "the simulator", "visual odometry"


class Absence(NamedTuple):
    """Something that a log lacks, and what the filter does instead: one line each."""

    what: str
    instead: str


class FedSegment(NamedTuple):
    """The input of one navigator: its equipment (fields of navigation.feed.Equipment by name), and the queue."""

    equipment: dict[str, Any]
    queue: EventQueue


@dataclass(frozen=True)
class Log:
    """A recorded flight as streams.

    streams: by sensor, times in seconds of the log's own clock, in the units and frames of `measurement`.
    clock_start_s: time of the vehicle's clock, by which its log is stamped, at time 0 of the streams [s]; None where
    the log does not give it. origin_deg_m: latitude, longitude [deg] and altitude [m] of the local frame's origin; None
    without GPS. truth: an external reference, columns as record.TABLES["truth"]; its frame may be turned in yaw.
    truth_name: where the reference comes from; of visual odometry it is an estimate itself, and no truth.
    heading_truth: the vehicle's heading in the truth's frame, columns t_s and yaw_rad, where it came apart from it.
    inputs: SHA-256 of each file read, by name. notes: remarks of the reader for the user, one line each. autopilot: the
    vehicle's own estimates, columns as record.TABLES["autopilot"], and its name. fed: of a live session, the input of
    its filter, in order, navigator by navigator; fed_settings: the filter's settings and other options. limits: the
    range that a sensor states of itself, lowest and highest, by name with unit ("range_m", "flow_height_m",
    "flow_rad_s"). absences: the sensors that the log lacks. parameters: the vehicle's own settings by name, as last
    written; empty where the log has none. happened: its events besides the sensors' readings, in order of time
    (`logs/happened.py`). setpoints: the autopilot's set-points, in the frame of its estimate: tables of position and of
    attitude, each at its own times. battery: columns as record.TABLES["battery"].
    """

    path: Path
    streams: dict[Sensor, Stream]
    origin_deg_m: tuple[float, float, float] | None = None
    truth: Table | None = None
    inputs: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    autopilot: Table | None = None
    autopilot_name: str = ""
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    absences: tuple[Absence, ...] = ()
    clock_start_s: float | None = None
    fed: tuple[FedSegment, ...] = ()
    fed_settings: dict[str, Any] = field(default_factory=dict)
    heading_truth: Table | None = None
    truth_name: str = TRUTH_FILE
    parameters: dict[str, float] = field(default_factory=dict)
    happened: tuple[Happened, ...] = ()
    setpoints: tuple[Table, ...] = ()
    battery: Table | None = None

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last reading."""
        times = [stream.t_s for stream in self.streams.values() if len(stream)]
        return float(min(t[0] for t in times)), float(max(t[-1] for t in times))


INSTEAD = {
    Sensor.ATTITUDE: Absence(
        "no attitude", "it is found from the IMU: level by the accelerometer, heading counted from its start"
    ),
    Sensor.GPS_POSITION: Absence(
        "no GPS fix", "the path starts at the local origin and is dead reckoning on what is left; it drifts"
    ),
    Sensor.IMU: Absence("no inertial readings", "velocity is held between readings of the other sensors"),
    Sensor.BARO: Absence("no barometer", "height comes from the range, and from GPS where there is some"),
}


def absences_of(streams: Mapping[Sensor, Stream], **phrases: str) -> Iterator[Absence]:
    """The sensors that the streams lack. phrases: the reader's own text for `Absence.what`, by name of the sensor."""
    for sensor, absence in INSTEAD.items():
        if sensor not in streams:
            alone = sensor == Sensor.ATTITUDE and Sensor.IMU not in streams
            instead = "nothing finds it without an IMU: the log cannot be replayed" if alone else absence.instead
            yield Absence(phrases.get(sensor.name.lower(), absence.what), instead)
    if Sensor.GPS_POSITION in streams and Sensor.GPS_VELOCITY not in streams:
        yield Absence(
            phrases.get("gps_velocity", "no GPS velocity"),
            "velocity comes from flow and inertial readings, and from how the GPS position moves",
        )
    flow = streams.get(Sensor.FLOW_RATE)
    if flow is None and Sensor.FLOW_VELOCITY not in streams:
        yield Absence(phrases.get("flow_rate", "no optical flow"), "nothing but GPS holds the horizontal velocity")
    if flow is not None and Sensor.RANGE not in streams:
        yield Absence(
            phrases.get("range", "no range"),
            "flow is fused on the height that the other sensors leave, which is uncertain",
        )
    if flow is not None and np.isnan(flow.value[:, 2:]).all():
        others = {Sensor.IMU: "the IMU", Sensor.ATTITUDE: "the turning of the attitude"}
        other = " or ".join(name for sensor, name in others.items() if sensor in streams)
        yield Absence("no gyro in the flow sensor", f"rotation is taken out of the flow with {other or 'nothing'}")


ROOT_HALF = float(np.sqrt(0.5))
NED_FROM_ENU = (0.0, ROOT_HALF, ROOT_HALF, 0.0)
FLU_FROM_FRD = (0.0, 1.0, 0.0, 0.0)


def frd(vector: Array) -> Array:
    """Vectors (n, 3) of body FLU in body FRD; of north-west-up in NED likewise."""
    return np.asarray(vector * (1.0, -1.0, -1.0))


def ned(vector: Array) -> Array:
    """Vectors (n, 3) of east-north-up in north-east-down."""
    return np.asarray(vector[:, [1, 0, 2]] * (1.0, 1.0, -1.0))


def ned_from_frd(wxyz: Array) -> Array:
    """Quaternions (n, 4) of body FLU to ENU, as those of body FRD to NED."""
    left = quaternion_product(NED_FROM_ENU, tuple(wxyz.T))
    return np.column_stack(quaternion_product(left, FLU_FROM_FRD))


def ned_from_frd_of_nwu(wxyz: Array) -> Array:
    """Quaternions (n, 4) of body FLU to north-west-up, as those of body FRD to NED."""
    return np.asarray(wxyz * (1.0, 1.0, -1.0, -1.0))


# -- attitudes and rates ------------------------------------------------------------------------------------
def integrated(value: Array, step_s: Array) -> Array:
    """The integral of samples from the first on, linear between them; value (n,) or (n, k), step_s (n - 1,)."""
    path = np.zeros(value.shape)
    np.cumsum(0.5 * (value[1:] + value[:-1]) * step_s.reshape(-1, *[1] * (value.ndim - 1)), axis=0, out=path[1:])
    return path


def mean_over(t_s: Array, value: Array, start_s: Array, end_s: Array) -> Array:
    """Mean of sampled columns over intervals, linear between the samples; value (n, k) -> (m, k).

    Intervals have a length above 0; outside the samples the nearest one holds.
    """
    step_s, lasts_s = np.diff(t_s), end_s - start_s
    outside = [(np.minimum(at - t_s[0], 0.0), np.maximum(at - t_s[-1], 0.0)) for at in (start_s, end_s)]
    means = np.empty((len(start_s), value.shape[1]))
    for k in range(value.shape[1]):
        column = np.ascontiguousarray(value[:, k])
        integral = integrated(column, step_s)
        begun, ended = (
            np.interp(at, t_s, integral) + before * column[0] + after * column[-1]
            for at, (before, after) in zip((start_s, end_s), outside, strict=True)
        )
        means[:, k] = (ended - begun) / lasts_s
    return means


def attitude_at(attitude: Stream, instants_s: Array) -> Array:
    """Unit quaternions (m, 4) at given instants, linear between the logged ones, held outside them."""
    agree = np.where(np.sum(attitude.value[1:] * attitude.value[:-1], axis=1) < 0, -1.0, 1.0)
    continuous = attitude.value * np.concatenate([[1.0], np.cumprod(agree)])[:, None]
    blended = np.column_stack([np.interp(instants_s, attitude.t_s, column) for column in continuous.T])
    return np.asarray(blended / np.linalg.norm(blended, axis=1)[:, None])


def attitude_rates(attitude: Stream, start_s: Array, end_s: Array) -> Array:
    """Mean body rates (m, 3) [rad/s] that turn the attitude at start into that at end: free of gyro bias.

    The rotation from start to end is conj(q0) q1; its vector part is half the turn for the small turns between.
    """
    w0, x0, y0, z0 = attitude_at(attitude, start_s).T
    w1, x1, y1, z1 = attitude_at(attitude, end_s).T
    scalar = w0 * w1 + x0 * x1 + y0 * y1 + z0 * z1
    vector = np.column_stack([
        w0 * x1 - x0 * w1 - y0 * z1 + z0 * y1,
        w0 * y1 + x0 * z1 - y0 * w1 - z0 * x1,
        w0 * z1 - x0 * y1 + y0 * x1 - z0 * w1,
    ])  # fmt: skip
    sine = np.linalg.norm(vector, axis=1)
    half_angle = np.arctan2(sine, np.abs(scalar))
    stretch = np.where(sine > 1e-12, half_angle / np.maximum(sine, 1e-12), 1.0) * np.where(scalar < 0, -1.0, 1.0)
    return np.asarray(2.0 * vector * stretch[:, None] / (end_s - start_s)[:, None])


# -- states -------------------------------------------------------------------------------------------------
def state_table(t_s: Array, position_ned_m: Array, velocity_ned_m_s: Array, quaternion: Array | None) -> Table:
    """Position, and where the attitude (n, 4), body FRD to earth NED, is known body velocity and attitude."""
    table: Table = {"t_s": t_s, **dict(zip(POSITION_NED, position_ned_m.T, strict=True))}
    if quaternion is None:
        return table
    body = np.column_stack(to_body(rotation_from_quaternion(*quaternion.T), *velocity_ned_m_s.T))
    table |= dict(zip(VELOCITY_BODY, body.T, strict=True))
    return table | dict(zip(QUATERNION, quaternion.T, strict=True))


def in_order(table: Table) -> Table:
    """The rows in the order of their times; ties keep theirs."""
    order = np.argsort(table["t_s"], kind="stable")
    return {name: column[order] for name, column in table.items()}
