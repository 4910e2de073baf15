"""A flight of a campaign flown again, to the bit, as a record with its report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from flownav.campaigns.local import fly_recorded
from flownav.campaigns.plan import Plan
from flownav.record import Record


def record_again(plan: Plan, cell: int, flight: int) -> Record:
    """The record of a flight; it says what was drawn, and is the same bytes whenever it is made."""
    ready = plan.ready(cell)
    failing = ready.faults(plan.seed)
    record = fly_recorded(
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
