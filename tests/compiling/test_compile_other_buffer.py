"""Functions of records on lanes: records of another buffer, and those whose row the caller tells."""

from typing import NamedTuple

import numpy as np
import pytest

from flownav.core.compile import LANES, Layout, kernel, pointer

COUNT = len(LANES)


class Own(NamedTuple):
    value: float


class Other(NamedTuple):
    first: float
    second: float = 3.0


class Somewhere(NamedTuple):
    here: float


BESIDE = Layout(2)
BESIDE.keep(Other)
BELOW = Layout()
BELOW.keep(Own)
BELOW.anywhere(Somewhere, "row")
BOTH = Layout(below=BELOW)
BOTH.beside(BESIDE, "aside")


class Swapped(NamedTuple):
    own: Own
    other: Other
    kept: Somewhere


@BOTH.loop
def swapped(own: Own, other: Other, *, by: float) -> Swapped:
    return Swapped(Own(other.second), Other(own.value * by, other.first), Somewhere(own.value))


@kernel
def run_swapped(work, aside, lanes, row):
    swapped(pointer(work), lanes, 2.0, pointer(aside), row)


@pytest.fixture
def buffers():
    work = np.arange(8.0 * COUNT)
    return work, -work.copy()


def test_records_of_two_buffers_lie_where_their_layouts_say(buffers):
    work, aside = (buffer.reshape(-1, COUNT) for buffer in buffers)
    before = work.copy(), aside.copy()
    swapped(work.reshape(-1), LANES, by=2.0, aside=aside.reshape(-1), row=5)
    assert (work[0] == before[1][3]).all()
    assert (work[5] == before[0][0]).all()
    assert (aside[2] == 2.0 * before[0][0]).all()
    assert (aside[3] == before[1][2]).all()
    untouched = [i for i in range(8) if i not in (0, 5)]
    assert (work[untouched] == before[0][untouched]).all()
    assert (np.delete(aside, (2, 3), axis=0) == np.delete(before[1], (2, 3), axis=0)).all()


def test_the_compiled_loop_does_the_same(buffers):
    plain = [buffer.copy() for buffer in buffers]
    swapped(plain[0], LANES, by=2.0, aside=plain[1], row=5)
    run_swapped(*buffers, LANES, 5)
    assert (buffers[0] == plain[0]).all()
    assert (buffers[1] == plain[1]).all()


def test_a_record_of_a_layout_that_is_not_known_is_refused():
    with pytest.raises(TypeError, match="is no record of this layout"):
        BELOW.loop(swapped.law)
