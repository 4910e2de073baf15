"""Topics: a topic's messages as columns of numbers, which topic serves as which sensor, and one clock for all."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array

ODOMETRY, POSE_STAMPED = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"
POSES = (POSE_STAMPED, "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/TransformStamped", ODOMETRY)
TARGET, BATTERY = "mavros_msgs/msg/PositionTarget", "sensor_msgs/msg/BatteryState"
S_PER_NS = 1e-9
AGREEING_S = 3600.0  # headers of one clock; a simulator's clock may lie decades from the recorder's
LONGEST_DELAY_S = 1.0

QUATERNION = ("qw", "qx", "qy", "qz")
POSE = ("x", "y", "z", *QUATERNION)
Values = Callable[[Any], tuple[Any, ...]]


def _xyz(prefix: str, vector: str, *, axes: str = "xyz") -> dict[str, str]:
    return {f"{prefix}{axis}": f"{vector}.{axis}" for axis in axes}


def _pose(position: str, orientation: str) -> dict[str, str]:
    return _xyz("", position) | _xyz("q", orientation, axes="wxyz")


# what is kept of each type: columns by name, and where each lies in the message
FIELDS_READ: dict[str, dict[str, str]] = {
    "sensor_msgs/msg/Imu": {
        **_xyz("gyro_", "angular_velocity"), **_xyz("accel_", "linear_acceleration"),
        **_xyz("q", "orientation", axes="wxyz"), "no_orientation": "orientation_covariance",
        "no_rates": "angular_velocity_covariance", "no_force": "linear_acceleration_covariance",
    },
    "sensor_msgs/msg/NavSatFix": {
        "status": "status.status", "lat": "latitude", "lon": "longitude", "alt": "altitude",
        **dict.fromkeys(("var_e", "var_n", "var_u"), "position_covariance"),
        "covariance_type": "position_covariance_type",
    },
    "sensor_msgs/msg/FluidPressure": {"pressure": "fluid_pressure", "variance": "variance"},
    "sensor_msgs/msg/MagneticField": _xyz("", "magnetic_field"),
    "sensor_msgs/msg/Range": {name: name for name in ("range", "min_range", "max_range")},
    "geometry_msgs/msg/TwistStamped": _xyz("v", "twist.linear"),
    "geometry_msgs/msg/PoseStamped": _pose("pose.position", "pose.orientation"),
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose("pose.pose.position", "pose.pose.orientation"),
    "geometry_msgs/msg/TransformStamped": _pose("transform.translation", "transform.rotation"),
    "nav_msgs/msg/Odometry": _pose("pose.pose.position", "pose.pose.orientation") | _xyz("v", "twist.twist.linear"),
    "mavros_msgs/msg/OpticalFlowRad": {
        name: name
        for name in ("integration_time_us", "integrated_x", "integrated_y", "integrated_xgyro", "integrated_ygyro",
                     "quality", "distance")
    },
    TARGET: {"frame": "coordinate_frame", "mask": "type_mask", **_xyz("", "position")},
    BATTERY: {name: name for name in ("voltage", "current", "percentage")},
}  # fmt: skip
NAMES = {kind: tuple(columns) for kind, columns in FIELDS_READ.items()}
VALUES_READ: dict[str, Values] = {kind: attrgetter(*columns.values()) for kind, columns in FIELDS_READ.items()}


@dataclass
class Gathered:
    """One topic's messages: when each was logged and its header's stamp [ns], and its numbers."""

    topic: str
    kind: str
    log_ns: array[int] = field(default_factory=lambda: array("q"))
    stamp_ns: array[int] = field(default_factory=lambda: array("q"))
    rows: array[float] = field(default_factory=lambda: array("d"))
    names: tuple[str, ...] = ()

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
    """The values kept of a message, in the order of NAMES[kind]; of covariances the mark that there are none."""
    values = VALUES_READ[kind](message)
    if kind == "sensor_msgs/msg/Imu":
        values = (*values[:10], *(covariance[0] == -1.0 for covariance in values[10:]))
    elif kind == "sensor_msgs/msg/NavSatFix":
        values = (*values[:4], *(values[4][k] for k in (0, 4, 8)), values[7])
    return tuple(map(float, values))


# -- which topic serves -------------------------------------------------------------------------------------
class Role(NamedTuple):
    """A role that a topic may serve in. kinds: types that can; likely, unlikely: words in its name that suggest it,
    or that rule it out unless it is asked for; named: only topics with a likely word.
    """

    name: str
    kinds: tuple[str, ...]
    likely: tuple[str, ...] = ()
    unlikely: tuple[str, ...] = ()
    named: bool = False


TRUE_WORDS = ("mocap", "vicon", "optitrack", "vrpn", "qualisys", "ground_truth", "groundtruth", "truth", "leica", "gt")
OWN_WORDS = ("local_position", "estimat", "ekf", "fused", "filtered", "odom")
ASKED_WORDS = ("target_local", "setpoint", "target")
NOT_DOWN = ("front", "forward", "left", "right", "back", "rear", "upward")
ROLES = (
    Role(
        "imu", ("sensor_msgs/msg/Imu",), ("imu/data_raw", "imu"), ("camera", "realsense", "lidar", "ouster", "velodyne")
    ),
    Role("gps", ("sensor_msgs/msg/NavSatFix",), ("raw/fix", "gps", "gnss", "fix")),
    Role("gps_velocity", ("geometry_msgs/msg/TwistStamped",), ("gps", "gnss", "fix"), named=True),
    Role("baro", ("sensor_msgs/msg/FluidPressure",), ("static", "baro", "pressure"), ("diff", "airspeed")),
    Role("mag", ("sensor_msgs/msg/MagneticField",)),
    Role("range", ("sensor_msgs/msg/Range",), ("down", "ground", "rangefinder", "lidar", "sonar", "height"), NOT_DOWN),
    Role("flow", ("mavros_msgs/msg/OpticalFlowRad",)),
    Role("truth", POSES, TRUE_WORDS, (*OWN_WORDS, *ASKED_WORDS)),
    Role("autopilot", POSES, OWN_WORDS, (*TRUE_WORDS, *ASKED_WORDS), named=True),
    Role("setpoint", (TARGET, POSE_STAMPED), ASKED_WORDS, named=True),
    Role("battery", (BATTERY,)),
)


def asked_topics(texts: Iterable[str]) -> dict[str, str]:
    """Topics by role of words "ROLE=TOPIC". InputError where one is none, or a role is named twice."""
    found: dict[str, str] = {}
    for text in texts:
        role, _, topic = text.partition("=")
        if not topic or role in found:
            why = "is the second for its role" if topic else "ROLE=TOPIC is needed"
            raise InputError(f"{arg('topics')} {text}: {why}; the roles are {', '.join(each.name for each in ROLES)}")
        found[role] = topic
    return found


def chosen(
    topics: Iterable[Gathered], asked: Mapping[str, str], flow_instance: int | None
) -> tuple[dict[str, Gathered], list[str]]:
    """The topic of each role that has one, and a note a role where there was a choice.

    asked: topics by role, as a user names them. flow_instance: which of the flow topics, in the order of their names.
    InputError where a topic that was asked for is not in the bag or cannot serve.
    """
    listed = sorted((topic for topic in topics if len(topic)), key=lambda topic: topic.topic)
    _check_asked(asked, listed)
    found: dict[str, Gathered] = {}
    notes = []
    for role in ROLES:
        fitting = [topic for topic in listed if topic.kind in role.kinds]
        if role.name in asked:
            found[role.name] = next(topic for topic in fitting if topic.topic == asked[role.name])
            notes.append(f"{role.name} is {asked[role.name]}, as asked")
            continue
        if role.name == "flow" and flow_instance is not None:
            if not 0 <= flow_instance < len(fitting):
                names = ", ".join(f"{k} ({topic.topic})" for k, topic in enumerate(fitting)) or "none"
                raise InputError(f"{arg('flow_instance')} {flow_instance}: the bag's flow topics are {names}")
            fitting = [fitting[flow_instance]]
        taken, why = _best(role, [topic for topic in fitting if topic.topic not in asked.values()])
        if taken is None:
            continue
        found[role.name] = taken
        others = [f"{topic.topic} ({len(topic)})" for topic in fitting if topic is not taken]
        if others or role.name in ("truth", "autopilot"):
            left = f"; not used: {', '.join(others)}" if others else ""
            notes.append(f"{role.name} is {taken.topic} ({len(taken)} messages, {why}){left}")
    if found.get("truth") is found.get("autopilot") and "truth" in found:
        del found["autopilot"]
    return found, notes


def _best(role: Role, fitting: list[Gathered]) -> tuple[Gathered | None, str]:
    """The topic for a role, and why: by the first likely word that a name has, then by how many messages it has."""
    usable = [topic for topic in fitting if not _has(topic, role.unlikely) or _has(topic, role.likely[:1])]
    for word in role.likely:
        named = [topic for topic in usable if word in topic.topic.lower()]
        if named:
            return max(named, key=len), f"by its name: {word}"
    if role.named or not usable:
        return None, ""
    return max(usable, key=len), "the fullest" if len(usable) > 1 else "the only one"


def _has(topic: Gathered, words: tuple[str, ...]) -> bool:
    return any(word in topic.topic.lower() for word in words)


def _check_asked(asked: Mapping[str, str], listed: list[Gathered]) -> None:
    roles = {role.name: role for role in ROLES}
    for name, topic in asked.items():
        if name not in roles:
            raise InputError(f"{arg('topics')} {name}={topic}: the roles are {', '.join(roles)}")
        fitting = [each.topic for each in listed if each.kind in roles[name].kinds]
        if topic not in fitting:
            raise InputError(
                f"{arg('topics')} {name}={topic}: no such topic; for {name} the bag has {', '.join(fitting) or 'none'}"
            )


# -- one clock ----------------------------------------------------------------------------------------------
class Clock(NamedTuple):
    """start_ns: what is time 0. offset_ns: the recorder's clock less that of the headers. by_header: topics whose
    headers are believed. delays_s: by topic, how long after its stamp a message was logged, usually."""

    start_ns: int
    offset_ns: int
    by_header: frozenset[str]
    delays_s: dict[str, float]

    def times(self, topic: Gathered) -> Array:
        """When each message arrived [s]: its stamp and the topic's usual delay, or when it was logged."""
        if topic.topic in self.by_header:
            return np.asarray((topic.stamped - self.start_ns) * S_PER_NS + self.delay_s(topic), np.float64)
        return np.asarray((topic.logged - self.offset_ns - self.start_ns) * S_PER_NS, np.float64)

    def delay_s(self, topic: Gathered) -> float:
        """How old a reading is on arrival [s]."""
        return self.delays_s.get(topic.topic, 0.0)


