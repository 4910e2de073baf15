"""The tables of the report: scores, phases, outages, sensors, events, parameters. Scores are shown, never computed."""

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flownav.core.measurement import Array
from flownav.core.record import Record, mapping
from flownav.report import series
from flownav.report.figures_innovation import SENSOR_TITLES
from flownav.report.panels import MOST, NONE, number
from flownav.scoring.phases import Phase, phase_at
from flownav.scoring.recorded import rejected_mostly_in, scores_by_phase
from flownav.scoring.sensor_verdict import verdict

EVENTS_LISTED = 300


ATTITUDE = {"roll": ("right down", "°"), "pitch": ("nose up", "°"), "yaw": ("heading", "°")}
STATES = {"x": ("north", "m"), "y": ("east", "m"), "z": ("down", "m"),
          "u": ("forward", "m/s"), "v": ("right", "m/s"), "w": ("down", "m/s")}  # fmt: skip


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
    scores = mapping(record.manifest.get("scores"))
    states = {**mapping(scores.get("states")), **mapping(scores.get("attitude_deg"))}
    published = mapping(mapping(record.manifest.get("paper")).get("states"))
    rows = []
    for key, (direction, unit) in (STATES | ATTITUDE).items():
        mine, theirs = mapping(states.get(key)), mapping(published.get(key))
        if mine:
            mean, std, rms, largest = (number(mine.get(f"{kind}_error")) for kind in ("mean", "std", "rms", "max"))
            beside = (number(theirs.get("mean_error")), number(theirs.get("std_error")))
            rows.append(ScoreRow(key, direction, unit, (mean, std, rms, largest), beside))
    return rows


def outage_rows(record: Record, phases: Sequence[Phase] = ()) -> list[tuple[str, str, str, str, str]]:
    """Scored GPS outages as (window, phases, rms, max, where GPS was cut); the median and the worst last, if scored."""
    scores, here = mapping(record.manifest.get("scores")), series.outages(record)
    rows = []
    for outage in series.scored_outages(record):
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
    rows = series.event_rows(record)
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


MOST_LISTED = 200
NAMED_BY_VALUE = {"parameter": "{detail} = {value}", "clipping": "{detail} samples so far"}
USED = {"0": "no", "1": "yes"}


def autopilot_rows(record: Record, phases: Sequence[Phase] = ()) -> list[Event]:
    """Events of an autopilot's log besides its sensors, in order of time: modes, messages, parameters set in it."""
    where = list(phases)
    return [
        Event(t_s, (source, kind, _in_words(kind, detail, value), value), phase_at(where, t_s))
        for t_s, source, kind, detail, value in series.event_rows(record) if source == "autopilot"
    ][:MOST_LISTED]  # fmt: skip


def _in_words(kind: str, detail: str, value: str) -> str:
    """An autopilot's event in one column: a parameter with its value, whether its filter fuses flow as yes or no."""
    if kind == "fuses flow":
        return USED.get(detail, detail)
    return NAMED_BY_VALUE.get(kind, "{detail}").format(detail=detail, value=value)


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
    """The command line that made the record, "" where it does not hold it."""
    stated = record.manifest.get("command")
    if isinstance(stated, (list, tuple)):
        return shlex.join(str(part) for part in stated)
    return str(stated) if stated else ""


@dataclass(frozen=True)
class PhaseRow:
    """A phase as the page's table has it; start_s: the instant that the row moves the page to."""

    name: str
    start_s: float
    cells: tuple[str, ...]  # from, to, length, horizontal, vertical, velocity, not fused


def phase_rows(record: Record, phases: Sequence[Phase]) -> list[PhaseRow]:
    """A row for each phase, in order of time."""
    rows = []
    for one in scores_by_phase(record, phases):
        name, t0, t1 = one.phase
        errors = (number(one.horizontal_rms_m, 3), number(one.vertical_rms_m, 3), number(one.velocity_rms_m_s, 3))
        share = f"{one.rejected:,} of {one.offered:,}" if one.offered else NONE
        rows.append(PhaseRow(name, t0, (f"{t0:.1f}", f"{t1:.1f}", f"{t1 - t0:.1f}", *errors, share)))
    return rows


