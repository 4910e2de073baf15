"""Output-error identification: least squares on the simulated output, one or several runs jointly.

Gauss-Newton with Levenberg's damping (`descent`) on exact derivatives (`response`). Several starts are compared,
the better ones get some iterations, the best is finished.

For white residuals this is the maximum-likelihood estimate, and its covariance sigma^2 (J'J)^-1 the Cramer-Rao
bound. Residuals that are not white get the sandwich with their own autocovariance in place of J'J.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.lab.identification import descent
from flownav.lab.identification.descent import Point as Point
from flownav.lab.identification.descent import Structure as Structure
from flownav.lab.identification.experiment import Experiment

Z_95 = 1.959963984540054
WHITENESS_LAGS = 25


class Whiteness(NamedTuple):
    """Ljung-Box test of the residuals. `white`: not rejected at 1 %; readings_per_independent: 1 where white."""

    statistic: float
    lags: int
    p_value: float
    white: bool
    readings_per_independent: float


def fit_percent(measured: Array, predicted: Array) -> float:
    """100 (1 - |y - yhat| / |y - mean(y)|): the normalised root-mean-square fit of MATLAB's `compare`."""
    spread = float(measured.std())
    return 100.0 * (1.0 - math.sqrt(float(np.mean((measured - predicted) ** 2))) / spread) if spread else -math.inf


def information_criteria(cost: float, readings: int, parameters: int, independent: float) -> tuple[float, float]:
    """(AIC, BIC) of a least-squares fit; `independent` readings count, which coloured residuals make fewer.

    N log(cost/N) + 2 k and N log(cost/N) + k log N (Ljung 1999, section 16.4).
    """
    level = independent * math.log(max(cost, 1e-300) / readings)
    return level + 2.0 * parameters, level + parameters * math.log(max(independent, 2.0))


def autocorrelation(residual: Array, lags: int) -> Array:
    """(lags + 1,) from lag 0, which is 1."""
    centred = residual - residual.mean()
    lags = min(lags, len(centred) - 1)
    size = 1 << (2 * len(centred) - 1).bit_length()
    spectrum = np.fft.rfft(centred, size)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, size)[: lags + 1]
    return np.asarray(covariance / covariance[0] if covariance[0] > 0.0 else np.eye(1, lags + 1)[0])


def whiteness(residuals: list[Array]) -> Whiteness:
    """The test over several runs: their statistics and degrees of freedom add up."""
    statistic, degrees, weight, inflation = 0.0, 0, 0, 0.0
    for residual in residuals:
        lags = min(WHITENESS_LAGS, len(residual) // 5)
        rho = autocorrelation(residual, lags)
        count = len(residual)
        statistic += count * (count + 2) * float(np.sum(rho[1:] ** 2 / (count - np.arange(1, len(rho)))))
        degrees += len(rho) - 1
        inflation += count * float(np.sum(correlation_window(residual) * 2.0)) - count
        weight += count
    p_value = chi_square_tail(statistic, degrees)
    white = p_value > 0.01
    return Whiteness(statistic, degrees, p_value, white, 1.0 if white else max(1.0, inflation / weight))


def correlation_window(residual: Array) -> Array:
    """Autocorrelation from lag 0, tapered (Parzen) to zero at four times the lag where it first dies out.

    It dies out where it stays within two standard errors of zero for five lags.
    """
    longest = max(5, len(residual) // 8)
    rho = autocorrelation(residual, longest)
    small = np.abs(rho) < 2.0 / math.sqrt(len(residual))
    runs = np.convolve(small[1:], np.ones(5), "valid") >= 5 if len(small) > 6 else np.zeros(0, bool)
    dies = int(np.argmax(runs)) + 1 if runs.any() else longest // 4
    length = min(max(4 * dies, 4), len(rho) - 1)
    x = np.arange(length + 1) / length
    taper = np.where(x <= 0.5, 1.0 - 6.0 * x**2 * (1.0 - x), 2.0 * (1.0 - x) ** 3)
    return np.asarray(rho[: length + 1] * taper)


def coloured_information(jacobian: Array, residual: Array) -> Array:
    """J' R J / sigma^2 with R the residual's own autocovariance: what replaces J'J for coloured residuals."""
    window = correlation_window(residual)
    size = 1 << (len(jacobian) + len(window)).bit_length()
    kernel = np.zeros(size)
    kernel[: len(window)] = window
    kernel[-len(window) + 1 :] = window[:0:-1]
    spectrum = np.fft.rfft(jacobian, size, axis=0)
    filtered = np.fft.irfft(spectrum * np.fft.rfft(kernel)[:, None], size, axis=0)[: len(jacobian)]
    information = jacobian.T @ filtered
    return np.asarray(0.5 * (information + information.T))


def chi_square_tail(statistic: float, degrees: int) -> float:
    """P(chi-square > statistic), Wilson and Hilferty: good to 6e-3 from 3 degrees on, to 1e-3 below 0.05."""
    if degrees <= 0:
        return 1.0
    spread = 2.0 / (9.0 * degrees)
    z = ((statistic / degrees) ** (1.0 / 3.0) - (1.0 - spread)) / math.sqrt(spread)
    return 0.5 * math.erfc(z / math.sqrt(2.0))


# -- the fit -----------------------------------------------------------------------------------------------------
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
    runs = [run.within(descent.DELAY_RANGE_S) for run in experiments]
    if starts is None:
        guess = guess or descent.gain_and_delay(runs, descent.DELAY_RANGE_S)
        starts = descent.points(guess, structure)
        if structure.order > 2:
            second = fit(experiments, structure._replace(order=2), guess=guess).point
            starts = [*starts, second._replace(log_a=descent.with_fast_poles(second.log_a, structure.order))]
    states = sorted((descent.begin(runs, structure, start) for start in starts), key=descent.by_cost)
    hopeful = [descent.descend(runs, structure, state, HEAT_ITERATIONS) for state in states[:FINALISTS]]
    state = descent.descend(runs, structure, min(hopeful, key=descent.by_cost), MOST_ITERATIONS)
    if not np.isfinite(state.cost):
        raise InputError(f"{runs[0].name}: no stable model of order {structure.label} fits; try a lower order")
    return _finish(runs, structure, state)


def _finish(runs: Sequence[Experiment], structure: Structure, state: descent.State) -> Fit:
    parts = descent.linearise_all(runs, structure, state.point, state.nuisance, whole=True)
    normal = descent.normal_equations(parts, structure.parameters)
    residuals = [part.columns[:, -1].copy() for part in parts]
    readings = sum(map(len, residuals))
    free = structure.parameters + len(runs) * (structure.order + 1)
    variance = state.cost / max(1, readings - free)
    inverse = descent.inverse_of(normal.matrix)
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
    if np.any(coloured <= descent.SMALLEST_EIGENVALUE * sure):
        return white * readings_per_independent
    keep = np.sqrt(np.maximum(1.0, sure / coloured))
    return np.asarray(sandwich * np.outer(keep, keep))


def simulate(run: Experiment, structure: Structure, point: Point) -> Array:
    """Model output at a run's readings, with the start and offset that suit this run best (as `compare` does)."""
    part = descent.linearise(run, structure, point, np.zeros(structure.order + 1), whole=True)
    normal = descent.normal_equations([part], structure.parameters)
    own = normal.inverse[0] @ normal.own_gradient[0]
    shared = structure.parameters
    return np.asarray(run.y - part.columns[:, -1] + part.columns[:, shared:-1] @ own)
