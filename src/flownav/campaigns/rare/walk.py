"""Subset simulation: a small probability as a product of larger ones, by walks among flights beyond a level.

A flight is its random draws: the numbers drawn once (dispersed inputs, the sensors' constants and start values), kept
as they are, and the noise of every epoch, which is not kept: a flight holds the number of the stream that its noise
comes from, one for each span of KEYED_EPOCHS epochs. A walk's step moves both a little and in such a way that, were
there no level, all flights would stay as probable as they are (Neal, "Regression and classification using Gaussian
process priors", 1998; Papaioannou et al., Probabilistic Engineering Mechanics 41, 2015): the numbers z become (1 - s) z
+ sqrt(1 - (1 - s)^2) xi, and each stream is, by the chance s, a new one. The noise as a whole, made of many independent
draws, thereby keeps the correlation 1 - s with its former value, as z does, at the cost of one flight however long the
walk. A step that ends at or below the level is not taken.

After Au and Beck (Probabilistic Engineering Mechanics 16, 2001), in two parts. A pilot finds levels that about one in
eight of the flights beyond the last one exceeds, and the size of the steps. Then, with both fixed, independent
*islands* are flown: on each, flights are drawn at random, those beyond the first level are walked on from, the states
of the walks are the flights beyond that level, and so on; the island's estimate is the product of its shares. With
levels that do not depend on the flights that are counted this is without bias, however few they are (Dau and Chopin,
"Waste-free sequential Monte Carlo", J. Royal Statistical Society B 84, 2022), which an estimate from its own quantiles
is not; and how far islands lie apart says how well the mean of them is known, whatever the walks do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array

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


# -- levels and islands ------------------------------------------------------------------------------------------
WALK_STATES = 8  # states of a walk, its first among them: one in this number of flights is beyond the next level
LARGEST_SHARE = 0.5  # of the flights beyond a level, where its ties allow
STEP_SIZES = np.array([0.02, 0.05, 0.1, 0.2, 0.4, 0.8])  # of steps, that a pilot tries


class Ladder(NamedTuple):
    """The result of a pilot: levels up to the event's, and the size of the steps beyond each but the last.

    above: the pilot's own estimate for the last level, and reached whether that is the event's.
    """

    levels: tuple[float, ...]
    sizes: tuple[float, ...]
    above: float
    reached: bool


class Islands(NamedTuple):
    """shares (islands, levels): of each island's flights beyond each level; the flights beyond the last, whose they
    are, and the weight of each in the estimate.
    """

    shares: Array
    beyond: States
    island: NDArray[np.int64]

    @property
    def estimates(self) -> Array:
        """Each island's estimate of the probability."""
        return np.asarray(self.shares.prod(axis=1))


def next_level(response: Array, limit: float) -> float | None:
    """The level that one in WALK_STATES flights exceeds, or where they are tied about as many; the limit at most.

    None where no level lies between them.
    """
    share = 1.0 / WALK_STATES
    if np.mean(response > limit) >= share:
        return limit
    values, counts = np.unique(response[response <= limit], return_counts=True)
    beyond = 1.0 - np.cumsum(counts) / len(response)
    useful = (beyond > 0.0) & (beyond <= LARGEST_SHARE)
    if not useful.any():
        return None
    distance = np.abs(np.log(np.where(useful, beyond, 1.0) / share))
    return float(values[np.argmin(np.where(useful, distance, np.inf))])


def climb(walker: Walker, limit: float, count: int, most: int, negligible: float = 0.0) -> Ladder:
    """The pilot: `count` flights a level, `most` in all or a few more; no higher than `negligible` takes."""
    levels: list[float] = []
    sizes: list[float] = []
    states, above = walker.fresh(count), 1.0
    while True:
        level = next_level(states.response, limit)
        if level is None:
            return Ladder(tuple(levels), tuple(sizes), above, False)
        above *= float(np.mean(states.response > level))
        levels.append(level)
        if level == limit or walker.flown >= most or above < negligible:
            return Ladder(tuple(levels), tuple(sizes), above, level == limit)
        first = ancestors(walker.rng, np.flatnonzero(states.response > level), count // WALK_STATES)
        states, size = learn(walker, states.at(first), level)
        sizes.append(size)


def learn(walker: Walker, states: States, level: float) -> tuple[States, float]:
    """States of walks with steps of all STEP_SIZES, and the size that leads farthest: times the share taken."""
    walked, tried, went = [states], np.zeros(len(STEP_SIZES)), np.zeros(len(STEP_SIZES))
    for _ in range(WALK_STATES - 1):
        size = walker.rng.permutation(np.arange(len(states.response)) % len(STEP_SIZES))
        states, taken = walker.step(states, level, STEP_SIZES[size])
        walked.append(states)
        tried += np.bincount(size, minlength=len(STEP_SIZES))
        went += np.bincount(size[taken], minlength=len(STEP_SIZES))
    return together(walked), float(STEP_SIZES[np.argmax(STEP_SIZES * went / np.maximum(tried, 1.0))])


def fly_islands(walker: Walker, ladder: Ladder, islands: int, count: int) -> Islands:
    """Islands of `count` flights a level, a multiple of WALK_STATES."""
    states, island = walker.fresh(islands * count), np.repeat(np.arange(islands), count)
    shares = np.zeros((islands, len(ladder.levels)))
    for k, level in enumerate(ladder.levels):
        above = states.response > level
        shares[:, k] = np.bincount(island[above], minlength=islands) / count
        if k + 1 == len(ladder.levels) or not above.any():
            break
        own = [np.flatnonzero(above & (island == i)) for i in range(islands)]
        first = [ancestors(walker.rng, beyond, count // WALK_STATES) for beyond in own if len(beyond)]
        index = np.concatenate(first)
        states, island = walk(walker, states.at(index), level, ladder.sizes[k]), np.tile(island[index], WALK_STATES)
    return Islands(shares, states.at(np.flatnonzero(above)), island[above])


def walk(walker: Walker, states: States, level: float, size: float) -> States:
    """WALK_STATES states of each walk, the first where it begins."""
    walked = [states]
    for _ in range(WALK_STATES - 1):
        states, _ = walker.step(states, level, np.full(len(states.response), size))
        walked.append(states)
    return together(walked)
