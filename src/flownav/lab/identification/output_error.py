"""Output-error identification: least squares on the simulated output, one or several runs jointly.

Gauss-Newton with Levenberg's damping (`descent`) on exact derivatives (`response`). Several starts are compared,
the better ones get some iterations, the best is finished.

For white residuals this is the maximum-likelihood estimate, and its covariance sigma^2 (J'J)^-1 the Cramer-Rao
bound. Residuals that are not white get the sandwich with their own autocovariance in place of J'J.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.lab.identification import starting_points
from flownav.lab.identification.descent import (
    DELAY_RANGE_S,
    SMALLEST_EIGENVALUE,
    State,
    begin,
    by_cost,
    descend,
    inverse_of,
    linearise,
    linearise_all,
    normal_equations,
)
from flownav.lab.identification.descent import Point as Point
from flownav.lab.identification.descent import Structure as Structure
from flownav.lab.identification.experiment import Experiment
from flownav.lab.identification.statistics import (
    Whiteness,
    coloured_information,
    fit_percent,
    information_criteria,
    whiteness,
)

HIGHEST_ORDER = 6
FINALISTS = 2  # starts that get
HEAT_ITERATIONS = 2  # iterations each, before the best is finished
MOST_ITERATIONS = 60


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    covariance (p, p) of (log a_1 .. log a_n, gain, delay if it is a parameter), p = structure.parameters, and
    white_covariance the same if the residuals were white (the Cramer-Rao bound at the estimate); sigma the
    residuals' standard deviation; fits one per run, fit_percent over all runs; residuals and predictions by run.
    """

    structure: Structure
    point: Point
    covariance: Array
    white_covariance: Array
    sigma: float
    fit_percent: float
    fits: tuple[float, ...]
    aic: float
    bic: float
    whiteness: Whiteness
    readings: int
    converged: bool
    residuals: tuple[Array, ...]
    predictions: tuple[Array, ...]
    cost: float
    unknowns: int

    def criteria(self, readings_per_independent: float) -> tuple[float, float]:
        """(AIC, BIC); models are compared with the same readings per independent one."""
        return information_criteria(self.cost, self.readings, self.unknowns, self.readings / readings_per_independent)


def fit(
    experiments: Sequence[Experiment],
    structure: Structure,
    starts: Sequence[Point] | None = None,
    guess: tuple[float, float] | None = None,
) -> Fit:
    """The least-squares model of one or several runs.

    starts: where to begin; around a guess of gain and delay where None, which the runs give where it is None too.
    InputError where a run is too short for the delays considered, or no start leads to a stable model.
    """
    if not experiments:
        raise InputError("no experiment to identify from; give a log")
    if not 0 <= structure.order <= HIGHEST_ORDER:
        raise InputError(f"order {structure.order}: 0 (gain and delay) to {HIGHEST_ORDER} are possible")
    runs = [run.within(DELAY_RANGE_S) for run in experiments]
    if starts is None:
        guess = guess or starting_points.gain_and_delay(runs, DELAY_RANGE_S)
        starts = starting_points.points(guess, structure)
        if structure.order > 2:
            second = fit(experiments, structure._replace(order=2), guess=guess).point
            starts = [*starts, second._replace(log_a=starting_points.with_fast_poles(second.log_a, structure.order))]
    states = sorted((begin(runs, structure, start) for start in starts), key=by_cost)
    hopeful = [descend(runs, structure, state, HEAT_ITERATIONS) for state in states[:FINALISTS]]
    state = descend(runs, structure, min(hopeful, key=by_cost), MOST_ITERATIONS)
    if not np.isfinite(state.cost):
        raise InputError(f"{runs[0].name}: no stable model of order {structure.label} fits; try a lower order")
    return _finish(runs, structure, state)


def _finish(runs: Sequence[Experiment], structure: Structure, state: State) -> Fit:
    parts = linearise_all(runs, structure, state.point, state.nuisance, whole=True)
    normal = normal_equations(parts, structure.parameters)
    residuals = [part.columns[:, -1].copy() for part in parts]
    readings = sum(map(len, residuals))
    free = structure.parameters + len(runs) * (structure.order + 1)
    variance = state.cost / max(1, readings - free)
    inverse = inverse_of(normal.matrix)
    tested = whiteness(residuals)
    covariance = white = variance * inverse
    if not tested.white:
        meat = np.zeros_like(inverse)
        for part, inner, across in zip(parts, normal.inverse, normal.coupling, strict=True):
            shared, own, residual = np.split(part.columns, [structure.parameters, -1], axis=1)
            projected = shared - own @ (inner @ across.T)
            meat += coloured_information(projected, residual[:, 0]) * float(residual.var())
        covariance = _at_least(white, inverse @ meat @ inverse, tested.readings_per_independent)
    predictions = tuple(run.y - residual for run, residual in zip(runs, residuals, strict=True))
    fits = tuple(fit_percent(run.y, predicted) for run, predicted in zip(runs, predictions, strict=True))
    spread = sum(float(np.sum((run.y - run.y.mean()) ** 2)) for run in runs)
    aic, bic = information_criteria(state.cost, readings, free, readings / tested.readings_per_independent)
    return Fit(
        structure,
        state.point,
        covariance,
        white,
        float(np.sqrt(variance)),
        100.0 * (1.0 - float(np.sqrt(state.cost / spread))),
        fits,
        aic,
        bic,
        tested,
        readings,
        state.converged,
        tuple(residuals),
        predictions,
        state.cost,
        free,
    )


def _at_least(white: Array, sandwich: Array, readings_per_independent: float) -> Array:
    """The sandwich, no parameter surer than with white residuals.

    Of parameters that the data hardly hold it is rounding, and no covariance: then white's, of fewer readings.
    """
    sure, coloured = np.diag(white), np.diag(sandwich)
    if np.any(coloured <= SMALLEST_EIGENVALUE * sure):
        return white * readings_per_independent
    keep = np.sqrt(np.maximum(1.0, sure / coloured))
    return np.asarray(sandwich * np.outer(keep, keep))


def simulate(run: Experiment, structure: Structure, point: Point) -> Array:
    """Model output at a run's readings, with the start and offset that suit this run best (as `compare` does)."""
    part = linearise(run, structure, point, np.zeros(structure.order + 1), whole=True)
    normal = normal_equations([part], structure.parameters)
    own = normal.inverse[0] @ normal.own_gradient[0]
    shared = structure.parameters
    return np.asarray(run.y - part.columns[:, -1] + part.columns[:, shared:-1] @ own)
