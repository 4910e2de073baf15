"""One descent: where it starts, the cost's derivatives over all runs, and Levenberg-Marquardt on them.

What the runs share are the log coefficients, the gain and the delay; each run has its own start and offset, which
are eliminated run by run (Schur complement), so the work grows linearly with the runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.lab.identification.experiment import Experiment, lay_grid
from flownav.lab.identification.response import Input, Tried, delayed, response

DELAY_RANGE_S = (-0.1, 0.6)
CONVERGED_FALL = 1e-2  # predicted fall of the cost in residual variances: the step that makes it is the last
MOST_DAMPING = 1e8
LIGHT_DAMPING = 1e-2  # up to which a step that gains next to nothing is the last
START_WEIGHT = 1e-4  # of the belief that a run starts at rest, against one reading's of 1
START_TIME_S = 0.1  # unit of a start's rates
SMALLEST_EIGENVALUE = 1e-14
SMALLEST_DIAGONAL = 1e-100  # beside the largest: far below what any data give, far above what overflows
LEAST_DIAGONAL = 1e-60  # where there is nothing beside it: of data that move by LEAST_MOTION it is more
MOST_STIFFNESS = 100.0  # rate x step of a model that is tried: faster ones cannot be distinguished from none
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
        """The order's name on the command line."""
        return "delay" if self.order == 0 else f"{self.order}{'+delay' if self.delay else ''}"


class Point(NamedTuple):
    """Shared parameters. log_a (n,): log a_1 .. log a_n; delay_s is 0 where it is not a parameter."""

    log_a: Array
    gain: float
    delay_s: float

    def moved(self, step: Array, structure: Structure) -> Point:
        """The point after a step in (log a, gain, delay)."""
        n = structure.order
        delay = (
            min(max(self.delay_s + float(step[n + 1]), DELAY_RANGE_S[0]), DELAY_RANGE_S[1])
            if (structure.has_delay)
            else 0.0
        )
        return Point(self.log_a + np.clip(step[:n], -1.5, 1.5), self.gain + float(step[n]), delay)


class Linearised(NamedTuple):
    """Derivatives by the shared parameters, by start and offset, then the residual."""

    columns: Array  # (m, k), or (1, k) where only their products are needed
    products: Array  # columns' columns


class State(NamedTuple):
    """Where a descent stands."""

    point: Point
    nuisance: list[Array]  # by run: start and offset
    parts: list[Linearised]
    cost: float
    converged: bool


def linearise(run: Experiment, structure: Structure, point: Point, nuisance: Array, whole: bool = False) -> Linearised:
    """Errors and derivatives of one run; `whole` keeps them reading by reading, not their products alone."""
    n = structure.order
    width = structure.parameters + n + 2
    if n and _stiffness(point) * run.longest_step_s > MOST_STIFFNESS:
        return Linearised(np.zeros((0, width)), np.full((width, width), np.inf))
    given = Input(run.t_u, run.u, structure.held)
    grid = lay_grid(run.t_u, run.t_y, point.delay_s, run.between)
    columns, sums = np.empty((len(run.t_y) if whole else 1, width)), np.zeros((width, width))
    if n:
        tried = Tried(point.log_a, point.gain, structure.delay, nuisance)
        response((0,) * n, given, grid, tried, run.y, columns, sums)
    else:
        delayed(given, grid, point.gain, float(nuisance[0]), run.y, columns, sums)
    return Linearised(columns, _with_prior(sums, structure, nuisance))


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


def linearise_all(
    runs: Sequence[Experiment], structure: Structure, point: Point, nuisance: list[Array], whole: bool = False
) -> list[Linearised]:
    """`linearise` of each run."""
    return [linearise(run, structure, point, own, whole) for run, own in zip(runs, nuisance, strict=True)]


def cost_of(parts: Sequence[Linearised]) -> float:
    """Sum of squared errors over the runs; infinite for an unstable model."""
    cost = sum(float(part.products[-1, -1]) for part in parts)
    return cost if all(np.abs(part.products).max() < LARGEST_PRODUCT for part in parts) else np.inf


class Normal(NamedTuple):
    """The normal equations with each run's own unknowns eliminated."""

    matrix: Array
    gradient: Array
    inverse: list[Array]  # of each run's own block
    coupling: list[Array]
    own_gradient: list[Array]


def normal_equations(parts: Sequence[Linearised], count: int) -> Normal:
    """`count` parameters are shared."""
    matrix, gradient = np.zeros((count, count)), np.zeros(count)
    inverse, coupling, own_gradient = [], [], []
    own = slice(count, -1)
    for part in parts:
        block, across, own_part = part.products[own, own], part.products[:count, own], part.products[own, -1]
        inner = inverse_of(block)
        matrix += part.products[:count, :count] - across @ inner @ across.T
        gradient += part.products[:count, -1] - across @ inner @ own_part
        inverse.append(inner)
        coupling.append(across)
        own_gradient.append(own_part)
    return Normal(0.5 * (matrix + matrix.T), gradient, inverse, coupling, own_gradient)


def _solve(matrix: Array, gradient: Array, damping: float) -> Array:
    """The damped step in columns scaled to one."""
    scale, values, vectors = _scaled(matrix)
    return np.asarray(vectors @ ((vectors.T @ (gradient / scale)) / (values + damping)) / scale)


def _scaled(matrix: Array) -> tuple[Array, Array, Array]:
    """Scales of the columns, and eigenvalues and eigenvectors of the matrix in columns scaled to one.

    Neither a scale nor an eigenvalue is nothing beside the largest: what a matrix does not hold is very uncertain.
    """
    diagonal = np.diag(matrix)
    scale = np.sqrt(np.maximum(diagonal, max(SMALLEST_DIAGONAL * float(diagonal.max(initial=0.0)), LEAST_DIAGONAL)))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return scale, np.maximum(values, SMALLEST_EIGENVALUE * max(values[-1], 1.0)), vectors


