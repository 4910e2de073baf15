"""The words and tables of the report: headline, scores, events, parameters. Scores are shown, never computed."""

import math
import re
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import numpy as np

from flownav.core.measurement import Sensor
from flownav.core.record import POSITION_NED, Record, mapping
from flownav.report import series
from flownav.report.panels import NONE, Part, Tile, metres, number
from flownav.report.series import has, readings
from flownav.scoring.headline import WITH_GPS, sentence

UNIT_AFTER_NUMBER = re.compile(r"(\d) (m/s|m|s)\b")
SETTLES_S = 1.0  # after the first range, until the height follows it
AXES = {"x": "north", "y": "east", "z": "height"}
KINDS = {
    "fly": "A closed-loop simulated flight of {}.",
    "replay": "A recorded flight of {}, fused again.",
    "live": "A live flight of {}.",
}


def title(record: Record) -> str:
    """The heading of a report: the scenario's name in words, or the log's as its file is called."""
    scenario, log = record.manifest.get("scenario"), record.manifest.get("log")
    if log and not scenario:
        return PurePath(str(log)).name or "Flight"
    return in_words(str(scenario or record.manifest.get("kind") or "Flight"))


def in_words(name: str) -> str:
    """A scenario's name, or its file's, as a heading."""
    words = PurePath(name).name.removesuffix(".toml").replace("_", " ").replace("-", " ").strip() or "Flight"
    return words[0].upper() + words[1:]


def duration_s(record: Record) -> float:
    """The flight's length [s]: by the manifest, or else of its estimate."""
    stated = record.manifest.get("duration_s")
    start, end = series.whole_s(record)
    return float(stated) if isinstance(stated, (int, float)) else end - start


def summary(record: Record) -> str:
    """The verdict in sentences."""
    manifest, scores = record.manifest, mapping(record.manifest.get("scores"))
    sentences = [KINDS.get(str(manifest.get("kind")), "A flight of {}.").format(f"{duration_s(record):.1f} s")]
    sentences += landing_sentences(mapping(scores.get("touchdown")))
    headline = sentence(manifest, scores) if manifest.get("kind") == "fly" else ""
    sentences = [headline, *sentences] if headline else sentences
    largest = scores.get("max_position_error_m")
    if largest is not None:
        published = mapping(manifest.get("paper")).get("max_position_error_m")
        beside = f" (the paper: {metres(published)} m)" if published is not None else ""
        ever = "No axis of the estimated position was ever"
        ever = "In flight no axis of the position that the autopilot used was" if has(record, "flown") else ever
        sentences.append(f"{ever} off by more than {metres(largest)} m{beside}.")
    if manifest.get("known_exactly"):
        sentences.append(f"Known to the vehicle without error: {manifest['known_exactly']}.")
    cut = series.scored_outages(record)
    if cut:
        worst = max(cut, key=series.rms_m)
        among = f", the worst of {len(cut)} outages," if len(cut) > 1 else ""
        rms, largest = number(worst.get("horizontal_rms_m"), 2), number(worst.get("horizontal_max_m"), 2)
        against = series.truth_name(record) if scores.get("truth") else "GPS"
        sentences.append(
            f"With GPS withheld from {worst['t0']:g} to {worst['t1']:g} s{among} the position drifted "
            f"{rms} m rms and {largest} m at most, against {against}."
        )
    truth = mapping(scores.get("truth"))
    if truth:
        rms, largest = number(truth.get("horizontal_rms_m"), 2), number(truth.get("horizontal_max_m"), 2)
        sentences.append(
            f"Against {_reference(record)} its position is off by {rms} m rms, {largest} m at most, horizontally."
        )
    if scores.get("end_drift_m") is not None:
        sentences.append(f"Laid on each other at take-off, the two end {metres(scores['end_drift_m'])} m apart.")
    if truth and "gps_position" in mapping(scores.get("coverage")):
        sentences.append(f"{WITH_GPS}.")
    own = mapping(scores.get("autopilot"))
    if own.get("against"):
        rms, largest = number(own.get("horizontal_rms_m"), 2), number(own.get("horizontal_max_m"), 2)
        against = _reference(record) if own["against"] == "truth" else "GPS, their mean difference taken out"
        sentences.append(
            f"The autopilot's own estimate ({own.get('name')}) is off by {rms} m rms, "
            f"{largest} m at most, horizontally, against {against}."
        )
    if not scores:
        sentences.append("The record carries no scores.")
    return UNIT_AFTER_NUMBER.sub("\\1\N{NO-BREAK SPACE}\\2", " ".join(sentences))


def _reference(record: Record) -> str:
    """The reference of the errors, in words: a truth, or an estimate that serves for want of one."""
    name = series.truth_name(record)
    return "the recorded truth" if name == "truth" else f"the recorded {name} (an estimate itself)"


