"""The words and tables of the report: headline, scores, events, parameters. Scores are shown, never computed."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np

from flownav.core.measurement import Sensor
from flownav.core.record import Record
from flownav.report.figure_words import NONE, Tile, metres, number
from flownav.report.landing import landing_sentences, landing_tiles
from flownav.report.phase_rows import phases_within
from flownav.report.series import (
    event_rows,
    flow_readings,
    flow_velocity,
    has,
    mapping,
    outages,
    readings,
    rms_m,
    scored_outages,
    start_end_s,
    truth_name,
)
from flownav.scoring.phases import Phase, phase_at

EVENTS_LISTED = 300
UNIT_AFTER_NUMBER = re.compile(r"(\d) (m/s|m|s)\b")
STATES = {"x": ("north", "m"), "y": ("east", "m"), "z": ("down", "m"),
          "u": ("forward", "m/s"), "v": ("right", "m/s"), "w": ("down", "m/s")}  # fmt: skip
KINDS = {
    "fly": "A closed-loop simulated flight of {}.",
    "replay": "A recorded flight of {}, fused again.",
    "live": "A live flight of {}.",
}


def title(record: Record) -> str:
    """What flew, as a heading: the scenario's (or the log's) name."""
    name = record.manifest.get("scenario") or record.manifest.get("log") or record.manifest.get("kind") or "Flight"
    words = PurePath(str(name)).name.removesuffix(".toml").replace("_", " ").replace("-", " ").strip() or "Flight"
    return words[0].upper() + words[1:]


def duration_s(record: Record) -> float:
    """The flight's length [s]: as the manifest says, or else as its estimate lasts."""
    stated = record.manifest.get("duration_s")
    start, end = start_end_s(record)
    return float(stated) if isinstance(stated, (int, float)) else end - start


def facts(record: Record) -> list[tuple[str, str]]:
    """The line under the heading: filter, GPS model, plant, seed, length."""
    manifest = record.manifest
    named = {"Filter": "filter", "GPS model": "gps", "Plant": "truth", "Truth": "truth_model",
             "Feedback": "feedback", "Seed": "seed",
             "Flight": "flight"}  # fmt: skip
    shown = [(name, str(manifest[key])) for name, key in named.items() if manifest.get(key) is not None]
    return [*shown, ("Length", f"{duration_s(record):.1f} s")]


def summary(record: Record) -> str:
    """The verdict in sentences."""
    manifest, scores = record.manifest, mapping(record.manifest.get("scores"))
    said = [KINDS.get(str(manifest.get("kind")), "A flight of {}.").format(f"{duration_s(record):.1f} s")]
    said += landing_sentences(mapping(scores.get("touchdown")))
    largest = scores.get("max_position_error_m")
    if largest is not None:
        published = mapping(manifest.get("paper")).get("max_position_error_m")
        beside = f" (the paper: {metres(published)} m)" if published is not None else ""
        ever = "No axis of the estimated position was ever"
        ever = "In flight no axis of the position that was flown on was" if has(record, "flown") else ever
        said.append(f"{ever} off by more than {metres(largest)} m{beside}.")
    if manifest.get("known_exactly"):
        said.append(f"What the vehicle knew exactly: {manifest['known_exactly']}.")
    cut = scored_outages(record)
    if cut:
        worst = max(cut, key=rms_m)
        among = f", the worst of {len(cut)} outages," if len(cut) > 1 else ""
        rms, largest = number(worst.get("horizontal_rms_m"), 2), number(worst.get("horizontal_max_m"), 2)
        said.append(
            f"With GPS withheld from {worst['t0']:g} to {worst['t1']:g} s{among} the position drifted "
            f"{rms} m rms and {largest} m at most."
        )
    truth = mapping(scores.get("truth"))
    if truth:
        rms, largest = number(truth.get("horizontal_rms_m"), 2), number(truth.get("horizontal_max_m"), 2)
        said.append(
            f"Against {_reference(record)} its position is off by {rms} m rms, {largest} m at most, horizontally."
        )
    if scores.get("end_drift_m") is not None:
        said.append(f"Laid on each other at take-off, the two end {metres(scores['end_drift_m'])} m apart.")
    own = mapping(scores.get("autopilot"))
    if own.get("against"):
        rms, largest = number(own.get("horizontal_rms_m"), 2), number(own.get("horizontal_max_m"), 2)
        against = _reference(record) if own["against"] == "truth" else "GPS, their mean difference taken out"
        said.append(
            f"The autopilot's own estimate ({own.get('name')}) is off by {rms} m rms, "
            f"{largest} m at most, horizontally, against {against}."
        )
    if not scores:
        said.append("The record carries no scores.")
    return UNIT_AFTER_NUMBER.sub("\\1\N{NO-BREAK SPACE}\\2", " ".join(said))