def clock_of(topics: Iterable[Gathered]) -> tuple[Clock, list[str]]:
    """The clock, and notes on topics whose headers are not believed."""
    listed = [topic for topic in topics if len(topic)]
    late_ns = {
        topic.topic: float(np.median((topic.logged - topic.stamped)[topic.stamped > 0]))
        for topic in listed
        if np.mean(topic.stamped > 0) > 0.5
    }
    notes = []
    if late_ns and (max(late_ns.values()) - min(late_ns.values())) * S_PER_NS > AGREEING_S:
        notes.append("the headers' stamps are of different clocks: the times at which messages were logged are taken")
        late_ns = {}
    unstamped = sorted(topic.topic for topic in listed if topic.topic not in late_ns)
    if late_ns and unstamped:
        notes.append(f"no stamp in the headers of {', '.join(unstamped)}: the times of logging are taken")
    elif unstamped and not notes:
        notes.append("no stamps in the headers: the times at which messages were logged are taken")
    one_clock = all(abs(late) * S_PER_NS < LONGEST_DELAY_S for late in late_ns.values())
    offset_ns = 0 if one_clock else int(min(late_ns.values()))
    delays = {name: min(max((late - offset_ns) * S_PER_NS, 0.0), LONGEST_DELAY_S) for name, late in late_ns.items()}
    starts = [
        int(topic.stamped[topic.stamped > 0].min()) if topic.topic in late_ns else int(topic.logged.min()) - offset_ns
        for topic in listed
    ]
    middle = sorted(starts)[(len(starts) - 1) // 2] if starts else 0  # a damaged stamp is no start
    return Clock(middle, offset_ns, frozenset(late_ns), delays), notes
