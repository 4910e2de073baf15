"""Estimators, and records, compared on one page: tables, GPS cuts, errors over each other, differences, paths."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core import guard
from flownav.core.measurement import Array
from flownav.core.record import Record
from flownav.core.version import __version__
from flownav.report.chart import Stack, sliding_mean
from flownav.report.figures_states import Paths, PathsView, paths_of
from flownav.report.html import (
    HERE,
    flight_facts,
    linked_with,
    template,
)
from flownav.report.panels import Panel, Section, number
from flownav.report.series import Track, Window, start_end_s
from flownav.report.style import FONT, PALETTE
from flownav.scoring.phases import phases_of

POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"  # no script at all
Lines = Sequence[tuple[str, ...]]


def write_comparison(headings: tuple[str, ...], lines: Lines, rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Write the page, whole or not at all. OSError where the file cannot be written.

    headings and lines: the table as text. rows: what `flownav compare --json` prints, for the GPS cuts.
    """
    guard.write_page(render(headings, lines, rows), path)


def render(headings: tuple[str, ...], lines: Lines, rows: Sequence[dict[str, Any]]) -> str:
    """The page as text."""
    from markupsafe import Markup

    page: str = template("comparison.html.j2").render(
        headings=headings,
        lines=lines,
        cuts=cuts_of(rows, [line[1] for line in lines]),
        version=__version__,
        palette=PALETTE,
        font=Markup(FONT),
        style=Markup((HERE / "page.css").read_text(encoding="utf-8")),
        policy=POLICY,
    )
    return page


def cuts_of(rows: Sequence[dict[str, Any]], names: Sequence[str]) -> list[tuple[str, list[str], list[list[str]]]]:
    """By log with GPS cuts: its name, who went through them, and a line for each cut with everyone's rms [m]."""
    found = []
    for log in dict.fromkeys(row["log"] for row in rows):
        through = [(name, row["outages"]["windows"]) for row, name in zip(rows, names, strict=True)
                   if row["log"] == log and row["outages"]["windows"]]  # fmt: skip
        lines = [
            [f"{cut['t0']:g} to {cut['t1']:g} s", *(number(cuts[k]["horizontal_rms_m"], 2) for _, cuts in through)]
            for k, cut in enumerate(through[0][1] if through else [])
        ]
        if lines:
            found.append((log, [name for name, _ in through], lines))
    return found


ROLES = tuple(f"record-{k}" for k in range(1, 7))
TITLES = {"horizontal_m": "horizontal (m)", "vertical_m": "vertical (m)", "velocity_m_s": "velocity (m/s)"}
SMOOTHED_S = 1.0
Named = Sequence[tuple[str, Record]]
Errors = Sequence[Mapping[str, tuple[Array, Array]]]


def write_records(
    named: Named, errors: Errors, headings: Sequence[str], lines: Sequence[Sequence[str]], path: Path
) -> None:
    """Write the page, whole or not at all. OSError where the file cannot be written.

    errors: of each record by measure (a key of TITLES) instants and lengths of the error. headings, lines: the table.
    """
    guard.write_page(render_records(named, errors, headings, lines), path)


def render_records(named: Named, errors: Errors, headings: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """The page as text."""
    first = named[0][1]
    window = _window([record for _, record in named])
    shown = [section for section in _sections(named, errors, window) if section.panels]
    facts = flight_facts(first, phases_of(first)) | {"t0": window[0], "t1": window[1], "name": "records"}
    page: str = template("records.html.j2").render(
        names=[name for name, _ in named],
        roles=[role_of(k) for k in range(len(named))],
        headings=headings,
        lines=lines,
        version=__version__,
        **linked_with(shown, facts, _together(named), window),
    )
    return page


def role_of(place: int) -> str:
    """The colour of the record at a place; from the seventh on they come again."""
    return ROLES[place % len(ROLES)]


def _window(records: Sequence[Record]) -> Window:
    spans = [start_end_s(record) for record in records]
    return min(t0 for t0, _ in spans), max(t1 for _, t1 in spans)


def _sections(named: Named, errors: Errors, window: Window) -> list[Section]:
    together = _together(named)
    paths = []
    if together is not None:
        names = ", ".join(name for name, _ in named)
        paths = [
            Panel("path-3d", "Paths in space", "Drag to turn, or use the arrow keys.", f"Paths in space of {names}.",
                  PathsView(together, "space")),
            Panel("ground-track", "Ground tracks", "From above.", f"Paths over the ground of {names}.",
                  PathsView(together, "above")),
        ]  # fmt: skip
    return [
        Section("path", "Paths", tuple(paths)),
        Section("errors", "Errors over each other", tuple(_over_each_other(named, errors, window))),
        Section("differences", f"Differences from {named[0][0]}", tuple(_differences(named, errors, window))),
    ]


def _over_each_other(named: Named, errors: Errors, window: Window) -> list[Panel]:
    known = [measure for measure in TITLES if any(measure in one for one in errors)]
    if not known:
        return [Panel("errors-all", "Errors", absent="No record holds a truth or GPS to take errors against.")]
    stack = Stack([TITLES[measure] for measure in known], row_height_px=150)
    for row, measure in enumerate(known, 1):
        for k, ((name, _), one) in enumerate(zip(named, errors, strict=True)):
            if measure in one:
                stack.line(row, role_of(k), name, *one[measure])
    stack.from_zero()
    caption = "Length of the error of the autopilot's input, or else of the estimate, against the truth, or else GPS."
    return [Panel("errors-all", "Errors", caption, caption, stack.chart(window), wide=True)]


def _differences(named: Named, errors: Errors, window: Window) -> list[Panel]:
    shared = [m for m in TITLES if m in errors[0] and any(m in one for one in errors[1:])]
    if not shared:
        return []
    stack = Stack([TITLES[measure] for measure in shared], row_height_px=130)
    for row, measure in enumerate(shared, 1):
        t_s, error = errors[0][measure]
        for k, ((name, _), one) in enumerate(zip(named[1:], errors[1:], strict=True), 1):
            if measure not in one:
                continue
            there_s, there = one[measure]
            apart = np.interp(t_s, there_s, there, np.nan, np.nan) - error
            stack.line(row, role_of(k), name, t_s, sliding_mean(t_s, apart, SMOOTHED_S))
        stack.line(row, "command", "no difference", np.array(window), np.zeros(2))
    caption = (
        f"Error less that of {named[0][0]} at the same time of flight, a mean over {SMOOTHED_S:g} s: above 0 is worse."
    )
    return [Panel("errors-apart", "Differences of the errors", caption, caption, stack.chart(window), wide=True)]


def _together(named: Named) -> Paths | None:
    """The paths of all records as one set, the first record's last, so that it stands for the vehicle."""
    found = [(k, name, paths) for k, (name, record) in enumerate(named) if (paths := paths_of(record)) is not None]
    if not found:
        return None
    tracks: list[tuple[str, str, Track]] = [(role_of(k), name, paths.main()[2]) for k, name, paths in found]
    first = found[0][2]
    return Paths((*tracks[1:], tracks[0]), None, first.pad, first.touch, ())
