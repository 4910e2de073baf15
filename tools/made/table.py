"""Flights that were judged, as a table: a row a class, and what the issue asks of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from made.flight import Array
from made.judging import Verdict

MOST_DRIFT_M = 3.0  # a flight further off, at any time, has diverged
MEDIAN_RATIO, P95_RATIO, HEADING_MORE_DEG = 1.1, 1.5, 1.0  # asked: at most these of dead reckoning
NIS_BAND, SQUARES_BAND = (0.5, 2.0), (0.7, 1.3)


class Three(NamedTuple):
    """Median, 95th percentile, worst."""

    median: float
    p95: float
    worst: float


class Row(NamedTuple):
    """The result of some flights. drift_m: at the end; heading_deg likewise; ours, and those of dead reckoning (line).

    closer: share of flights in which flownav is at least as close. percent: median of the drift over the path, ours and
    line. nis: means over flights, flow and range. level_m: median. unwarned: share of the flight beyond the level
    without a warning; beyond: flights in which that ever happens. warned: share of the flight with a warning. over
    (3,): root mean squares of the error over the stated one, over flights: position, velocity, heading. diverged:
    flights beyond MOST_DRIFT_M or refused.
    """

    name: str
    flights: int
    path_m: float
    ours_m: Three
    line_m: Three
    closer: float
    percent: tuple[float, float]
    ours_deg: Three
    line_deg: Three
    nis: tuple[float, float]
    level_m: float
    unwarned: float
    beyond: int
    warned: float
    over: tuple[float, float, float]
    diverged: int


def three(values: Sequence[float]) -> Three:
    """Median, 95th percentile and worst; of endless ones too."""
    ordered = np.sort(np.asarray(values, float))
    at = 0.95 * (len(ordered) - 1)
    low, high = ordered[int(at)], ordered[min(int(at) + 1, len(ordered) - 1)]
    middle = 0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2])
    p95 = low if low == high else low + (high - low) * (at - int(at))
    return Three(float(middle), float(p95), float(ordered[-1]))


def row_of(name: str, flights: Sequence[Verdict]) -> Row:
    """One row of some flights."""
    ours, line = [v.ours.end_m for v in flights], [v.line.end_m for v in flights]
    squares = np.array([v.squares for v in flights])
    return Row(
        name=name,
        flights=len(flights),
        path_m=float(np.median([v.path_m for v in flights])),
        ours_m=three(ours),
        line_m=three(line),
        closer=float(np.mean([mine <= theirs for mine, theirs in zip(ours, line, strict=True)])),
        percent=(_percent(ours, flights), _percent(line, flights)),
        ours_deg=three([v.ours.heading_deg for v in flights]),
        line_deg=three([v.line.heading_deg for v in flights]),
        nis=(_mean(np.array([v.nis_flow for v in flights])), _mean(np.array([v.nis_range for v in flights]))),
        level_m=three([v.level_m for v in flights if np.isfinite(v.level_m)] or [np.nan]).median,
        unwarned=float(np.mean([v.unwarned for v in flights])),
        beyond=sum(v.unwarned > 0.0 for v in flights),
        warned=float(np.mean([v.warned for v in flights])),
        over=(*(float(np.sqrt(_mean(column))) for column in squares.T),),  # type: ignore[arg-type]
        diverged=sum(not v.ours.worst_m <= MOST_DRIFT_M for v in flights),
    )


def rows_of(flights: Sequence[Verdict]) -> list[Row]:
    """A row a class in the order met, one of each generator, and one of all."""
    names = list(dict.fromkeys(v.name for v in flights))
    rows = [row_of(name, [v for v in flights if v.name == name]) for name in names]
    for letter in "ab":
        some = [v for v in flights if v.name.startswith(f"{letter}-")]
        if some:
            rows.append(row_of(f"generator {letter.upper()}", some))
    return [*rows, row_of("all", list(flights))]


def _percent(drifts: Sequence[float], flights: Sequence[Verdict]) -> float:
    return three([100.0 * drift / v.path_m for drift, v in zip(drifts, flights, strict=True)]).median


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan


# -- what is asked -------------------------------------------------------------------------------------------------
def failings(row: Row) -> list[str]:
    """The targets that a row misses, in words: of drift, heading, divergence, NIS."""
    found = []
    if not row.ours_m.median <= MEDIAN_RATIO * row.line_m.median:
        found.append("median")
    if not row.ours_m.p95 <= P95_RATIO * row.line_m.p95:
        found.append("p95")
    if not row.ours_deg.median <= row.line_deg.median + HEADING_MORE_DEG:
        found.append("heading")
    if not row.ours_deg.p95 <= row.line_deg.p95 + HEADING_MORE_DEG:
        found.append("heading p95")
    if row.diverged:
        found.append("diverges")
    if row.beyond:
        found.append("unwarned")
    for name, value in zip(("NIS flow", "NIS range"), row.nis, strict=True):
        if not NIS_BAND[0] <= value <= NIS_BAND[1]:
            found.append(name)
    return found


# -- as Markdown -----------------------------------------------------------------------------------------------------
DRIFT = (
    "class", "flights", "path [m]", "flownav: end drift, median [m]", "95 %", "worst",
    "dead reckoning: median [m]", "95 %", "worst", "ratio of medians", "of 95 %", "at least as close [%]",
    "flownav [% of path]", "dead reckoning", "beyond 3 m",
)  # fmt: skip
TRUST = (
    "class", "heading, flownav: median [deg]", "95 %", "raw gyro: median", "95 %", "NIS flow", "NIS range",
    "level, median [m]", "beyond it without a warning [% of flight]", "flights", "warned [% of flight]",
    "error over stated: position", "velocity", "heading", "falls short in",
)  # fmt: skip


def markdown(rows: Sequence[Row]) -> str:
    """Two tables: drift next to dead reckoning, and stated errors next to true ones."""
    return _table(DRIFT, [_drift(row) for row in rows]) + "\n" + _table(TRUST, [_trust(row) for row in rows])


def _table(headings: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    ruled = [headings, ("---", *["---:"] * (len(headings) - 1)), *lines]
    return "".join(f"| {' | '.join(line)} |\n" for line in ruled)


def _drift(row: Row) -> tuple[str, ...]:
    ratios = (row.ours_m.median / row.line_m.median, row.ours_m.p95 / row.line_m.p95)
    figures = (*row.ours_m, *row.line_m, *ratios)
    return (
        row.name, str(row.flights), f"{row.path_m:.0f}", *(f"{value:.2f}" for value in figures),
        f"{100.0 * row.closer:.0f}", *(f"{value:.1f}" for value in row.percent), str(row.diverged),
    )  # fmt: skip


def _trust(row: Row) -> tuple[str, ...]:
    headings = (row.ours_deg.median, row.ours_deg.p95, row.line_deg.median, row.line_deg.p95)
    return (
        row.name, *(f"{value:.1f}" for value in headings), *(f"{value:.2f}" for value in row.nis),
        f"{row.level_m:.1f}", f"{100.0 * row.unwarned:.1f}", str(row.beyond), f"{100.0 * row.warned:.0f}",
        *(f"{value:.2f}" for value in row.over),
        ", ".join(failings(row)) or "-",
    )  # fmt: skip
