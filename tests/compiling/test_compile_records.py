"""Records in a lane buffer: where a field lies, and laws of one lane's records that return several."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Layout


class Place(NamedTuple):
    north_m: float = 0.0
    east_m: float = 2.0


class Count(NamedTuple):
    count: float = 0.0


def laid_out() -> tuple[Layout, np.ndarray]:
    layout = Layout(4)
    layout.keep(Place)
    layout.keep(Count, 3, "axis")
    work = np.zeros((layout.next, 2))
    layout.put_fresh(work)
    return layout, work.ravel()


def test_a_records_field_has_a_row_and_a_named_one_the_row_that_was_there():
    layout, work = laid_out()
    assert (layout.row(Place, "north_m"), layout.row(Place, "east_m"), layout.row(Count, "count")) == (4, 5, 6)
    assert work.reshape(-1, 2)[layout.row(Place, "east_m")].tolist() == [2.0, 2.0]
    named = Layout(layout.next, below=layout)
    named.name(Count, 5)
    assert (named.row(Count, "count"), named.row(Place, "east_m"), layout.row(Count, "count")) == (5, 5, 6)


def test_a_law_may_return_a_tuple_of_records():
    layout, work = laid_out()

    @layout.loop
    def step(place: Place, count: Count, *, by_m: float) -> tuple[Place, Count]:
        """A step north, counted."""
        return Place(place.north_m + by_m, place.east_m), Count(count.count + 1.0)

    step(work, (0, 0), 0.5, 2)
    assert layout.access(Place)[0](work, (0, 0), 1) == Place(0.5, 2.0)
    assert [layout.access(Count)[0](work, (0, 0), axis, 1).count for axis in range(3)] == [0.0, 0.0, 1.0]


class Apart(NamedTuple):
    apart_m: float


def test_what_is_seen_is_computed_from_records_and_from_what_is_told():
    layout, work = laid_out()
    above = Layout(layout.next, below=layout)

    def apart(place: Place, count: Count, *, scale: float) -> Apart:
        """How far apart, so often."""
        return Apart(scale * count.count * (place.east_m - place.north_m))

    above.see(apart)

    @above.loop
    def go(seen: Apart) -> Place:
        """There."""
        return Place(seen.apart_m, 0.0)

    layout.access(Count)[1](work, (0, 0), 1, 1, Count(3.0))
    go(work, (0, 0), scale=10.0, axis=1)
    assert [layout.access(Place)[0](work, (0, 0), lane).north_m for lane in range(2)] == [0.0, 60.0]
