"""A stand-in for flights whose probabilities are known: a weighted sum of what flights are drawn from, N(0, 1)."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from flownav.campaigns.rare.walk import Walker
from flownav.simulation.sources import normals_of

INPUTS, SPANS = 3, 12
WEIGHTS = np.concatenate([[2.0, 1.0, 0.5], np.linspace(0.2, 1.0, SPANS)])
WEIGHTS /= np.linalg.norm(WEIGHTS)


def walker_of(seed, shaped=lambda total: total):
    """Flights whose response is that of their sum; half of its variance is of the inputs, half of the noise."""

    def respond(inputs, streams):
        spans = np.broadcast_to(np.arange(SPANS, dtype=np.uint64), streams.shape)
        noise = normals_of(seed, streams.astype(np.uint64), np.ascontiguousarray(spans), 0)[0]
        return shaped(inputs @ WEIGHTS[:INPUTS] + noise @ WEIGHTS[INPUTS:])

    return Walker(respond, INPUTS, SPANS, seed)


def limit_of(probability):
    """The limit that the sum exceeds with this probability."""
    return float(norm.isf(probability))
