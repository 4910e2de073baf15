"""A bag as a Log: which messages are read, on one clock, and the notes on the choice. docs/reference/ros.md.

px4_msgs (https://github.com/PX4/px4_msgs) become the topics of a ULog: the same fields under the same names, so the
same converters make streams of them. A topic's name is that of uORB behind /fmu/out/ (`uxrce_dds_client`), with the
version that PX4 1.16 appends (_v1).
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.provenance import hash_of
from flownav.logs.log import Log, absences_of
from flownav.logs.plausible import check_plausible, of_one_clock
from flownav.logs.record_log import is_ours, log_of_export
from flownav.logs.ros import standard
from flownav.logs.ros.bag import Bag, Channel, Decoder, one_line
from flownav.logs.ros.containers import files_of, messages
from flownav.logs.ros.topics import NAMES, Clock, Gathered, chosen, clock_of, stamp_of, values_of
from flownav.logs.ulog import FIELDS, STATES, TOPICS, log_of_topics
from flownav.logs.ulog_topics import Topic, Topics, count_from_first

PACKAGE = "px4_msgs/msg/"
S_PER_US = 1e-6
LACKING = {
    "attitude": "no attitude (an orientation in sensor_msgs/Imu, px4_msgs/VehicleAttitude)",
    "imu": "no IMU (sensor_msgs/Imu, px4_msgs/SensorCombined)",
    "range": "no range downwards (sensor_msgs/Range, px4_msgs/DistanceSensor)",
    "gps_position": "no GPS fix (sensor_msgs/NavSatFix, px4_msgs/SensorGps)",
    "baro": "no barometer (sensor_msgs/FluidPressure, px4_msgs/VehicleAirData)",
    "flow_rate": "no optical flow (mavros_msgs/OpticalFlowRad, px4_msgs/VehicleOpticalFlow)",
}
TOPICS_SHOWN = 8  # topics in a message


def px4_topic(topic: str, kind: str) -> str:
    """The uORB name that a topic stands for; "" where it is none that is read."""
    name = re.sub(r"_v\d+$", "", topic.rsplit("/", 1)[-1])
    bare = name.rstrip("0123456789")
    for each in (name, bare):
        if each in TOPICS:
            return each
    snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind.removeprefix(PACKAGE)).lower()
    return snake if snake in TOPICS and kind != f"{PACKAGE}VehicleOdometry" else ""


def px4_values(message: Any) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Times and the wanted fields of a message, arrays element by element."""
    names, values = ["timestamp"], [float(message.timestamp)]
    for name in message.__dataclass_fields__:
        if name not in FIELDS and name != "timestamp_sample":
            continue
        value = getattr(message, name)
        if isinstance(value, (bool, int, float)):
            names.append(name)
            values.append(float(value))
        elif isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "fiub":
            names += [f"{name}[{k}]" for k in range(len(value))]
            values += [float(each) for each in value]
    return tuple(names), tuple(values)


def px4_topics(gathered: list[Gathered], sha256: str, states: tuple[str, ...]) -> Topics:
    """The topics, in order, their times in seconds since the first reading (`Topics.start_s` on PX4's clock)."""
    found = []
    count: dict[str, int] = {}
    for each in sorted(gathered, key=lambda topic: topic.topic):
        name = px4_topic(each.topic, each.kind)
        columns = {field: each.column(field)[:, 0] for field in each.names}
        t_s = S_PER_US * columns.pop("timestamp")
        if "timestamp_sample" in columns:
            columns["sample_s"] = S_PER_US * columns.pop("timestamp_sample")
        topic = Topic(t_s, columns, name=name, instance=count.get(name, 0))
        count[name] = topic.instance + 1
        found.append(topic)
    return Topics(found, {}, sha256, count_from_first(found, states))


# -- the log ------------------------------------------------------------------------------------------------
@np.errstate(all="ignore")  # a flipped bit makes numbers that overflow; the limits leave them out
def read_ros(path: Path, *, flow_instance: int | None = None, topics: Mapping[str, str] | None = None) -> Log:
    """Read a ROS 2 bag (folder, .db3, .mcap), a ROS 1 bag (.bag), or an MCAP file that `flownav export` wrote.

    flow_instance: which of several flow topics. topics: which topic serves as what, by role ("imu": "/imu/data").
    Times are seconds since the start of the bag, by the headers' stamps where these are sound. InputError where the
    bag cannot be read, holds no message of a known type, or lacks a topic that was asked for; where two sensors
    cannot be right together; where the package rosbags is not installed.
    """
    bag, decoder = Bag(), Decoder()
    files = files_of(path)
    if len(files) == 1 and is_ours(files[0]):
        return log_of_export(files[0], flow_instance)
    gathered = _gathered(files, bag, decoder)
    if not gathered:
        kinds = sorted({one_line(f"{channel.topic} ({channel.kind})") for channel in bag.channels})
        listed = ", ".join(kinds[:TOPICS_SHOWN]) + (" ..." if len(kinds) > TOPICS_SHOWN else "") or "nothing"
        if bag.notes:
            raise InputError(
                f"{path}: no message can be read ({one_line(bag.notes[0]).partition(';')[0]}); copy it again"
            )
        why = f"; of {', '.join(sorted(decoder.undefined))} it lacks the definition" if decoder.undefined else ""
        raise InputError(f"{path}: no message of a known type{why}; the bag holds {listed}")
    inputs = {file.name: hash_of(file) for file in files}
    notes = [*bag.notes, *_lost(decoder)]
    flown = [topic for topic in gathered if topic.kind.startswith(PACKAGE)]
    others = [topic for topic in gathered if not topic.kind.startswith(PACKAGE)]
    if flown:
        return _px4_log(path, flown, others, inputs, notes, flow_instance, topics or {})
    return _ros_log(path, others, inputs, notes, flow_instance, topics or {})


