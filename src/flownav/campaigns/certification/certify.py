"""A requirement flown, judged and written down: the certificate, with what decides the outcome in its worst cell."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.certification.again import SAMPLE, Again, deciding, drawn, fly_again
from flownav.campaigns.certification.cells import words_of
from flownav.campaigns.certification.envelope import Judgement, bad_first, envelope_of, failures_in, judged, outcome
from flownav.campaigns.certification.remade import require_drawn
from flownav.campaigns.chain import DIGEST_BYTES, DamagedError, read_part, write_part
from flownav.campaigns.engines import Engine, Part
from flownav.campaigns.measures import ROW_COLUMNS, measured
from flownav.campaigns.plan import Plan
from flownav.campaigns.ranking import Index, Ranking, rank
from flownav.campaigns.requirement import USUAL_SEED, Requirement, RequirementTable, fixed_by, scenario_of
from flownav.campaigns.run import Watch, run_campaign
from flownav.campaigns.store import Dataset, Store
from flownav.campaigns.summary import inputs_of
from flownav.campaigns.tolerance import Verdict, joint
from flownav.core.arrow_columns import as_numpy, numbers
from flownav.core.files import written_whole
from flownav.core.measurement import Array
from flownav.core.text import finite
from flownav.simulation.dispersion import Design

NONE_AGAIN = Again(0, 0)
FLIGHTS_NAMED = 10  # flights that are named as the worst


@dataclass(frozen=True)
class Flown:
    """All flights of a certificate, one after the other: cell and number of each, (flights,).

    rows (flights, len(ROW_COLUMNS)); inputs: the dispersed numbers by name, (flights,), NaN in cells without one;
    verdicts and limits: the outcome of each, and its limiting cause.
    """

    cell: NDArray[np.int64]
    number: NDArray[np.int64]
    rows: Array
    inputs: dict[str, Array]
    verdicts: tuple[str, ...]
    limits: tuple[str, ...]


@dataclass(frozen=True)
class Certificate:
    """The judgement of a certificate's flights. ranking: None where none was asked for."""

    requirement: Requirement
    plan: Plan
    flown: Flown
    judgements: tuple[Judgement, ...]
    envelope: dict[str, Any]
    worst: tuple[int, ...]
    ranking: dict[str, Any] | None
    again: Again = NONE_AGAIN

    @property
    def verdict(self) -> Verdict:
        """The verdict of all requirements together."""
        return joint(judgement.verdict for judgement in self.judgements)

    def as_json(self) -> dict[str, Any]:
        """The certificate but for what was assumed, files and hashes."""
        own, rows = self.requirement, self.flown.rows
        primary = self.judgements[0]
        together = outcome(own, rows)
        facts = {
            "verdict": self.verdict,
            "requirement": {
                "name": own.name,
                "description": own.description,
                "scenario": own.scenario,
                "requirements": [judgement.as_json() for judgement in self.judgements],
                "conditions": own.conditions.model_dump(mode="json", exclude_unset=True),
                "set": fixed_by(own),
            },
            "seed": own.seed,
            "chosen": self.chosen(),
            "flights": len(rows),
            "needed": own.flights(),
            "flown_again": self.again._asdict(),
            "failures": together["failures"],
            "low": together["low"],
            "high": together["high"],
            "risk": max(judgement.risk for judgement in self.judgements),
            "tolerance_bound": primary.as_json()["tolerance_bound"],
            "verdicts": {name: self.flown.verdicts.count(name) for name in sorted(set(self.flown.verdicts))},
            "envelope": self.envelope,
            "worst": [self.facts_of(flight) for flight in self.worst],
        }
        return facts | ({"ranking": None, "split": None} if self.ranking is None else self.ranking)

    def chosen(self) -> dict[str, int | str | None]:
        """The user's choices that differ from the defaults: the seed, the number of flights in all, the vehicle; None
        each where it is the default.

        A user who may choose these may try them until the flights pass.
        """
        own, cells = self.requirement, len(self.plan.cells)
        usual = cells * -(-own.flights() // cells)
        flights = cells * self.plan.flights
        return {
            "seed": None if own.seed == USUAL_SEED else own.seed,
            "flights": None if flights == usual else flights,
            "vehicle": self._other_vehicle(),
        }

    def _other_vehicle(self) -> str | None:
        """The vehicle that was flown in place of the requirement's, where that names but one."""
        own, flown = self.requirement, self.plan.cells[0].scenario.vehicle.file
        return None if own.conditions.vehicle or flown == scenario_of(own).vehicle.file else flown

    def facts_of(self, flight: int) -> dict[str, Any]:
        """One flight in the list of the worst."""
        cell, rows = int(self.flown.cell[flight]), self.flown.rows[flight : flight + 1]
        figures = {table.measure: measured(table.measure, rows)[0] for table in self.requirement.requirement}
        return {
            "flight": int(self.flown.number[flight]),
            "cell": words_of(self.plan.cells[cell]),
            "cell_number": cell,
            "verdict": self.flown.verdicts[flight],
            "limited_by": self.flown.limits[flight],
            "failed": bool(failures_in(self.requirement, rows).any()),
            "figures": finite(figures),
            "inputs": {name: float(self.flown.inputs[name][flight]) for name in self.envelope["axes"]},
        }


def certify(
    requirement: Requirement, plan: Plan, engine: Engine, store: Store, watch: Watch = lambda progress: None
) -> Certificate:
    """Fly what the folder lacks of a plan (`certification.cells.plan_of`), and judge it.

    store: open. InputError where a cell cannot be flown, or the folder's flights are not those of the plan.
    """
    data = run_campaign(plan, engine, store, watch)
    require_drawn(plan, data)
    return judged_from(requirement, plan, data)


def judged_from(requirement: Requirement, plan: Plan, data: Dataset) -> Certificate:
    """The certificate of a folder's flights; all flights of the plan are there."""
    flown = flown_of(plan, data)
    judgements = tuple(judged(table, flown.rows) for table in requirement.requirement)
    ready = plan.ready(0)
    assert ready.ensemble is not None  # a certificate's cells are dispersed
    envelope = envelope_of(requirement, flown.rows, flown.inputs, ready.ensemble)
    envelope["cells"] = [
        {"cell": words_of(cell)} | outcome(requirement, flown.rows[flown.cell == k])
        for k, cell in enumerate(plan.cells)
    ]
    return Certificate(requirement, plan, flown, judgements, envelope, worst_of(requirement, flown.rows), None)


def checked(
    certificate: Certificate, data: Dataset, engine: Engine, sample: int = SAMPLE,
    on_progress: Callable[[int], object] = lambda flown: None,
) -> Certificate:  # fmt: skip
    """The certificate once `sample` of its flights, drawn at random, and those that decided were flown again.

    InputError where one differs from the folder's.
    """
    flown, plan = certificate.flown, certificate.plan
    margin = deciding(certificate.requirement, certificate.judgements, flown.rows)
    own = drawn(len(flown.rows), sample)
    places = np.union1d(own, margin)
    for cell in range(len(plan.cells)):
        fly_again(plan, data, cell, flown.number[places[flown.cell[places] == cell]].tolist(), engine, on_progress)
    return replace(certificate, again=Again(len(own), len(margin)))


def with_ranking(
    certificate: Certificate, engine: Engine, folder: Path, rows: int,
    on_progress: Callable[[int], object] = lambda flown: None,
) -> Certificate:  # fmt: skip
    """The certificate with the inputs ranked, by the first requirement's measure in the cell with most failures.

    rows: of the ranking's samples, a power of 2. What the folder holds of it is not flown again.
    """
    plan, table = certificate.plan, certificate.requirement.requirement[0]
    worst = int(np.argmax([cell["failures"] for cell in certificate.envelope["cells"]]))
    found = ranking_json(ranked(plan, worst, table, rows, engine, folder, on_progress))
    of = {"ranking_measure": table.measure, "ranking_cell": words_of(plan.cells[worst])}
    return replace(certificate, ranking=found | of)


def flown_of(plan: Plan, data: Dataset) -> Flown:
    """The flights of a plan's folder."""
    cells, inputs = range(len(plan.cells)), [inputs_of(data, cell) for cell in range(len(plan.cells))]
    nothing = np.full(plan.flights, np.nan)
    names = list(dict.fromkeys(name for own in inputs for name in own))

    def texts(name: str) -> tuple[str, ...]:
        return tuple(text for cell in cells for text in data.column(cell, name))

    return Flown(
        cell=np.repeat(np.arange(len(cells)), plan.flights),
        number=np.concatenate([data.column(cell, "flight") for cell in cells]),
        rows=np.concatenate([data.rows(cell) for cell in cells]).reshape(-1, len(ROW_COLUMNS)),
        inputs={name: np.concatenate([own.get(name, nothing) for own in inputs]) for name in names},
        verdicts=texts("verdict"),
        limits=texts("limited_by"),
    )


def worst_of(requirement: Requirement, rows: Array) -> tuple[int, ...]:
    """The places of the worst flights: those that fail most requirements first, then by the first one's figure."""
    table = requirement.requirement[0]
    figures = bad_first(table, measured(table.measure, rows))
    badness = figures if table.upper else -figures
    order = np.lexsort((np.arange(len(rows)), -badness, -failures_in(requirement, rows).sum(axis=0)))
    return tuple(int(flight) for flight in order[:FLIGHTS_NAMED])


# -- the ranking -------------------------------------------------------------------------------------------------
FOLDER, FIGURE = "ranking", "figure"


def ranked(
    plan: Plan, cell: int, table: RequirementTable, n: int, engine: Engine, folder: Path,
    on_progress: Callable[[int], object] = lambda flown: None,
) -> Ranking:  # fmt: skip
    """The inputs of a cell ranked by what they do to a requirement's measure; folder: the campaign's.

    The outcomes of each sample are a file, which is not flown again. InputError where a cell cannot be flown.
    """
    ready = plan.ready(cell)
    assert ready.ensemble is not None  # a certificate's cells are dispersed
    place, number = folder / FOLDER / f"cell-{cell:03d}-{table.measure}-{n}", 0

    def fly(design: Design, first: int, flights: int) -> Array:
        nonlocal number
        path, number = place / f"sample-{number:03d}.parquet", number + 1
        figures = _kept(path, flights)
        if figures is None:
            crossed = replace(ready, ensemble=ready.setup.ensemble(design))
            ((_, rows),) = engine.fly(crossed, plan.seed, [Part(0, first, flights)], on_progress)
            figures = bad_first(table, measured(table.measure, rows))
            _keep(path, figures)
        else:
            on_progress(flights)
        return figures

    return rank(ready.ensemble.entries, plan.seed, n, fly)


def ranking_json(ranking: Ranking) -> dict[str, Any]:
    """Inputs, classes and how they were found."""
    return {
        "ranking": [_index(index, "input") for index in ranking.inputs],
        "split": [_index(index, "known") for index in ranking.classes],
        "ranking_rows": ranking.n,
        "ranking_flights": ranking.flights,
        "ranking_of": ranking.of,
    }


def _index(index: Index, name: str) -> dict[str, Any]:
    return {
        name: index.input,
        "first": index.first,
        "first_interval": list(index.first_interval),
        "total": index.total,
        "total_interval": list(index.total_interval),
    }


def _kept(path: Path, flights: int) -> Array | None:
    """The outcomes of a sample that was flown before; None where there is none, or not all of it."""
    try:
        figures = as_numpy(read_part(path).table.column(FIGURE))
    except (OSError, KeyError, DamagedError):
        return None
    return np.asarray(figures) if len(figures) == flights else None


def _keep(path: Path, figures: Array) -> None:
    import pyarrow as pa

    with written_whole(path) as temporary:
        write_part(temporary, pa.table({FIGURE: numbers(figures)}), bytes(DIGEST_BYTES))
