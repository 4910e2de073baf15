"""A receiver whose place walks off: found by innovations that are alike, held back, refused once it leaves its gate."""

from __future__ import annotations

import math

import pytest

from flownav.navigation import verdicts
from flownav.navigation.fix_walk import (
    HELD_RATIO,
    LONGEST_S,
    MOMENT_S,
    SOUND_M_S,
    OwnVelocity,
    hold_walk,
    watch_walk,
)
from flownav.navigation.flow_noise import AGREEMENT_S
from flownav.navigation.reasons import FUSED, INNOVATION_GATE
from flownav.navigation.records import FlowMemory, GpsMemory, LevelMemory, WitnessMemory

FLOWS = FlowMemory(taken_s=9.9)
AGREES = OwnVelocity(-0.05, -0.1, 9.9, 0.0)  # the receiver's velocity says that the estimate is fast enough
STEP_S = 0.2
WALKS_M = 0.45  # innovation of a place that walks at 1 m/s, where the states take 0.45 of it


def watched(m=GpsMemory(), innovation=WALKS_M, own=AGREES, flow=FLOWS, axis=0, reason=FUSED, ratio=0.2, before=None):  # noqa: B008
    """After a place at 10 s, 0.2 s after one that was off by the same."""
    before = innovation if before is None else before
    return watch_walk.law(
        verdicts.Tested(reason, innovation, 0.04, 0.022), own, flow,
        WitnessMemory(before=before, received_s=10.0 - STEP_S, fused_s=9.8), LevelMemory(ratio), m,
        t_s=10.0, axis=axis,
    )  # fmt: skip


def test_innovations_that_are_alike_are_averaged_over_a_second_along_their_own_axis():
    m = GpsMemory(alike_n=-1.0, alike_e=-0.5)
    north, east, product = watched(m), watched(m, axis=1), WALKS_M**2 / 0.04
    assert (north.alike_n, north.alike_e) == (pytest.approx(-1.0 + 0.2 * (product + 1.0)), -0.5)
    assert (east.alike_n, east.alike_e) == (-1.0, pytest.approx(-0.5 + 0.2 * (product + 0.5)))
    turned = watched(GpsMemory(alike_n=0.5, alike_e=0.3), before=-WALKS_M)
    assert turned.alike_n == pytest.approx(0.5 + 0.2 * (-product - 0.5))


def test_a_walk_is_found_once_they_are_as_alike_as_those_of_one_error():
    found = watched(GpsMemory(alike_n=0.9, alike_e=0.4), ratio=0.3)
    assert (found.walked_s, found.walked_ratio, found.alike_n, found.alike_e) == (10.0, 0.3, 0.0, 0.4)
    assert watched(GpsMemory(alike_n=-0.1)).walked_s == -math.inf


@pytest.mark.parametrize(("own", "flow"), [
    (AGREES._replace(error_m_s=0.05), FLOWS),  # the receiver is faster than the estimate, which lags behind it
    (AGREES._replace(before=0.1), FLOWS),  # it is so now
    (AGREES._replace(fused_s=10.0 - MOMENT_S - 0.1), FLOWS),
    (AGREES._replace(since_s=9.85), FLOWS),  # its velocity was refused a moment ago
    (AGREES, FLOWS._replace(taken_s=10.0 - MOMENT_S - 0.1)),
    (AGREES, FLOWS._replace(doubted=1.0)),
    (AGREES, FLOWS._replace(wrong_s=9.0)),
])  # fmt: skip
def test_without_two_other_witnesses_no_walk_is_seen(own, flow):
    assert watched(GpsMemory(alike_n=0.9), own=own, flow=flow).alike_n == pytest.approx(0.9 - 0.2 * 0.9)


def test_a_place_that_parts_as_sound_receivers_do_does_not_walk():
    for speed, walks in ((0.98, False), (1.02, True)):
        innovation = speed * SOUND_M_S * STEP_S / (1.0 - 0.022 / 0.04)
        assert (watched(innovation=innovation).alike_n > 0.0) == walks


def test_a_place_that_is_not_fused_changes_nothing():
    m = GpsMemory(alike_n=0.5, alike_e=0.3, walked_s=9.0, walked_ratio=0.2)
    for ratio in (HELD_RATIO, 1.2):
        assert watched(m, reason=INNOVATION_GATE, ratio=ratio) == m


@pytest.mark.parametrize(("since_s", "ratio", "held"), [
    (AGREEMENT_S - 0.1, 0.1, True),
    (AGREEMENT_S + 0.1, 0.1, False),
    (AGREEMENT_S + 0.1, 0.3, True),  # it goes on parting
    (LONGEST_S + 0.1, 0.3, False),
    (math.inf, 0.3, False),
])  # fmt: skip
def test_a_walk_is_held_back_for_a_moment_and_longer_where_it_goes_on(since_s, ratio, held):
    gps = GpsMemory(walked_s=10.0 - since_s, walked_ratio=0.2)
    assert hold_walk.law(LevelMemory(ratio), gps, t_s=10.0).ratio == (HELD_RATIO if held else ratio)
    assert hold_walk.law(LevelMemory(1.4), gps, t_s=10.0).ratio == 1.4  # beyond its gate it is as it was
    assert HELD_RATIO > 1.0
