"""Log: what every reader yields, and what replay takes; what a log lacks, in the same words for every format."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.measurement import EventQueue, Sensor, Stream
from flownav.core.record import Table

TRUTH_FILE, SIMULATOR, VISUAL_ODOMETRY = "truth.csv", "the simulator", "visual odometry"


class Absence(NamedTuple):
    """Something that a log lacks, and what the filter does instead: one line each."""

    what: str
    instead: str


class FedSegment(NamedTuple):
    """What one navigator was fed: its equipment (fields of navigation.feed.Equipment by name), and the queue."""

    equipment: dict[str, Any]
    queue: EventQueue


@dataclass(frozen=True)
class Log:
    """A recorded flight as streams.

    streams: by sensor, times in seconds of the log's own clock, in the units and frames of `measurement`.
    clock_start_s: what the vehicle's clock, by which its log is stamped, showed at time 0 of the streams [s]; None
    where the log does not say.
    origin_deg_m: latitude, longitude [deg] and altitude [m] of the local frame's origin; None without GPS.
    truth: an external reference, columns as record.TABLES["truth"]; its frame may be turned in yaw.
    truth_name: where the reference comes from; of visual odometry it is an estimate itself, and no truth.
    heading_truth: the vehicle's heading in the truth's frame, columns t_s and yaw_rad, where it came apart from it.
    inputs: SHA-256 of each file read, by name. notes: what a reader would tell the user, one line each.
    autopilot: what the vehicle's own estimator said, columns as record.TABLES["autopilot"], and its name.
    fed: of a live session, what its filter was fed, in order, navigator by navigator; fed_settings: the filter's
    settings and what else shaped it.
    limits: what a sensor states of itself, lowest and highest, by name with unit ("range_m", "flow_height_m",
    "flow_rad_s"). absences: what the log lacks.
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


def absences_of(streams: Mapping[Sensor, Stream], **said: str) -> Iterator[Absence]:
    """What the streams lack. said: what the reader knows better, by name of the sensor, for `Absence.what`."""
    for sensor, absence in INSTEAD.items():
        if sensor not in streams:
            alone = sensor == Sensor.ATTITUDE and Sensor.IMU not in streams
            instead = "nothing finds it without an IMU: the log cannot be replayed" if alone else absence.instead
            yield Absence(said.get(sensor.name.lower(), absence.what), instead)
    flow = streams.get(Sensor.FLOW_RATE)
    if flow is None and Sensor.FLOW_VELOCITY not in streams:
        yield Absence(said.get("flow_rate", "no optical flow"), "nothing but GPS holds the horizontal velocity")
    if flow is not None and Sensor.RANGE not in streams:
        yield Absence(
            said.get("range", "no range"),
            "flow is fused on the height that the other sensors leave, which is uncertain",
        )
    if flow is not None and np.isnan(flow.value[:, 2:]).all():
        others = {Sensor.IMU: "the IMU", Sensor.ATTITUDE: "the turning of the attitude"}
        other = " or ".join(name for sensor, name in others.items() if sensor in streams)
        yield Absence("no gyro in the flow sensor", f"rotation is taken out of the flow with {other or 'nothing'}")
