"""A receiver whose place walks off: found by innovations that are alike, held back, refused once it leaves its gate."""

from __future__ import annotations

import math

import pytest

from flownav.navigation import verdicts
from flownav.navigation.fix_walk import (
    HELD_RATIO,
    HELD_S,
    MOMENT_S,
    SOUND_M_S,
    OwnVelocity,
    hold_walk,
    watch_walk,
)
from flownav.navigation.reasons import FUSED, INNOVATION_GATE
from flownav.navigation.records import FlowMemory, LevelMemory, WalkMemory, WitnessMemory

FLOWS = FlowMemory(taken_s=9.9)
AGREES = OwnVelocity(-0.1, 9.9, 0.0)  # the receiver's velocity says that the estimate is fast enough
STEP_S = 0.2
WALKS_M = 0.45  # innovation of a place that walks at 1 m/s, where the states take 0.45 of it


def watched(m=WalkMemory(), innovation=WALKS_M, own=AGREES, flow=FLOWS, axis=0, reason=FUSED, before=None):  # noqa: B008
    """After a place at 10 s, 0.2 s after one that was off by the same."""
    before = innovation if before is None else before
    return watch_walk.law(
        verdicts.Tested(reason, innovation, 0.04, 0.022), own, flow,
        WitnessMemory(before=before, received_s=10.0 - STEP_S, fused_s=9.8), m,
        t_s=10.0, axis=axis,
    )  # fmt: skip


def test_innovations_that_are_alike_are_averaged_over_a_second_along_their_own_axis():
    m = WalkMemory(alike_n=-1.0, alike_e=-0.5)
    north, east, product = watched(m), watched(m, axis=1), WALKS_M**2 / 0.04
    assert (north.alike_n, north.alike_e) == (pytest.approx(-1.0 + 0.2 * (product + 1.0)), -0.5)
    assert (east.alike_n, east.alike_e) == (-1.0, pytest.approx(-0.5 + 0.2 * (product + 0.5)))
    turned = watched(WalkMemory(alike_n=0.5, alike_e=0.3), before=-WALKS_M)
    assert turned.alike_n == pytest.approx(0.5 + 0.2 * (-product - 0.5))


def test_a_walk_is_found_once_they_are_as_alike_as_those_of_one_error():
    found = watched(WalkMemory(alike_n=0.9, alike_e=0.4))
    assert found == WalkMemory(0.0, 0.4, 10.0)
    assert watched(WalkMemory(alike_n=-0.1)).found_s == -math.inf


@pytest.mark.parametrize(("own", "flow"), [
    (AGREES._replace(before=0.1), FLOWS),  # the receiver is faster than the estimate, which lags behind it
    (AGREES._replace(fused_s=10.0 - MOMENT_S - 0.1), FLOWS),
    (AGREES._replace(since_s=9.85), FLOWS),  # its velocity was refused a moment ago
    (AGREES, FLOWS._replace(taken_s=10.0 - MOMENT_S - 0.1)),
    (AGREES, FLOWS._replace(doubted=1.0)),
    (AGREES, FLOWS._replace(wrong_s=9.0)),
])  # fmt: skip
def test_without_two_other_witnesses_no_walk_is_seen(own, flow):
    assert watched(WalkMemory(alike_n=0.9), own=own, flow=flow).alike_n == pytest.approx(0.9 - 0.2 * 0.9)


def test_a_place_that_parts_as_sound_receivers_do_does_not_walk():
    for speed, walks in ((0.98, False), (1.02, True)):
        innovation = speed * SOUND_M_S * STEP_S / (1.0 - 0.022 / 0.04)
        assert (watched(innovation=innovation).alike_n > 0.0) == walks


def test_a_place_that_is_not_fused_changes_nothing():
    m = WalkMemory(alike_n=0.5, alike_e=0.3, found_s=9.0)
    assert watched(m, reason=INNOVATION_GATE) == m


@pytest.mark.parametrize(
    ("since_s", "held"), [(0.0, True), (HELD_S - 0.1, True), (HELD_S + 0.1, False), (math.inf, False)]
)
def test_a_walk_is_held_back_for_two_seconds(since_s, held):
    walk = WalkMemory(found_s=10.0 - since_s)
    assert hold_walk.law(LevelMemory(0.3), walk, t_s=10.0).ratio == (HELD_RATIO if held else 0.3)
    assert hold_walk.law(LevelMemory(1.4), walk, t_s=10.0).ratio == 1.4  # beyond its gate it is as it was
    assert HELD_RATIO > 1.0