def _gathered(files: list[Path], bag: Bag, decoder: Decoder) -> list[Gathered]:
    """The messages of known types, topic by topic."""
    found: dict[Channel, Gathered] = {}
    for file in files:
        for message in messages(file, bag, _known):
            content = decoder.decode(message)
            if content is None:
                continue
            channel = message.channel
            gathered = found.setdefault(channel, Gathered(channel.topic, channel.kind))
            try:
                if channel.kind in NAMES:
                    names, values = NAMES[channel.kind], values_of(channel.kind, content)
                else:
                    names, values = px4_values(content)
                gathered.take(message.log_ns, stamp_of(content), names, values)
            except (AttributeError, TypeError, ValueError, IndexError, OverflowError):
                decoder.undecodable[channel.topic] += 1  # a type of that name with other fields
    return [gathered for gathered in found.values() if len(gathered)]


def _known(channel: Channel) -> bool:
    """Whether a topic's messages are read."""
    if channel.encoding not in ("cdr", "ros1"):
        return False
    return channel.kind in NAMES or bool(channel.kind.startswith(PACKAGE) and px4_topic(channel.topic, channel.kind))


def _lost(decoder: Decoder) -> list[str]:
    notes = [f"{topic}: {count} messages cannot be decoded" for topic, count in sorted(decoder.undecodable.items())]
    missing = ", ".join(sorted(decoder.undefined))
    return [*notes, *([f"the bag lacks the definition of {missing}; left out"] if missing else [])]


def _ros_log(
    path: Path, gathered: list[Gathered], inputs: dict[str, str], notes: list[str], flow_instance: int | None,
    asked: Mapping[str, str],
) -> Log:  # fmt: skip
    roles, choice = chosen(gathered, asked, flow_instance)
    clock, clock_notes = clock_of(topic for role, topic in roles.items() if role not in ("setpoint", "battery"))
    listed, origin = standard.streams_of(roles, clock)
    nothing = "no usable reading of any sensor; record an Imu and a NavSatFix or OpticalFlowRad"
    streams, strays = of_one_clock(path, listed, nothing)
    check_plausible(path, streams)
    truth, own = (
        standard.path_table(roles[name], clock.times(roles[name]) - clock.delay_s(roles[name]))
        if name in roles
        else None
        for name in ("truth", "autopilot")
    )
    asked_for, battery = roles.get("setpoint"), roles.get("battery")
    if "range" in roles:
        choice.append(f"range {roles['range'].topic} is taken to look down: its message does not state a direction")
    return Log(
        path, streams, origin, truth, inputs, (*notes, *choice, *clock_notes, *strays),
        own, roles["autopilot"].topic if own is not None else "", standard.limits_of(roles),
        tuple(absences_of(streams, **LACKING)), clock_start_s=clock.start_ns * 1e-9,
        truth_name=roles["truth"].topic if truth is not None else "",
        setpoints=() if asked_for is None else (standard.asked_table(asked_for, clock.times(asked_for)),),
        battery=None if battery is None else standard.battery_table(battery, clock.times(battery)),
    )  # fmt: skip


def _px4_log(
    path: Path, flown: list[Gathered], others: list[Gathered], inputs: dict[str, str], notes: list[str],
    flow_instance: int | None, asked: Mapping[str, str],
) -> Log:  # fmt: skip
    """A log as of a ULog; another topic's reference (motion capture) is laid on PX4's clock by the times of logging."""
    topics = px4_topics(flown, "", STATES)
    offset_ns = np.median(np.concatenate([each.logged - 1e3 * each.column("timestamp")[:, 0] for each in flown]))
    poses, choice = chosen(others, {name: topic for name, topic in asked.items() if name == "truth"}, None)
    truth, truth_name = None, ""
    if "truth" in poses:
        start_ns = int(offset_ns + 1e9 * topics.start_s)
        clock, clock_notes = clock_of([poses["truth"]])
        if abs(clock.offset_ns) * 1e-9 > 1.0:
            clock = Clock(0, 0, frozenset(), {})
        times = clock._replace(start_ns=start_ns).times(poses["truth"]) - clock.delay_s(poses["truth"])
        truth, truth_name = standard.path_table(poses["truth"], times), poses["truth"].topic
        choice += clock_notes
    return log_of_topics(
        path, topics, flow_instance, inputs=inputs, notes=(*notes, *choice), reference=truth, reference_name=truth_name
    )
