"""The plan of a campaign: cells, each a scenario with its values of the swept parameters, and how their flights are
drawn.

A design gives the uniforms of an input, a number in (0, 1) for each flight, as a function of (seed, flight, name) and
of how many flights the campaign has. Hypercubes and sequences are of `LOT_FLIGHTS` flights each, one after the other,
independent of each other: a flight's inputs can be had without those of a million others.
"""

import hashlib
import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Literal, Protocol

import numpy as np

from flownav.campaigns.measures import FIGURES, MEASURES, stop_of
from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array
from flownav.core.parameter_files import check
from flownav.core.provenance import code_sha256
from flownav.core.version import __version__
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.dispersion import Design, uniforms
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.plan import Flight
from flownav.simulation.scenario import Scenario
from flownav.simulation.truth import SensorFault

LOT_FLIGHTS = 1024  # flights of one hypercube, or of one scrambled sequence
EDGE_MARGIN = 2.0**-53  # of (0, 1): a point may lie on the edge, where a distribution may be infinite
SAMPLINGS = ("plain", "latin", "sobol")
Sampling = Literal["plain", "latin", "sobol"]


class Spread:
    """A design of scipy.stats.qmc over the named inputs, for flights 0 to `flights - 1`; later ones are plain."""

    def __init__(self, kind: Literal["latin", "sobol"], names: Sequence[str], flights: int) -> None:
        self.kind, self.flights = kind, flights
        self.column = {name: column for column, name in enumerate(sorted(names))}
        self._points = lru_cache(maxsize=8)(self._drawn)

    def uniforms(self, seed: int, flights: Sequence[int], name: str) -> Array:
        """The numbers of these flights."""
        found = uniforms(seed, flights, name)
        index, column = np.asarray(flights), self.column[name]
        for lot in np.unique(index[index < self.flights] // LOT_FLIGHTS):
            own = (index // LOT_FLIGHTS == lot) & (index < self.flights)
            found[own] = self._points(seed, int(lot))[index[own] - lot * LOT_FLIGHTS, column]
        return found

    def _drawn(self, seed: int, lot: int) -> Array:
        """The points of one lot, (flights in it, inputs)."""
        from scipy.stats import qmc

        count = min(LOT_FLIGHTS, self.flights - lot * LOT_FLIGHTS)
        rng = np.random.default_rng([seed, lot])
        engine: Any
        if self.kind == "latin":
            engine = qmc.LatinHypercube(len(self.column), rng=rng)
            points = engine.random(count)
        else:
            engine = qmc.Sobol(len(self.column), scramble=True, rng=rng)
            points = engine.random_base2(LOT_FLIGHTS.bit_length() - 1)[:count]
        return np.asarray(np.clip(points, EDGE_MARGIN, 1.0 - EDGE_MARGIN))


def design_of(sampling: Sampling, names: Sequence[str], flights: int) -> Design | None:
    """The design of a sampling; None: by the noise counter, each flight independent of all others."""
    return None if sampling == "plain" or not names else Spread(sampling, names, flights)


# -- cells -------------------------------------------------------------------------------------------------------
SCHEMA_VERSION = 1
MOST_CELLS = 10_000
MOST_FLIGHTS = 100_000_000

TruthModel = Literal["matched", "ensemble"]
Value = float | bool | str
Sweep = Mapping[str, Sequence[Value]]


class Failure(Protocol):
    """The failure in every flight of a cell."""

    @property
    def words(self) -> str:
        """The failure, from when to when, in words."""

    def law(self, flight: Flight, seed: int, number: int) -> SensorFault:
        """One flight's fault, by its number."""


@dataclass(frozen=True)
class Ready:
    """A cell made ready to fly, of a campaign of `flights` flights.

    ensemble: the parameters that differ from flight to flight; None where none does. failure: None without one.
    """

    setup: Setup
    truth_model: TruthModel
    sampling: Sampling
    flights: int
    ensemble: Ensemble | None
    failure: Failure | None = None

    @property
    def flight(self) -> Flight:
        """The flight as the kernel flies it, with the cell's failure."""
        return self.setup.flight if self.failure is None else self.setup.flight._replace(fails=True)

    def faults(self, seed: int) -> Callable[[int], SensorFault] | None:
        """Each flight's fault by its number; None where nothing fails."""
        failure, flight = self.failure, self.setup.flight
        return None if failure is None else lambda number: failure.law(flight, seed, number)


@dataclass(frozen=True)
class Cell:
    """One scenario of a campaign. values: of what is swept, by its name in the scenario file.

    first: the number of its first flight. failure: what fails in its flights; None: nothing.
    """

    scenario: Scenario
    values: dict[str, Value]
    truth_model: TruthModel
    fixed: tuple[str, ...] = ()  # numbers of the world that the campaign sets, and no dispersion draws
    first: int = 0
    failure: Failure | None = None

    @property
    def label(self) -> str:
        """The scenario's name and the cell's values."""
        values = [f"{name}={_shown(value)}" for name, value in self.values.items()]
        return " ".join([self.scenario.name, *values, self.truth_model])

    @cached_property
    def setup(self) -> Setup:
        """The scenario made ready. InputError as `assemble`."""
        setup = assemble(self.scenario)
        drawn = {name: entry for name, entry in setup.dispersion.items() if name not in self.fixed}
        return replace(setup, dispersion=drawn)


@dataclass(frozen=True)
class Plan:
    """A campaign: every cell flies `flights` flights of the seed, from its first on (flight 0)."""

    cells: tuple[Cell, ...]
    seed: int
    flights: int
    sampling: Sampling = "plain"
    until: str | None = None
    asked: tuple[str, ...] = ()  # of a certificate: what its flights are for
    parts: tuple[str, ...] = ()  # that are not ours: each with its name and the hash of its source

    def ready(self, cell: int) -> Ready:
        """A cell made ready. InputError where its scenario or its dispersion cannot be."""
        own = self.cells[cell]
        return ready_of(own.setup, own.truth_model, self.sampling, self.flights, own.failure)

    @cached_property
    def as_json(self) -> dict[str, Any]:
        """The campaign as written in its folder; two campaigns of the same are the same flights."""
        return {
            "schema_version": SCHEMA_VERSION,
            "flownav": __version__,
            "code_sha256": code_sha256(),
            "seed": self.seed,
            "flights": self.flights,
            "sampling": self.sampling,
            "until": self.until,
            "asked": list(self.asked),
            **({"parts": list(self.parts)} if self.parts else {}),
            "cells": [
                {
                    "label": cell.label,
                    "values": cell.values,
                    "truth_model": cell.truth_model,
                    "first": cell.first,
                    "failure": cell.failure.words if cell.failure else None,
                    "scenario": cell.scenario.model_dump(mode="json"),
                    "parameters_sha256": made_of(cell.setup),
                }
                for cell in self.cells
            ],
        }


def ready_of(
    setup: Setup, truth_model: TruthModel, sampling: Sampling, flights: int, failure: Failure | None = None
) -> Ready:
    """A cell made ready. InputError where its dispersion cannot be."""
    ensemble = None
    if truth_model == "ensemble":
        ensemble = setup.ensemble(design_of(sampling, tuple(setup.ensemble().entries), flights))
    return Ready(setup, truth_model, sampling, flights, ensemble, failure)


def planned(
    scenarios: Sequence[Scenario],
    sweeps: Sweep,
    *,
    truth_models: Sequence[TruthModel],
    seed: int,
    flights: int,
    sampling: Sampling = "plain",
    until: str | None = None,
    changes: Mapping[str, Value] | None = None,
) -> Plan:
    """Every scenario with these changes at every combination of the swept values. InputError for one that cannot be."""
    fixed, names = dict(changes or {}), tuple(sweeps)
    if both := sorted(set(fixed) & set(names)):
        raise InputError(f"{arg('sweep')} {both[0]}: is set as well; leave one of the two out")
    if len({scenario.name for scenario in scenarios}) < len(scenarios):
        raise InputError(f"{scenarios[0].name}: two scenarios have the same name, and the same flights; leave one out")
    count = len(scenarios) * len(truth_models) * math.prod(len(values) for values in sweeps.values())
    if count > MOST_CELLS:
        raise InputError(f"{arg('sweep')}: {count} combinations; at most {MOST_CELLS} are flown in one campaign")
    combinations = [dict(zip(names, each, strict=True)) for each in itertools.product(*sweeps.values())]
    cells = tuple(
        Cell(changed(scenario, fixed | values), values, truth_model, (*fixed, *names))
        for scenario in scenarios
        for values in combinations
        for truth_model in truth_models
    )
    if until is not None:
        _require_figure(stop_of(until).figure, cells)
    return Plan(cells, seed, flights, sampling, until)


def _require_figure(name: str, cells: Sequence[Cell]) -> None:
    """InputError where a cell has no such figure: it never lands."""
    never = next((cell for cell in cells if not lands(cell.scenario)), None)
    if never is not None and MEASURES[FIGURES[name].measure].of_landing:
        raise InputError(
            f"{arg('until')} {name}: the scenario {never.scenario.name} never lands; give p95_axis_m, or another"
        )


def lands(scenario: Scenario) -> bool:
    """Whether a scenario's flights are to land before their end."""
    lands_s = scenario.flight.may_land_after_s
    return lands_s is not None and lands_s < scenario.flight.duration_s and scenario.truth != "linear"


def changed(scenario: Scenario, changes: Mapping[str, Value]) -> Scenario:
    """The scenario with other values at dotted names of its file, checked anew. InputError names what is wrong."""
    entries = scenario.model_dump(exclude_unset=True)
    for name, value in changes.items():
        inside, (*tables, key) = entries, name.split(".")
        for table in tables:
            inside = inside.setdefault(table, {})
            if not isinstance(inside, dict):
                raise InputError(f"{scenario.name}: {name}: {table} is no table of a scenario")
        inside[key] = value
    return check(entries, Scenario, f"{scenario.name} with {', '.join(changes)}") if changes else scenario


def _shown(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def made_of(setup: Setup) -> str:
    """SHA-256 of everything that a scenario's flights are made of: the numbers of every file that it names."""
    numbers = {
        "parameters": setup.parameters,
        "dispersion": {name: entry.model_dump() for name, entry in sorted(setup.dispersion.items())},
        "vehicle": setup.file.model_dump(),
    }
    return hashlib.sha256(json.dumps(numbers, sort_keys=True, default=str).encode()).hexdigest()
