"""A ROS 1 bag (.bag), which the library rosbags reads."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from flownav.core.errors import InputError
from flownav.logs.ros.bag import Bag, Channel, Message, Wanted

NEEDED = "ROS bags need the package rosbags: pip install 'flownav[ros]'"
LARGEST_CHUNK = 256 << 20


def ros1_messages(path: Path, bag: Bag, wanted: Wanted) -> Iterator[Message]:
    """The wanted messages of a .bag file. InputError where the library cannot open it (a bag without its index)."""
    try:
        from rosbags.rosbag1 import Reader
    except ImportError as error:
        raise InputError(NEEDED) from error
    try:
        reader = Reader(path)
        reader.open()
    except Exception as error:  # whatever the library raises is the file's fault
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: no readable ROS 1 bag ({why}); try `rosbag reindex`") from error
    try:
        channels = {
            connection: Channel(connection.topic, connection.msgtype, "ros1", connection.msgdef.data, "ros1msg")
            for connection in reader.connections
        }
        bag.channels.update(channels.values())
        taken = [connection for connection, channel in channels.items() if wanted(channel)]
        if taken:
            for connection, log_ns, data in reader.messages(connections=taken):
                yield Message(channels[connection], log_ns, bytes(data))
    except Exception as error:
        bag.notes.append(f"{path.name}: damaged ({type(error).__name__}); what follows is left out")
    finally:
        reader.close()
