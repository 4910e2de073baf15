"""The summary of a campaign: figures of every cell with their intervals, outcomes of its flights, views, the worst."""

from collections import Counter
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns import measures
from flownav.campaigns.plan import Plan
from flownav.campaigns.run import LANDING, TAKEOFF
from flownav.campaigns.store import INPUT, Dataset
from flownav.core.arrow_columns import as_numpy
from flownav.core.measurement import Array
from flownav.core.text import finite_or_none
from flownav.scoring.errors import SCORE_COLUMNS, touchdown_rows
from flownav.scoring.landings import EXPECTED
from flownav.scoring.percentiles import share_with_interval

VERDICTS = ("landed", "beside_the_pad", "went_around", "crashed", "unfinished")
YES_OR_NO = ("crash", "not_landed")  # measures that say yes or no: their share is a figure
WORST_FLIGHTS = 10  # flights that are named


class Flight(NamedTuple):
    """A flight by its place, with the measure by which it was chosen (None: infinite)."""

    cell: int
    flight: int
    value: float | None
    verdict: str
    limited_by: str


def summary_of(plan: Plan, data: Dataset) -> dict[str, Any]:
    """The whole campaign as `summary.json` has it; nothing in it depends on when or where it was flown."""
    cells = [cell_summary(plan, cell, data) for cell in range(len(plan.cells))]
    landing = [k for k, cell in enumerate(cells) if "r95_m" in cell["figures"]]
    alike = landing or list(range(len(cells)))  # what never lands is not pooled with what does
    rows = np.concatenate([data.rows(cell) for cell in alike])
    verdicts = {name: sum(cell["verdicts"][name] for cell in cells) for name in VERDICTS}
    every = [Flight(**flight) for k in alike for flight in cells[k]["worst"]]
    return {
        "schema_version": 1,
        "scenarios": list(dict.fromkeys(cell.scenario.name for cell in plan.cells)),
        "seed": plan.seed,
        "sampling": plan.sampling,
        "until": plan.until,
        "flights": sum(cell["flights"] for cell in cells),
        "pooled_cells": alike,
        "scores": scores_of(rows),
        "verdicts": verdicts,
        "worst": [flight._asdict() for flight in worst_first(every)[:WORST_FLIGHTS]],
        "cells": cells,
    }


