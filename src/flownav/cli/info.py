"""`flownav info`: what a log holds, before anything is done with it."""

from typing import Any

from flownav.cli import options
from flownav.cli.replay import autopilot_errors
from flownav.cli.tables import Column, answer, figure, plain_look, say, table_of

STREAMS = (
    Column("sensor", "sensor"),
    Column("readings", "count"),
    Column("rate [Hz]", "rate_hz", ".1f"),
    Column("from [s]", "start_s", ".1f"),
    Column("to [s]", "end_s", ".1f"),
    Column("gap [s]", "largest_gap_s", ".2f"),
    Column("no data [%]", lambda stream: f"{100 * stream['no_data_share']:.0f}" if stream["no_data_share"] else ""),
)


def command(
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

    say(f"{facts['log']}: {facts['end_s'] - facts['start_s']:.1f} s", f"Verdict: {facts['verdict']}")
    say(*(f"Cannot be replayed: {obstacle}" for obstacle in facts["obstacles"]))
    say(table_of(STREAMS, facts["streams"], left=1, fixed=1, **plain_look(edge=False)))
    for s in facts["streams"]:
        if s["rejected"]:
            rejected = ", ".join(f"{count} {reason}" for reason, count in s["rejected"].items())
            say(f"Thrown away of {s['sensor']}: {rejected}")
    say(*(f"Clock: {line}" for line in facts["clock"] or ["nothing found"]))
    for name, limit in facts["limits"].items():
        said, share = f"Stated limits of {name}: {limit['low']:g} to {limit['high']:g}", limit["outside_share"]
        say(said if share is None else f"{said}; {100 * share:.1f} % of readings outside")
    say(f"Compared: {facts['checked']}", *(f"Warning: {text}" for text in facts["warnings"]))
    if facts["absences"]:
        say("What is missing, and what is done instead:")
        say(*(padded(f"{absence['what']}: {absence['instead']}") for absence in facts["absences"]))
    own, truth = facts["autopilot"], facts["truth"]
    if own:
        say(f"The autopilot's own estimate: {own['name']}, {own['count']} rows at {figure(own['rate_hz'], '.1f')} Hz")
        say(*([padded(autopilot_errors(own))] if own["against"] else []))
    if truth:
        say(f"Reference: {truth['count']} rows at {figure(truth['rate_hz'], '.1f')} Hz")
    say(*(f"Note: {note}" for note in facts["notes"]))
