"""`flownav info`: what a log holds, before anything is done with it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console


def command(
    log: Annotated[
        Path, typer.Argument(help="A log: CSV folder, .ulg, .bin or .tlog (docs/logs.md).", show_default=False)
    ],
    flow_instance: Annotated[
        int | None, typer.Option("--flow-instance", metavar="N", help="Which of several flow sensors.")
    ] = None,
    topic: Annotated[
        list[str] | None,
        typer.Option("--topic", metavar="ROLE=TOPIC", help="Of a ROS bag: which topic serves as what; several times."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Show what a log holds: sensors, rates, gaps, thrown-away rows, limits, signs, and what it lacks."""
    from flownav.compile import announce_compilation
    from flownav.inspection.summary import summarise
    from flownav.logs.open_log import open_log
    from flownav.logs.ros.choice import asked_topics

    read = open_log(log, flow_instance=flow_instance, topics=asked_topics(topic or []))
    with announce_compilation("inspection"):
        facts = summarise(read)
    if as_json:
        typer.echo(json.dumps(facts))
    else:
        _print(facts)


def _print(facts: dict[str, Any]) -> None:
    """The same figures for people."""
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, highlight=False)
    console.print(f"{facts['log']}: {facts['end_s'] - facts['start_s']:.1f} s")
    console.print(f"Verdict: {facts['verdict']}")
    for obstacle in facts["obstacles"]:
        console.print(f"Cannot be replayed: {obstacle}")
    streams = Table("sensor", "readings", "rate [Hz]", "from, to [s]", "gap [s]", "no data", "thrown away")
    for column in streams.columns[:4]:
        column.no_wrap = True
    for s in facts["streams"]:
        rejected = ", ".join(f"{count} {reason}" for reason, count in s["rejected"].items())
        no_data = f"{100 * s['no_data_share']:.0f} %" if s["no_data_share"] else ""
        span, gap = f"{s['start_s']:.1f}, {s['end_s']:.1f}", _figure(s["largest_gap_s"], 2)
        streams.add_row(s["sensor"], str(s["count"]), _figure(s["rate_hz"], 1), span, gap, no_data, rejected)
    console.print(streams)
    for line in facts["clock"] or ["nothing found"]:
        console.print(f"Clock: {line}")
    for name, limit in facts["limits"].items():
        said = f"Stated limits of {name}: {limit['low']:g} to {limit['high']:g}"
        share = limit["outside_share"]
        console.print(said if share is None else f"{said}; {100 * share:.1f} % of readings outside")
    console.print(f"Compared: {facts['checked']}")
    for text in facts["warnings"]:
        console.print(f"Warning: {text}")
    if facts["absences"]:
        lacking = Table("the log has", "instead", title="What is missing")
        for absence in facts["absences"]:
            lacking.add_row(absence["what"], absence["instead"])
        console.print(lacking)
    if facts["autopilot"]:
        _print_autopilot(console, facts["autopilot"])
    if facts["truth"]:
        console.print(f"Reference: {facts['truth']['count']} rows at {_figure(facts['truth']['rate_hz'], 1)} Hz")
    for note in facts["notes"]:
        console.print(f"Note: {note}")


def _print_autopilot(console: Console, own: dict[str, Any]) -> None:
    from flownav.cli.output import autopilot_errors

    console.print(
        f"The autopilot's own estimate: {own['name']}, {own['count']} rows at {_figure(own['rate_hz'], 1)} Hz"
    )
    if own["against"]:
        console.print(f"  {autopilot_errors(own)}")


def _figure(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
