"""`flownav replay`: a recorded flight through the filter."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import chosen, option, out_option, switch
from flownav.cli.output import (
    Column,
    answer,
    figure,
    plain_look,
    progress,
    record_place,
    save,
    say,
    say_files,
    table,
    table_of,
)
from flownav.core.errors import InputError, VerdictError
from flownav.core.text import number

if TYPE_CHECKING:
    from flownav.core.record import Record
    from flownav.logs.log import Log
    from flownav.replays.prepare import ReplayOptions


OUTAGE_COLUMNS = (
    Column("GPS cut [s]", lambda cut: f"{cut['t0']:g} to {cut['t1']:g}"),
    Column("rms [m]", "horizontal_rms_m", ".2f"),
    Column("max [m]", "horizontal_max_m", ".2f"),
)
OUTAGE = "Withhold GPS from T0 to T1 [s]; repeated or with commas."
OUTAGES = "Windows of LENGTH from T0 to T1 [s]: one replay each, with GPS withheld in it."
VERBOSE = "Also the figures behind each sensor's verdict, and what was not fused."
SMOOTH = "Also compute the best estimate after the flight (the smoother)."
FILTER = "The navigator's filter, an installed one's name, or your own class."


def command(
    log: options.Log,
    gps_outage: Annotated[list[str] | None, option("T0:T1", OUTAGE)] = None,
    no_flow: Annotated[bool, switch("Withhold the optical flow.", "--no-flow")] = False,
    flow_scale: Annotated[str, option("X,Y", "Factors on the flow about body x and y.")] = "1,1",
    gps_delay: options.GpsDelay = 0.22,
    sensor: options.Sensor = None,
    outage_table: Annotated[str | None, option("T0:T1:LENGTH", OUTAGES)] = None,
    flow_instance: options.FlowInstance = None,
    topic: options.Topic = None,
    settings: options.Settings = None,
    smooth: Annotated[bool, switch(SMOOTH, "--smooth")] = False,
    filter_name: Annotated[str, chosen(FILTER, "landing", **options.OWN_FILTERS)] = "landing",
    out: Annotated[Path | None, out_option("The record", "out/LOG.fnr")] = None,
    force: options.Force = False,
    report: options.Report = True,
    verbose: Annotated[bool, switch(VERBOSE, "--verbose")] = False,
    as_json: options.Json = False,
) -> None:
    """Fuse a recorded flight: its trajectory, its errors against its own GPS, and the drift through GPS outages."""
    from flownav.api.calls import own_filter
    from flownav.api.replaying import replay_log
    from flownav.core.parameter_files import load
    from flownav.logs.open_log import open_flight
    from flownav.logs.ros.topics import asked_topics
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.replays.session import table_windows
    from flownav.sensors.datasheet import load_sensor

    asked_options = _options(gps_delay, gps_outage or [], flow_scale, no_flow=no_flow)
    asked = out or Path("out") / f"{log.resolve().name}.fnr"
    record_path = record_place(asked, log, settings, sensor, force=force, report=report)
    table = table_windows(*numbers("--outage-table", outage_table, ":", 3, "T0:T1:LENGTH")) if outage_table else []
    flow = load_sensor(sensor) if sensor else None
    stated = load(settings, NavigatorSettingsFile) if settings else None
    part = own_filter(filter_name)
    read = open_flight(log, flow_instance=flow_instance, topics=asked_topics(topic or []))
    with progress("GPS outages", len(table)) if table else nullcontext() as advance:
        record = replay_log(read, asked_options, flow, stated, smooth=smooth, table=table, part=part, progress=advance)
    if report and not read.fed:
        record.manifest["explained"] = _explained(read)
    scores = record.scores | save(record, record_path, report=report)
    answer(scores, as_json, lambda: show(record, scores, verbose=verbose))
    if record.verdict:
        raise VerdictError(f"{log}: {record.verdict}")


def _explained(log: Log) -> dict[str, Any]:
    """Why the log drifted, for the record's page."""
    from flownav.studies.explain.judge import explain
    from flownav.studies.explain.page import HEADINGS, lines

    found = explain(log)
    causes = [{"cause": one.name, "sentence": one.sentence, "probability": one.probability} for one in found.findings]
    return {
        "verdict": found.verdict,
        "causes": causes,
        "headings": list(HEADINGS),
        "lines": [list(line) for line in lines(found)],
    }


def _options(gps_delay_s: float, outages: list[str], flow_scale: str, *, no_flow: bool) -> ReplayOptions:
    """The replay's options: outages, factors, delay. InputError where a window or the factors are none."""
    from flownav.replays.prepare import ReplayOptions

    cuts = [text for given in outages for text in given.split(",")]
    windows = [numbers("--gps-outage", text, ":", 2, "T0:T1") for text in cuts]
    scale = numbers("--flow-scale", flow_scale, ",", 2, "X,Y")
    return ReplayOptions(gps_delay_s, tuple((t0, t1) for t0, t1 in windows), not no_flow, (scale[0], scale[1]))


