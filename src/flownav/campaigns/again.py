"""A flight of a campaign flown again, to the bit, as a record with its report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Protocol

from flownav.campaigns.local import fly_recorded
from flownav.campaigns.plan import Plan
from flownav.core.record import Record
from flownav.simulation.assemble import Setup
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.truth import SensorFault


class Recording(Protocol):
    """Flies one flight as a scored record."""

    def __call__(
        self, setup: Setup, seed: int, index: int, ensemble: Ensemble | None, fault: SensorFault | None, /
    ) -> Record:
        """As `campaigns.local.fly_recorded`."""


def record_again(plan: Plan, cell: int, flight: int, recording: Recording = fly_recorded) -> Record:
    """The record of a flight; it says what was drawn, and is the same bytes whenever it is made.

    recording: what flies it, with parts that are not ours.
    """
    ready = plan.ready(cell)
    failing = ready.faults(plan.seed)
    record = recording(
        replace(ready.setup, flight=ready.flight), plan.seed, flight, ready.ensemble, failing and failing(flight)
    )
    record.manifest["command"] = f"flownav campaign ... --flight {place_of(cell, flight)}"
    record.manifest["campaign"] = {"cell": plan.cells[cell].label, "flight": flight, "sampling": plan.sampling}
    record.manifest["provenance"].pop("written_utc")
    return record


def place_of(cell: int, flight: int) -> str:
    """How a flight is named on the command line."""
    return f"{cell}:{flight}"


def record_path(folder: Path, cell: int, flight: int) -> Path:
    """Where the record of a flight is written."""
    return folder / f"cell-{cell:03d}-flight-{flight:06d}.fnr"
