"""The meaning of a sensor's innovation consistency for its user: harmless, or something to act on."""

from collections.abc import Iterable

import numpy as np

from flownav.scoring.consistency import MODEST_SQUARES

MANY_REFUSED = 0.05  # of a sensor's values outside the gate: chance refuses less than one in a hundred
GOOD, HARMLESS, ACT = "as expected", "harmless", "act"
MEANING = {
    HARMLESS: "the noise that is set for the sensor is large enough. It may be lowered in `--settings` where the "
    "scatter is less; errors that last do not average out.",
    ACT: "the sensor is trusted too much, or does not fit the others: `flownav explain` looks for the cause; where "
    "it finds none, state a larger noise in `--settings`.",
}  # the meaning of each verdict for the estimate's use, and the action to take


def verdict(nis_per_dof: float, *, white: bool, refused: float = 0.0) -> str:
    """A sensor in words: whether something must be done, and the ratio of its errors to the filter's expectation.

    refused: the share of its values, in flight, that lay outside the gate.
    """
    larger = nis_per_dof > MODEST_SQUARES[1]
    phrases = [f"{np.sqrt(nis_per_dof):.1f} times the scatter that the filter expects"] if larger else []
    phrases += [f"{100.0 * refused:.0f} % of it refused in flight"] if refused > MANY_REFUSED else []
    if phrases:
        return f"{ACT}: {', '.join(phrases)}"
    phrases = ["less scatter than the filter expects"] if nis_per_dof < MODEST_SQUARES[0] else []
    phrases += [] if white else ["its errors last"]
    return f"{HARMLESS}: {', '.join(phrases)}" if phrases else GOOD


def meanings(verdicts: Iterable[str]) -> list[str]:
    """The meaning of each verdict and the action to take, a sentence for each that occurs."""
    found = list(verdicts)
    return [
        f"{word}: {meaning}" for word, meaning in MEANING.items() if any(phrases.startswith(word) for phrases in found)
    ]