def numbers(option: str, text: str, separator: str, count: int, form: str) -> tuple[float, ...]:
    """An option's numbers; InputError where it has another form than it should."""
    from math import isfinite

    try:
        found = tuple(number(part) for part in text.split(separator))
    except ValueError:
        found = ()
    if len(found) != count or not all(map(isfinite, found)):
        raise InputError(f"{option} {text}: {form} is needed, numbers")
    return found


def show(record: Record, scores: dict[str, Any], *, verbose: bool = False) -> None:
    """Print the figures for people."""
    say(f"{record.manifest['log']}: {scores['duration_s']:.1f} s")
    if scores["outages"]:
        against = (scores.get("truth") or {}).get("reference", "GPS")
        title = f"Horizontal drift through GPS outages, against {against}"
        say(table_of(OUTAGE_COLUMNS, scores["outages"], title=title))
    say(*error_lines(scores))
    say(*_sensors(scores, verbose=verbose))
    rejected = _rejected(scores)
    if rejected.row_count and verbose:
        say(rejected)
    say(*(f"Note: {note}" for note in record.manifest["notes"]))
    say(*(f"{finding['label']}: {finding['text']}" for finding in record.manifest["findings"]))
    say_files(scores, ("record", "report"))


def error_lines(scores: dict[str, Any]) -> list[str]:
    """The errors against each reference that there is, a sentence a line."""
    from flownav.scoring.headline import WITH_GPS

    sentences, truth = [], scores.get("truth")
    if "outage_median_rms_m" in scores:
        median, worst = figure(scores["outage_median_rms_m"]), figure(scores["outage_worst_rms_m"])
        sentences.append(f"Over the table's windows: median {median} m rms, worst {worst} m rms")
    if scores["velocity_rms_m_s"] is not None:
        sentences.append(f"Horizontal velocity against GPS: {scores['velocity_rms_m_s']:.3f} m/s rms")
    if truth:
        turned = "" if truth["yaw_rad"] is None else f", turned by {57.29578 * truth['yaw_rad']:.1f} deg"
        sentences.append(
            f"Against {truth['reference']}{turned}: horizontal {truth['horizontal_rms_m']:.2f} m rms, "
            f"{truth['horizontal_max_m']:.2f} m max; velocity {truth['velocity_rms_m_s']:.3f} m/s rms"
        )
    if scores["end_drift_m"] is not None:
        laid = f"{scores['truth']['reference']} laid on it at take-off"
        sentences.append(f"At the end of the flight, {laid}: {scores['end_drift_m']:.2f} m off")
    if truth and "gps_position" in scores["coverage"]:
        sentences.append(f"{WITH_GPS} (--gps-outage)")
    if scores["protection"]:
        sentences.append(_protection(scores["protection"]))
    if "smoothed" in scores:
        sentences.append(f"Smoothed over the whole flight: {_smoothed_errors(scores['smoothed'])}")
    own = scores.get("autopilot", {})
    if own.get("against"):
        sentences.append(f"The autopilot's own estimate ({own['name']}) {autopilot_errors(own)}")
    return sentences


def autopilot_errors(scores: dict[str, Any]) -> str:
    """The errors of an autopilot's own estimate (scoring/autopilot) in words, where it was compared with anything."""
    from flownav.scoring.path import AGAINST

    velocity = "" if scores["velocity_rms_m_s"] is None else f"; velocity {scores['velocity_rms_m_s']:.3f} m/s rms"
    return (
        f"against {AGAINST[scores['against']]}: horizontal {scores['horizontal_rms_m']:.2f} m rms, "
        f"{scores['horizontal_max_m']:.2f} m max; vertical {scores['vertical_rms_m']:.2f} m rms{velocity}"
    )


def _sensors(scores: dict[str, Any], *, verbose: bool) -> list[Any]:
    """A verdict a sensor, and what that means; verbose: when it gave readings, and the figures behind the verdict."""
    from flownav.report.figures_innovation import SENSOR_TITLES
    from flownav.scoring.sensor_verdict import meanings, verdict

    rows = []
    for name in dict.fromkeys([*scores["coverage"], *scores["consistency"]]):
        span, judged = scores["coverage"].get(name), scores["consistency"].get(name)
        fused = nis = refused = words = ""
        if judged:
            mean = judged["nis_per_dof"]
            fused, nis = str(judged["samples"]), "< 0.01" if mean < 0.005 else figure(mean)
            refused = figure(judged["refused"], ".1f", 100.0)
            words = verdict(mean, white=judged["white"], refused=judged["refused"])
        title = SENSOR_TITLES.get(name, name.replace("_", " "))
        rows.append((title, f"{span['t0']:.0f}, {span['t1']:.0f}" if span else "", fused, nis, refused, words))
    heads = ("sensor", "from, to [s]", "fused", "NIS", "refused [%]", "in flight")
    shown = rows if verbose else [row for row in rows if row[-1]]
    kept = range(len(heads)) if verbose else (0, len(heads) - 1)
    look = plain_look(edge=False)
    return [table([heads[k] for k in kept], ([row[k] for k in kept] for row in shown), fixed=1, **look),
            *(f"  {sentences}" for sentences in meanings(row[-1] for row in rows))]  # fmt: skip


