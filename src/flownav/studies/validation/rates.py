"""How often a recorded sensor reads."""

from __future__ import annotations

import numpy as np

from flownav.core.measurement import Stream


def rate_hz(stream: Stream) -> float:
    """One over the median step of a stream."""
    return float(1.0 / np.median(np.diff(stream.t_s)))
