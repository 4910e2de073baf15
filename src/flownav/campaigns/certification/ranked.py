"""The ranking of a certificate: flown in its worst cell, kept in its folder, taken up again where it stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.arrow import column, numbers, read
from flownav.campaigns.certification.judgement import bad_first
from flownav.campaigns.engines.engine import Engine, Part
from flownav.campaigns.measures import measured
from flownav.campaigns.plan import Plan
from flownav.campaigns.ranking import Index, Ranking, rank
from flownav.campaigns.requirement import RequirementTable
from flownav.core.files import written_whole
from flownav.simulation.dispersion import Design

Array = NDArray[np.float64]

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
    import pyarrow as pa

    try:
        figures = column(read(path), FIGURE)
    except (OSError, KeyError, pa.ArrowException):
        return None
    return np.asarray(figures) if len(figures) == flights else None


def _keep(path: Path, figures: Array) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    with written_whole(path) as temporary:
        pq.write_table(pa.table({FIGURE: numbers(figures)}), temporary)
