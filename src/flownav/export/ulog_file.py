"""A record as a ULog file of its own, or merged into the log that it was replayed from."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from flownav.core.errors import InputError
from flownav.core.guard import written_whole
from flownav.core.provenance import hash_of
from flownav.core.record import Record
from flownav.core.version import __version__
from flownav.export.stamps import finite_rows, shift_needed_s
from flownav.export.tables import is_text
from flownav.export.trajectory import Trajectory, trajectories
from flownav.export.ulog_merge import merged
from flownav.export.ulog_messages import Stamped, Topic, assembled
from flownav.export.ulog_topics import (
    attitude_topic,
    event_strings,
    innovation_topics,
    our_topic,
    position_topic,
    table_topic,
)

NAMED = {"estimate": "", "truth": "_groundtruth"}  # what PX4 calls the estimate and the truth of a simulation
APART = ("estimate", "smoothed", "truth", "autopilot", "innovation", "events")


class Contents(NamedTuple):
    """What goes into a log: topics, logged strings, texts about the whole log, and notes for the user."""

    topics: list[Topic]
    strings: list[Stamped]
    texts: dict[str, str]
    notes: list[str]


def write_ulog(record: Record, path: Path, original: Path | None = None) -> tuple[list[Path], list[str]]:
    """Write a ULog file, whole or not at all; the file and notes.

    With `original`, the log that the record was replayed from, a copy of that log with flownav's topics among
    its own, on its clock: the manifest's `clock_start_s` says what that showed at time 0 of the record. InputError
    where the original is missing, is no ULog, is not the log that was replayed or does not overlap in time, or
    where the record holds no path or does not say how its times lie on that clock.
    """
    if original is None:
        contents = _all_of(record)
        whole = assembled(contents.topics, contents.strings, _known(contents.texts))
    else:
        log = _read_original(record, original)
        contents = _from_zero_on(_ours(record, _clock_start_s(record, original)))
        whole = merged(log, str(original), contents.topics, contents.strings, contents.texts)
    with written_whole(path) as temporary:
        temporary.write_bytes(whole)
    return [path], contents.notes


def _all_of(record: Record) -> Contents:
    """Everything that the record holds, the estimate and the truth also under PX4's names."""
    shift_s = shift_needed_s(record)
    ours = _ours(record, shift_s)
    topics, notes = list(ours.topics), list(ours.notes)
    if shift_s:
        notes.append(f"all times are {shift_s:g} s later than in the record: the format has no negative time")
    for path in trajectories(record):
        if path.name in NAMED:
            topics.append(position_topic(record, path, f"vehicle_local_position{NAMED[path.name]}", shift_s))
            if path.oriented:
                topics.append(attitude_topic(path, f"vehicle_attitude{NAMED[path.name]}", shift_s))
    for name, table in record.tables.items():
        if name not in APART:
            topics.append(table_topic(name, table, shift_s))
            text = [column for column in table if is_text(table[column])]
            if text:
                notes.append(f"{name}: ULog topics hold numbers; left out: {', '.join(text)}")
    return Contents(topics, ours.strings, ours.texts, notes)


def _ours(record: Record, shift_s: float) -> Contents:
    """What only flownav can say: paths, innovations, events."""
    paths = trajectories(record)
    notes = [note for path in paths for note in _notes(path)]
    for name, table in record.tables.items():
        lost = len(table["t_s"]) - len(finite_rows(table["t_s"]))
        if lost and name not in [path.name for path in paths]:
            notes.append(f"{name}: rows without a time left out: {lost}")
    topics = [our_topic(record, path, shift_s) for path in paths]
    texts = {"flownav_record": str(record.manifest.get("scenario") or record.manifest.get("log") or "")}
    if "innovation" in record.tables:
        innovations, reasons = innovation_topics(record.tables["innovation"], shift_s)
        topics += innovations
        texts["flownav_reasons"] = ", ".join(f"{code} {reason}" for code, reason in enumerate(reasons))
    strings = event_strings(record.tables["events"], shift_s) if "events" in record.tables else []
    return Contents(topics, strings, texts, notes)


def _clock_start_s(record: Record, original: Path) -> float:
    """What the original's clock showed at time 0 of the record."""
    start_s = record.manifest.get("clock_start_s")
    if start_s is None:
        raise InputError(f"--merge {original}: the record does not say when its time began there; replay the log again")
    return float(start_s)


def _from_zero_on(contents: Contents) -> Contents:
    """Contents without what lies before time 0 of the log's clock, which ULog cannot say; counted in the notes."""
    topics = []
    for topic in contents.topics:
        kept = topic.time_us >= 0
        topics.append(Topic(topic.name, topic.time_us[kept], [f._replace(values=f.values[kept]) for f in topic.fields]))
    strings = [string for string in contents.strings if string.time_us >= 0]
    lost = sum(len(before.time_us) - len(after.time_us) for before, after in zip(contents.topics, topics, strict=True))
    lost += len(contents.strings) - len(strings)
    notes = [*contents.notes, *([f"rows before time 0 of the log's clock left out: {lost}"] if lost else [])]
    return contents._replace(topics=topics, strings=strings, notes=notes)


def _notes(path: Trajectory) -> list[str]:
    """A path's notes; here nothing stands in for an attitude that was not recorded."""
    return list(path._replace(oriented=True).notes)


def _known(texts: dict[str, str]) -> dict[str, str]:
    """Texts about the whole log, with who wrote it."""
    return {"sys_name": "flownav", "ver_sw": __version__, **texts}


def _read_original(record: Record, original: Path) -> bytes:
    """The log's bytes. InputError where it cannot be read or is not among the record's inputs."""
    if not original.is_file():
        raise InputError(f"--merge {original}: no such file; give the log that was replayed")
    inputs = record.manifest.get("provenance", {}).get("inputs", {}).values()
    hashes = {value["sha256"] if isinstance(value, dict) else value for value in inputs}
    if hash_of(original) not in hashes:
        raise InputError(f"--merge {original}: the record was not replayed from this file (its SHA-256 differs)")
    return original.read_bytes()
