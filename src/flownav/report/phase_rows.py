"""The report's table of phases: when each was, its errors, and what was not fused in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flownav.core.record import Record
from flownav.report.figure_words import NONE, number
from flownav.scoring.by_phase import scores_by_phase
from flownav.scoring.phases import Phase, phase_at


@dataclass(frozen=True)
class PhaseRow:
    """A phase as the page's table has it; start_s: the instant that the row moves the page to."""

    name: str
    start_s: float
    cells: tuple[str, ...]  # from, to, length, horizontal, vertical, velocity, not fused


def phase_rows(record: Record, phases: Sequence[Phase]) -> list[PhaseRow]:
    """A row for each phase, in order of time."""
    rows = []
    for one in scores_by_phase(record, phases):
        name, t0, t1 = one.phase
        errors = (number(one.horizontal_rms_m, 3), number(one.vertical_rms_m, 3), number(one.velocity_rms_m_s, 3))
        share = f"{one.rejected:,} of {one.offered:,}" if one.offered else NONE
        rows.append(PhaseRow(name, t0, (f"{t0:.1f}", f"{t1:.1f}", f"{t1 - t0:.1f}", *errors, share)))
    return rows


def phases_within(phases: Sequence[Phase], t0: float, t1: float) -> str:
    """The phases that a window of time touches, in words; "" without any."""
    names = [phase.name for phase in phases if phase.t0 < t1 and phase.t1 > t0]
    return ", ".join(dict.fromkeys(names)) or phase_at(list(phases), t0)
