"""Which topic serves as which sensor, and why: the one that was asked for, else by its name, else the fullest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from flownav.core.errors import InputError
from flownav.logs.ros.columns import Gathered

ODOMETRY, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"
POSES = (POSE, "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/TransformStamped", ODOMETRY)


class Role(NamedTuple):
    """What a topic may serve as. kinds: types that can; likely, unlikely: words in its name that speak for it, or
    that rule it out unless it is asked for; named: only topics with a likely word."""

    name: str
    kinds: tuple[str, ...]
    likely: tuple[str, ...] = ()
    unlikely: tuple[str, ...] = ()
    named: bool = False


TRUE_WORDS = ("mocap", "vicon", "optitrack", "vrpn", "qualisys", "ground_truth", "groundtruth", "truth", "leica", "gt")
OWN_WORDS = ("local_position", "estimat", "ekf", "fused", "filtered", "odom")
AHEAD = ("front", "forward", "left", "right", "back", "rear", "upward")
ROLES = (
    Role(
        "imu", ("sensor_msgs/msg/Imu",), ("imu/data_raw", "imu"), ("camera", "realsense", "lidar", "ouster", "velodyne")
    ),
    Role("gps", ("sensor_msgs/msg/NavSatFix",), ("raw/fix", "gps", "gnss", "fix")),
    Role("gps_velocity", ("geometry_msgs/msg/TwistStamped",), ("gps", "gnss", "fix"), named=True),
    Role("baro", ("sensor_msgs/msg/FluidPressure",), ("static", "baro", "pressure"), ("diff", "airspeed")),
    Role("mag", ("sensor_msgs/msg/MagneticField",)),
    Role("range", ("sensor_msgs/msg/Range",), ("down", "ground", "rangefinder", "lidar", "sonar", "height"), AHEAD),
    Role("flow", ("mavros_msgs/msg/OpticalFlowRad",)),
    Role("truth", POSES, TRUE_WORDS, OWN_WORDS),
    Role("autopilot", POSES, OWN_WORDS, TRUE_WORDS, named=True),
)


def asked_topics(texts: Iterable[str]) -> dict[str, str]:
    """Topics by role of words "ROLE=TOPIC". InputError where one is none, or a role is named twice."""
    found: dict[str, str] = {}
    for text in texts:
        role, _, topic = text.partition("=")
        if not topic or role in found:
            why = "is the second for its role" if topic else "ROLE=TOPIC is needed"
            raise InputError(f"--topic {text}: {why}; the roles are {', '.join(each.name for each in ROLES)}")
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
                raise InputError(f"--flow-instance {flow_instance}: the bag's flow topics are {names}")
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
            raise InputError(f"--topic {name}={topic}: the roles are {', '.join(roles)}")
        fitting = [each.topic for each in listed if each.kind in roles[name].kinds]
        if topic not in fitting:
            raise InputError(
                f"--topic {name}={topic}: no such topic; for {name} the bag has {', '.join(fitting) or 'none'}"
            )
