"""Readings on their way: a ring of slots in the lane buffer, between the sensors and the navigator's horizon.

A slot holds one reading of every lane, field by field as `navigation.memory.Reading` has them. Slots are filled in the
order of sampling and emptied in the order of the instants that the readings describe, both known beforehand
(`schedule`), so that no lane waits for another.
"""

from __future__ import annotations

from flownav.core.compile import Lanes, Work, equation, lane_access
from flownav.navigation.memory import store_reading
from flownav.navigation.records import Reading
from flownav.simulation import layout
from flownav.simulation.layout import load_slot, put_slot

__all__ = ["FIELDS", "FIRST", "hand_over", "load_slot", "put_slot", "reading_at", "store_row"]

FIELDS = len(Reading._fields)
FIRST = layout.ROWS

reading_at, store_row = lane_access(Reading, None)


@equation
def hand_over(work: Work, nav: Work, lanes: Lanes, slot: int) -> None:
    """A slot's readings become the reading at hand of the navigator's buffer."""
    for lane in range(len(lanes)):
        store_reading(nav, lanes, lane, load_slot(work, lanes, slot, lane))
