"""Records beside each other: the errors of each, and how much each differs from the first one, with an interval."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, VELOCITY_BODY, Record, mapping
from flownav.core.text import finite_or_none
from flownav.scoring.landings import CONFIDENCE
from flownav.scoring.percentiles import mean_difference
from flownav.scoring.phases import phases_of
from flownav.scoring.recorded import errors_of

Row = dict[str, Any]
MEASURES = ("horizontal_m", "vertical_m", "velocity_m_s")


def rows_of_records(named: Sequence[tuple[str, Record]]) -> list[Row]:
    """A row for each record in the order given; the differences are those from the first.

    Errors are lengths of the error of the estimate used by the autopilot, or else of the navigator's, against the
    record's truth, or else (position alone) against GPS, in flight alone. rms: over the flight; difference: the mean of
    a record's error less the first one's at the same time of flight, over the stretch that both have.
    """
    series = [in_flight(record, errors_in_time(record)) for _, record in named]
    return [
        {
            "record": name,
            "scenario": record.manifest.get("scenario") or record.manifest.get("log"),
            "filter": record.manifest.get("filter"),
            "against": against(record),
            **{f"{measure.replace('_m', '_rms_m', 1)}": _rms(found.get(measure)) for measure in MEASURES},
            **touchdown_of(record),
            "difference": None if k == 0 else {m: _difference(series[0], found, m) for m in MEASURES},
        }
        for k, ((name, record), found) in enumerate(zip(named, series, strict=True))
    ]


def against(record: Record) -> str | None:
    """The reference of a record's errors: "truth", the name of another reference, "gps", or None."""
    if len(record.tables.get("truth", {}).get("t_s", ())):
        stated = str(record.manifest.get("truth_name") or "truth")
        return "truth" if stated in ("truth.csv", "the simulator") else stated
    return None if errors_of(record, POSITION_NED) is None else "gps"


def errors_in_time(record: Record) -> dict[str, tuple[Array, Array]]:
    """By measure the instants (n,) and the lengths of the error (n,); a measure that is not known is left out."""
    found = {}
    place, speed = errors_of(record, POSITION_NED), errors_of(record, VELOCITY_BODY)
    if place is not None:
        found["horizontal_m"] = (place[0], np.hypot(place[1][:, 0], place[1][:, 1]))
        found["vertical_m"] = (place[0], np.abs(place[1][:, 2]))
    if speed is not None:
        found["velocity_m_s"] = (speed[0], np.linalg.norm(speed[1], axis=1))
    return found


def in_flight(record: Record, errors: dict[str, tuple[Array, Array]]) -> dict[str, tuple[Array, Array]]:
    """The errors from the first phase in the air to the last; all of them where no phase is in the air."""
    aloft = [phase for phase in phases_of(record) if phase.name not in ("ground", "touchdown", "landed")]
    if not aloft:
        return errors
    t0, t1 = aloft[0].t0, aloft[-1].t1
    kept = {name: (t_s >= t0) & (t_s <= t1) for name, (t_s, _) in errors.items()}
    return {name: (t_s[kept[name]], error[kept[name]]) for name, (t_s, error) in errors.items() if kept[name].any()}


def touchdown_of(record: Record) -> Row:
    """Where the touchdown was [m from the pad's centre] and what it was limited by; None where it was not scored."""
    landing = mapping(mapping(record.manifest.get("scores")).get("touchdown"))
    parts, contact = (mapping(landing.get(name)) for name in ("limited_by", "contact"))
    limits = {name: parts.get(name) for name in ("estimate_m", "guidance_m", "pad_m")}
    return {"touchdown_m": contact.get("distance_m"), "touchdown_limited_by": limits if parts else None}


def _rms(found: tuple[Array, Array] | None) -> float | None:
    if found is None or not np.isfinite(found[1]).any():
        return None
    return float(np.sqrt(np.nanmean(found[1] ** 2)))


def _difference(first: dict[str, Any], other: dict[str, Any], measure: str) -> Row | None:
    if measure not in first or measure not in other:
        return None
    t_s, error = first[measure]
    there_s, there = other[measure]
    known = np.isfinite(there)
    if known.sum() < 2:
        return None
    same = np.interp(t_s, there_s[known], there[known], np.nan, np.nan)
    found = mean_difference(t_s, error, same)
    if found is None:
        return None
    low, high = finite_or_none(found.low), finite_or_none(found.high)
    return {"mean": found.mean, "low": low, "high": high, "confidence": CONFIDENCE}


# -- words -------------------------------------------------------------------------------------------------
HEADINGS = (
    "record", "against", "horizontal [m]", "vertical [m]", "velocity [m/s]", "touchdown [m]",
    "horizontal, less the first [m]", "vertical, less the first [m]", "velocity, less the first [m/s]",
)  # fmt: skip


def cells(row: Row) -> tuple[str, ...]:
    """A row under HEADINGS; a dash where there is nothing to say."""
    figures = [row[name] for name in ("horizontal_rms_m", "vertical_rms_m", "velocity_rms_m_s", "touchdown_m")]
    apart = row["difference"] or {}
    return (
        row["record"], row["against"] or "-", *(figure(value) for value in figures),
        *(difference_words(apart.get(measure)) for measure in MEASURES),
    )  # fmt: skip


def difference_words(found: Row | None) -> str:
    """A mean difference with its interval, "+0.012 (0.004 to 0.020)"; a dash without one."""
    if found is None:
        return "-"
    if found["low"] is None:
        return f"{found['mean']:+.3f}"
    return f"{found['mean']:+.3f} ({found['low']:+.3f} to {found['high']:+.3f})"


def figure(value: float | None) -> str:
    """A figure to the millimetre; a dash where there is none."""
    return "-" if value is None else f"{value:.3f}"