def phases_within(phases: Sequence[Phase], t0: float, t1: float) -> str:
    """The phases that a window of time touches, in words; "" without any."""
    names = [phase.name for phase in phases if phase.t0 < t1 and phase.t1 > t0]
    return ", ".join(dict.fromkeys(names)) or phase_at(list(phases), t0)


def rejected_rows(record: Record, phases: Sequence[Phase] = ()) -> list[tuple[str, str, str, str, str]]:
    """The readings that were not fused, as (sensor, reason, readings and of how many, components, phase of most), most
    first.

    Records from before readings were counted have components only.
    """
    scores = mapping(record.manifest.get("scores"))
    readings_of = mapping(scores.get("readings"))
    rows = []
    for sensor, reasons in mapping(scores.get("rejected")).items():
        counted = mapping(readings_of.get(sensor))
        whole, read = mapping(counted.get("rejected")), counted.get("read")
        of = f" of {read:,}" if isinstance(read, int) else ""
        rows += [
            (sensor, reason, n if isinstance(n := whole.get(reason), int) else None, count, of)
            for reason, count in mapping(reasons).items()
            if isinstance(count, int)
        ]
    rows.sort(key=lambda row: -row[3])
    mostly = rejected_mostly_in(record, phases)
    return [
        (SENSOR_TITLES.get(s, s.replace("_", " ")), r.replace("_", " "), NONE if n is None else f"{n:,}{of}", f"{c:,}",
         mostly.get((s, r), NONE))
        for s, r, n, c, of in rows
    ]  # fmt: skip


def _known(value: Any) -> float:
    """A score of a manifest; 0 where it is none."""
    return float(value) if isinstance(value, (int, float)) and abs(value) < MOST else 0.0


def sensor_rows(record: Record) -> list[tuple[str, ...]]:
    """Sensors as (name, from and to [s], rate [Hz], longest gap [s], components fused in flight, their mean square,
    share refused [%], verdict).
    """
    scores = mapping(record.manifest.get("scores"))
    spans, judged = mapping(scores.get("coverage")), mapping(scores.get("consistency"))
    rows: list[tuple[str, ...]] = []
    for name in dict.fromkeys([*spans, *judged]):
        span, found = mapping(spans.get(name)), mapping(judged.get(name))
        span_s = f"{number(span.get('t0'), 1)} to {number(span.get('t1'), 1)}" if span else NONE
        mean, tested, lost, verdict_words = NONE, NONE, NONE, ""
        if found:
            square, samples, refused = (_known(found.get(key)) for key in ("nis_per_dof", "samples", "refused"))
            mean, tested, lost = number(found.get("nis_per_dof"), 2), f"{samples:,.0f}", number(100.0 * refused, 1)
            verdict_words = verdict(square, white=bool(found.get("white")), refused=refused)
        title = SENSOR_TITLES.get(name, name.replace("_", " "))
        rows.append((title, span_s, *_pace(record, name), tested, mean, lost, verdict_words))
    return rows


def _read_s(record: Record, name: str) -> Array:
    """When a sensor was read [s], in order: of its own table, or else of those that were offered to the filter."""
    own, offered = (record.tables.get(table, {}) for table in (name, "innovation"))
    t_s = np.asarray(own.get("t_s", ()), float)
    if not len(t_s) and len(offered.get("sensor", ())):
        t_s = np.unique(np.asarray(offered["t_s"], float)[np.asarray(offered["sensor"]) == name])
    return np.sort(t_s[np.isfinite(t_s)])


def _pace(record: Record, name: str) -> tuple[str, str]:
    """A sensor's mean rate [Hz] and its longest gap [s] between readings; dashes where the record lacks them."""
    t_s = _read_s(record, name)
    if len(t_s) < 2 or t_s[-1] <= t_s[0]:
        return NONE, NONE
    return number((len(t_s) - 1) / float(t_s[-1] - t_s[0]), 1), number(float(np.max(np.diff(t_s))), 2)
