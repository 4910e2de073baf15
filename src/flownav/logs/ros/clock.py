"""One clock for all topics of a bag: the times in the headers where they are sound, else the times of logging."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.logs.ros.columns import Gathered

NS = 1e-9
AGREEING_S = 3600.0  # headers of one clock; a simulator's clock may lie decades from the recorder's
LONGEST_DELAY_S = 1.0


class Clock(NamedTuple):
    """start_ns: what is time 0. offset_ns: the recorder's clock less that of the headers. by_header: topics whose
    headers are believed. delays_s: by topic, how long after its stamp a message was logged, usually."""

    start_ns: int
    offset_ns: int
    by_header: frozenset[str]
    delays_s: dict[str, float]

    def times(self, topic: Gathered) -> Array:
        """When each message arrived [s]: its stamp and the topic's usual delay, or when it was logged."""
        if topic.topic in self.by_header:
            return np.asarray((topic.stamped - self.start_ns) * NS + self.delay_s(topic), np.float64)
        return np.asarray((topic.logged - self.offset_ns - self.start_ns) * NS, np.float64)

    def delay_s(self, topic: Gathered) -> float:
        """How old a reading is on arrival [s]."""
        return self.delays_s.get(topic.topic, 0.0)


def clock_of(topics: Iterable[Gathered]) -> tuple[Clock, list[str]]:
    """The clock, and notes on topics whose headers are not believed."""
    listed = [topic for topic in topics if len(topic)]
    late_ns = {
        topic.topic: float(np.median((topic.logged - topic.stamped)[topic.stamped > 0]))
        for topic in listed
        if np.mean(topic.stamped > 0) > 0.5
    }
    notes = []
    if late_ns and (max(late_ns.values()) - min(late_ns.values())) * NS > AGREEING_S:
        notes.append("the headers' stamps are of different clocks: the times at which messages were logged are taken")
        late_ns = {}
    unstamped = sorted(topic.topic for topic in listed if topic.topic not in late_ns)
    if late_ns and unstamped:
        notes.append(f"no stamp in the headers of {', '.join(unstamped)}: the times of logging are taken")
    elif unstamped and not notes:
        notes.append("no stamps in the headers: the times at which messages were logged are taken")
    one_clock = all(abs(late) * NS < LONGEST_DELAY_S for late in late_ns.values())
    offset_ns = 0 if one_clock else int(min(late_ns.values()))
    delays = {name: min(max((late - offset_ns) * NS, 0.0), LONGEST_DELAY_S) for name, late in late_ns.items()}
    starts = [
        int(topic.stamped[topic.stamped > 0].min()) if topic.topic in late_ns else int(topic.logged.min()) - offset_ns
        for topic in listed
    ]
    middle = sorted(starts)[(len(starts) - 1) // 2] if starts else 0  # a damaged stamp is no start
    return Clock(middle, offset_ns, frozenset(late_ns), delays), notes
