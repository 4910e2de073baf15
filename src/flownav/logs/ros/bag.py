"""What a bag holds, whatever file it lies in: channels, messages, and what walking through it finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

MCAP_MAGIC, SQLITE_MAGIC, ROS1_MAGIC = b"\x89MCAP0\r\n", b"SQLite format 3\0", b"#ROSBAG V2.0\n"


class Channel(NamedTuple):
    """What one topic's messages are.

    kind: the type, "sensor_msgs/msg/Imu". encoding: of the messages, "cdr", "ros1" or "json". definition: of the type
    in ROS's own words, empty where the bag has none; definition_kind: "ros2msg", "ros2idl", "ros1msg", "jsonschema".
    """

    topic: str
    kind: str
    encoding: str
    definition: str
    definition_kind: str


class Message(NamedTuple):
    """One message: its channel, when it was logged [ns], its bytes."""

    channel: Channel
    log_ns: int
    data: bytes


@dataclass
class Bag:
    """What walking through a bag finds: what channels there are, notes on damage, files attached to it."""

    channels: set[Channel] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)
    attachments: dict[str, bytes] = field(default_factory=dict)


Wanted = Callable[[Channel], bool]
