"""Subset simulation: a small probability as the product of larger ones, of one level of the response after the other.

After Au and Beck (Probabilistic Engineering Mechanics 16, 2001), in two parts. A pilot finds levels that about one in
eight of the flights beyond the last one exceeds, and the size of the steps. Then, with both fixed, independent
*islands* are flown: on each, flights are drawn at random, those beyond the first level are walked on from, the states
of the walks are the flights beyond that level, and so on; the island's estimate is the product of its shares. With
levels that do not depend on the flights that are counted this is without bias, however few they are (Dau and Chopin,
"Waste-free sequential Monte Carlo", J. Royal Statistical Society B 84, 2022), which an estimate from its own quantiles
is not; and how far islands lie apart says how well the mean of them is known, whatever the walks do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.rare.chains import Array, States, Walker, ancestors, together

WALK = 8  # states of a walk, its first among them: one in so many flights is beyond the next level
LARGEST_SHARE = 0.5  # of the flights beyond a level, where its ties allow
SIZES = np.array([0.02, 0.05, 0.1, 0.2, 0.4, 0.8])  # of steps, that a pilot tries


class Ladder(NamedTuple):
    """What a pilot found: levels up to the event's, and the size of the steps beyond each but the last.

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
    """The level that one in WALK of the flights exceeds, or where they are tied about as many; the limit at most.

    None where no level lies between them.
    """
    share = 1.0 / WALK
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
        first = ancestors(walker.rng, np.flatnonzero(states.response > level), count // WALK)
        states, size = learn(walker, states.at(first), level)
        sizes.append(size)


def learn(walker: Walker, states: States, level: float) -> tuple[States, float]:
    """WALK states of each walk with steps of all SIZES, and the size that leads farthest: times the share taken."""
    walked, tried, went = [states], np.zeros(len(SIZES)), np.zeros(len(SIZES))
    for _ in range(WALK - 1):
        size = walker.rng.permutation(np.arange(len(states.response)) % len(SIZES))
        states, taken = walker.step(states, level, SIZES[size])
        walked.append(states)
        tried += np.bincount(size, minlength=len(SIZES))
        went += np.bincount(size[taken], minlength=len(SIZES))
    return together(walked), float(SIZES[np.argmax(SIZES * went / np.maximum(tried, 1.0))])


def fly_islands(walker: Walker, ladder: Ladder, islands: int, count: int) -> Islands:
    """Islands of `count` flights a level, a multiple of WALK."""
    states, island = walker.fresh(islands * count), np.repeat(np.arange(islands), count)
    shares = np.zeros((islands, len(ladder.levels)))
    for k, level in enumerate(ladder.levels):
        above = states.response > level
        shares[:, k] = np.bincount(island[above], minlength=islands) / count
        if k + 1 == len(ladder.levels) or not above.any():
            break
        own = [np.flatnonzero(above & (island == i)) for i in range(islands)]
        first = [ancestors(walker.rng, beyond, count // WALK) for beyond in own if len(beyond)]
        index = np.concatenate(first)
        states, island = walk(walker, states.at(index), level, ladder.sizes[k]), np.tile(island[index], WALK)
    return Islands(shares, states.at(np.flatnonzero(above)), island[above])


def walk(walker: Walker, states: States, level: float, size: float) -> States:
    """WALK states of each walk, the first where it begins."""
    walked = [states]
    for _ in range(WALK - 1):
        states, _ = walker.step(states, level, np.full(len(states.response), size))
        walked.append(states)
    return together(walked)