def _own_steps(normal: Normal, step: Array) -> list[Array]:
    return [
        inner @ (gradient - across.T @ step)
        for inner, across, gradient in zip(normal.inverse, normal.coupling, normal.own_gradient, strict=True)
    ]


def _predicted_fall(normal: Normal, step: Array) -> float:
    """By how much the linearised cost falls over a full step."""
    own = zip(_own_steps(normal, step), normal.own_gradient, strict=True)
    return float(step @ normal.gradient) + sum(float(change @ gradient) for change, gradient in own)


def by_cost(state: State) -> float:
    """For sorting."""
    return state.cost


def begin(runs: Sequence[Experiment], structure: Structure, start: Point) -> State:
    """A start with each run at rest."""
    nuisance = [np.zeros(structure.order + 1) for _ in runs]
    parts = linearise_all(runs, structure, start, nuisance)
    return State(start, nuisance, parts, cost_of(parts), False)


def descend(runs: Sequence[Experiment], structure: Structure, state: State, iterations: int) -> State:
    """Levenberg-Marquardt from a state, for at most `iterations` iterations."""
    readings, damping = sum(len(run.t_y) for run in runs), 1e-3
    for _ in range(iterations):
        if state.converged or not np.isfinite(state.cost):
            break
        normal = normal_equations(state.parts, structure.parameters)
        full = _solve(normal.matrix, normal.gradient, 0.0)
        converged = _predicted_fall(normal, full) <= CONVERGED_FALL * state.cost / readings
        while damping < MOST_DAMPING:
            step = _solve(normal.matrix, normal.gradient, damping)
            point = state.point.moved(step, structure)
            moved = [own + change for own, change in zip(state.nuisance, _own_steps(normal, step), strict=True)]
            parts = linearise_all(runs, structure, point, moved)
            if cost_of(parts) < state.cost:
                break
            if converged:
                return state._replace(converged=True)
            damping *= 10.0
        else:
            break
        small = state.cost - cost_of(parts) <= CONVERGED_FALL * state.cost / readings and damping <= LIGHT_DAMPING
        state = State(point, moved, parts, cost_of(parts), converged or small)
        damping = max(0.1 * damping, 1e-12)
    return state


def inverse_of(matrix: Array) -> Array:
    """The inverse of an information matrix; what it does not hold is very uncertain, not an error."""
    scale, values, vectors = _scaled(matrix)
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


# -- where the fits start ----------------------------------------------------------------------------------------
DELAY_STEPS = 71
COMPARED_READINGS = 1000  # of a run, that the delays are compared on
SHORTEST_LAG_S = 2e-3
FAST_POLE = 4.0


def points(guess: tuple[float, float], structure: Structure) -> list[Point]:
    """Starts for a structure from a gain and a delay, the delay split between dynamics and a pure one."""
    gain, delay_s = guess
    if structure.order == 0:
        return [Point(np.zeros(0), gain, delay_s)]
    lag_s = max(delay_s, SHORTEST_LAG_S)
    if not structure.delay:
        lags = [(shape, lag_s * factor, 0.0) for shape in (critical, butterworth) for factor in (1.0, 0.4)]
    else:
        lags = [(shape, max(lag_s * share, SHORTEST_LAG_S), lag_s * (1.0 - share))
                for shape in (critical, butterworth) for share in (0.8, 0.3)]  # fmt: skip
    return [Point(np.log(shape(structure.order, lag)), gain, rest) for shape, lag, rest in lags]


def gain_and_delay(runs: Sequence[Experiment], delay_range_s: tuple[float, float]) -> tuple[float, float]:
    """The gain and the delay on a grid that explain most, by regression of each run on its shifted input."""
    best = (0.0, 1.0, 0.0)
    thin = [(run, slice(None, None, max(1, len(run.t_y) // COMPARED_READINGS))) for run in runs]
    for delay_s in np.linspace(*delay_range_s, DELAY_STEPS):
        across, along = 0.0, 1e-300
        for run, some in thin:
            shifted = np.interp(run.t_y[some] - delay_s, run.t_u, run.u)
            shifted -= shifted.mean()
            across += float(shifted @ run.y[some])
            along += float(shifted @ shifted)
        best = max(best, (across * across / along, across / along, float(delay_s)))
    return best[1] or 1e-3, best[2]


def critical(order: int, lag_s: float) -> Array:
    """a_1 .. a_n of (s + n/lag)^n: equal real poles."""
    return np.asarray(np.poly(np.full(order, -order / lag_s))[1:])


def butterworth(order: int, lag_s: float) -> Array:
    """a_1 .. a_n of the Butterworth polynomial whose slow delay a_{n-1}/a_n is the lag."""
    angles = np.pi * (2.0 * np.arange(1, order + 1) + order - 1.0) / (2.0 * order)
    unit = np.poly(np.exp(1j * angles)).real
    rate = unit[-2] / lag_s
    return np.asarray(unit[1:] * rate ** np.arange(1.0, order + 1.0))


def with_fast_poles(log_a: Array, order: int) -> Array:
    """Dynamics with more real poles, FAST_POLE times as fast as the model's own rate and up."""
    rate = float(np.exp(log_a[-1] / len(log_a)))
    whole = np.concatenate([[1.0], np.exp(log_a)])
    for extra in range(order - len(log_a)):
        whole = np.convolve(whole, [1.0, (FAST_POLE + extra) * rate])
    return np.asarray(np.log(whole[1:]))