def _reference(record: Record) -> str:
    """What errors are taken against, in words: a truth, or an estimate that serves for want of one."""
    name = truth_name(record)
    return "the recorded truth" if name == "truth" else f"the recorded {name}, an estimate itself,"


def tiles(record: Record) -> list[Tile]:
    """The headline figures that the record's scores and streams give."""
    scores, paper = mapping(record.manifest.get("scores")), mapping(record.manifest.get("paper"))
    found = landing_tiles(mapping(scores.get("touchdown")))
    if scores.get("max_position_error_m") is not None:
        published = paper.get("max_position_error_m")
        against = "what was flown on" if has(record, "flown") else f"estimate against {truth_name(record)}"
        note = f"paper {metres(published)} m" if published is not None else against
        found.append(Tile("Largest error of one axis", metres(scores["max_position_error_m"]), "m", note))
    cut = scored_outages(record)
    if cut:
        worst = max(cut, key=rms_m)
        when = f"rms, {worst['t0']:g} to {worst['t1']:g} s"
        name = "Drift without GPS" if len(cut) == 1 else f"Worst drift of {len(cut)} outages"
        found.append(Tile(name, number(worst.get("horizontal_rms_m"), 2), "m", when))
    truth = mapping(scores.get("truth"))
    if truth:
        largest = f"at most {number(truth.get('horizontal_max_m'), 2)} m, against {truth_name(record)}"
        found.append(Tile("Horizontal error", number(truth.get("horizontal_rms_m"), 2), "m", f"rms, {largest}"))
    if scores.get("end_drift_m") is not None:
        laid = f"horizontal, {truth_name(record)} laid on at take-off"
        found.append(Tile("Drift at the end", metres(scores["end_drift_m"]), "m", laid))
    if scores.get("velocity_rms_m_s") is not None:
        found.append(Tile("Velocity error", number(scores["velocity_rms_m_s"], 2), "m/s", "rms, against GPS"))
    share = flow_share(record)
    papers = record.manifest.get("kind") == "fly" and has(record, "flow_velocity")  # whose sensor reads above the pad
    name = "Flow sensor engaged" if papers else "Valid flow readings"
    if share is None:
        return [*found, Tile(name, NONE, "", "no valid readings")]
    return [*found, Tile(name, f"{100 * share:.0f}", "%", "of the time")]


def flow_share(record: Record) -> float | None:
    """Share of the flight with valid flow readings, a gap not counted; None without readings."""
    flow = flow_readings(record)
    start, end = start_end_s(record)
    if flow is None or len(flow.t_s) < 2 or end <= start:
        return None
    interval = np.diff(flow.t_s)
    return float(min(1.0, interval[interval <= 3.0 * np.median(interval)].sum() / (end - start)))


def lacking(record: Record) -> list[str]:
    """What the record does not hold, in words, and what the report can therefore not show."""
    notes = []
    covered = record.manifest.get("covered_fraction", 1.0)
    if covered < 0.99:
        share = f"{100.0 * covered:.0f} %"
        notes.append(f"The estimate covers {share} of what is scored; its errors are those of that part.")
    gps = readings(record, Sensor.GPS_POSITION) is not None
    if not has(record, "truth"):
        errors = "errors are shown against GPS, which has errors of its own" if gps else "no error can be shown"
        notes.append(f"No truth: {errors}.")
    elif truth_name(record) != "truth":
        notes.append(f"No truth: errors are shown against the {truth_name(record)}, which has errors of its own.")
    if not has(record, "estimate"):
        notes.append("No estimate: nothing was fused.")
    if flow_readings(record) is None:
        notes.append("No valid optical flow: position and velocity rest on the other sensors.")
    elif flow_velocity(record) is None:
        notes.append("No range at the time of the flow: its readings are fused, but no velocity of theirs is drawn.")
    if not gps:
        notes.append("No GPS positions.")
    if record.manifest.get("kind") != "fly" and not has(record, "autopilot"):
        notes.append("No estimate of an autopilot's own to compare with.")
    if not mapping(record.manifest.get("scores")):
        notes.append("No scores.")
    return notes


