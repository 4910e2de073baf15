"""`flownav explain`: why a log drifted, the evidence as a page, and the parameters that cure it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import chosen, out_option
from flownav.cli.output import Column, answer, by_reason, place, say, say_files, table_of, writing
from flownav.core.errors import VerdictError
from flownav.core.guard import write_text

if TYPE_CHECKING:
    from flownav.studies.explain.judge import Explanation

FOR = "Whose parameters cure it, where the log does not say."
TRIED = (
    Column("cause", lambda row: row["title"]),
    Column("likely", lambda row: f"{100.0 * row['probability']:.0f} %"),
    Column("explains", lambda row: _explains(row)),
    Column("seconds", lambda row: f"{row['t0_s']:.0f} to {row['t1_s']:.0f}"),
)
CURE = (
    Column("parameter", "name"),
    Column("value", lambda row: f"{row['value']:g}"),
    Column("because", "reason"),
)
LEAST_LIKELY = 0.1


def _explains(row: dict[str, Any]) -> str:
    """The share that a trial explains, or that the sign is another cause's consequence."""
    if row["consequence_of"]:
        return f"follows from {row['consequence_of'].replace('_', ' ')}"
    return "" if row["explained"] is None else f"{100.0 * row['explained']:.0f} %"


def command(
    log: options.Log,
    autopilot: Annotated[str | None, chosen(FOR, *options.SCALED_FLOW, flag="--for", unset="the log's own")] = None,
    flow_instance: options.FlowInstance = None,
    topic: options.Topic = None,
    out: Annotated[
        Path | None, out_option("The page (HTML); the parameters lie beside it", "out/LOG-explained.html")
    ] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Name the first cause of a log's drift, with the seconds, the evidence and the parameters that cure it."""
    from flownav.core.compile import announce_compilation
    from flownav.logs.open_log import open_log
    from flownav.logs.ros.topics import asked_topics
    from flownav.studies.explain.cure import SUFFIX
    from flownav.studies.explain.judge import explain
    from flownav.studies.explain.page import facts, write_explanation

    asked = out or Path("out") / f"{log.resolve().name}-explained.html"
    page = place(asked, log, force=force, beside=tuple(SUFFIX.values()))
    read = open_log(log, flow_instance=flow_instance, topics=asked_topics(topic or []))
    with announce_compilation("explanation"):
        explained = explain(read, dialect=autopilot or "")
    found = facts(explained)
    with writing(page):
        write_explanation(explained, read.span_s, page)
    found |= {"page": str(page), "parameters": _write_cure(explained, page, SUFFIX)}
    answer(found, as_json, lambda: _show(found))
    if explained.first is not None:
        raise VerdictError(f"{log}: {explained.first.title}")


def _write_cure(explained: Explanation, page: Path, suffixes: dict[str, str]) -> str | None:
    """The parameter file beside the page; None where no parameter cures anything, or the autopilot is not known."""
    if not explained.dialect or not any(one.cure.settings for one in explained.findings):
        return None
    path = page.with_suffix(suffixes[explained.dialect])
    with writing(path):
        write_text(explained.cure_text(), path)
    return str(path)


def _show(found: dict[str, Any]) -> None:
    """The verdict on top, then each cause with its cure, and what was looked for."""
    say(f"{found['log']}: {found['verdict']}")
    for number, one in enumerate(found["causes"]):
        if number:
            say(f"Also: {one['sentence']} ({one['t0_s']:.0f} to {one['t1_s']:.0f} s)")
        if one["beside_replay"]:
            say(one["beside_replay"])
        if one["cure"]["parameters"]:
            say(table_of(CURE, one["cure"]["parameters"], left=1))
        if one["cure"]["by_hand"]:
            say(one["cure"]["by_hand"])
    likely = [row for row in found["checked"] if row["probability"] >= LEAST_LIKELY]
    if likely:
        likely.sort(key=lambda row: (bool(row["consequence_of"]), -row["probability"]))
        title = "Hypotheses that remained" if found["causes"] else "Possible, but not likely enough to be named"
        say(table_of(TRIED, likely, left=1, title=title))
    say(f"Looked for: {', '.join(row['cause'].replace('_', ' ') for row in found['checked'])}.")
    missing = by_reason((row["cause"].replace("_", " "), row["what"]) for row in found["missing"])
    say(*(f"Not looked into, {causes}: {what}." for causes, what in missing))
    say_files(found, ("page", "parameters"))
