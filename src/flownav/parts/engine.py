"""A campaign's engine for flights with parts of somebody else's: one after the other, or equations on lanes."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from flownav.campaigns.again import Recording
from flownav.campaigns.engines.engine import Engine, Part
from flownav.campaigns.engines.local import Local
from flownav.campaigns.local import fly_recorded
from flownav.campaigns.plan import Ready
from flownav.campaigns.rows import rows_of
from flownav.compile import LANES, announce_compilation
from flownav.measurement import Array
from flownav.parts.calling import name_of
from flownav.parts.equations import EquationFilter
from flownav.parts.flying import fly_parts, fly_with
from flownav.parts.protocols import Parts
from flownav.record import Record
from flownav.simulation.assemble import Setup
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.fault import SensorFault


class OwnPartsEngine:
    """parts: flown in every flight, each beginning anew; a filter of equations alone, on lanes as ours."""

    def __init__(self, parts: Parts) -> None:
        self.parts = parts

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object] = lambda flown: None
    ) -> Iterator[tuple[Part, Array]]:
        """The rows of each part. InputError where a part of a flight makes a mistake."""
        own = self.parts
        if isinstance(own.filter, EquationFilter) and not (own.sensors or own.vehicle or own.controller):
            with announce_compilation("batch"):
                address = own.filter.unit(LANES).address
            yield from Local(instead=address).fly(cell, seed, parts, on_progress)
            return
        faults = cell.faults(seed)
        for part in parts:
            rows = []
            for number in range(part.first, part.first + part.flights):
                fault = faults(number) if faults else None
                flown = fly_parts(cell.setup, self.parts, seed, number, cell.ensemble, fault, written=False)
                rows.append(rows_of(cell.flight, flown.history))
                on_progress(1)
            yield part, np.concatenate(rows)

    def recording(
        self, setup: Setup, seed: int, index: int, ensemble: Ensemble | None, fault: SensorFault | None, /
    ) -> Record:
        """One of the flights as a scored record."""
        return fly_with(setup, self.parts, seed, index, ensemble, fault)


def recording_of(engine: Engine | None) -> Recording:
    """How the flights of an engine are flown again, one by one."""
    return engine.recording if isinstance(engine, OwnPartsEngine) else fly_recorded


def identities(parts: Parts) -> tuple[str, ...]:
    """What a campaign's folder says of its parts: kind, name and SHA-256 of the source. It resumes with these alone."""
    kinds = [("filter", parts.filter), *(("sensor", one) for one in parts.sensors), ("vehicle", parts.vehicle),
             ("controller", parts.controller)]  # fmt: skip
    return tuple(f"{kind} {name_of(part)} {_digest(part)}" for kind, part in kinds if part is not None)


def _digest(part: Any) -> str:
    """Of the file that a part's class stands in; of its class alone where it stands in none (a notebook's cell)."""
    kind = part if isinstance(part, type) or inspect.isfunction(part) else type(part)
    try:
        source = inspect.getsource(inspect.getmodule(kind) or kind)
    except (OSError, TypeError):
        source = _class_source(kind)
    return hashlib.sha256(source.encode()).hexdigest()


def _class_source(kind: Any) -> str:
    try:
        return inspect.getsource(kind)
    except (OSError, TypeError):
        return repr(kind)