@dataclass(frozen=True)
class ScoreRow:
    """A state's scores beside the paper's, as text."""

    state: str
    direction: str
    unit: str
    ours: tuple[str, str, str, str]  # mean, std, rms, max
    paper: tuple[str, str]  # mean, std


def score_rows(record: Record) -> list[ScoreRow]:
    """One row for each scored state."""
    states = mapping(mapping(record.manifest.get("scores")).get("states"))
    published = mapping(mapping(record.manifest.get("paper")).get("states"))
    rows = []
    for key, (direction, unit) in STATES.items():
        mine, theirs = mapping(states.get(key)), mapping(published.get(key))
        if mine:
            mean, std, rms, largest = (number(mine.get(f"{kind}_error")) for kind in ("mean", "std", "rms", "max"))
            beside = (number(theirs.get("mean_error")), number(theirs.get("std_error")))
            rows.append(ScoreRow(key, direction, unit, (mean, std, rms, largest), beside))
    return rows


def outage_rows(record: Record, phases: Sequence[Phase] = ()) -> list[tuple[str, str, str, str, str]]:
    """Scored GPS outages as (window, phases, rms, max, where GPS was cut); the median and the worst last, if scored."""
    scores, here = mapping(record.manifest.get("scores")), outages(record)
    rows = []
    for outage in scored_outages(record):
        window = (float(outage["t0"]), float(outage["t1"]))
        figures = number(outage.get("horizontal_rms_m"), 2), number(outage.get("horizontal_max_m"), 2)
        place = "this record" if window in here else "a replay of its own"
        rows.append((f"{window[0]:g} to {window[1]:g} s", phases_within(phases, *window), *figures, place))
    for name, key in (("median", "outage_median_rms_m"), ("worst", "outage_worst_rms_m")):
        if scores.get(key) is not None:
            rows.append((name, "", number(scores[key], 2), "", ""))
    return rows


@dataclass(frozen=True)
class Event:
    """An event as the page lists it."""

    t_s: float
    cells: tuple[str, str, str, str]  # source, kind, detail, value
    phase: str


@dataclass(frozen=True)
class EventTables:
    """Events counted by what they are, and one by one up to a limit."""

    counted: list[tuple[str, str, int, str, str, str]]  # source, kind, count, first, last, phases
    listed: list[Event]
    total: int


def events(record: Record, phases: Sequence[Phase] = ()) -> EventTables:
    """The events table, counted and listed."""
    rows = event_rows(record)
    groups: dict[tuple[str, str], list[float]] = {}
    for t_s, source, kind, _, _ in rows:
        groups.setdefault((source, kind), []).append(t_s)
    where = list(phases)
    counted = [
        (source, kind, len(times), f"{min(times):.2f}", f"{max(times):.2f}",
         ", ".join(dict.fromkeys(name for t_s in times if (name := phase_at(where, t_s)))))
        for (source, kind), times in groups.items()
    ]  # fmt: skip
    listed = [Event(t_s, (source, kind, detail, value), phase_at(where, t_s))
              for t_s, source, kind, detail, value in rows[:EVENTS_LISTED]]  # fmt: skip
    return EventTables(counted, listed, len(rows))


def groups(tree: Any) -> list[tuple[str, list[tuple[str, str]]]]:
    """A nested mapping as (group, [(dotted key, value as text)]); its own plain values come first, as "general"."""
    tree = mapping(tree)
    plain = [(str(key), text(value)) for key, value in tree.items() if not isinstance(value, Mapping)]
    nested = [(str(key), list(_flat(value))) for key, value in tree.items() if isinstance(value, Mapping)]
    return ([("general", plain)] if plain else []) + nested


def _flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", text(value)


def text(value: Any) -> str:
    """A manifest value as text: strings as they are, everything else as JSON."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)


def command(record: Record) -> str:
    """The command line that made the record, "" where it does not say."""
    stated = record.manifest.get("command")
    if isinstance(stated, (list, tuple)):
        return shlex.join(str(part) for part in stated)
    return str(stated) if stated else ""
