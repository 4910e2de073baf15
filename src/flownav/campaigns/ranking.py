"""Which input decides the outcome: Sobol indices of the dispersed inputs, and of groups of them, from a campaign.

The outcome Y is a function of the dispersed inputs and of the flight's own noise, which counts as one more input. The
first index of an input is the share of Y's variance that would go if the input were known, V(E(Y | x)) / V(Y); its
total index the share that would stay if all others were, E(V(Y | others)) / V(Y). Saltelli's design: two independent
samples A and B of n flights each, and for each input a sample AB that is A with this input out of B,

    first = mean(B (AB - A)) / V,    total = mean((A - AB)^2) / (V of A + V of AB)

(Saltelli et al., Computer Physics Communications 181, 2010; the total after Jansen, ibid. 117, 1999, over the variance
of the two samples that are compared, so that few rows do not take it far beyond 1), with intervals by the bootstrap
over the n rows. Indices of a group are the same, the whole group out of B.

Noise is by counter: flights 0 to n - 1 have the noise of A, flights n to 2n - 1 that of B.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from flownav.campaigns.plan import EDGE_MARGIN
from flownav.core.measurement import Array
from flownav.simulation.dispersion import Design, Distribution

NOISE = "noise"
CLASSES = ("build", "day", "never")
CONFIDENCE = 0.90
RESAMPLES = 1000
MOST_KURTOSIS = 10.0  # beyond it the ranks are ranked: few outcomes far off carry the variance
LEAST_ROWS, MOST_ROWS = 16, 65_536  # rows: fewer show nothing
Fly = Callable[[Design, int, int], Array]


class Index(NamedTuple):
    """An input, or a class of them, with both indices and their intervals (low, high)."""

    input: str
    first: float
    total: float
    first_interval: tuple[float, float]
    total_interval: tuple[float, float]


class Ranking(NamedTuple):
    """Inputs by falling total index; classes in the order of CLASSES; n: rows; flights: flown for it.

    ranked: of what the indices are: "values", "ranks" (see `bounded`), "nothing" (all flights alike).
    """

    inputs: tuple[Index, ...]
    classes: tuple[Index, ...]
    n: int
    flights: int
    of: str


class Crossed:
    """A design of n rows: sample A, but for the named inputs, which are out of B; flight k has row k mod n."""

    def __init__(self, points: Array, column: Mapping[str, int], of_b: frozenset[str]) -> None:
        self.points, self.column, self.of_b = points, column, of_b

    def uniforms(self, seed: int, flights: Sequence[int], name: str) -> Array:
        """The numbers of these flights, whatever the seed: it is in the points."""
        sample = 1 if name in self.of_b else 0
        rows = np.asarray(flights) % self.points.shape[1]
        return np.asarray(self.points[sample, rows, self.column[name]])


def rank(entries: Mapping[str, Distribution], seed: int, n: int, fly: Fly) -> Ranking:
    """Inputs and classes of a campaign, ranked.

    entries: the dispersed inputs by name. n: rows, a power of 2. fly(design, first, n): the outcomes (n,) of flights
    `first` to `first + n - 1`, infinite where there was none. ValueError where n is none such.
    """
    if not LEAST_ROWS <= n <= MOST_ROWS or n & (n - 1):
        raise ValueError(f"{n} rows: a power of 2 is needed, {LEAST_ROWS} to {MOST_ROWS}")
    names = tuple(entries)
    points, column = points_of(seed, n, len(names)), {name: k for k, name in enumerate(names)}

    def crossed(*of_b: str) -> Array:
        taken = frozenset(of_b)
        return fly(Crossed(points, column, taken), n if NOISE in taken else 0, n)

    a, b = crossed(), crossed(*names, NOISE)
    inputs = (*names, NOISE)
    groups = {
        known: [name for name in inputs if ("never" if name == NOISE else entries[name].known) == known]
        for known in CLASSES
    }
    found = [crossed(name) for name in inputs] + [crossed(*group) for group in groups.values()]
    (a, b, *swapped), of = bounded([a, b, *found])
    indices = indices_of(a, b, np.array(swapped), (*inputs, *groups), seed)
    ranked = sorted(indices[: len(inputs)], key=lambda index: -index.total)
    return Ranking(tuple(ranked), tuple(indices[len(inputs) :]), n, n * (2 + len(swapped)), of)


def flights_of(inputs: int, n: int) -> int:
    """The number of flights that `rank` flies for `inputs` dispersed inputs."""
    return n * (2 + inputs + 1 + len(CLASSES))


def points_of(seed: int, n: int, inputs: int) -> Array:
    """Samples A and B, (2, n, inputs), of one scrambled Sobol sequence."""
    from scipy.stats import qmc

    if not inputs:
        return np.empty((2, n, 0))
    engine: Any = qmc.Sobol(2 * inputs, scramble=True, rng=np.random.default_rng([seed, n]))
    points = np.clip(engine.random_base2(n.bit_length() - 1), EDGE_MARGIN, 1.0 - EDGE_MARGIN)
    return np.asarray(points.reshape(n, 2, inputs).transpose(1, 0, 2))


def bounded(samples: Sequence[Array]) -> tuple[list[Array], str]:
    """The outcomes as they are, or as ranks among those of A and B, in (0, 1); 0 where all are one.

    Ranks where a figure is infinite, which no variance can take (a flight without a touchdown is the worst of all), or
    where the variance would be that of a few flights far off: a kurtosis above MOST_KURTOSIS, of a normal outcome 3.
    """
    from scipy.stats import kurtosis

    both = np.concatenate(samples[:2])
    if (both == both[0]).all():
        return [np.zeros(len(sample)) for sample in samples], "nothing"
    every = np.concatenate(samples)
    if np.isfinite(every).all() and kurtosis(every, fisher=False) <= MOST_KURTOSIS:
        return list(samples), "values"
    ordered = np.sort(both)

    def place(sample: Array) -> Array:
        below, upto = (np.searchsorted(ordered, sample, side=side) for side in ("left", "right"))
        return np.asarray(0.5 * (below + upto) / len(ordered))

    return [place(sample) for sample in samples], "ranks"


def indices_of(a: Array, b: Array, swapped: Array, names: Sequence[str], seed: int) -> list[Index]:
    """Indices with intervals from outcomes a and b (n,), swapped (inputs, n). All 0 where all outcomes are alike."""
    first, total = sobol(a, b, swapped)
    rng = np.random.default_rng([seed, len(a), RESAMPLES])
    rows = rng.integers(0, len(a), (RESAMPLES, len(a)))
    again = np.array([sobol(a[row], b[row], swapped[:, row]) for row in rows])  # (resamples, 2, inputs)
    low, high = np.quantile(again, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE], axis=0)
    return [
        Index(
            name, float(first[k]), float(total[k]),
            (float(low[0, k]), float(high[0, k])), (float(low[1, k]), float(high[1, k])),
        )
        for k, name in enumerate(names)
    ]  # fmt: skip


def sobol(a: Array, b: Array, swapped: Array) -> tuple[Array, Array]:
    """First and total indices, (inputs,) each; 0 where nothing varies."""
    both = np.concatenate([a, b])
    mean, variance = both.mean(), both.var()
    if not variance > 0.0:
        return np.zeros(len(swapped)), np.zeros(len(swapped))
    first = ((b - mean) * (swapped - a)).mean(axis=1) / variance
    of_both = a.var() + swapped.var(axis=1)
    differ = ((swapped - a) ** 2).mean(axis=1)
    return first, np.divide(differ, of_both, out=np.zeros(len(swapped)), where=of_both > 0.0)
