"""When a landing is broken off, and when the vehicle comes down again."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from flownav.control.gains import AutopilotGains
from flownav.control.guidance import (
    SEARCH_M_S,
    Approach,
    GoAround,
    Knowledge,
    climb_out,
    mind_landing,
    search_offset,
    seeks,
)
from flownav.simulation.scenario import AutopilotSection, GoAroundSection, PrecisionSection

DT_S = 0.02
GAINS = AutopilotGains(
    land_height_m=3.0,
    align_height_m=0.3,
    commit_height_m=0.1,
    search_height_m=2.5,
    go_around_height_m=2.5,
    pad_view_m=0.5,
    pad_lost_s=2.0,
    landing_sigma_m=0.5,
    doubt_s=2.0,
    align_wait_s=30.0,
    search_wait_s=20.0,
    search_radius_m=3.0,
    drift_radius_m=0.5,
    drift_speed_m_s=0.6,
    clear_s=3.0,
)
SURE = Knowledge(pad_found=1.0, ground_found=1.0, pad_unseen_s=0.1, sigma_m=0.02, doubted=0.0)
DOWN = GoAround(0.0, 0.0, 0.0)


def minded(
    known=SURE,
    beside_m=0.0,
    speed_m_s=0.0,
    height_m=1.0,
    waited_s=0.0,
    searched_s=0.0,
    before=DOWN,
    gains=GAINS,
    **more,
):
    """The state after `for_s` seconds of the same."""
    state, landing = before, more.get("landing", True)
    for _ in range(round(more.get("for_s", DT_S) / DT_S)):
        now = Approach(beside_m**2, speed_m_s**2, height_m, waited_s, searched_s, landing)
        state = mind_landing(state, known, now, gains, DT_S)
    return state


def test_a_landing_that_is_well_goes_on_for_ever():
    for height_m in (0.05, 0.3, 1.0, 2.9):
        assert minded(height_m=height_m, for_s=60.0) == DOWN


@pytest.mark.parametrize(
    ("what", "changed"),
    [
        ("pad lost in sight", {"known": SURE._replace(pad_unseen_s=2.1)}),
        ("place unsure", {"known": SURE._replace(sigma_m=0.6), "for_s": 2.1}),
        ("fault out of sight", {"known": SURE._replace(doubted=1.0, pad_unseen_s=2.1), "height_m": 0.4, "for_s": 2.1}),
        ("gate shut", {"height_m": 0.2, "waited_s": 30.1}),
        ("searched in vain", {"known": SURE._replace(pad_found=0.0), "height_m": 2.5, "searched_s": 20.1}),
        ("place unknown", {"known": SURE._replace(sigma_m=float("nan")), "for_s": 2.1}),
        ("adrift", {"height_m": 0.05, "beside_m": 0.6}),
        ("fast", {"height_m": 0.05, "speed_m_s": 0.7}),
    ],
)
def test_each_cause_breaks_a_landing_off_once_and_only_while_it_lands(what, changed):
    after = minded(**changed)
    assert (after.away, after.times) == (1.0, 1.0), what
    assert minded(**{**changed, "landing": False}).away == 0.0
    assert minded(**{**changed, "gains": GAINS._replace(go_around_height_m=0.0)}).away == 0.0
    assert minded(**{**changed, "before": GoAround(0.0, 2.0, 0.0)}).away == 0.0  # it went twice: it lands


@pytest.mark.parametrize(
    "changed",
    [
        {"known": SURE._replace(pad_unseen_s=9.0), "height_m": 0.4},  # so low no camera sees it
        {"known": SURE._replace(pad_unseen_s=9.0), "height_m": 2.6},  # nor so high
        {"known": SURE._replace(sigma_m=0.6), "for_s": 1.9},
        {"known": SURE._replace(doubted=1.0), "for_s": 9.0},  # in sight of the pad no sensor leads it away
        {"known": SURE._replace(sigma_m=0.6), "height_m": 0.05, "for_s": 9.0},  # committed
        {"known": SURE._replace(pad_found=0.0, sigma_m=9.0), "for_s": 9.0},  # not found yet: it looks for it
        {"beside_m": 0.6, "speed_m_s": 0.7, "height_m": 0.2},
        {"beside_m": 0.6, "speed_m_s": 0.7, "height_m": 0.01},  # the skids may touch already
        {"known": SURE._replace(pad_found=0.0), "beside_m": 0.6, "height_m": -1.0},  # a height that nothing tells
    ],
)
def test_what_is_no_cause(changed):
    assert minded(**changed).away == 0.0


def test_aloft_it_waits_until_all_is_well_for_three_seconds_and_comes_down():
    away = GoAround(1.0, 1.0, 0.0)
    well = {"height_m": 2.4, "before": away}
    assert minded(**well, for_s=2.9).away == 1.0
    assert minded(**well, for_s=3.1) == GoAround(0.0, 1.0, pytest.approx(0.0))
    for unwell in (
        {"known": SURE._replace(pad_unseen_s=1.1)},
        {"known": SURE._replace(sigma_m=0.6)},
        {"known": SURE._replace(pad_found=0.0)},
        {"beside_m": 0.6},
        {"height_m": 1.5},
    ):
        assert minded(**{**well, **unwell}, for_s=30.0) == away


def test_without_a_camera_the_pad_need_not_be_seen():
    known = SURE._replace(pad_unseen_s=1e6)
    gains = GAINS._replace(search_height_m=0.0)
    assert minded(known, height_m=2.4, before=GoAround(1.0, 1.0, 0.0), gains=gains, for_s=3.1).away == 0.0
    assert minded(known, height_m=1.0, gains=gains, for_s=30.0).away == 0.0


def test_one_gust_beside_the_pad_does_not_begin_the_wait_anew():
    gust = {"height_m": 2.4, "before": GoAround(1.0, 1.0, 2.5)}
    assert minded(**gust, beside_m=0.6).since_s == pytest.approx(2.48)


def test_without_a_camera_it_waits_no_longer_than_it_can_help():
    unsure, gains = SURE._replace(sigma_m=0.6, pad_unseen_s=1e6), GAINS._replace(aloft_most_s=20.0)
    aloft = {"known": unsure, "height_m": 2.4, "before": GoAround(1.0, 1.0, 0.0)}
    blind = gains._replace(search_height_m=0.0)
    assert minded(**aloft, gains=blind, waited_s=19.9).away == 1.0
    assert minded(**aloft, gains=blind, waited_s=20.1).away == 0.0
    assert minded(**aloft, gains=gains, waited_s=99.0).away == 1.0  # a camera must find the pad


def test_it_climbs_to_its_height_and_stays_there():
    assert climb_out(0.0, GAINS) == -GAINS.climb_limit_m_s
    assert climb_out(GAINS.go_around_height_m, GAINS) == 0.0
    assert climb_out(9.0, GAINS) == GAINS.climb_limit_m_s


def test_it_looks_for_its_pad_where_it_is_low_over_ground_that_it_knows():
    lost = SURE._replace(pad_found=0.0)
    assert seeks(lost, 0.0, 2.5, GAINS)
    assert not seeks(lost._replace(ground_found=0.0), 0.0, 2.5, GAINS)
    assert not seeks(lost, 0.0, 3.0, GAINS)
    assert not seeks(SURE, 0.0, 1.0, GAINS)
    assert seeks(SURE._replace(pad_unseen_s=2.1), 1.0, 2.5, GAINS)  # it had it and lost it
    assert not seeks(SURE._replace(pad_unseen_s=2.1), 0.0, 2.5, GAINS)


def test_the_search_goes_out_at_walking_pace_and_round():
    assert search_offset(0.0, GAINS) == (0.0, 0.0)
    for t_s in (1.0, 5.0, 20.0, 23.5):
        north, east = search_offset(t_s, GAINS)
        later_n, later_e = search_offset(t_s + 1e-3, GAINS)
        assert north**2 + east**2 == pytest.approx(min(SEARCH_M_S * t_s, 3.0) ** 2)
        speed = ((later_n - north) ** 2 + (later_e - east) ** 2) ** 0.5 / 1e-3
        assert speed <= 2.0 * SEARCH_M_S


def test_a_landing_that_is_broken_off_must_be_one():
    with pytest.raises(ValidationError, match=r"needs \[autopilot.precision\]"):
        AutopilotSection(go_around=GoAroundSection())
    assert AutopilotSection(precision=PrecisionSection(), go_around=GoAroundSection()).go_around is not None
