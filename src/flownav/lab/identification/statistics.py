"""How good a fit is: MATLAB's fit, information criteria, whiteness, and intervals that coloured residuals widen."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array

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
