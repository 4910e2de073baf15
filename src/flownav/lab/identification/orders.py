"""Which order: fit each, keep those that the input can show whole, and choose by BIC; validate on held-out runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flownav.core.errors import InputError
from flownav.lab.identification.descent import DELAY_RANGE_S, Structure
from flownav.lab.identification.experiment import LEAST_READINGS, Experiment
from flownav.lab.identification.output_error import Fit, fit, simulate
from flownav.lab.identification.quantities import Excitation, excitation
from flownav.lab.identification.starting_points import gain_and_delay
from flownav.lab.identification.statistics import fit_percent

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
        """What the input says of the paper's second-order model, where it was tried; else of the chosen one."""
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
        raise InputError(f"--order {text}: auto, delay, 1 to 6, or an order with +delay (2+delay) is needed")
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
