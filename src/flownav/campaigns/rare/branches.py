"""Between the walk's flights, which are normals and streams, and the engine's; the likeliest as a file, and again."""

import json
import math
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from flownav.campaigns.local import record_flown, rows_of
from flownav.campaigns.plan import made_of
from flownav.campaigns.rare.walk import Streams
from flownav.core.compile import LANES
from flownav.core.errors import InputError
from flownav.core.files import written_whole
from flownav.core.guard import object_in
from flownav.core.measurement import Array
from flownav.core.record import Record
from flownav.simulation import layout
from flownav.simulation.assemble import Setup
from flownav.simulation.block import KEYED_EPOCHS, Noise
from flownav.simulation.engine import Branches, Instead, fly_blocks, fly_written
from flownav.simulation.ensemble import Ensemble, believed
from flownav.simulation.plan import Flight
from flownav.simulation.sources import starts_of

START_ROWS = layout.START_END - layout.START_NORMALS
LARGEST_SHARE = 1.0 - 2.0**-53  # of a distribution: a normal beyond 8 sigma has no larger one


class Branch(NamedTuple):
    """One flight as it is written down: seed, dispersed numbers by name, start normals by name, stream of each span."""

    seed: int
    drawn: dict[str, float]
    start: dict[str, float]
    streams: list[int]


class Space:
    """The random numbers of a setup's flights: the dispersed inputs first, then the sensors' constants and start
    values.

    names: of the numbers drawn once. spans: of the flight, KEYED_EPOCHS each.
    """

    def __init__(self, setup: Setup, seed: int, *, dispersed: bool) -> None:
        self.flight: Flight = setup.flight
        self.ensemble: Ensemble | None = setup.ensemble() if dispersed else None
        self.seed = seed
        self.dispersed = [] if self.ensemble is None else list(self.ensemble.entries)
        self.starts = starts_of(setup.flight)
        self.names = [*self.dispersed, *(start.name for start in self.starts)]
        self.spans = ceil(setup.flight.plan.epochs / KEYED_EPOCHS)

    def values(self, inputs: Array) -> dict[str, list[float]]:
        """The dispersed numbers of flights with these normals, (flights, names), by dotted name."""
        if self.ensemble is None:
            return {}
        shares = np.minimum(ndtr(inputs[:, : len(self.dispersed)]), LARGEST_SHARE)
        found = self.ensemble.values_of(dict(zip(self.dispersed, shares.T, strict=True)))
        return {name: column.tolist() for name, column in found.items()}

    def fly(self, inputs: Array, streams: Streams, threads: int | None = None) -> Array:
        """The rows of these flights in their order, (flights, len(measures.ROW_COLUMNS))."""
        values, count = self.values(inputs), len(inputs)

        def branches(start: int) -> Instead:
            index = np.minimum(np.arange(start, start + len(LANES)), count - 1)
            own = {name: [column[k] for k in index] for name, column in values.items()}
            return Instead(self.block(own, inputs[index, len(self.dispersed) :], streams[index]))

        flown = fly_blocks(self.flight, self.seed, 0, count, self._judge, threads, instead=branches)
        return np.concatenate([block for _, block in flown])

    def usual(self, count: int, threads: int | None = None) -> Array:
        """The rows of flights 0 to `count - 1` of the seed, as any campaign has them."""
        flown = fly_blocks(self.flight, self.seed, 0, count, self._judge, threads, self.ensemble)
        return np.concatenate([block for _, block in flown])

    def _judge(self, history: Array) -> Array:
        return rows_of(self.flight, history)

    def block(self, values: dict[str, list[float]], start: Array, streams: Streams) -> Branches:
        """The engine's input: dispersed numbers, start normals (lanes, starts) and streams (lanes, spans)."""
        lanes = len(streams)
        truths = [believed(self.flight)] * lanes
        if self.ensemble is not None:
            truths = self.ensemble.truths_of(values, streams.max(axis=1).tolist())
        rows = np.zeros((START_ROWS, lanes))
        rows[[one.row for one in self.starts]] = start.T
        return Branches(truths, Noise(np.ascontiguousarray(streams.T).astype(np.uint64), rows))

    def branch(self, inputs: Array, streams: NDArray[np.int64]) -> Branch:
        """One flight, inputs (names,) and streams (spans,), to be written down."""
        drawn = {name: column[0] for name, column in self.values(inputs[None, :]).items()}
        start = zip(self.starts, inputs[len(self.dispersed) :].tolist(), strict=True)
        return Branch(self.seed, drawn, {one.name: value for one, value in start}, streams.tolist())

    def one(self, branch: Branch) -> Branches:
        """A branch flown again, as a block of one lane."""
        start = np.array([[branch.start[one.name] for one in self.starts]])
        values = {name: [branch.drawn[name]] for name in self.dispersed}
        return self.block(values, start, np.array([branch.streams], np.int64))


