"""A log's estimators side by side: one row each, in JSON, in words, in Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from flownav.logs.log import Log
from flownav.replays.judged import airborne_of
from flownav.replays.session import outage_summary
from flownav.scoring.outage import OutageError
from flownav.scoring.path import References, end_drift_of, outage_entry
from flownav.studies.compare.like_for_like import Reference, Window, errors_of, reference_of, shared_by
from flownav.studies.compare.tracks import Track

FLOWNAV, DEAD_RECKONING, AUTOPILOT = "flownav", "dead reckoning", "autopilot"
WINDOW_S = 60.0
SETTLED_S = 60.0  # after the log's start and before its end nothing is cut

HEADINGS = (
    "log", "estimator", "against", "horizontal [m]", "in flight [m]", "velocity [m/s]", "in flight [m/s]",
    "end drift [m]", "GPS cut: median [m]", "worst [m]",
)  # fmt: skip

Row = dict[str, Any]


class Entrant(NamedTuple):
    """Who estimates, by which settings (an autopilot: by which of its estimators), its path, its GPS cuts."""

    estimator: str
    settings: str | None
    track: Track
    outages: tuple[OutageError, ...] = ()


def rows_of(name: str, log: Log, entrants: Sequence[Entrant], gps_delay_s: float) -> list[Row]:
    """One row for each entrant, errors at the instants that all of them have; the first entrant is always scored."""
    reference, airborne = reference_of(log, gps_delay_s), airborne_of(log)
    figures = _figures(entrants, reference, airborne)
    known = References(truth=log.truth, heading=log.heading_truth, flight_s=airborne)
    return [
        {
            "log": name,
            "settings": entrant.settings,
            "estimator": entrant.estimator,
            **found,
            "end_drift_m": end_drift_of(entrant.track.motion, known),
            "outages": _outages(entrant.outages),
        }
        for entrant, found in zip(entrants, figures, strict=True)
    ]


def _figures(entrants: Sequence[Entrant], reference: Reference | None, airborne: Window | None) -> list[Row]:
    """What is the same for all kinds of estimator."""
    nothing = {"horizontal_rms_m": None, "velocity_rms_m_s": None, "samples": 0}
    if reference is None:
        return [{"against": None, **nothing, "airborne": None} for _ in entrants]
    tracks = [entrant.track for entrant in entrants]
    places, kept = shared_by(tracks, reference.position_t_s)
    speeds, _ = shared_by([track for track, stays in zip(tracks, kept, strict=True) if stays], reference.velocity_t_s)
    rows = []
    for track, stays in zip(tracks, kept, strict=True):
        whole = errors_of(track, reference, places, speeds) if stays else nothing
        apart = errors_of(track, reference, places, speeds, airborne) if stays and airborne is not None else None
        rows.append({"against": reference.against, **whole, "airborne": apart})
    return rows


def _outages(errors: Sequence[OutageError]) -> Row:
    summary = outage_summary(list(errors))
    return {
        "median_m": summary["outage_median_rms_m"],
        "worst_m": summary["outage_worst_rms_m"],
        "windows": [outage_entry(error) for error in errors],
    }


def default_windows(span_s: Window) -> list[Window]:
    """Whole windows of WINDOW_S, from SETTLED_S after the log's start (to the second) to SETTLED_S before its end."""
    first, last = round(span_s[0]) + SETTLED_S, span_s[1] - SETTLED_S
    count = max(int((last - first) // WINDOW_S), 0)
    return [(first + k * WINDOW_S, first + (k + 1) * WINDOW_S) for k in range(count)]


def names_of(paths: Sequence[Path]) -> list[str]:
    """The last part of each path, and as much before it as tells it from the others."""
    parts = [path.resolve().parts for path in paths]
    deepest = max((len(part) for part in parts), default=1)
    names = ["/".join(part[-1:]) for part in parts]
    for depth in range(2, deepest + 1):
        twice = {name for name in names if names.count(name) > 1}
        names = ["/".join(p[-depth:]) if n in twice else n for n, p in zip(names, parts, strict=True)]
    return names


# -- words -------------------------------------------------------------------------------------------------
def cells(row: Row) -> tuple[str, ...]:
    """A row under HEADINGS; a dash where there is nothing to say."""
    airborne = row["airborne"] or {}
    estimator = row["estimator"] if row["settings"] is None else f"{row['estimator']} ({row['settings']})"
    return (
        row["log"], estimator, row["against"] or "-",
        _figure(row["horizontal_rms_m"]), _figure(airborne.get("horizontal_rms_m")),
        _figure(row["velocity_rms_m_s"]), _figure(airborne.get("velocity_rms_m_s")),
        _figure(row["end_drift_m"]), _figure(row["outages"]["median_m"]), _figure(row["outages"]["worst_m"]),
    )  # fmt: skip


def markdown(rows: Sequence[Row]) -> str:
    """The table as Markdown."""
    lines = [HEADINGS, ("---", "---", "---", *["---:"] * (len(HEADINGS) - 3)), *map(cells, rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
