"""The envelope of a certificate: where in its conditions the requirement is shown, field by field and cell by cell."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.certification.judgement import failed, judged
from flownav.campaigns.measures import measured
from flownav.campaigns.requirement import Requirement, needed_by
from flownav.campaigns.tolerance import interval, joint
from flownav.campaigns.views import DIRECTION, SPEED
from flownav.simulation.ensemble import Ensemble

Array = NDArray[np.float64]

WIND = (SPEED, DIRECTION)
GRIDS = ((6, 12), (5, 8), (4, 8), (4, 4), (3, 4), (2, 4))  # fields of the first axis and the second, finest first
USEFUL = 50  # flights of a field that say something, where there are too few to show the requirement
EDGE = 1e-3  # share of a distribution that the outermost edge leaves out, where it has no end


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
    failures = int(failing(requirement, rows).any(axis=0).sum())
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


def failing(requirement: Requirement, rows: Array) -> NDArray[np.bool_]:
    """Which flights fail which requirement, (requirements, flights)."""
    return np.array([failed(table, measured(table.measure, rows)) for table in requirement.requirement])


def _grid(requirement: Requirement, flights: int, axes: int) -> Sequence[int]:
    """How many fields each axis has: the finest grid whose fields can show the requirement, else tell something."""
    needs = max(needed_by(table, 0) for table in requirement.requirement)
    fields = [int(np.prod(grid[:axes])) for grid in GRIDS]
    enough = [grid for grid, count in zip(GRIDS, fields, strict=True) if flights >= 1.25 * needs * count]
    some = [grid for grid, count in zip(GRIDS, fields, strict=True) if flights >= USEFUL * count]
    return (*enough, *some, GRIDS[-1])[0]


def _edges(ensemble: Ensemble, name: str, count: int) -> Array:
    """Edges of fields that flights fall into equally often, (count + 1,)."""
    found = ensemble.frozen[name].support()
    low = 0.0 if np.isfinite(found[0]) else EDGE
    high = 1.0 if np.isfinite(found[1]) else 1.0 - EDGE
    return np.sort(ensemble.numbers(name, np.linspace(low, high, count + 1)))
