"""The code that is written from laws' names: it reads and writes what they say, and refuses what nobody knows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from filters import Filter, N, random_covariance
from flownav.core.compile import LANES, ONE_LANE
from flownav.estimation.law import law, step
from flownav.estimation.states import (
    BARO,
    COEFFICIENT,
    FORCE,
    GPS_FAST,
    INNOVATION,
    MEASURED,
    OBSERVED,
    PLACES,
    POSITION,
    RATE,
    STATE,
)
from flownav.estimation.transition import transition


class OnThree(NamedTuple):
    pos: float
    gps_fast: float
    baro: float


@law
def three(
    axis: int, pos: float, gps_fast: float, baro: float, rate_y: float, *, by: float, more: float = 2.0
) -> tuple[float, OnThree]:
    """A prediction of three states, a row and two scalars."""
    return pos + by * gps_fast + more * baro + rate_y, OnThree(1.0, by, more)


def test_a_law_reads_its_lane_and_its_axis_and_names_the_places_it_read():
    wide = len(LANES)
    rows = np.random.default_rng(0).normal(size=(Filter().work.size, wide))
    work = rows.copy().ravel()
    three(work, LANES, 2, by=0.5)
    after = work.reshape(-1, wide)
    predicted = (
        rows[STATE + POSITION + 2] + 0.5 * rows[STATE + GPS_FAST + 2] + 2.0 * rows[STATE + BARO] + rows[RATE + 1]
    )
    assert np.array_equal(after[INNOVATION], rows[MEASURED] - predicted)
    assert np.array_equal(after[COEFFICIENT : COEFFICIENT + 3], np.repeat([[1.0], [0.5], [2.0]], wide, axis=1))
    assert after[OBSERVED : OBSERVED + 4, 0].tolist() == [3.0, POSITION + 2, GPS_FAST + 2, BARO]
    three(work, LANES, 0, 0.5, 3.0)
    assert work.reshape(-1, wide)[COEFFICIENT + 2, 7] == 3.0


def test_a_law_keeps_its_name_its_words_and_itself():
    assert three.__name__ == "three"
    assert three.__doc__ == "A prediction of three states, a row and two scalars."
    assert three.law(1, 1.0, 2.0, 3.0, 4.0, by=10.0) == (1.0 + 20.0 + 6.0 + 4.0, (1.0, 10.0, 2.0))


def test_a_step_replaces_the_rows_that_it_names():
    class Moved(NamedTuple):
        baro: float
        force_d: float

    def swap(force_d: float, baro: float, *, by: float) -> Moved:
        return Moved(force_d + by, baro)

    swap.__annotations__["return"] = Moved
    moved = step(swap)
    filter_ = Filter()
    filter_.work[:] = np.arange(filter_.work.size)
    before = filter_.work.copy()
    moved(filter_.work, ONE_LANE, by=0.25)
    changed = np.flatnonzero(filter_.work != before)
    assert changed.tolist() == [STATE + BARO, FORCE + 2]
    assert filter_.x[BARO] == before[FORCE + 2] + 0.25
    assert filter_.work[FORCE + 2] == before[STATE + BARO]


def named(function, returns):
    """A function with this return annotation, which the enclosing test defines."""
    function.__annotations__["return"] = returns
    return function


def test_a_name_that_nobody_knows_is_refused():
    class OnNothing(NamedTuple):
        altitude: float

    with pytest.raises(NameError, match="a law reads 'altitude', which is no state, no vector and no row"):
        law(named(lambda altitude: (altitude, OnThree(1.0, 1.0, 1.0)), tuple[float, OnThree]))
    with pytest.raises(NameError, match="a Jacobian names 'altitude', which is no state"):
        law(named(lambda baro: (baro, OnNothing(1.0)), tuple[float, OnNothing]))
    with pytest.raises(NameError, match="changes states that it does not read"):
        transition(named(lambda pos_n: OnThree(1.0, 1.0, 1.0), Scattered))


def test_a_law_that_reads_more_than_there_is_room_for_is_refused():
    class OnMany(NamedTuple):
        gps_slow_n: float
        gps_slow_e: float
        gps_slow_d: float
        gps_fast_n: float
        gps_fast_e: float
        gps_fast_d: float
        pos_n: float
        pos_e: float
        pos_d: float
        vel_n: float
        vel_e: float
        vel_d: float
        baro: float

    with pytest.raises(ValueError, match="reads more than 12 states"):
        law(named(lambda baro: (baro, OnMany(*[1.0] * 13)), tuple[float, OnMany]))


# -- transitions -----------------------------------------------------------------------------------------------
class Scattered(NamedTuple):
    baro: float
    pos_e: float
    lag_u2: float


@transition
def scattered(
    pos_e: float, vel_d: float, heading: float, baro: float, pad_n: float, lag_u2: float, rate_x: float, *, by: float
) -> Scattered:
    """Some states from some others, in no order."""
    return Scattered(
        baro=baro + by * vel_d - 2.0 * pos_e, pos_e=0.5 * pos_e + rate_x * heading, lag_u2=lag_u2 - baro + by * pad_n
    )


def test_a_transition_is_a_dense_congruence():
    """F P F' with F from the law itself, column by column, in lanes that differ."""
    random, wide = np.random.default_rng(3), len(LANES)
    filters = [Filter() for _ in range(wide)]
    for filter_ in filters:
        filter_.work[RATE] = random.normal()
        filter_.p = random_covariance(random)
    work = np.stack([filter_.work for filter_ in filters], axis=1).ravel()
    scattered(work, LANES, N, by=0.3)
    names = ["pos_e", "vel_d", "heading", "baro", "pad_n", "lag_u2"]
    for lane, filter_ in enumerate(filters):
        dense = np.eye(N)
        for name, unit in zip(names, np.eye(len(names)), strict=True):
            found = scattered.law(*unit, filter_.work[RATE], by=0.3)
            for target in Scattered._fields:
                dense[PLACES[target], PLACES[name]] = getattr(found, target)
        after = Filter()
        after.work[:] = work.reshape(-1, wide)[:, lane]
        assert np.allclose(after.p, dense @ filter_.p @ dense.T, rtol=0, atol=1e-12)
        scattered(filter_.work, ONE_LANE, N, by=0.3)
        assert after.kept == filter_.kept