def _protection(found: dict[str, Any]) -> str:
    """Protection levels in words."""
    level, unwarned = found["horizontal_m"], found["exceeded_unsaid_fraction"]
    sentences = f"Protection level, horizontal: {level['median']:.2f} m in the median, {level['p95']:.2f} m at 95 %"
    late = "" if unwarned is None else ". The error stayed within it, or a warning stood"
    late = f". The error was above it without a warning {100.0 * unwarned:.2f} % of the time" if unwarned else late
    return sentences + late


def _rejected(scores: dict[str, Any]) -> Any:
    """The table of readings that were not fused and why, in readings and in components (a row that the reader threw
    away is one).
    """
    rows = []
    for sensor, counted in scores["readings"].items():
        read, components = counted["read"], scores["rejected"].get(sensor, {})
        for reason, count in counted["rejected"].items():
            rows.append((sensor, reason, str(count), str(read), str(components.get(reason, ""))))
    return table(("sensor", "reason", "readings", "of those read", "components"), rows, title="Not fused")


def _smoothed_errors(scores: dict[str, Any]) -> str:
    """The smoothed path's errors in words."""
    sentences = [
        f"GPS cut {cut['t0']:g} to {cut['t1']:g} s: {figure(cut['horizontal_rms_m'])} m rms, "
        f"{figure(cut['horizontal_max_m'])} m max"
        for cut in scores["outages"]
    ]
    if scores["velocity_rms_m_s"] is not None:
        sentences.append(f"velocity against GPS {scores['velocity_rms_m_s']:.3f} m/s rms")
    if "truth" in scores:
        truth = scores["truth"]
        sentences.append(f"against {truth['reference']} {truth['horizontal_rms_m']:.2f} m rms horizontally")
    return "; ".join(sentences) or "nothing to compare it with"


STREAMS = (
    Column("sensor", "sensor"),
    Column("readings", "count"),
    Column("rate [Hz]", "rate_hz", ".1f"),
    Column("from [s]", "start_s", ".1f"),
    Column("to [s]", "end_s", ".1f"),
    Column("gap [s]", "largest_gap_s", ".2f"),
    Column("no data [%]", lambda stream: f"{100 * stream['no_data_share']:.0f}" if stream["no_data_share"] else ""),
)


def info(
    log: options.Log,
    flow_instance: options.FlowInstance = None,
    topic: options.Topic = None,
    as_json: options.Json = False,
) -> None:
    """Show what a log holds: sensors, rates, gaps, thrown-away rows, limits, signs, and what it lacks."""
    from flownav.core.compile import announce_compilation
    from flownav.logs.open_log import open_log
    from flownav.logs.ros.topics import asked_topics
    from flownav.studies.inspection import summarise

    read = open_log(log, flow_instance=flow_instance, topics=asked_topics(topic or []))
    with announce_compilation("inspection"):
        facts = summarise(read)
    answer(facts, as_json, lambda: _print(facts))


def _print(facts: dict[str, Any]) -> None:
    """Print the figures for people."""
    from rich.padding import Padding

    def padded(text: str) -> Padding:
        return Padding(text, (0, 0, 0, 2))

    say(f"{facts['log']}: {facts['end_s'] - facts['start_s']:.1f} s")
    say(
        f"A cause of drift: {facts['explained']}" if facts["causes"] else facts["explained"],
        f"Verdict: {facts['verdict']}",
    )
    say(*(f"Cannot be replayed: {obstacle}" for obstacle in facts["obstacles"]))
    say(table_of(STREAMS, facts["streams"], left=1, fixed=1, **plain_look(edge=False)))
    for s in facts["streams"]:
        if s["rejected"]:
            rejected = ", ".join(f"{count} {reason}" for reason, count in s["rejected"].items())
            say(f"Thrown away of {s['sensor']}: {rejected}")
    say(*(f"Clock: {line}" for line in facts["clock"] or ["no gap, no jump, nothing repeated"]))
    for name, limit in facts["limits"].items():
        sentences, share = f"Stated limits of {name}: {limit['low']:g} to {limit['high']:g}", limit["outside_share"]
        say(sentences if share is None else f"{sentences}; {100 * share:.1f} % of readings outside")
    say(f"Compared: {facts['checked']}", *(f"Warning: {text}" for text in facts["warnings"]))
    if facts["absences"]:
        say("Missing sensors, and the substitutes used:")
        say(*(padded(f"{absence['what']}: {absence['instead']}") for absence in facts["absences"]))
    own, truth = facts["autopilot"], facts["truth"]
    if own:
        say(f"The autopilot's own estimate: {own['name']}, {own['count']} rows at {figure(own['rate_hz'], '.1f')} Hz")
        say(*([padded(autopilot_errors(own))] if own["against"] else []))
    if truth:
        say(f"Reference: {truth['count']} rows at {figure(truth['rate_hz'], '.1f')} Hz")
    say(*(f"Note: {note}" for note in facts["notes"]))