def tiles(record: Record) -> list[Tile]:
    """The headline figures that the record's scores and streams give."""
    scores, paper = mapping(record.manifest.get("scores")), mapping(record.manifest.get("paper"))
    found = landing_tiles(mapping(scores.get("touchdown")))
    if scores.get("max_position_error_m") is not None:
        published = paper.get("max_position_error_m")
        against = (
            "of the autopilot's input" if has(record, "flown") else f"estimate against {series.truth_name(record)}"
        )
        note = (
            f"paper {metres(published)} m" if published is not None else f"{against}{_axis_of_largest(scores, record)}"
        )
        found.append(Tile("Largest error of one axis", metres(scores["max_position_error_m"]), "m", note))
    turned: list[Any] = [mapping(error).get("rms_error") for error in mapping(scores.get("attitude_deg")).values()]
    if len(turned) == 3 and all(isinstance(angle, float) for angle in turned):
        tilt, heading = math.hypot(*turned[:2]), number(turned[2], 2)
        found.append(
            Tile(
                "Attitude error",
                number(tilt, 2),
                "°",
                f"rms of roll and pitch; heading {heading}°{_heading_limit(record)}",
            )
        )
    cut = series.scored_outages(record)
    if cut:
        worst = max(cut, key=series.rms_m)
        when = f"rms, {worst['t0']:g} to {worst['t1']:g} s"
        name = "Drift without GPS" if len(cut) == 1 else f"Worst drift of {len(cut)} outages"
        found.append(Tile(name, number(worst.get("horizontal_rms_m"), 2), "m", when))
    truth = mapping(scores.get("truth"))
    if truth:
        largest = f"at most {number(truth.get('horizontal_max_m'), 2)} m, against {series.truth_name(record)}"
        found.append(Tile("Horizontal error", number(truth.get("horizontal_rms_m"), 2), "m", f"rms, {largest}"))
    if scores.get("end_drift_m") is not None:
        laid = f"horizontal, {series.truth_name(record)} laid on at take-off"
        found.append(Tile("Drift at the end", metres(scores["end_drift_m"]), "m", laid))
    if scores.get("velocity_rms_m_s") is not None:
        found.append(Tile("Velocity error", number(scores["velocity_rms_m_s"], 2), "m/s", "rms, against GPS"))
    share = flow_share(record)
    papers = record.manifest.get("kind") == "fly" and has(record, "flow_velocity")  # whose sensor reads above the pad
    name = "Flow sensor engaged" if papers else "Valid flow readings"
    if share is None:
        return [*found, Tile(name, NONE, "", "no valid readings")]
    return [*found, Tile(name, f"{100 * share:.0f}", "%", "of the time")]


def _heading_limit(record: Record) -> str:
    """The limit of the navigator's heading in simulation, as words to follow."""
    ours = record.manifest.get("kind") == "fly" and record.manifest.get("filter") == "landing"
    return ", which only the compass shows in hover" if ours else ""


def _axis_of_largest(scores: Mapping[str, Any], record: Record) -> str:
    """Which axis of the position erred most, as words to follow; "" where the scores lack it.

    Of a height it is added if the error was so large only before the first range was received.
    """
    states = mapping(scores.get("states"))
    errors = {words: mapping(states.get(key)).get("max_error") for key, words in AXES.items()}
    known = {words: float(value) for words, value in errors.items() if isinstance(value, int | float)}
    if len(known) != len(AXES):
        return ""
    worst = max(known, key=lambda words: known[words])
    before = worst == AXES["z"] and _is_before_the_first_range(record, known[worst])
    return f": {worst}{', before the first range' if before else ''}"


def _is_before_the_first_range(record: Record, largest_m: float) -> bool:
    """Whether the height's error is smaller than its largest by half from the first range on that was fused."""
    ranged_s = series.first_fused_s(record, Sensor.RANGE)
    flown = series.track(record, "flown" if has(record, "flown") else "estimate", POSITION_NED)
    truth = series.track(record, "truth", POSITION_NED)
    if ranged_s is None or flown is None or truth is None:
        return False
    error = series.difference(flown, truth)
    after = np.abs(error.value[error.t_s > ranged_s + SETTLES_S, 2])
    return bool(len(after) and np.nanmax(after) < 0.5 * largest_m)


def flow_share(record: Record) -> float | None:
    """Share of the flight with valid flow readings, a gap not counted; None without readings."""
    flow = series.flow_readings(record)
    start, end = series.whole_s(record)
    if flow is None or len(flow.t_s) < 2 or end <= start:
        return None
    interval = np.diff(flow.t_s)
    return float(min(1.0, interval[interval <= 3.0 * np.median(interval)].sum() / (end - start)))