def cell_summary(plan: Plan, cell: int, data: Dataset) -> dict[str, Any]:
    """One cell."""
    own, rows = plan.cells[cell], data.rows(cell)
    verdict_columns = data.table(cell, ["verdict", "limited_by"])
    verdicts, limits = (np.asarray(verdict_columns[name].to_pylist()) for name in ("verdict", "limited_by"))
    counts, lands = Counter(verdicts.tolist()), was_to_land(rows)
    values = measures.values_of(LANDING if lands else TAKEOFF, rows)
    order = np.argsort(values, kind="stable")
    inputs = inputs_of(data, cell)
    listed = [Flight(cell, int(k), finite_or_none(values[k]), str(verdicts[k]), str(limits[k])) for k in order]
    return {
        "label": own.label,
        "scenario": own.scenario.name,
        "truth_model": own.truth_model,
        "values": own.values,
        "flights": len(rows),
        "figures": figures_of(rows, plan),
        "stopped": None if plan.until is None else len(rows) < plan.flights or _is_enough(plan, rows),
        "scores": scores_of(rows),
        "verdicts": {name: counts[name.replace("_", " ")] for name in VERDICTS},
        "limited_by": dict(sorted(Counter(limits.tolist()).items(), key=lambda entry: (-entry[1], entry[0]))),
        "convergence": convergence(LANDING if lands else TAKEOFF, values),
        "envelope": envelope(inputs, verdicts == "landed"),
        "sensitivity": sensitivity(inputs, values),
        "median": listed[(len(listed) - 1) // 2]._asdict(),
        "worst": [flight._asdict() for flight in reversed(listed[-WORST_FLIGHTS:])],
    }


def _is_enough(plan: Plan, rows: Array) -> bool:
    """Whether the figure of --until is as narrow as was asked for."""
    stop = measures.stop_of(str(plan.until))
    return measures.enough(stop, measures.values_of(stop.figure, rows), plan.flights) is not None


def was_to_land(rows: Array) -> bool:
    """Whether a cell's flights were to land."""
    return bool((touchdown_rows(rows[:, : len(SCORE_COLUMNS)])[:, EXPECTED] > 0.0).any())


def figures_of(rows: Array, plan: Plan) -> dict[str, dict[str, float | None]]:
    """The figures of a cell's flights, each with its interval; the one that stopped it with that of the last look.

    A figure of fewer flights than it needs would be the largest of them: it is null.
    """
    stop = measures.stop_of(plan.until).figure if plan.until else None
    found = {}
    for name, figure in measures.FIGURES.items():
        if measures.MEASURES[figure.measure].of_landing and not was_to_land(rows):
            continue
        confidence = measures.confidence_of_a_look(plan.flights) if name == stop else measures.CONFIDENCE
        needed = measures.flights_needed(name)
        known = measures.figure_of(name, measures.values_of(name, rows), confidence).finite()
        shown = known if len(rows) >= needed else dict.fromkeys(known)
        found[name] = shown | {"confidence": confidence, "flights_needed": needed}
    return found


def scores_of(rows: Array) -> dict[str, dict[str, Any]]:
    """Median and 95th percentile of every measure that the flights have, the latter with its 95 % interval."""
    lands = was_to_land(rows)
    return {
        name: measures.spread_of(measures.measured(name, rows))
        for name, measure in measures.MEASURES.items()
        if name not in YES_OR_NO and (lands or not measure.of_touchdown)
    }


def worst_first(flights: list[Flight]) -> list[Flight]:
    """Flights, the worst first; those without a finite figure before all others."""
    return sorted(flights, key=lambda one: (one.value is not None, -(one.value or 0.0), one.cell, one.flight))


def inputs_of(data: Dataset, cell: int) -> dict[str, Array]:
    """The dispersed numbers of a cell's flights by name, each (flights,)."""
    table = data.table(cell)
    names = [name for name in table.column_names if name.startswith(INPUT)]
    return {name.removeprefix(INPUT): as_numpy(table.column(name)) for name in names}


# -- views of a cell ---------------------------------------------------------------------------------------------
SPEED, DIRECTION = "wind.speed_20ft_m_s", "wind.from_direction_deg"
SECTORS, RINGS = 8, 4
CONVERGENCE_POINTS = 24  # of a convergence
LEAST = 8  # flights, before a figure is drawn
INPUTS_SHOWN = 12  # inputs


def convergence(figure: str, values: Array) -> list[dict[str, float | None]]:
    """The figure and its interval after the first 8, ... flights, spaced evenly by their logarithm."""
    if len(values) < LEAST:
        return []
    after = np.unique(np.geomspace(LEAST, len(values), CONVERGENCE_POINTS).round().astype(int))
    return [{"flights": int(count)} | measures.figure_of(figure, values[:count]).finite() for count in after]


def envelope(inputs: Mapping[str, Array], landed: NDArray[np.bool_]) -> list[dict[str, Any]]:
    """The share that landed by the wind that was drawn: rings of equal numbers of flights, sectors of 45 degrees.

    Empty where speed and direction are not both drawn, or always the same.
    """
    if SPEED not in inputs or DIRECTION not in inputs or len(landed) < LEAST * RINGS or np.ptp(inputs[SPEED]) == 0.0:
        return []
    speed, direction = inputs[SPEED], inputs[DIRECTION] % 360.0
    edges, width = np.quantile(speed, np.linspace(0.0, 1.0, RINGS + 1)), 360.0 / SECTORS
    edges[0] = 0.0
    ring = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, RINGS - 1)
    sector = np.floor((direction + 0.5 * width) / width).astype(int) % SECTORS
    found = []
    for k in range(RINGS):
        for s in range(SECTORS):
            own = landed[(ring == k) & (sector == s)]
            share = share_with_interval(int(own.sum()), len(own)) if len(own) else (None, None, None)
            found.append(
                {
                    "from_m_s": float(edges[k]),
                    "to_m_s": float(edges[k + 1]),
                    "direction_deg": s * width,
                    "flights": len(own),
                    **dict(zip(("landed", "low", "high"), share, strict=True)),
                }
            )
    return found


def ranked(values: Array) -> Array:
    """The place of each number in their order, from 1, the mean of their places for equal ones; NaN where one is NaN.

    As `scipy.stats.rankdata`, which takes 46 MB to import.
    """
    order = np.argsort(values, kind="stable")
    if np.isnan(values).any():
        return np.full(len(values), np.nan)
    ascending = values[order]
    is_new = np.concatenate([[True], ascending[1:] != ascending[:-1]])
    ends = np.append(np.flatnonzero(is_new), len(values))
    group = np.cumsum(is_new)
    found = np.empty(len(values))
    found[order] = 0.5 * (ends[group - 1] + 1 + ends[group])
    return found


def sensitivity(inputs: Mapping[str, Array], values: Array) -> list[dict[str, Any]]:
    """Inputs by the rank correlation of what was drawn with the measure, the strongest first, with a 95 % interval.

    Spearman's coefficient, its interval by Fisher's transformation with Bonett and Wright's variance (Psychometrika 65,
    2000); infinite measures rank last. It sees what is monotonic only; `flownav certify` gives Sobol's indices.
    """
    if len(values) < LEAST or not inputs:
        return []
    ranks = ranked(values)
    found: list[tuple[float, dict[str, Any]]] = []
    for name, drawn in inputs.items():
        if np.ptp(drawn) == 0.0 or np.ptp(ranks) == 0.0:
            continue
        rho = float(np.corrcoef(ranked(drawn), ranks)[0, 1])
        reach = 1.96 * np.sqrt((1.0 + 0.5 * rho**2) / max(len(values) - 3, 1))
        middle = np.arctanh(np.clip(rho, -1.0 + 1e-12, 1.0 - 1e-12))
        low, high = (float(np.tanh(middle + side * reach)) for side in (-1.0, 1.0))
        found.append((abs(rho), {"input": name, "rank_correlation": rho, "low": low, "high": high}))
    return [one for _, one in sorted(found, key=lambda each: -each[0])][:INPUTS_SHOWN]
