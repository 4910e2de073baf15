"""Output-error identification: least squares on the simulated output, one or several runs jointly.

Gauss-Newton with Levenberg's damping on exact derivatives (`response.py`). What the runs share are the log
coefficients, the gain and the delay; each run has its own start and offset, which are eliminated run by run
(Schur complement), so the work grows linearly with the runs. Several starts are compared, the better
ones get some iterations, the best is finished.

For white residuals this is the maximum-likelihood estimate, and its covariance sigma^2 (J'J)^-1 the Cramer-Rao
bound. Residuals that are not white get the sandwich with their own autocovariance in place of J'J.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flownav.errors import InputError
from flownav.identification import starting_points
from flownav.identification.experiment import Experiment
from flownav.identification.response import delayed, lay_grid, response
from flownav.identification.statistics import (
    Whiteness,
    coloured_information,
    fit_percent,
    information_criteria,
    whiteness,
)
from flownav.measurement import Array

HIGHEST_ORDER = 6
DELAY_RANGE_S = (-0.1, 0.6)
FINALISTS = 2  # starts that get
HEAT_ITERATIONS = 2  # iterations each, before the best is finished
MOST_ITERATIONS = 60
CONVERGED = 1e-2  # predicted fall of the cost in residual variances: the step that makes it is the last
MOST_DAMPING = 1e8
START_WEIGHT = 1e-4  # of the belief that a run starts at rest, against one reading's of 1
START_TIME_S = 0.1  # unit of a start's rates
SMALLEST_EIGENVALUE = 1e-14
STIFFEST = 100.0  # rate x step of a model that is tried: faster ones cannot be told from none
LARGEST_PRODUCT = 1e60  # of an unstable model: it has no cost


class Structure(NamedTuple):
    """Which model: order 0 is gain and delay alone; `delay` adds a pure delay to dynamics."""

    order: int
    delay: bool = False
    held: bool = False  # input by zero-order hold instead of straight lines between its samples

    @property
    def has_delay(self) -> bool:
        """Whether the delay is a parameter: always without dynamics."""
        return self.delay or self.order == 0

    @property
    def parameters(self) -> int:
        """Coefficients, gain and delay."""
        return self.order + 1 + (1 if self.has_delay else 0)

    @property
    def label(self) -> str:
        """As the command line names it."""
        return "delay" if self.order == 0 else f"{self.order}{'+delay' if self.delay else ''}"


class Point(NamedTuple):
    """Shared parameters. log_a (n,): log a_1 .. log a_n; delay_s is 0 where it is not a parameter."""

    log_a: Array
    gain: float
    delay_s: float

    def moved(self, step: Array, structure: Structure) -> Point:
        """The point after a step in (log a, gain, delay)."""
        n = structure.order
        delay = min(max(self.delay_s + float(step[n + 1]), DELAY_RANGE_S[0]), DELAY_RANGE_S[1]) if (
            structure.has_delay
        ) else 0.0
        return Point(self.log_a + np.clip(step[:n], -1.5, 1.5), self.gain + float(step[n]), delay)


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
        return information_criteria(
            self.cost, self.readings, self.unknowns, self.readings / readings_per_independent
        )


def fit(experiments: Sequence[Experiment], structure: Structure, starts: Sequence[Point] | None = None) -> Fit:
    """The least-squares model of one or several runs.

    starts: where to begin; from the runs' own gain and delay where None. InputError where a run is too short for
    the delays considered, or no start leads to a stable model.
    """
    if not experiments:
        raise InputError("no experiment to identify from; give a log")
    if not 0 <= structure.order <= HIGHEST_ORDER:
        raise InputError(f"order {structure.order}: 0 (gain and delay) to {HIGHEST_ORDER} are possible")
    runs = [run.within(DELAY_RANGE_S) for run in experiments]
    if starts is None:
        starts = starting_points.points(runs, structure, DELAY_RANGE_S)
        if structure.order > 2:
            lower = fit(experiments, structure._replace(order=structure.order - 1)).point
            starts = [*starts, lower._replace(log_a=starting_points.with_fast_pole(lower.log_a))]
    states = sorted((_begin(runs, structure, start) for start in starts), key=_by_cost)
    hopeful = [_descend(runs, structure, state, HEAT_ITERATIONS) for state in states[:FINALISTS]]
    state = _descend(runs, structure, min(hopeful, key=_by_cost), MOST_ITERATIONS)
    if not np.isfinite(state.cost):
        raise InputError(f"{runs[0].name}: no stable model of order {structure.label} fits; try a lower order")
    return _finish(runs, structure, state)


class _Linearised(NamedTuple):
    """Derivatives by the shared parameters, by start and offset, then the residual."""

    columns: Array  # (m, k), or (1, k) where only their products are needed
    products: Array  # columns' columns


class _State(NamedTuple):
    point: Point
    nuisance: list[Array]  # by run: start and offset
    parts: list[_Linearised]
    cost: float
    converged: bool


def _linearise(
    run: Experiment, structure: Structure, point: Point, nuisance: Array, whole: bool = False
) -> _Linearised:
    n = structure.order
    width = structure.parameters + n + 2
    if n and _stiffness(point) * run.longest_step_s > STIFFEST:
        return _Linearised(np.zeros((0, width)), np.full((width, width), np.inf))
    grid = lay_grid(run.t_u, run.t_y, point.delay_s, run.between)
    columns, sums = np.empty((len(run.t_y) if whole else 1, width)), np.zeros((width, width))
    if n:
        response(
            (0,) * n, run.t_u, run.u, structure.held, grid, point.log_a, point.gain, structure.delay,
            nuisance, run.y, columns, sums,
        )  # fmt: skip
    else:
        delayed(run.t_u, run.u, structure.held, grid, point.gain, float(nuisance[0]), run.y, columns, sums)
    return _Linearised(columns, _with_prior(sums, structure, nuisance))


def _stiffness(point: Point) -> float:
    """A bound on the model's fastest rate [1/s]."""
    n = len(point.log_a)
    return float(np.max(np.exp(point.log_a / np.arange(1.0, n + 1.0)))) * n


