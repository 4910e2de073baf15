"""Flights as points of a space of standard normals, and the walk among those beyond a level.

A flight is what was drawn for it: the numbers drawn once (dispersed inputs, what its sensors are and how they start),
kept as they are, and the noise of every epoch, which nobody keeps: a flight holds the number of the stream that its
noise comes from, one for each span of KEYED_EPOCHS epochs. A walk's step moves both a little and in such a way that,
were there no level, all flights would stay as probable as they are (Neal, "Regression and classification using
Gaussian process priors", 1998; Papaioannou et al., Probabilistic Engineering Mechanics 41, 2015): the numbers z become
(1 - s) z + sqrt(1 - (1 - s)^2) xi, and each stream is, by the chance s, a new one. Noise of so many independent draws
thereby keeps the correlation 1 - s with what it was, as z does, at the cost of one flight however long the walk. A step
that ends at or below the level is not taken.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Streams = NDArray[np.int64]
Respond = Callable[[Array, Streams], Array]

FIRST_STREAM = 1 << 40  # beyond the flights of any campaign


class States(NamedTuple):
    """Flights: inputs (n, numbers drawn once), streams (n, spans) and response (n,), what levels are of."""

    inputs: Array
    streams: Streams
    response: Array

    def at(self, index: NDArray[np.int64]) -> States:
        """Some of them, in this order."""
        return States(self.inputs[index], self.streams[index], self.response[index])


def together(states: list[States]) -> States:
    """One after the other."""
    return States(*(np.concatenate(column) for column in zip(*states, strict=True)))


class Walker:
    """Draws and moves flights, and counts them; every flight draws from streams of its own number, none ever again.

    respond: the response of flights, of their inputs and streams. All randomness is of `seed`, in the order of the
    calls: which threads fly does not matter. part: walkers of one seed and different parts share nothing.
    """

    def __init__(self, respond: Respond, inputs: int, spans: int, seed: int, part: int = 0) -> None:
        self.respond, self.inputs, self.spans = respond, inputs, spans
        self.first = (1 + part) * FIRST_STREAM
        self.rng = np.random.default_rng([seed, self.first])
        self.flown = 0

    def fresh(self, count: int) -> States:
        """Flights drawn at random."""
        inputs = self.rng.standard_normal((count, self.inputs))
        return self._flown(inputs, np.repeat(self._numbers(count)[:, None], self.spans, axis=1))

    def step(self, states: States, level: float, size: Array) -> tuple[States, NDArray[np.bool_]]:
        """Each flight one step on, and which of the steps were taken. size: each flight's s in (0, 1], (n,)."""
        count, kept = len(states.response), (1.0 - size)[:, None]
        noise = self.rng.standard_normal((count, self.inputs))
        renewed = self.rng.random((count, self.spans)) < size[:, None]
        inputs = kept * states.inputs + np.sqrt(1.0 - kept * kept) * noise
        found = self._flown(inputs, np.where(renewed, self._numbers(count)[:, None], states.streams))
        taken = found.response > level
        after = (np.where(taken.reshape(-1, *[1] * (a.ndim - 1)), b, a) for a, b in zip(states, found, strict=True))
        return States(*after), taken

    def _numbers(self, count: int) -> Streams:
        """The streams of the next flights."""
        return self.first + self.flown + np.arange(count, dtype=np.int64)

    def _flown(self, inputs: Array, streams: Streams) -> States:
        self.flown += len(inputs)
        return States(inputs, streams, self.respond(inputs, streams) if len(inputs) else np.zeros(0))


def ancestors(rng: np.random.Generator, beyond: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """`count` of these flights to walk on from, each as often as any other in the mean, and as evenly as can be."""
    times, left = divmod(count, len(beyond))
    return np.concatenate([np.tile(beyond, times), rng.choice(beyond, left, replace=False)])
