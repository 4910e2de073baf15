"""The names of the files that PX4's `ulog2csv` writes, LOG_TOPIC_INSTANCE.csv, in a folder; nothing is read here."""

import re
from pathlib import Path
from typing import NamedTuple

from flownav.core.errors import InputError

# files that a replay needs, and by which such a folder is recognised
CARRIERS = (
    "vehicle_attitude", "sensor_combined", "vehicle_imu", "vehicle_gps_position", "sensor_gps", "vehicle_optical_flow",
    "optical_flow", "sensor_optical_flow", "vehicle_visual_odometry",
)  # fmt: skip


class TopicFile(NamedTuple):
    """A file, the log's name that it begins with, and the topic and its instance."""

    path: Path
    log: str
    topic: str
    instance: int


def is_topic_folder(folder: Path) -> bool:
    """Whether a folder holds the files of `ulog2csv` and none of flownav's own names."""
    own = any((folder / name).exists() for name in ("attitude.csv", "imu.csv"))
    return not own and any(_file(path, CARRIERS) for path in folder.glob("*.csv"))


def topic_files(folder: Path, topics: tuple[str, ...]) -> list[TopicFile]:
    """The files of the topics, in order of topic and instance. InputError where they are of several logs."""
    found = [file for path in sorted(folder.glob("*.csv")) if (file := _file(path, topics))]
    logs = {file.log for file in found}
    brought = {log: {file.topic for file in found if file.log == log and file.topic in CARRIERS} for log in logs}
    # a topic that is not known may end in one that is: its log would be the other's with a word more, and bring little
    logs = {log for log in logs if not any(_lengthens(log, other) for other in logs) or len(brought[log]) > 1}
    if len(logs) > 1:
        first, second, *_ = sorted(logs)
        raise InputError(f"{folder}: files of several logs ({first}, {second}); give each a folder of its own")
    return sorted((file for file in found if file.log in logs), key=lambda file: (file.topic, file.instance))


def _lengthens(log: str, other: str) -> bool:
    return log != other and log.startswith(f"{other}_")


def _file(path: Path, topics: tuple[str, ...]) -> TopicFile | None:
    """A file whose name ends in one of the topics and an instance; the longest topic that fits."""
    stem, _, instance = path.name.removesuffix(".csv").rpartition("_")
    if not path.name.endswith(".csv") or not re.fullmatch(r"\d{1,2}", instance):
        return None
    for topic in sorted(topics, key=len, reverse=True):
        if stem == topic or stem.endswith(f"_{topic}"):
            return TopicFile(path, stem.removesuffix(topic).rstrip("_"), topic, int(instance))
    return None