def _with_prior(sums: Array, structure: Structure, nuisance: Array) -> Array:
    """The sums with a very weak belief that a run starts near rest: most runs forget their start unread."""
    n, first = structure.order, structure.parameters
    weight = START_WEIGHT * START_TIME_S ** (2.0 * np.arange(n))
    start = np.arange(first, first + n)
    sums[start, start] += weight
    sums[start, -1] -= weight * nuisance[:n]
    sums[-1, start] -= weight * nuisance[:n]
    sums[-1, -1] += float(weight @ nuisance[:n] ** 2)
    return sums


def _linearise_all(
    runs: Sequence[Experiment], structure: Structure, point: Point, nuisance: list[Array], whole: bool = False
) -> list[_Linearised]:
    return [_linearise(run, structure, point, own, whole) for run, own in zip(runs, nuisance, strict=True)]


def _cost(parts: Sequence[_Linearised]) -> float:
    cost = sum(float(part.products[-1, -1]) for part in parts)
    return cost if all(np.abs(part.products).max() < LARGEST_PRODUCT for part in parts) else np.inf


class _Normal(NamedTuple):
    """The normal equations with each run's own unknowns eliminated."""

    matrix: Array
    gradient: Array
    inverse: list[Array]  # of each run's own block
    coupling: list[Array]
    own_gradient: list[Array]


def _normal(parts: Sequence[_Linearised], count: int) -> _Normal:
    """`count` parameters are shared."""
    matrix, gradient = np.zeros((count, count)), np.zeros(count)
    inverse, coupling, own_gradient = [], [], []
    own = slice(count, -1)
    for part in parts:
        block, across, own_part = part.products[own, own], part.products[:count, own], part.products[own, -1]
        inner = _inverse(block)
        matrix += part.products[:count, :count] - across @ inner @ across.T
        gradient += part.products[:count, -1] - across @ inner @ own_part
        inverse.append(inner)
        coupling.append(across)
        own_gradient.append(own_part)
    return _Normal(0.5 * (matrix + matrix.T), gradient, inverse, coupling, own_gradient)


