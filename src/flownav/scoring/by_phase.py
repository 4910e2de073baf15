"""What each phase of a flight was like: errors, and readings that were not fused."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, VELOCITY_BODY, Record
from flownav.scoring.phases import Phase, phase_at


class PhaseScores(NamedTuple):
    """A phase's errors, NaN where they are not known, and of the values offered to the filter how many were not fused.

    horizontal_rms_m, vertical_rms_m: of what was flown on, or else of the estimate, against the truth, or else GPS.
    velocity_rms_m_s: of the length of the velocity's error.
    """

    phase: Phase
    horizontal_rms_m: float
    vertical_rms_m: float
    velocity_rms_m_s: float
    offered: int
    rejected: int


def scores_by_phase(record: Record, phases: Sequence[Phase]) -> list[PhaseScores]:
    """A row for each phase. An instant on the border of two belongs to the later one."""
    place, speed = errors_of(record, POSITION_NED), errors_of(record, VELOCITY_BODY)
    table = record.tables.get("innovation", {})
    t_s = np.asarray(table.get("t_s", ()), float)
    fused = np.asarray(table.get("fused", np.ones(len(t_s))), float) > 0.5
    rows = []
    for k, phase in enumerate(phases):
        last = k + 1 == len(phases)
        horizontal, vertical, velocity = (
            _rms(place, phase, slice(0, 2), last),
            _rms(place, phase, slice(2, 3), last),
            _rms(speed, phase, slice(0, 3), last),
        )
        here = _inside(t_s, phase, last)
        rows.append(PhaseScores(phase, horizontal, vertical, velocity, int(here.sum()), int((here & ~fused).sum())))
    return rows


def rejected_mostly_in(record: Record, phases: Sequence[Phase]) -> dict[tuple[str, str], str]:
    """By sensor and reason, the name of the phase in which most of its values were not fused."""
    table = record.tables.get("innovation", {})
    if not phases or not all(name in table for name in ("t_s", "sensor", "fused", "reason")):
        return {}
    rows = np.flatnonzero(np.asarray(table["fused"], float) < 0.5)
    counted: dict[tuple[str, str], Counter[str]] = {}
    for row in rows:
        key = (str(table["sensor"][row]), str(table["reason"][row]))
        counted.setdefault(key, Counter())[phase_at(list(phases), float(table["t_s"][row]))] += 1
    return {key: names.most_common(1)[0][0] for key, names in counted.items()}


def errors_of(record: Record, columns: tuple[str, ...]) -> tuple[Array, Array] | None:
    """Instants (n,) and errors (n, 3) against the truth, of what was flown on or else of the estimate; without a truth
    those of the position against GPS.
    """
    truth = record.tables.get("truth", {})
    for name in ("flown", "estimate"):
        table = record.tables.get(name, {})
        if len(table.get("t_s", ())) and len(truth.get("t_s", ())) and all(c in table and c in truth for c in columns):
            t_s, known = np.asarray(table["t_s"], float), np.asarray(truth["t_s"], float)
            there = np.column_stack(
                [np.interp(t_s, known, np.asarray(truth[c], float), np.nan, np.nan) for c in columns]
            )
            return t_s, record.matrix(name, columns) - there
    return _against_gps(record, columns) if columns == POSITION_NED else None


def _against_gps(record: Record, columns: tuple[str, ...]) -> tuple[Array, Array] | None:
    """Errors against GPS, at the instants that it describes: its arrival less its delay."""
    gps, estimate = record.tables.get("gps_position", {}), record.tables.get("estimate", {})
    if not all(len(table.get("t_s", ())) and all(c in table for c in columns) for table in (gps, estimate)):
        return None
    delays: Any = record.manifest.get("delays_s")
    delay_s = delays.get("gps_position") if isinstance(delays, Mapping) else None
    t_s = np.asarray(gps["t_s"], float) - (float(delay_s) if isinstance(delay_s, (int, float)) else 0.0)
    known = np.asarray(estimate["t_s"], float)
    ours = np.column_stack([np.interp(t_s, known, estimate[c], np.nan, np.nan) for c in columns])
    error = ours - record.matrix("gps_position", columns)
    error[np.asarray(gps.get("quality", np.full(len(t_s), 255.0)), float) <= 0.0] = np.nan
    return t_s, error


def _rms(errors: tuple[Array, Array] | None, phase: Phase, columns: slice, last: bool) -> float:
    if errors is None:
        return float("nan")
    t_s, error = errors
    squares = (error[_inside(t_s, phase, last), columns] ** 2).sum(axis=1)
    squares = squares[np.isfinite(squares)]
    return float(np.sqrt(squares.mean())) if len(squares) else float("nan")


def _inside(t_s: Array, phase: Phase, last: bool) -> NDArray[np.bool_]:
    return (t_s >= phase.t0) & ((t_s <= phase.t1) if last else (t_s < phase.t1))