def explained(record: Record) -> dict[str, Any]:
    """The output of `flownav explain` on the log: verdict, causes, headings and lines of its table; {} without."""
    explanation = mapping(record.manifest.get("explained"))
    if not isinstance(explanation.get("verdict"), str):
        return {}
    lines = [[str(cell) for cell in line] for line in explanation.get("lines") or [] if isinstance(line, list)]
    return {
        "verdict": explanation["verdict"], "found": bool(explanation.get("causes")),
        "headings": [str(heading) for heading in explanation.get("headings") or []], "lines": lines,
    }  # fmt: skip


def lacking(record: Record) -> list[str]:
    """The data that a record lacks, in words, and the figures that its report therefore cannot show."""
    notes = []
    covered = record.manifest.get("covered_fraction", 1.0)
    if covered < 0.99:
        share = f"{100.0 * covered:.0f} %"
        notes.append(f"The estimate covers {share} of what is scored; its errors are those of that part.")
    gps = readings(record, Sensor.GPS_POSITION) is not None
    if not has(record, "truth"):
        errors = "errors are shown against GPS, which has errors of its own" if gps else "no error can be shown"
        notes.append(f"No truth: {errors}.")
    elif series.truth_name(record) != "truth":
        notes.append(
            f"No truth: errors are shown against the {series.truth_name(record)}, which has errors of its own."
        )
    if not has(record, "estimate"):
        notes.append("No estimate: nothing was fused.")
    if series.flow_readings(record) is None:
        notes.append("No valid optical flow: position and velocity rest on the other sensors.")
    elif series.flow_velocity(record) is None:
        notes.append("No range at the time of the flow: its readings are fused, but no velocity of theirs is drawn.")
    if not gps:
        notes.append("No GPS positions.")
    if record.manifest.get("kind") != "fly" and not has(record, "autopilot"):
        notes.append("No estimate of an autopilot's own to compare with.")
    if not mapping(record.manifest.get("scores")):
        notes.append("No scores.")
    return notes


def landing_sentences(landing: Mapping[str, Any]) -> list[str]:
    """Sentences on `scores.touchdown` as one flight has it; empty where it touched nothing."""
    contact, rest, limited = (mapping(landing.get(name)) for name in ("contact", "rest", "limited_by"))
    sentences = []
    if contact.get("distance_m") is not None:
        sentences.append(
            f"It touched down after {number(contact.get('t_s'), 1)} s, {metres(contact.get('distance_m'))} m from the "
            f"pad's centre, sinking at {number(contact.get('sink_rate_m_s'), 2)} m/s and drifting at "
            f"{number(contact.get('lateral_speed_m_s'), 2)} m/s."
        )
    if limited.get("estimate_m") is not None:
        sentences.append(
            f"Of that its estimate was off by {metres(limited.get('estimate_m'))} m, its guidance by "
            f"{metres(limited.get('guidance_m'))} m and the pad's place by {metres(limited.get('pad_m'))} m."
        )
    if rest.get("distance_m") is not None:
        sentences.append(
            f"It came to rest {metres(rest.get('distance_m'))} m from the centre, {metres(rest.get('slide_m'))} m from "
            "where it touched."
        )
    if landing.get("broken"):
        sentences.append(f"It crashed: {', '.join(landing['broken'])}.")
    if landing.get("reason"):
        sentences.append(f"It never landed: {landing['reason']}.")
    return sentences


def parts_of(limited: Mapping[str, Any]) -> tuple[Part, ...]:
    """The parts of the touchdown's error as bars; they add as vectors. None where it was not scored."""
    sizes = {name: limited.get(f"{name}_m") for name in ("estimate", "guidance", "pad")}
    known = {name: float(size) for name, size in sizes.items() if isinstance(size, (int, float)) and size == size}
    longest = max(known.values(), default=0.0)
    return tuple(Part(name, metres(size), size / longest if longest else 0.0) for name, size in known.items())


def landing_tiles(landing: Mapping[str, Any]) -> list[Tile]:
    """The landing as headline figures."""
    contact, rest, limited = (mapping(landing.get(name)) for name in ("contact", "rest", "limited_by"))
    found = []
    if contact.get("distance_m") is not None:
        when = f"at {number(contact.get('t_s'), 1)} s"
        found.append(Tile("Touchdown off centre", metres(contact.get("distance_m")), "m", when, parts_of(limited)))
        found.append(Tile("Touchdown sink rate", number(contact.get("sink_rate_m_s"), 2), "m/s", when))
    if rest.get("distance_m") is not None:
        slid = f"slid {metres(rest.get('slide_m'))} m"
        found.append(Tile("At rest off centre", metres(rest.get("distance_m")), "m", slid))
    if landing.get("broken"):
        found.append(Tile("Crashed", "yes", "", ", ".join(landing["broken"])))
    if landing.get("reason"):
        found.append(Tile("Landed", "never", "", landing["reason"]))
    return found
