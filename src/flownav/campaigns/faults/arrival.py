"""In what order a navigator is fed where readings come late, twice, in the wrong order or with a wrong clock.

A receiver holds what arrives until a horizon has passed the instant that it describes, and feeds in the order of those
instants. What comes after its turn is fed at once, for the navigator to refuse; what is stamped ahead of the receiver's
own clock has not been measured yet, and is not fed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, EventQueue, Sensor, Stream, merge

WAIT_S = 0.1  # beyond the largest delay
CLOCKS_DIFFER_S = 0.1


@dataclass(frozen=True)
class Restamped(Stream):
    """A stream whose time stamps are not when its readings arrived: that is arrival_s (n,)."""

    arrival_s: Array = field(default_factory=lambda: np.zeros(0))


def arrival_of(stream: Stream) -> Array:
    """When each reading arrived (n,): at its time stamp, but not before those that stand ahead of it."""
    return stream.arrival_s if isinstance(stream, Restamped) else np.maximum.accumulate(stream.t_s)


def stamped_ahead(stream: Stream) -> NDArray[np.bool_]:
    """The readings (n,) whose time stamps lie ahead of the receiver's clock."""
    return np.asarray(stream.t_s > arrival_of(stream) + CLOCKS_DIFFER_S)


def as_fed(streams: Mapping[Sensor, Stream]) -> EventQueue:
    """The events of all streams in the order in which a receiver feeds them, without those stamped ahead.

    A reading's turn comes when the horizon, the largest delay and WAIT_S, has passed its instant, or when it arrives.
    """
    queue = merge(streams.values())
    if not len(queue.t_s):
        return queue
    horizon_s = max(stream.delay_s for stream in streams.values()) + WAIT_S
    arrival, ahead = np.zeros(len(queue.t_s)), np.zeros(len(queue.t_s), bool)
    for sensor, stream in streams.items():
        here = queue.sensor == sensor
        arrival[here] = arrival_of(stream)[queue.row[here]]
        ahead[here] = stamped_ahead(stream)[queue.row[here]]
    turn = np.maximum(arrival, queue.t_s + horizon_s)
    order = np.lexsort((queue.t_s, turn))
    kept = order[~ahead[order]]
    columns: dict[str, Any] = {name: column[kept] for name, column in queue._asdict().items()}
    return EventQueue(**columns)
