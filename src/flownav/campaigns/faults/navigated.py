"""What a navigator that is to be tried with faults takes and gives back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, Sensor, Stream
from flownav.navigation.flags import Flag


class Offers(NamedTuple):
    """One row for each component of a reading that the navigator was given and judged.

    t_s (m,): the reading's time stamp, as in the stream that was handed in (not less its delay). sensor (m,): of
    measurement.Sensor. component (m,): its number in the reading. fused (m,): whether it moved the state or set a
    datum. reason (m,): the label where it was not.
    """

    t_s: Array
    sensor: NDArray[np.int64]
    component: NDArray[np.int64]
    fused: NDArray[np.bool_]
    reason: NDArray[np.str_]


class Event(NamedTuple):
    """A happening: a reset, a datum, a flag raised or taken down. source: "gps", "flow", "range", ... or "filter"."""

    t_s: float
    source: str
    kind: str


@dataclass(frozen=True)
class Navigated:
    """What a navigator made of a log.

    t_s (n,) increasing, the instants that the estimates describe; position_ned_m and sigma_ned_m (n, 3) in the log's
    local frame, one standard deviation each; offers, events, flags in any order. levels_m (n, 2): protection levels,
    horizontal and vertical; None where the navigator states none.
    """

    t_s: Array
    position_ned_m: Array
    sigma_ned_m: Array
    offers: Offers
    events: tuple[Event, ...] = ()
    flags: tuple[Flag, ...] = ()
    levels_m: Array | None = None


Navigate = Callable[[Mapping[Sensor, Stream]], Navigated]
