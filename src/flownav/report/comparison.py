"""A comparison of estimators as one HTML page that needs nothing but a browser: the table, and every GPS cut."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flownav.core import guard
from flownav.core.version import __version__
from flownav.report.figure_words import number
from flownav.report.html import HERE
from flownav.report.style import FONT, PALETTE

POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"  # no script at all
Lines = Sequence[tuple[str, ...]]


def write_comparison(headings: tuple[str, ...], lines: Lines, rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Write the page, whole or not at all. OSError where the file cannot be written.

    headings and lines: the table as text. rows: what `flownav compare --json` prints, for the GPS cuts.
    """
    page = render(headings, lines, rows)
    guard.write_page(page, path)


def render(headings: tuple[str, ...], lines: Lines, rows: Sequence[dict[str, Any]]) -> str:
    """The page as text."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=FileSystemLoader(HERE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("comparison.html.j2").render(
        headings=headings,
        lines=lines,
        cuts=cuts_of(rows, [line[1] for line in lines]),
        version=__version__,
        palette=PALETTE,
        font=Markup(FONT),
        style=Markup((HERE / "page.css").read_text(encoding="utf-8")),
        policy=POLICY,
    )


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
