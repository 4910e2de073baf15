"""The topics of a ULog file as rows: pyulog decodes what the framing lets through, the clock is put in order."""

import hashlib
import io
from collections.abc import Collection, Iterable
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.core.measurement import Array
from flownav.logs.assembly import Rows, checked_size, put_in_order
from flownav.logs.ulog_framing import Framed, frame
from flownav.logs.ulog_rows import Bytes, Places, field_of

LONGEST_DELAY_S = 1.0  # a sample older than this on arrival carries a wrong time


@dataclass
class Topic(Rows):
    """One instance of a topic. t_s: when it was published; column `sample_s`, where there, when it was sampled."""

    name: str = ""
    instance: int = 0

    @property
    def label(self) -> str:
        """The topic's name as PX4's tools write it."""
        return f"{self.name}[{self.instance}]"

    def has(self, *names: str) -> bool:
        """Whether the topic has these fields."""
        return all(name in self.columns for name in names)

    def parts(self, name: str, count: int) -> list[Array]:
        """The fields name[0], name[1], ... each (n,)."""
        return [self.column(f"{name}[{k}]") for k in range(count)]

    def vector(self, name: str, count: int) -> Array:
        """Fields side by side, (n, count)."""
        return np.column_stack(self.parts(name, count))

    @property
    def delay_s(self) -> float:
        """How old a reading usually is when it is published [s]."""
        if "sample_s" not in self.columns:
            return 0.0
        age_s = self.t_s - self.columns["sample_s"]
        likely = age_s[(age_s >= 0) & (age_s < LONGEST_DELAY_S)]
        return float(np.median(likely)) if len(likely) else 0.0

    @property
    def instant_s(self) -> Array:
        """The instant that each row describes: its sample's time where that can be, else its own less the delay."""
        if "sample_s" not in self.columns:
            return self.t_s
        sample_s = self.columns["sample_s"]
        likely = (sample_s <= self.t_s) & (self.t_s - sample_s < LONGEST_DELAY_S)
        return np.asarray(np.maximum.accumulate(np.where(likely, sample_s, self.t_s - self.delay_s)))

    @property
    def rate_hz(self) -> float:
        """Rows a second over the topic's own span; 0 where there are not two."""
        if len(self) < 2 or self.t_s[-1] <= self.t_s[0]:
            return 0.0
        return float((len(self) - 1) / (self.t_s[-1] - self.t_s[0]))


@dataclass
class Topics:
    """The wanted topics of a file, parameters, and what was wrong with the file.

    start_s: what the file's clock shows at time 0 of the topics. system: the name of the system that wrote the log.
    messages: logged strings with the file's own time [s].
    """

    found: list[Topic]
    parameters: dict[str, float]
    sha256: str
    start_s: float
    notes: list[str] = field(default_factory=list)
    system: str = ""
    messages: list[tuple[float, str]] = field(default_factory=list)

    def of(self, *names: str) -> list[Topic]:
        """Every instance of the named topics that has rows, in the order of the names."""
        return [topic for name in names for topic in self.found if topic.name == name and len(topic)]

    def fullest(self, *names: str, needs: Iterable[str] = ()) -> Topic | None:
        """The instance with most rows of the first named topic that is there with the fields `needs`."""
        fields = tuple(needs)
        for name in names:
            usable = [topic for topic in self.of(name) if topic.has(*fields)]
            if usable:
                return max(usable, key=len)
        return None


