"""One requirement held against the flights, and the envelope: where in its conditions it is shown, field by field."""

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.measures import MEASURES, measured
from flownav.campaigns.requirement import Requirement, RequirementTable, needed_by
from flownav.campaigns.summary import DIRECTION, SPEED
from flownav.campaigns.tolerance import (
    Interval,
    Verdict,
    allowed,
    flights_to_show,
    interval,
    joint,
    risk,
    tolerance_bound,
    verdict,
)
from flownav.core.measurement import Array
from flownav.core.text import finite_or_none
from flownav.simulation.ensemble import Ensemble

PLAN_FAILURES = (0, 1, 2)  # numbers of failures of the plans that are stated


class Judgement(NamedTuple):
    """A requirement's outcome.

    most: failures with which these flights would still pass, -1: none. share: one-sided bounds of the share that
    succeeds. risk: how likely these flights pass when the requirement is only just not met. bound: the tolerance bound
    of the measure, infinite where the flights give none, None of a measure that is yes or no. needs: flights by
    failures, for PLAN_FAILURES.
    """

    table: RequirementTable
    verdict: Verdict
    flights: int
    failures: int
    most: int
    share: Interval
    risk: float
    bound: float | None
    needs: tuple[int, ...]

    def as_json(self) -> dict[str, Any]:
        """The figures as the certificate has them; null for a figure that is infinite."""
        table = self.table
        return {
            "measure": table.measure,
            "words": MEASURES[table.measure].words,
            "unit": MEASURES[table.measure].unit,
            "at_most" if table.upper else "at_least": table.limit,
            "probability": table.probability,
            "confidence": table.confidence,
            "sentence": table.sentence(),
            "verdict": self.verdict,
            "flights": self.flights,
            "failures": self.failures,
            "failures_allowed": self.most,
            "share": (self.flights - self.failures) / self.flights,
            "low": self.share.low,
            "high": self.share.high,
            "risk": self.risk,
            "tolerance_bound": finite_or_none(self.bound),
            "yes_or_no": table.yes_or_no,
            "needed": {str(failures): count for failures, count in zip(PLAN_FAILURES, self.needs, strict=True)},
            "more": self.more(),
        }

    def more(self) -> str:
        """The further flights that are needed, in words; "" where the requirement is shown."""
        table, rate = self.table, self.failures / self.flights
        if self.verdict == "pass":
            return ""
        if self.verdict == "fail":
            return "No number of flights shows it: its opposite is shown."
        enough = needed_by(table, self.failures)
        statement = (
            f"{self.failures} failures in {self.flights} flights show neither that it is met nor that it is missed. "
            f"A plan that allows {self.failures} failures needs {enough} flights"
        )
        if not self.failures:
            return f"{statement}."
        serves = flights_to_show(rate, table.probability, table.confidence)
        if serves is None:
            return f"{statement}; at the share of failures found, {100.0 * rate:.3g} %, no plan is likely to pass."
        return (
            f"{statement}; at the share of failures found, {100.0 * rate:.3g} %, a plan of {serves} flights passes "
            "9 times in 10."
        )


def judged(table: RequirementTable, rows: Array) -> Judgement:
    """A requirement over flights, rows (flights, len(ROW_COLUMNS))."""
    figures = measured(table.measure, rows)
    flights, failures = len(figures), int(failed(table, figures).sum())
    most = allowed(flights, table.probability, table.confidence)
    bound = None
    if not table.yes_or_no:
        bound = tolerance_bound(bad_first(table, figures), table.probability, table.confidence, upper=table.upper)
    return Judgement(
        table=table,
        verdict=verdict(flights, failures, table.probability, table.confidence),
        flights=flights,
        failures=failures,
        most=most,
        share=interval(flights, failures, table.confidence),
        risk=risk(flights, most, table.probability),
        bound=bound,
        needs=tuple(needed_by(table, count) for count in PLAN_FAILURES),
    )


def failed(table: RequirementTable, figures: Array) -> NDArray[np.bool_]:
    """Which flights do not meet a limit; a touchdown that was none meets none."""
    bad = figures > table.limit if table.upper else (figures < table.limit) | np.isposinf(figures)
    return np.asarray(bad)


def bad_first(table: RequirementTable, figures: Array) -> Array:
    """The figures with a touchdown that was none as the worst on the requirement's side."""
    return figures if table.upper else np.where(np.isposinf(figures), -np.inf, figures)


