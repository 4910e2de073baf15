"""A ROS 2 bag of SQLite (.db3): topics, definitions (since ROS 2 Iron) and messages.

rosbag2_storage_sqlite3 has the tables: https://github.com/ros2/rosbag2, rosbag2_storage_sqlite3/README.md.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from flownav.core.errors import InputError
from flownav.logs.ros.bag import Bag, Channel, Message, Wanted


def sqlite_messages(path: Path, bag: Bag, wanted: Wanted) -> Iterator[Message]:
    """The wanted messages of a .db3 file. InputError where SQLite cannot open it or it holds no bag's tables."""
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as base:
            base.text_factory = lambda text: text.decode(errors="replace")
            channels = _channels(base)
            bag.channels.update(channels.values())
            taken = [number for number, channel in channels.items() if wanted(channel)]
            marks = ",".join("?" * len(taken))
            rows = base.execute(f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks})", taken)
            try:
                for number, log_ns, data in rows:
                    if isinstance(log_ns, int) and isinstance(data, bytes) and number in channels:
                        yield Message(channels[number], log_ns, data)
            except (sqlite3.Error, OverflowError) as error:
                bag.notes.append(f"{path.name}: damaged ({error}); what follows is left out")
    except (sqlite3.Error, OverflowError) as error:
        raise InputError(f"{path}: no readable ROS 2 bag ({error}); give another log") from error


def _channels(base: sqlite3.Connection) -> dict[int, Channel]:
    definitions = {}
    if base.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone():
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        definitions = {str(kind): (str(words), str(encoding)) for kind, encoding, words in base.execute(query)}
    found = {}
    for number, topic, kind, encoding in base.execute("SELECT id, name, type, serialization_format FROM topics"):
        words, definition_kind = definitions.get(str(kind), ("", ""))
        found[number] = Channel(str(topic), str(kind), str(encoding), words, definition_kind)
    return found
