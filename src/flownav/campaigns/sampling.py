"""How the dispersed inputs of a campaign's flights are spread: plainly, in Latin hypercubes, or by Sobol's sequence.

A design gives the uniforms of an input, a number in (0, 1) for each flight, as a function of (seed, flight, name) and
of how many flights the campaign has. Hypercubes and sequences are of `TOGETHER` flights each, one after the other and
independent of each other: a flight's inputs can be had without those of a million others.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from flownav.simulation.dispersion import Design, uniforms

Array = NDArray[np.float64]

TOGETHER = 1024  # flights of one hypercube, or of one scrambled sequence
INSIDE = 2.0**-53  # of (0, 1): a point may lie on the edge, where a distribution may be infinite
SAMPLINGS = ("plain", "latin", "sobol")
Sampling = Literal["plain", "latin", "sobol"]


class Spread:
    """A design of scipy.stats.qmc over the named inputs, for flights 0 to `flights - 1`; later ones are plain."""

    def __init__(self, kind: Literal["latin", "sobol"], names: Sequence[str], flights: int) -> None:
        self.kind, self.flights = kind, flights
        self.column = {name: column for column, name in enumerate(sorted(names))}
        self._points = lru_cache(maxsize=8)(self._drawn)

    def uniforms(self, seed: int, flights: Sequence[int], name: str) -> Array:
        """The numbers of these flights."""
        found = uniforms(seed, flights, name)
        index, column = np.asarray(flights), self.column[name]
        for lot in np.unique(index[index < self.flights] // TOGETHER):
            own = (index // TOGETHER == lot) & (index < self.flights)
            found[own] = self._points(seed, int(lot))[index[own] - lot * TOGETHER, column]
        return found

    def _drawn(self, seed: int, lot: int) -> Array:
        """The points of one lot, (flights in it, inputs)."""
        from scipy.stats import qmc

        count = min(TOGETHER, self.flights - lot * TOGETHER)
        rng = np.random.default_rng([seed, lot])
        engine: Any
        if self.kind == "latin":
            engine = qmc.LatinHypercube(len(self.column), rng=rng)
            points = engine.random(count)
        else:
            engine = qmc.Sobol(len(self.column), scramble=True, rng=rng)
            points = engine.random_base2(TOGETHER.bit_length() - 1)[:count]
        return np.asarray(np.clip(points, INSIDE, 1.0 - INSIDE))


def design_of(sampling: Sampling, names: Sequence[str], flights: int) -> Design | None:
    """The design of a sampling; None: by the noise counter, each flight independent of all others."""
    return None if sampling == "plain" or not names else Spread(sampling, names, flights)