# -- the envelope ------------------------------------------------------------------------------------------------
WIND = (SPEED, DIRECTION)
GRIDS = ((6, 12), (5, 8), (4, 8), (4, 4), (3, 4), (2, 4))  # fields of the first axis and the second, finest first
USEFUL_FLIGHTS = 50  # flights of a field that are of use, where there are too few to show the requirement
EDGE_SHARE = 1e-3  # share of a distribution that the outermost edge leaves out, where it has no end


def axes_of(requirement: Requirement, ensemble: Ensemble) -> tuple[str, ...]:
    """At most two inputs: the requirement's ranges in the order of its file, else the wind's speed and direction."""
    ranged = [name for name in requirement.conditions.ranges if name in ensemble.entries]
    wind = [name for name in WIND if name in ensemble.entries and name not in ranged]
    return tuple(sorted((ranged + wind)[:2], key=lambda name: (name == WIND[1], name != WIND[0])))


def envelope_of(
    requirement: Requirement, rows: Array, inputs: dict[str, Array], ensemble: Ensemble
) -> dict[str, Any]:  # fmt: skip
    """Axes and fields over them; ensemble: of the cell whose distributions the fields' edges are taken from."""
    axes = tuple(name for name in axes_of(requirement, ensemble) if np.isfinite(inputs[name]).all())
    grid = _grid(requirement, len(rows), len(axes))
    edges = [_edges(ensemble, name, count) for name, count in zip(axes, grid, strict=False)]
    place = [
        np.clip(np.searchsorted(edge, inputs[name], side="right") - 1, 0, len(edge) - 2)
        for name, edge in zip(axes, edges, strict=True)
    ]
    fields = []
    for field in product(*(range(len(edge) - 1) for edge in edges)) if axes else ():
        inside = np.all([own == k for own, k in zip(place, field, strict=True)], axis=0)
        ends = {name: [float(edge[k]), float(edge[k + 1])] for name, edge, k in zip(axes, edges, field, strict=True)}
        fields.append(ends | outcome(requirement, rows[inside]))
    needs = max(needed_by(table, 0) for table in requirement.requirement)
    return {"axes": list(axes), "flights_needed_in_a_field": needs, "bins": fields}


def outcome(requirement: Requirement, rows: Array) -> dict[str, Any]:
    """How a part of the flights did: of all requirements together, rows (flights, len(ROW_COLUMNS))."""
    if not len(rows):
        return {"flights": 0, "failures": 0, "share": None, "low": 0.0, "high": 1.0, "verdict": "not shown"}
    failures = int(failures_in(requirement, rows).any(axis=0).sum())
    confidence = max(table.confidence for table in requirement.requirement)
    low, high = interval(len(rows), failures, confidence)
    return {
        "flights": len(rows),
        "failures": failures,
        "share": 1.0 - failures / len(rows),
        "low": low,
        "high": high,
        "verdict": joint(judged(table, rows).verdict for table in requirement.requirement),
    }


def failures_in(requirement: Requirement, rows: Array) -> NDArray[np.bool_]:
    """Which flights fail which requirement, (requirements, flights)."""
    return np.array([failed(table, measured(table.measure, rows)) for table in requirement.requirement])


def _grid(requirement: Requirement, flights: int, axes: int) -> Sequence[int]:
    """How many fields each axis has: the finest grid whose fields can show the requirement, else the finest useful
    one.
    """
    needs = max(needed_by(table, 0) for table in requirement.requirement)
    fields = [int(np.prod(grid[:axes])) for grid in GRIDS]
    enough = [grid for grid, count in zip(GRIDS, fields, strict=True) if flights >= 1.25 * needs * count]
    some = [grid for grid, count in zip(GRIDS, fields, strict=True) if flights >= USEFUL_FLIGHTS * count]
    return (*enough, *some, GRIDS[-1])[0]


def _edges(ensemble: Ensemble, name: str, count: int) -> Array:
    """Edges of fields that flights fall into equally often, (count + 1,)."""
    found = ensemble.frozen[name].support()
    low = 0.0 if np.isfinite(found[0]) else EDGE_SHARE
    high = 1.0 if np.isfinite(found[1]) else 1.0 - EDGE_SHARE
    return np.sort(ensemble.numbers(name, np.linspace(low, high, count + 1)))
