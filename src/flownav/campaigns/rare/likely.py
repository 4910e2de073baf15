"""The most likely way there: how the flights that an event befell differ from all flights.

Of each number that was drawn: its mean in standard deviations of what it is in all flights, the standard deviation
about that, and how many nats the two say of it: the Kullback-Leibler divergence of N(mean, spread^2) from N(0, 1). A
pad can be missed to the north and to the south: then the mean stays where it was and the spread grows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.rare.chains import Array, States
from flownav.simulation.block import KEYED_EPOCHS
from flownav.simulation.onboard import EPOCH_S
from flownav.simulation.plan import Flight
from flownav.simulation.sources import Source, normals_of, sources_of

WINDOW_S = 0.5
NORMALS_READ = 20_000_000  # of the noise that is looked at
MOST_TOLD = 10
CHANCE_NATS = 10.0  # over the number of flights: what chance alone hardly ever makes of one number


def moments(values: Array, weights: Array) -> tuple[Array, Array]:
    """Weighted mean and standard deviation over the first axis."""
    share = (weights / weights.sum()).reshape(-1, *[1] * (values.ndim - 1))
    mean = (share * values).sum(axis=0)
    return mean, np.sqrt((share * (values - mean) ** 2).sum(axis=0))


def nats(mean: Array, spread: Array) -> Array:
    """The divergence of N(mean, spread^2) from N(0, 1)."""
    square = np.maximum(spread, 1e-3) ** 2
    return np.asarray(0.5 * (mean**2 + square - 1.0 - np.log(square)))


def effective(weights: Array) -> float:
    """How many flights of one weight say as much."""
    return float(weights.sum() ** 2 / (weights**2).sum())


def rank_inputs(names: list[str], inputs: Array, weights: Array, independent: float) -> list[dict[str, Any]]:
    """The inputs that differ by more than chance, the most telling first. independent: flights that are so, about."""
    mean, spread = moments(inputs, weights)
    said = nats(mean, spread)
    order = [k for k in np.argsort(-said) if said[k] > CHANCE_NATS / independent][:MOST_TOLD]
    return [
        {"input": names[k], "mean_sigma": float(mean[k]), "spread_sigma": float(spread[k]), "nats": float(said[k])}
        for k in order
    ]


def rank_noise(flight: Flight, seed: int, states: States, weights: Array, independent: float) -> list[dict[str, Any]]:
    """Of each source the window whose sum of noise differs most, where it does by more than chance.

    Of many flights the noise of some is looked at, one in so many of them.

    A window's sum is over the readings in WINDOW_S, in standard deviations of such a sum: slow noise shows, fast does
    not.
    """
    rows: list[dict[str, Any]] = []
    sources = sources_of(flight)
    every = len(weights) * flight.plan.epochs * len(sources) // NORMALS_READ + 1
    read = np.argsort(-weights, kind="stable")[::every]
    streams, weights, independent = states.streams[read], weights[read], independent / every
    for source in sources:
        sums, ends_s = window_sums(source, flight.plan.epochs, seed, streams)
        mean, spread = moments(sums, weights)
        said = nats(mean, spread)
        k = int(np.argmax(said))
        if said[k] > CHANCE_NATS / independent:
            rows.append(
                {
                    "source": source.name,
                    "from_s": max(float(ends_s[k]) - WINDOW_S, 0.0),
                    "to_s": float(ends_s[k]),
                    "mean_sigma": float(mean[k]),
                    "spread_sigma": float(spread[k]),
                    "nats": float(said[k]),
                }
            )
    return sorted(rows, key=lambda row: -row["nats"])[:MOST_TOLD]


def window_sums(source: Source, epochs: int, seed: int, streams: NDArray[np.int64]) -> tuple[Array, Array]:
    """Sums of a source's normals over each window, of variance 1, (flights, windows), and where the windows end [s]."""
    steps = np.arange(source.clock.first, epochs, source.clock.every, dtype=np.int64)
    keyed = streams[:, np.minimum(steps // KEYED_EPOCHS, streams.shape[1] - 1)].astype(np.uint64)
    counter = np.broadcast_to(steps.astype(np.uint64), keyed.shape)
    normals = normals_of(seed, keyed, np.ascontiguousarray(counter), source.channel)[source.half]
    window = (steps * EPOCH_S / WINDOW_S).astype(int)
    begins = np.flatnonzero(np.diff(window, prepend=-1))
    sums = np.add.reduceat(normals, begins, axis=1) / np.sqrt(np.diff([*begins, len(steps)]))
    return sums, (window[begins] + 1) * WINDOW_S