def _solve(matrix: Array, gradient: Array, damping: float) -> Array:
    """The damped step in columns scaled to one."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    values = np.maximum(values, SMALLEST_EIGENVALUE * max(values[-1], 1e-300)) + damping
    return np.asarray(vectors @ ((vectors.T @ (gradient / scale)) / values) / scale)


def _own_steps(normal: _Normal, step: Array) -> list[Array]:
    return [
        inner @ (gradient - across.T @ step)
        for inner, across, gradient in zip(normal.inverse, normal.coupling, normal.own_gradient, strict=True)
    ]


def _predicted_fall(normal: _Normal, step: Array) -> float:
    """By how much the linearised cost falls over a full step."""
    own = zip(_own_steps(normal, step), normal.own_gradient, strict=True)
    return float(step @ normal.gradient) + sum(float(change @ gradient) for change, gradient in own)


def _by_cost(state: _State) -> float:
    return state.cost


def _begin(runs: Sequence[Experiment], structure: Structure, start: Point) -> _State:
    """A start with each run at rest."""
    nuisance = [np.zeros(structure.order + 1) for _ in runs]
    parts = _linearise_all(runs, structure, start, nuisance)
    return _State(start, nuisance, parts, _cost(parts), False)


def _descend(runs: Sequence[Experiment], structure: Structure, state: _State, iterations: int) -> _State:
    """Levenberg-Marquardt from a state, for so many iterations at most."""
    readings, damping = sum(len(run.t_y) for run in runs), 1e-3
    for _ in range(iterations):
        if state.converged or not np.isfinite(state.cost):
            break
        normal = _normal(state.parts, structure.parameters)
        full = _solve(normal.matrix, normal.gradient, 0.0)
        converged = _predicted_fall(normal, full) <= CONVERGED * state.cost / readings
        while damping < MOST_DAMPING:
            step = _solve(normal.matrix, normal.gradient, damping)
            point = state.point.moved(step, structure)
            moved = [own + change for own, change in zip(state.nuisance, _own_steps(normal, step), strict=True)]
            parts = _linearise_all(runs, structure, point, moved)
            if _cost(parts) < state.cost:
                break
            if converged:
                return state._replace(converged=True)
            damping *= 10.0
        else:
            break
        state = _State(point, moved, parts, _cost(parts), converged)
        damping = max(0.1 * damping, 1e-12)
    return state


def _finish(runs: Sequence[Experiment], structure: Structure, state: _State) -> Fit:
    parts = _linearise_all(runs, structure, state.point, state.nuisance, whole=True)
    normal = _normal(parts, structure.parameters)
    residuals = [part.columns[:, -1].copy() for part in parts]
    readings = sum(map(len, residuals))
    free = structure.parameters + len(runs) * (structure.order + 1)
    variance = state.cost / max(1, readings - free)
    inverse = _inverse(normal.matrix)
    tested = whiteness(residuals)
    covariance = white = variance * inverse
    if not tested.white:
        meat = np.zeros_like(inverse)
        for part, inner, across in zip(parts, normal.inverse, normal.coupling, strict=True):
            shared, own, residual = np.split(part.columns, [structure.parameters, -1], axis=1)
            projected = shared - own @ (inner @ across.T)
            meat += coloured_information(projected, residual[:, 0]) * float(residual.var())
        sandwich = inverse @ meat @ inverse
        keep = np.sqrt(np.maximum(1.0, np.diag(white) / np.maximum(np.diag(sandwich), 1e-300)))
        covariance = sandwich * np.outer(keep, keep)
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


def _inverse(matrix: Array) -> Array:
    """The inverse of an information matrix; what it does not hold is very uncertain, not an error."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    values = np.maximum(values, SMALLEST_EIGENVALUE * max(values[-1], 1e-300))
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


def simulate(run: Experiment, structure: Structure, point: Point) -> Array:
    """Model output at a run's readings, with the start and offset that suit this run best (as `compare` does)."""
    part = _linearise(run, structure, point, np.zeros(structure.order + 1), whole=True)
    normal = _normal([part], structure.parameters)
    own = normal.inverse[0] @ normal.own_gradient[0]
    shared = structure.parameters
    return np.asarray(run.y - part.columns[:, -1] + part.columns[:, shared:-1] @ own)
