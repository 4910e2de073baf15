"""A message's bytes as an object with fields: rosbags' types, from the definitions that the bag itself holds."""

from __future__ import annotations

from collections import Counter
from typing import Any

from flownav.core.errors import InputError
from flownav.logs.ros.bag import Channel, Message
from flownav.logs.ros.ros1_bag import NEEDED

LONGEST_DEFINITION = 64 << 10


class Decoder:
    """Makes objects of messages. undecodable: how many could not be, by topic; undefined: topics without a type."""

    def __init__(self) -> None:
        self.undecodable: Counter[str] = Counter()
        self.undefined: set[str] = set()
        self._stores: dict[Channel, Any] = {}

    def decode(self, message: Message) -> Any | None:
        """A message's object; None, counted, where its bytes are none of its type."""
        channel = message.channel
        if channel not in self._stores:
            self._stores[channel] = self._store(channel)
        store = self._stores[channel]
        if store is None:
            return None
        read = store.deserialize_ros1 if channel.encoding == "ros1" else store.deserialize_cdr
        try:
            return read(message.data, channel.kind)
        except Exception:  # whatever the library stumbles over is the file's fault
            self.undecodable[channel.topic] += 1
            return None

    def _store(self, channel: Channel) -> Any | None:
        """The types of a channel: its own definition's; without one those of ROS itself. None where there is none."""
        try:
            from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
        except ImportError as error:
            raise InputError(NEEDED) from error
        if channel.definition and len(channel.definition) <= LONGEST_DEFINITION:
            read = {"ros2idl": lambda words, kind: get_types_from_idl(words)}.get(
                channel.definition_kind, get_types_from_msg
            )
            try:
                store = get_typestore(Stores.EMPTY)
                store.register(read(channel.definition, channel.kind))
                if channel.kind in store.fielddefs:
                    return store
            except Exception:  # a definition that is damaged: ROS's own serves, where it has one
                pass
        known = get_typestore(Stores.ROS1_NOETIC if channel.encoding == "ros1" else Stores.ROS2_HUMBLE)
        if channel.kind in known.fielddefs:
            return known
        self.undefined.add(channel.topic)
        return None
