"""px4_msgs as the topics of a ULog: the same fields under the same names, so the same converters make streams of them.

https://github.com/PX4/px4_msgs; a topic's name is that of uORB behind /fmu/out/ (`uxrce_dds_client`), with the
version that PX4 1.16 appends (_v1).
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from flownav.logs.ros.columns import Gathered
from flownav.logs.ulog import FIELDS, TOPICS
from flownav.logs.ulog_topics import Topic, Topics, order

PACKAGE = "px4_msgs/msg/"
US = 1e-6


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
        t_s = US * columns.pop("timestamp")
        if "timestamp_sample" in columns:
            columns["sample_s"] = US * columns.pop("timestamp_sample")
        topic = Topic(t_s, columns, name=name, instance=count.get(name, 0))
        count[name] = topic.instance + 1
        order(topic)
        found.append(topic)
    start_s = min((topic.t_s[0] for topic in found if len(topic) and topic.name not in states), default=0.0)
    for topic in found:
        topic.t_s = topic.t_s - start_s
        if "sample_s" in topic.columns:
            topic.columns["sample_s"] -= start_s
        if topic.name in states:
            topic.t_s = np.maximum(topic.t_s, 0.0)
    return Topics(found, {}, sha256, start_s)
