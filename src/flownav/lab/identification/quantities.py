"""Quantities of a fitted model, each with its interval; what the input shows of it, and which order to choose.

The latency is the delay of a slow signal, T + a_{n-1}/a_n: the one number that gain and delay models, the paper's
second-order ones (b/c) and an autopilot's delay parameter share.

Excitation. The covariance of the fit, in relative units (log coefficients, gain over its value, delay over the
latency), has as many directions as the model has parameters. A direction counts as identified where its standard
deviation is at most 5 % and no more than 50 times that of the best-determined one: the first shows that the log is long
and quiet enough, the second that the input, whatever its length, distinguishes the direction. A pendulum's single tone
passes for two directions, gain and latency, and no more (persistence of excitation of order two); its residual then
supports many triplets (a, b, c) equally, as the paper's Table 1 shows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array
from flownav.lab.identification.descent import DELAY_RANGE_S, Point, Structure, gain_and_delay
from flownav.lab.identification.experiment import LEAST_READINGS, Experiment
from flownav.lab.identification.output_error import Z_95, Fit, fit, fit_percent, simulate

LARGEST_SPREAD = 0.05
LARGEST_RATIO = 50.0
SMALLEST_LATENCY_S = 0.005  # relative to no less than this


class Interval(NamedTuple):
    """A value and its 95 % interval."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, value: float, sigma: float) -> Interval:
        """The interval of a normal estimate."""
        return cls(value, value - Z_95 * sigma, value + Z_95 * sigma)

    @classmethod
    def of_log(cls, value: float, sigma: float) -> Interval:
        """The interval of a positive value whose logarithm is the normal one, with standard deviation sigma."""
        spread = float(np.exp(min(Z_95 * sigma, 50.0)))
        return cls(value, value / spread, value * spread)


class Excitation(NamedTuple):
    """How many of a model's parameters the input shows. spreads: relative standard deviation of each direction."""

    parameters: int
    identifiable: int
    verdict: str
    spreads: tuple[float, ...]

    @property
    def complete(self) -> bool:
        """Whether every parameter is identified."""
        return self.identifiable == self.parameters


def latency_s(point: Point) -> float:
    """Delay of a slow signal: T + a_{n-1}/a_n (1/a_1 where n = 1)."""
    return point.delay_s + _lag_s(point.log_a)


def _lag_s(log_a: Array) -> float:
    if len(log_a) == 0:
        return 0.0
    before = float(log_a[-2]) if len(log_a) > 1 else 0.0
    return float(np.exp(before - log_a[-1]))


def gain(fit: Fit) -> Interval:
    """K, output over input at rest."""
    n = fit.structure.order
    return Interval.of(fit.point.gain, float(np.sqrt(fit.covariance[n, n])))


def latency(fit: Fit) -> Interval:
    """Interval of `latency_s` by its derivatives."""
    return _by_derivative(fit, latency_s)


def coefficients(fit: Fit) -> list[Interval]:
    """a_1 .. a_n."""
    sigmas = np.sqrt(np.diag(fit.covariance)[: fit.structure.order])
    return [Interval.of_log(float(np.exp(c)), float(s)) for c, s in zip(fit.point.log_a, sigmas, strict=True)]


def numerator(fit: Fit) -> Interval:
    """K a_n: the paper's `a`."""
    n, point = fit.structure.order, fit.point
    sigmas = np.zeros(len(fit.covariance))
    sigmas[n] = 1.0 / point.gain
    if n:
        sigmas[n - 1] = 1.0
    value = point.gain * (float(np.exp(point.log_a[-1])) if n else 1.0)
    return Interval.of_log(value, float(np.sqrt(sigmas @ fit.covariance @ sigmas)))


def excitation(fit: Fit) -> Excitation:
    """The verdict, see above."""
    n = fit.structure.order
    names = _names(fit)
    unit = np.ones(len(names))
    unit[n] = 1.0 / abs(fit.point.gain)
    if fit.structure.has_delay:
        unit[n + 1] = 1.0 / max(abs(latency_s(fit.point)), SMALLEST_LATENCY_S)
    relative = fit.covariance * np.outer(unit, unit)
    spreads = np.sqrt(np.maximum(np.linalg.eigvalsh(relative), 0.0))
    shown = (spreads <= LARGEST_SPREAD) & (spreads <= LARGEST_RATIO * spreads[0])
    count = int(np.count_nonzero(shown))
    return Excitation(len(names), count, _sentence(names, count), tuple(float(s) for s in spreads))


def _names(fit: Fit) -> list[str]:
    """The parameters in the order in which a slow, then a faster input shows them."""
    order, delay = fit.structure.order, fit.structure.delay
    if order < 2:
        rest = ["time constant"] if order and delay else []
    elif order == 2:
        rest = ["natural frequency and damping", *(["pure delay"] if delay else [])]
    else:
        rest = [f"coefficient {i} of order {order}" for i in range(1, order)] + (["pure delay"] if delay else [])
    return ["gain", "latency", *rest]


