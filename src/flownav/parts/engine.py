"""A campaign's engine for flights with parts of somebody else's: one after the other, or equations on lanes."""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from flownav.campaigns.engines import Engine, Local, Part
from flownav.campaigns.local import fly_recorded, rows_of
from flownav.campaigns.plan import Ready
from flownav.campaigns.run import Recording
from flownav.core.compile import LANES, announce_compilation
from flownav.core.measurement import Array
from flownav.core.record import Record
from flownav.parts.calling import name_of
from flownav.parts.equations import EquationFilter
from flownav.parts.flying import fly_parts, fly_with, require_started
from flownav.parts.protocols import Parts
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
            check = partial(require_started, name=name_of(own.filter))
            yield from Local(instead=address, check=check).fly(cell, seed, parts, on_progress)
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
    """What a campaign's folder says of its parts: kind, name and SHA-256 of what they are made of.

    That is the class, the source of its file, and the object's own numbers. A campaign resumes with these alone.
    """
    kinds = [("filter", parts.filter), *(("sensor", one) for one in parts.sensors), ("vehicle", parts.vehicle),
             ("controller", parts.controller)]  # fmt: skip
    return tuple(f"{kind} {name_of(part)} {_digest(part)}" for kind, part in kinds if part is not None)


def _digest(part: Any) -> str:
    """Of everything that a part is made of, as far as Python shows it."""
    digest = hashlib.sha256()
    made_of = [part if isinstance(part, type) or inspect.isfunction(part) else type(part)]
    if not isinstance(part, type) and not inspect.isfunction(part):
        own = vars(part) if hasattr(part, "__dict__") else {}
        told = {name: value for name, value in own.items() if not name.startswith("_") and name != "unit_source"}
        made_of += [value for value in told.values() if inspect.isfunction(value)]
        numbers = {name: value for name, value in told.items() if not inspect.isfunction(value)}
        digest.update(json.dumps(numbers, sort_keys=True, default=_plain).encode())
    for each in made_of:
        digest.update(f"{each.__module__} {each.__qualname__} {_source(each)}".encode())
    return digest.hexdigest()


def _plain(value: Any) -> Any:
    """A value that JSON has no word for."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else repr(value)


def _source(made_of: Any) -> str:
    """The source of the file that a class or a function stands in; of itself where it stands in none (a notebook)."""
    for each in (inspect.getmodule(made_of), made_of):
        try:
            return inspect.getsource(each) if each is not None else ""
        except (OSError, TypeError):
            continue
    return repr(made_of)
