"""`flownav live URL --setup`: the vehicle's parameters beside what flownav needs of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from flownav.cli.output import Column, answer, figure, say, table_of

if TYPE_CHECKING:
    from flownav.live.setup.check import Report

MARKS = {"right": "ok", "wrong": "CHANGE", "absent": "ABSENT", "unusual": "advised", "shown": ""}
ASKED = ("wrong", "absent", "unusual")
COLUMNS = (
    Column("parameter", lambda row: row.name),
    Column("has", lambda row: figure(row.has, "g")),
    Column("wanted", lambda row: row.wanted),
    Column("verdict", lambda row: MARKS.get(row.status, row.status)),
    Column("reboot", lambda row: "yes" if row.reboot and row.status in ASKED else ""),
)


def run(
    url: str, send: str, *, write: bool, source_set: int | None, system: int | None, component: int | None,
    key: bytes | None, origin: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Read, compare, write where asked to; print. Exit status 1 where something must change."""
    from flownav.live.byte_links import open_link
    from flownav.live.link import parse_url
    from flownav.live.setup.arming import origin_of
    from flownav.live.setup.check import check
    from flownav.live.setup.talk import Talk

    link = open_link(url)
    try:
        talk = Talk(link, system=system, component=component, key=key)
        place = origin_of(origin) if origin is not None else None
        report = check(talk, parse_url(url), send, writing=write, asked_set=source_set, origin=place)
    finally:
        link.close()
    answer(report.as_dict(), as_json, lambda: _show(report))
    if not report.fits or any(not change.done for change in report.changes):
        raise typer.Exit(1)


def _show(report: Report) -> None:
    if report.vehicle is not None:
        armed = {True: "ARMED", False: "disarmed", None: "unknown whether armed"}[report.armed]
        say(f"{report.make or 'vehicle'}: system {report.vehicle.system}, {armed}; for --send {report.send}")
    if report.source_set:
        say(f"Source set {report.source_set} is taken for flownav (--source-set chooses another)")
    if report.port:
        say(f"Serial port of the vehicle that we may be on: {report.port}")
    if report.rows:
        say(table_of(COLUMNS, report.rows))
    lines = [f"{row.name}: {row.why} [{row.source}]" for row in report.rows if row.status in ASKED]
    say(*lines, soft=True)
    for change in report.changes:
        after = "no answer" if change.after is None else f"{change.after:g}"
        say(f"{'written' if change.done else 'NOT WRITTEN'}: {change.name} {change.before:g} -> {after}")
    lines = [f"Not written: {line}" for line in report.refused]
    for says in dict.fromkeys(block.says for block in report.blocks):
        having = ", ".join(f"{block.name} {block.has:g}" for block in report.blocks if block.says == says)
        lines.append(f"Blocks arming: '{says}' ({having})")
    if report.ready.origin_deg_m is not None:
        latitude, longitude, altitude_m = report.ready.origin_deg_m
        lines.append(f"Origin of the EKF: {latitude:.7f}, {longitude:.7f}, {altitude_m:.1f} m")
    lines += [f"Missing: {line}" for line in report.ready.missing]
    lines += [f"The autopilot says: '{line}'" for line in report.ready.says]
    lines += report.notes
    if report.in_flight:
        lines += ["Switching sources in flight:", *(f"  {line}" for line in report.in_flight)]
    say(*lines, report.verdict[:1].upper() + report.verdict[1:] + ".", soft=True)
