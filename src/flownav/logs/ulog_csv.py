"""A folder that PX4's `ulog2csv` wrote, one CSV file a topic, as a Log: the same topics as those of a ULog file.

The files hold no parameters and no messages; what hangs on them is left out.
"""

import hashlib
from pathlib import Path

from flownav.core.errors import InputError
from flownav.logs.assembly import content_of, sha256_of
from flownav.logs.csv_table import columns_of, header_of
from flownav.logs.log import Log
from flownav.logs.topic_files import TopicFile, topic_files
from flownav.logs.ulog import FIELDS, STATES, TOPICS, log_of_topics
from flownav.logs.ulog_events import EVENT_TOPICS
from flownav.logs.ulog_topics import Topic, Topics, count_from_first

TIME, SAMPLED = "timestamp", "timestamp_sample"  # microseconds since the vehicle was switched on
NOTE = "read from ulog2csv's files, which hold no parameters and no messages; the ULog itself has them"


def read_topic_folder(folder: Path, *, flow_instance: int | None = None) -> Log:
    """Read a folder of `ulog2csv`; times and flow_instance as of `read_ulog`.

    InputError, one line, where a file cannot be read or is no such table, files are of several logs, or no sensor has
    a usable reading.
    """
    found, inputs = [], {}
    for file in topic_files(folder, TOPICS):
        topic, digest = _topic(file)
        inputs[file.path.name] = digest
        found.append(topic)
    together = hashlib.sha256("".join(inputs.values()).encode()).hexdigest()
    start_s = count_from_first(found, (*STATES, *EVENT_TOPICS))
    topics = Topics(found, {}, together, start_s)
    return log_of_topics(folder, topics, flow_instance, inputs=inputs, notes=(NOTE,))


def _topic(file: TopicFile) -> tuple[Topic, str]:
    """A file's rows with the fields that are used, and its SHA-256."""
    content = content_of(file.path, "a folder of ulog2csv's files")
    header = header_of(file.path, content)
    if TIME not in header:
        raise InputError(f"{file.path}: no column {TIME}; ulog2csv writes one into every file")
    wanted = [name for name in header if name.split("[")[0] in FIELDS]
    malformed: list[int] = []
    columns = columns_of(file.path, content, [TIME, *wanted, SAMPLED], malformed)
    t_s = 1e-6 * columns.pop(TIME)
    if SAMPLED in columns:
        columns["sample_s"] = 1e-6 * columns.pop(SAMPLED)
    rejected = {"malformed_row": len(malformed)} if malformed else {}
    return Topic(t_s, columns, rejected, file.topic, file.instance), sha256_of(content)
