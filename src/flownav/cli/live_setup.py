"""`flownav live URL --setup`: the vehicle's parameters beside what flownav needs of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from flownav.cli.output import emit

if TYPE_CHECKING:
    from rich.console import Console

    from flownav.live.setup.check import Report

MARKS = {"right": "ok", "wrong": "CHANGE", "absent": "ABSENT", "unusual": "advised", "shown": ""}


def run(
    url: str,
    send: str,
    *,
    write: bool,
    source_set: int | None,
    system: int | None,
    component: int | None,
    key: bytes | None,
    as_json: bool,
) -> None:
    """Read, compare, write where asked to; print. Exit status 1 where something must change."""
    from flownav.live.byte_links import open_link
    from flownav.live.link import parse_url
    from flownav.live.setup.check import check
    from flownav.live.setup.talk import Talk

    link = open_link(url)
    try:
        talk = Talk(link, system=system, component=component, key=key)
        report = check(talk, parse_url(url), send, writing=write, asked_set=source_set)
    finally:
        link.close()
    if as_json:
        emit(report.as_dict())
    else:
        _print(report)
    if not report.fits or any(not change.done for change in report.changes):
        raise typer.Exit(1)


def _print(report: Report) -> None:
    from rich.console import Console

    console = Console(markup=False, highlight=False)
    if report.vehicle is not None:
        armed = {True: "ARMED", False: "disarmed", None: "unknown whether armed"}[report.armed]
        console.print(f"{report.make or 'vehicle'}: system {report.vehicle.system}, {armed}; for --send {report.send}")
    if report.source_set:
        console.print(f"Source set {report.source_set} is taken for flownav (--source-set chooses another)")
    if report.port:
        console.print(f"Serial port of the vehicle that we may be on: {report.port}")
    if report.rows:
        console.print(_table(report))
        _why(console, report)
    for change in report.changes:
        after = "no answer" if change.after is None else f"{change.after:g}"
        state = "written" if change.done else "NOT WRITTEN"
        console.print(f"{state}: {change.name} {change.before:g} -> {after}")
    for line in report.refused:
        console.print(f"Not written: {line}", soft_wrap=True)
    for says in dict.fromkeys(block.says for block in report.blocks):
        having = ", ".join(f"{block.name} {block.has:g}" for block in report.blocks if block.says == says)
        console.print(f"Blocks arming: '{says}' ({having})", soft_wrap=True)
    for line in report.notes:
        console.print(line, soft_wrap=True)
    if report.in_flight:
        console.print("Switching sources in flight:")
        for line in report.in_flight:
            console.print(f"  {line}", soft_wrap=True)
    console.print(report.verdict[:1].upper() + report.verdict[1:] + ".", soft_wrap=True)


def _table(report: Report) -> Any:
    from rich.table import Table

    table = Table("parameter", "has", "wanted", "verdict", "reboot")
    for row in report.rows:
        has = "-" if row.has is None else f"{row.has:g}"
        reboot = "yes" if row.reboot and row.status in ("wrong", "unusual", "absent") else ""
        table.add_row(row.name, has, row.wanted, MARKS.get(row.status, row.status), reboot)
    return table


def _why(console: Console, report: Report) -> None:
    for row in report.rows:
        if row.status in ("wrong", "absent", "unusual"):
            console.print(f"{row.name}: {row.why} [{row.source}]", soft_wrap=True)