def read_topics(path: Path, wanted: Collection[str], fields: Collection[str], states: Collection[str]) -> Topics:
    """The wanted topics with the fields named, times in seconds since the first reading.

    states: topics that hold for longer than they are published; their values before the first reading of a sensor are
    put at its time. InputError where the file cannot be read, is no ULog, or holds none of the topics.
    """
    content, sha256 = _content(path)
    framed = frame(path, content, wanted)
    log = _decoded(path, framed)
    read = np.frombuffer(content, np.uint8)
    found = [_topic(data, read, framed.rows[data.msg_id], fields) for data in log.data_list]
    del content, read
    start_s = count_from_first(found, states)
    if not any(map(len, found)):
        others = f"; it holds {', '.join(sorted(framed.topics)[:6])} ..." if framed.topics else ""
        raise InputError(
            f"{path}: no reading of any sensor that is known here{others}; log vehicle_attitude, sensor_combined, "
            "vehicle_gps_position, vehicle_optical_flow and distance_sensor (SDLOG_PROFILE)"
        )
    stated = {str(name): float(value) for name, value in log.initial_parameters.items()}
    parameters = {name: value for name, value in stated.items() if np.isfinite(value)}
    return Topics(found, parameters, sha256, start_s, _notes(framed), framed.system, framed.messages)


def _content(path: Path) -> tuple[mmap, str]:
    """The file's bytes, mapped as long as something holds them, and their hash."""
    try:
        checked_size(path)
        with an_input(path).open("rb") as file:
            content = mmap(file.fileno(), 0, access=ACCESS_READ)
            return content, hashlib.sha256(content).hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give a ULog file") from error
    except ValueError as error:  # nothing to map
        raise InputError(f"{path}: not a ULog file (it is empty)") from error


def _decoded(path: Path, framed: Framed) -> Any:
    """The file as pyulog has it; its remarks are not for standard output."""
    from pyulog import ULog

    try:
        with redirect_stdout(io.StringIO()):
            return ULog(io.BytesIO(framed.content))
    except Exception as error:  # the framing leaves none that is known; whatever pyulog raises is the file's fault
        raise InputError(f"{path}: a damaged ULog ({type(error).__name__}: {error})") from error


def _topic(data: Any, content: Bytes, rows: Places, fields: Collection[str]) -> Topic:
    """The rows of one topic. data: what pyulog makes of its definition and first row."""
    layout = data.data["timestamp"].base.dtype.fields
    with np.errstate(invalid="ignore"):

        def column(name: str) -> Array:
            dtype, offset = layout[name][:2]
            return np.ascontiguousarray(field_of(content, rows, offset, dtype), float)

        columns = {name: column(name) for name in data.data if name.split("[")[0] in fields}
        t_s = column("timestamp")
        t_s *= 1e-6
        if "timestamp_sample" in data.data:
            columns["sample_s"] = 1e-6 * column("timestamp_sample")
    return Topic(t_s, columns, name=str(data.name), instance=int(data.multi_id))


def count_from_first(found: list[Topic], states: Collection[str]) -> float:
    """The time of the first reading, from which the topics' times count then; their rows are put in order before.

    states: topics that hold for longer than they are published, which are put at that time at the earliest.
    """
    for topic in found:
        topic.keep(topic.t_s > 0.0, "no_time")
        put_in_order(topic)
    start_s = min((float(topic.t_s[0]) for topic in found if len(topic) and topic.name not in states), default=0.0)
    for topic in found:
        topic.t_s = topic.t_s - start_s
        if topic.name in states:
            topic.t_s = np.maximum(topic.t_s, 0.0)
        if "sample_s" in topic.columns:
            topic.columns["sample_s"] -= start_s
    return start_s


def _notes(framed: Framed) -> list[str]:
    """Notes on the damage of the file as a whole, one line each."""
    notes = []
    if framed.dropouts_s:
        notes.append(
            f"the logger states {len(framed.dropouts_s)} dropouts, {sum(framed.dropouts_s):.2f} s together, "
            f"the longest {max(framed.dropouts_s):.2f} s"
        )
    if framed.damaged_stretches:
        notes.append(
            f"the file is damaged: {framed.damaged_bytes} bytes in {framed.damaged_stretches} places were skipped"
        )
    words = {
        "cut_message": "messages cut off at the end",
        "unknown_topic": "messages of topics that are never announced",
        "undefined_topic": "topics announced without a sound definition",
        "topic_redefined": "message ids announced again for another topic",
    }
    notes += [f"{count} {words[reason]} left out" for reason, count in framed.rejected.items()]
    return notes