# -- as a file ---------------------------------------------------------------------------------------------------
SCHEMA_VERSION = 1
MOST_SPANS = 1_000_000
OTHER_FILE = "give the rare_flight.json of `flownav campaign --rare`"


def branch_text(setup: Setup, branch: Branch, event: str, response: float | None) -> str:
    """A flight as JSON: what was drawn for it, and its streams as [stream, how many spans] one after the other."""
    runs: list[list[int]] = []
    for stream in branch.streams:
        if runs and runs[-1][0] == stream:
            runs[-1][1] += 1
        else:
            runs.append([stream, 1])
    facts = {"schema_version": SCHEMA_VERSION, "scenario": setup.scenario.name, "event": event, "response": response}
    facts["parameters_sha256"] = made_of(setup)
    return json.dumps(facts | branch._asdict() | {"streams": runs}, indent=1) + "\n"


def write_branch(path: Path, setup: Setup, branch: Branch, event: str, response: float | None) -> None:
    """The file of a flight, whole or not at all."""
    with written_whole(path) as whole:
        whole.write_text(branch_text(setup, branch, event, response), encoding="utf-8")


def read_branch(path: Path, setup: Setup) -> Branch:
    """A flight from its file. InputError where it is none, or none of this scenario."""
    found = object_in(path, OTHER_FILE)
    try:
        if found["schema_version"] != SCHEMA_VERSION:
            raise InputError(f"{path}: schema_version {found['schema_version']}: must be {SCHEMA_VERSION}")
        if found["scenario"] != setup.scenario.name:
            raise InputError(f"{path}: a flight of the scenario {found['scenario']}, not of {setup.scenario.name}")
        if found["parameters_sha256"] != made_of(setup):
            raise InputError(
                f"{path}: was flown with other settings; give the options with which `flownav campaign --rare` was run"
            )
        lengths = [int(spans) for _, spans in found["streams"]]
        if min(lengths, default=0) < 0 or sum(lengths) > MOST_SPANS:
            raise ValueError("too long")
        streams = [int(stream) for stream, spans in found["streams"] for _ in range(int(spans))]
        drawn, start = _numbers(found["drawn"]), _numbers(found["start"])
        branch = Branch(int(found["seed"]), drawn, start, streams)
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise InputError(f"{path}: no flight of a rare event; {OTHER_FILE}") from error
    space = Space(setup, branch.seed, dispersed=bool(drawn))
    if set(drawn) != set(space.dispersed) or set(start) != {one.name for one in space.starts}:
        raise InputError(f"{path}: a flight of another scenario: other numbers are drawn for it")
    if len(streams) != space.spans or min(streams) < 0:
        raise InputError(f"{path}: a flight of another length: {len(streams)} spans of noise, not {space.spans}")
    return branch


def _numbers(table: dict[str, Any]) -> dict[str, float]:
    if not all(math.isfinite(value) for value in table.values()):
        raise ValueError("a number is needed")
    return {str(name): float(value) for name, value in table.items()}


def replayed(setup: Setup, branch: Branch) -> Record:
    """The flight again, as a scored record; its number is that of the stream that it drew last."""
    space = Space(setup, branch.seed, dispersed=bool(branch.drawn))
    flown = fly_written(setup.flight, branch.seed, branches=space.one(branch))
    drawn = branch.drawn or None
    record = record_flown(setup, flown, branch.seed, max(branch.streams), drawn)
    record.manifest["branch"] = {"start": branch.start, "streams": branch.streams}
    return record
