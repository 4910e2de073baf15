"""The unknown of a law by Gauss-Newton from responses to a set-point, and how sure they are.

Each line weighs by the inverse variance of what noise leaves in it: of the scatter of the windows about their mean
response, shaped over the lines as the learning in hover has it (gusts leave the more the slower they are), and grown by
what neighbouring windows share: residuals of any colour are independent between lines, so that the intervals need no
whiteness. Where the law leaves more than the scatter explains, the intervals grow by that.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from flownav.control.learning import line_weights
from flownav.core.measurement import Array
from flownav.lab.identification.axis_laws import AxisResponse, Left
from flownav.lab.identification.excited import Spectra, excited_only, overlap_factor, responses

ROUNDS = 40
SETTLED = 1e-9
LONGEST_STEP = 0.5  # of a logarithm in one round
UNKNOWN = 3.0  # standard deviation before, of a logarithm of which nothing is stated

Law = Callable[[AxisResponse, Array], Left]


class Axis(NamedTuple):
    """One axis' spectra (signals own, other, command) and its law of the unknown."""

    spectra: Spectra
    law: Law


class Solution(NamedTuple):
    """The unknown (n,), their covariance with `before` in it, and Student's factor of a 95 % interval."""

    x: Array
    covariance: Array
    factor: float
    misfit: float  # the law's rest over what the scatter explains, in squares; 1: nothing is left unexplained


def solved(axes: Sequence[Axis], before: Sequence[float]) -> Solution:
    """The unknown that leave least of the responses. before: standard deviation of each about 0; 0: it is held."""
    free = [i for i, each in enumerate(before) if each > 0.0]
    prior = np.array([1.0 / before[i] ** 2 for i in free])
    x = np.zeros(len(before))
    seen = [_response(axis.spectra) for axis in axes]
    variances = [np.ones(len(response.own)) for response in seen]
    for outer in range(3):
        for _ in range(ROUNDS):
            normal, slope = np.diag(prior), prior * x[free]
            for axis, response, variance in zip(axes, seen, variances, strict=True):
                left = axis.law(response, x)
                slopes = left.slopes[:, free]
                scale = 1.0 if outer else 1.0 / max(float(np.mean(np.abs(response.command) ** 2)), 1e-300)
                normal = normal + scale * np.real(np.conj(slopes).T @ (slopes / variance[:, None]))
                slope = slope + scale * np.real(np.conj(slopes).T @ (left.rest / variance))
            step = np.clip(np.linalg.solve(normal, slope), -LONGEST_STEP, LONGEST_STEP)
            x[free] -= step
            if np.abs(step).max(initial=0.0) < SETTLED:
                break
        noise = [_noise(axis, response, x) for axis, response in zip(axes, seen, strict=True)]
        variances = [found.variance for found in noise]
    return _with_intervals(axes, seen, noise, x, free, prior)


class Noise(NamedTuple):
    """Of one axis: variance of either part of a line's rest (m,), and the readings that it rests on."""

    variance: Array
    degrees: float


def _response(found: Spectra) -> AxisResponse:
    averaged = responses(found)
    return AxisResponse(averaged.w_rad_s, *(averaged.signals[name] for name in ("own", "other", "command")))


def _noise(axis: Axis, response: AxisResponse, x: Array) -> Noise:
    """The scatter of the windows' rests about that of their mean."""
    found = excited_only(axis.spectra)
    energy = np.sum(np.abs(found.setpoint) ** 2, axis=0)
    shares = np.abs(found.setpoint) ** 2 / energy
    mean, power = axis.law(response, x).rest, np.zeros(len(energy))
    for row, share in enumerate(shares):
        one = AxisResponse(found.w_rad_s, *(found.signals[name][row] for name in ("own", "other", "command")))
        power += share * np.abs(axis.law(one, x).rest - found.setpoint[row] * mean) ** 2
    lost = np.minimum(np.sum(shares**2, axis=0), 0.5)  # of the scatter, by the mean that is taken off
    shape = 1.0 / line_weights(found.w_rad_s) ** 2
    smooth = shape * np.mean(power / (1.0 - lost) / shape)
    independent = float(np.sum(1.0 / lost - 1.0))
    return Noise(0.5 * smooth * overlap_factor(found) / energy, 2.0 * independent)


def _with_intervals(
    axes: Sequence[Axis],
    seen: Sequence[AxisResponse],
    noise: Sequence[Noise],
    x: Array,
    free: Sequence[int],
    prior: Array,
) -> Solution:
    normal, rest, lines = np.diag(prior), 0.0, 0
    for axis, response, found in zip(axes, seen, noise, strict=True):
        left = axis.law(response, x)
        slopes = left.slopes[:, free]
        normal = normal + np.real(np.conj(slopes).T @ (slopes / found.variance[:, None]))
        rest += float(np.sum(np.abs(left.rest) ** 2 / found.variance))
        lines += len(response.own)
    over = max(2 * lines - int(np.sum(np.sqrt(1.0 / prior) >= UNKNOWN)), 1)
    degrees = sum(found.degrees for found in noise)
    misfit = rest / over
    grown = max(1.0, misfit)
    covariance = np.zeros((len(x), len(x)))
    informed = np.linalg.inv((normal - np.diag(prior)) / grown + np.diag(prior))
    covariance[np.ix_(free, free)] = informed
    return Solution(x, covariance, float(stats.t.ppf(0.975, over + degrees)), misfit)
