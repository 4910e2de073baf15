"""`flownav info`: what a log holds, before anything is done with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flownav.cli.options import FlowInstanceOption, JsonOption, LogArgument, TopicOption
from flownav.cli.output import emit

if TYPE_CHECKING:
    from rich.console import Console


def command(
    log: LogArgument,
    flow_instance: FlowInstanceOption = None,
    topic: TopicOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what a log holds: sensors, rates, gaps, thrown-away rows, limits, signs, and what it lacks."""
    from flownav.core.compile import announce_compilation
    from flownav.logs.open_log import open_log
    from flownav.logs.ros.topics import asked_topics
    from flownav.studies.inspection.summary import summarise

    read = open_log(log, flow_instance=flow_instance, topics=asked_topics(topic or []))
    with announce_compilation("inspection"):
        facts = summarise(read)
    if as_json:
        emit(facts)
    else:
        _print(facts)


def _print(facts: dict[str, Any]) -> None:
    """The same figures for people."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.padding import Padding
    from rich.table import Table

    console = Console(markup=False, highlight=False)
    console.print(f"{facts['log']}: {facts['end_s'] - facts['start_s']:.1f} s")
    console.print(f"Verdict: {facts['verdict']}")
    for obstacle in facts["obstacles"]:
        console.print(f"Cannot be replayed: {obstacle}")
    heads = ("sensor", "readings", "rate [Hz]", "from [s]", "to [s]", "gap [s]", "no data [%]")
    streams = Table(*heads, box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    streams.columns[0].no_wrap = True
    for column in streams.columns[1:]:
        column.justify = "right"
    for s in facts["streams"]:
        no_data = f"{100 * s['no_data_share']:.0f}" if s["no_data_share"] else ""
        span, gap = (f"{s['start_s']:.1f}", f"{s['end_s']:.1f}"), _figure(s["largest_gap_s"], 2)
        streams.add_row(s["sensor"], str(s["count"]), _figure(s["rate_hz"], 1), *span, gap, no_data)
    console.print(streams)
    for s in facts["streams"]:
        if s["rejected"]:
            rejected = ", ".join(f"{count} {reason}" for reason, count in s["rejected"].items())
            console.print(f"Thrown away of {s['sensor']}: {rejected}")
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
        console.print("What is missing, and what is done instead:")
        for absence in facts["absences"]:
            console.print(Padding(f"{absence['what']}: {absence['instead']}", (0, 0, 0, 2)))
    if facts["autopilot"]:
        _print_autopilot(console, facts["autopilot"])
    if facts["truth"]:
        console.print(f"Reference: {facts['truth']['count']} rows at {_figure(facts['truth']['rate_hz'], 1)} Hz")
    for note in facts["notes"]:
        console.print(f"Note: {note}")


def _print_autopilot(console: Console, own: dict[str, Any]) -> None:
    from rich.padding import Padding

    from flownav.cli.output import autopilot_errors

    console.print(
        f"The autopilot's own estimate: {own['name']}, {own['count']} rows at {_figure(own['rate_hz'], 1)} Hz"
    )
    if own["against"]:
        console.print(Padding(autopilot_errors(own), (0, 0, 0, 2)))


def _figure(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
