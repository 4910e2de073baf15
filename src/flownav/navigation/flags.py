"""Warnings that stand: from the happening that raises one to the one that takes it down."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.navigation.rows import EventRow
from flownav.navigation.tape import (
    AIDED_AGAIN,
    DEAD_RECKONING,
    EVENT_NAMES,
    FAULT_CLEARED,
    FAULT_SUSPECTED,
    FLOW_DOUBTED,
    FLOW_TRUSTED,
    POSITION_INVALID,
)

RAISING = {
    int(DEAD_RECKONING): int(AIDED_AGAIN),
    int(POSITION_INVALID): int(AIDED_AGAIN),
    int(FLOW_DOUBTED): int(FLOW_TRUSTED),
    int(FAULT_SUSPECTED): int(FAULT_CLEARED),
}


class Flag(NamedTuple):
    """A warning that stood from t0_s until before t1_s (infinity: to the end), such as dead reckoning."""

    t0_s: float
    t1_s: float
    source: str
    kind: str


def flags_of(happened: Array) -> tuple[Flag, ...]:
    """The warnings of rows of a tape's events."""
    flags, events = [], EventRow.of(happened)
    for t_s, kind, _ in happened.tolist():
        if int(kind) in RAISING:
            down = events.t_s[(events.kind == RAISING[int(kind)]) & (events.t_s >= t_s)]
            flags.append(Flag(t_s, float(down.min(initial=np.inf)), *EVENT_NAMES[int(kind)][:2]))
    return tuple(flags)


def flagged(t_s: Array, flags: tuple[Flag, ...]) -> NDArray[np.bool_]:
    """At which instants (n,) some warning stands."""
    stands = np.zeros(len(t_s), bool)
    for flag in flags:
        stands |= (t_s >= flag.t0_s) & (t_s < flag.t1_s)
    return stands