def _sentence(names: list[str], count: int) -> str:
    if count == len(names):
        return f"the input excites all {count} parameters: {_listed(names)}"
    if count == 0:
        return f"the log fixes none of {len(names)} parameters to 5 %: take {_listed(names[:2])} with their intervals"
    verb = "is" if count == 1 else "are"
    lacking = names[count:]
    plural = len(lacking) > 1 or " and " in lacking[0]
    return (
        f"the input excites {count} of {len(names)} parameters: {_listed(names[:count])} {verb} reported, "
        f"{_listed(lacking)} {'are' if plural else 'is'} not identifiable from this log"
    )


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _by_derivative(fit: Fit, quantity: Callable[[Point], float]) -> Interval:
    """Interval of a function of the shared parameters, by central differences of it (it is smooth and cheap)."""
    n, size = fit.structure.order, len(fit.covariance)
    gradient = np.zeros(size)
    for i in range(size):
        step = np.zeros(n + 2)
        step[i] = 1e-6
        gradient[i] = (quantity(_shifted(fit.point, step)) - quantity(_shifted(fit.point, -step))) / 2e-6
    variance = float(gradient @ fit.covariance @ gradient)
    return Interval.of(quantity(fit.point), float(np.sqrt(max(variance, 0.0))))


def _shifted(point: Point, step: Array) -> Point:
    n = len(point.log_a)
    return Point(point.log_a + step[:n], point.gain + float(step[n]), point.delay_s + float(step[n + 1]))


# -- which order -------------------------------------------------------------------------------------------------
CANDIDATES = tuple(Structure(order, delay) for order, delay in ((0, False), (1, False), (1, True), (2, False),
                                                                (2, True), (3, False)))  # fmt: skip
HELD_OUT_SHARE = 1.0 / 3.0


@dataclass(frozen=True)
class Choice:
    """The chosen model, its verdict, and all that were tried, in the order tried."""

    best: Fit
    excitation: Excitation
    tried: tuple[tuple[Fit, Excitation], ...]

    @property
    def widest(self) -> Excitation:
        """Excitation of the paper's second-order model, where it was tried; else of the chosen one."""
        return next((shown for model, shown in self.tried if model.structure == Structure(2)), self.excitation)


def choose(experiments: Sequence[Experiment], candidates: Sequence[Structure] = CANDIDATES) -> Choice:
    """The model of least BIC among those whose every parameter the input shows; gain and delay where none is."""
    tried = []
    guess = gain_and_delay([run.within(DELAY_RANGE_S) for run in experiments], DELAY_RANGE_S)
    for structure in candidates:
        model = fit(experiments, structure, guess=guess)
        tried.append((model, excitation(model)))
    shown = [pair for pair in tried if pair[1].complete] or tried[:1]
    colour = min(tried, key=lambda pair: pair[0].cost)[0].whiteness.readings_per_independent
    best, verdict = min(shown, key=lambda pair: pair[0].criteria(colour)[1])
    return Choice(best, verdict, tuple(tried))


def parse_order(text: str) -> tuple[Structure, ...]:
    """`auto`, `delay`, `1` to `6`, or an order with `+delay`. InputError otherwise."""
    if text == "auto":
        return CANDIDATES
    if text == "delay":
        return (Structure(0),)
    order, plus, delay = text.partition("+")
    if not order.isdigit() or not 1 <= int(order) <= 6 or (plus and delay != "delay"):
        raise InputError(f"{arg('order')} {text}: auto, delay, 1 to 6, or an order with +delay (2+delay) is needed")
    return (Structure(int(order), bool(plus)),)


def cross_validation(experiments: Sequence[Experiment], model: Fit) -> tuple[float, ...]:
    """Fit per cent on what the model has not seen: each run in turn, or the last third of a single one.

    The start of the unseen run is estimated, as `compare` does; nothing else is. model: the fit to all runs, where the
    others start from. NaN where too little is left.
    """
    structure, starts = model.structure, [model.point]
    if len(experiments) == 1:
        run = experiments[0].within(DELAY_RANGE_S)
        cut = run.t_y[int(len(run.t_y) * (1.0 - HELD_OUT_SHARE))]
        seen, unseen = run.between_times(-np.inf, cut), run.between_times(cut, np.inf)
        if len(seen.t_y) < LEAST_READINGS or len(unseen.t_y) < LEAST_READINGS or np.ptp(seen.y) == 0.0:
            return (float("nan"),)
        return (_unseen_fit(fit([seen], structure, starts), _from(unseen, cut)),)
    return tuple(
        _unseen_fit(fit([*experiments[:i], *experiments[i + 1 :]], structure, starts), run.within(DELAY_RANGE_S))
        for i, run in enumerate(experiments)
    )


def _unseen_fit(model: Fit, run: Experiment) -> float:
    return fit_percent(run.y, simulate(run, model.structure, model.point))


def _from(run: Experiment, start_s: float) -> Experiment:
    """The run with input from one delay range before `start_s` on, so that its start can be estimated."""
    first = max(0, int(np.searchsorted(run.t_u, start_s - DELAY_RANGE_S[1])) - 1)
    return run.from_input(first)
