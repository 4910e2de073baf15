"""A campaign's question of rare events: how probable one is, and the flight in which it most likely happens."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flownav.api.record import Record
from flownav.campaigns.measures import MEASURES, Event, event_of
from flownav.campaigns.plan import Plan, lands
from flownav.campaigns.rare.branches import read_branch, replayed, write_branch
from flownav.campaigns.rare.estimate import Rare, estimate_rare
from flownav.core.errors import InputError
from flownav.core.files import written_whole

FLIGHT, FOUND = "rare_flight.json", "rare.json"


@dataclass(frozen=True)
class RareEvent:
    """What was found, as rare.json has it, how many flights a second, and where the most likely flight lies."""

    facts: dict[str, Any]
    rate_per_s: float
    where: dict[str, str]


def rare_event_of(plan: Plan, text: str) -> Event:
    """The event in these words. InputError where it is none, or this plan cannot be asked for it."""
    require_one(plan, "--rare")
    if plan.sampling != "plain" or plan.until is not None:
        raise InputError("--rare: has samples and a stop of its own; leave out --sampling and --until")
    chosen = event_of(text)
    if MEASURES[chosen.measure].of_landing and not lands(plan.cells[0].scenario):
        raise InputError(f"--rare {chosen}: the scenario {plan.cells[0].scenario.name} never lands")
    return chosen


def estimate_event(plan: Plan, event: Event, folder: Path, progress: Callable[[int], object]) -> RareEvent:
    """How probable an event is, by subset simulation; written into the folder with its most likely flight.

    progress: called with how many more flights are down.
    """
    folder.mkdir(parents=True, exist_ok=True)
    cell = plan.cells[0]
    began_s = time.monotonic()
    found = estimate_rare(
        cell.setup, event, seed=plan.seed, flights=plan.flights, dispersed=cell.truth_model == "ensemble",
        on_progress=progress,
    )  # fmt: skip
    rate = found.flights / (time.monotonic() - began_s)
    facts = found.as_json() | {"cell": cell.label, "seed": plan.seed, "known": found.known}
    with written_whole(folder / FOUND) as whole:
        whole.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    return RareEvent(facts, rate, _keep(plan, found, folder))


def fly_branch(plan: Plan, path: Path) -> tuple[Record, dict[str, str]]:
    """The flight of such a file, flown again; its record and its report lie beside it. InputError where it is none."""
    require_one(plan, "--flight")
    setup = plan.cells[0].setup
    record = Record.of(replayed(setup, read_branch(path, setup)))
    return record, _written(record, path.with_suffix(".fnr"))


def require_one(plan: Plan, option: str) -> None:
    """InputError where there is more than one cell."""
    if len(plan.cells) != 1:
        raise InputError(f"{option}: needs one scenario, one --truth-model and no --sweep, not {len(plan.cells)} cells")


def _keep(plan: Plan, found: Rare, folder: Path) -> dict[str, str]:
    """The most likely flight as a file, as a record and as a report; where they lie."""
    if found.branch is None:
        return {}
    setup, flight = plan.cells[0].setup, folder / FLIGHT
    write_branch(flight, setup, found.branch, found.event, found.branch_response)
    record = Record.of(replayed(setup, found.branch))
    return {"flight": str(flight), **_written(record, flight.with_suffix(".fnr"))}


def _written(record: Record, path: Path) -> dict[str, str]:
    record.save(path)
    return {"record": str(path), "report": str(record.report(path.with_suffix(".html")))}
