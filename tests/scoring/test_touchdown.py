"""The touchdown against motions made by hand: contact, rest, what limits it, what breaks it, and how many succeed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from flownav.scoring.course import first_contact
from flownav.scoring.landings import (
    CONTACT_DISTANCE,
    succeeded,
    success,
    touchdown_of_flight,
    touchdown_of_flights,
    verdict_of,
    with_reason,
)
from flownav.scoring.touchdown import (
    TOUCHDOWN_COLUMNS,
    Limits,
    Motion,
    motion_of,
    touchdowns,
)

LIMITS = Limits(2.0, 0.6, 10.0, 45.0, 0.3)
FLYING, STANDING = 100, 100
EPOCHS = FLYING + STANDING
T_S = 0.02 * np.arange(EPOCHS)


def contacts(pattern):
    """on_ground (epochs, 1) from runs of (value, epochs)."""
    return np.concatenate([np.full(count, float(value)) for value, count in pattern])[:, None]


def landing(**changed):
    """Two seconds of flight and two on the ground, 3 m north and 4 m east, at rest at once; arrays (epochs, 1)."""
    flying = np.arange(EPOCHS)[:, None] < FLYING
    flown = {
        "place_m": np.tile(np.array([[3.0], [4.0]]), (EPOCHS, 1, 1)),
        "cg_height_m": np.where(flying, 0.5, 0.22),
        "sink_m_s": np.where(flying, 0.3, 0.0),
        "lateral_m_s": np.where(flying, 0.1, 0.0),
        "tilt_deg": np.where(flying, 5.0, 0.5),
        "yaw_rate_deg_s": np.where(flying, 3.0, 0.0),
        "on_ground": np.where(flying, 0.0, 1.0),
    }
    return Motion(**{name: np.asarray(changed.get(name, values), float) for name, values in flown.items()})


def row_of(motion, error=None, seen=None, may_land_after_s=0.0, limits=LIMITS, away=None):
    """One lane's row."""
    error = np.zeros((EPOCHS, 2, 1)) if error is None else error
    seen = np.zeros((EPOCHS, 1)) if seen is None else seen
    return touchdowns(
        T_S, motion, error, seen, np.zeros((EPOCHS, 1)) if away is None else away, limits, may_land_after_s
    )[0]


def test_a_touch_that_a_go_around_follows_is_no_touchdown():
    """It touches 0.2 m beside the pad for a moment, goes around, and lands on the pad's middle."""
    touch = slice(FLYING // 2, FLYING // 2 + 3)
    ground = np.where(np.arange(EPOCHS)[:, None] < FLYING, 0.0, 1.0)
    ground[touch] = 1.0
    place = np.zeros((EPOCHS, 2, 1))
    place[: FLYING // 2 + 10, 0] = 0.2
    away = np.zeros((EPOCHS, 1))
    away[FLYING // 2 + 2 : FLYING - 30] = 1.0
    row = row_of(landing(on_ground=ground, place_m=place), away=away)
    assert verdict_of(row) == "landed"
    assert row[CONTACT_DISTANCE] == pytest.approx(0.0)
    assert row[TOUCHDOWN_COLUMNS.index("go_arounds")] == 1.0
    aloft = np.where(np.arange(EPOCHS)[:, None] < FLYING, ground, 0.0)
    assert verdict_of(row_of(landing(on_ground=aloft, place_m=place), away=away)) == "went around"
    assert verdict_of(row_of(landing(on_ground=aloft, place_m=place))) != "went around"
    said = with_reason({"touchdown": flight(landing(on_ground=aloft, place_m=place), away=away)}, 4.0, {})["touchdown"]
    assert said["reason"] == "broke its landing off 1 time, 4.00 m over the ground when the flight ends"
    assert said["contact"]["distance_m"] is None
    assert said["limited_by"] is None


def flight(motion, **options):
    """One flight's touchdown as JSON has it."""
    return touchdown_of_flight(row_of(motion, **options))


# -- contact -----------------------------------------------------------------------------------------------------
def test_touchdown_is_the_first_contact_after_half_a_second_of_flight():
    flutter, bounce = [(1, 5), (0, 3), (1, 2)], [(0, 30), (1, 4), (0, 40), (1, 4)]
    assert first_contact(contacts([*flutter, *bounce])).tolist() == [40]
    assert first_contact(contacts([(0, 50)])).tolist() == [-1]


@pytest.mark.parametrize(("epochs", "airborne"), [(24, False), (25, True)])
def test_half_a_second_without_contact_at_50_hz_is_a_flight(epochs, airborne):
    assert first_contact(contacts([(1, 5), (0, epochs), (1, 5)])).tolist() == [5 + epochs if airborne else -1]


def test_contact_has_the_motion_just_before_it_and_the_place_where_it_is():
    contact = flight(landing())["contact"]
    wanted = {"t_s": 2.0, "north_m": 3.0, "east_m": 4.0, "distance_m": 5.0, "sink_rate_m_s": 0.3,
              "lateral_speed_m_s": 0.1, "tilt_deg": 5.0, "yaw_rate_deg_s": 3.0}  # fmt: skip
    assert contact == pytest.approx(wanted)


def test_the_place_is_that_of_the_skids_under_a_tilted_vehicle():
    """Rolled right by 30 degrees, body down points left: the skids are 0.2 sin 30 to the west of its middle."""
    half = np.radians(15.0)
    quaternion = np.array([np.cos(half), np.sin(half), 0.0, 0.0]).reshape(1, 4, 1)
    position, velocity = np.array([1.0, 2.0, -3.0]).reshape(1, 3, 1), np.array([0.6, 0.8, 0.0]).reshape(1, 3, 1)
    motion = motion_of(position, velocity, quaternion, np.full((1, 1), -np.pi), np.zeros((1, 1)), 0.2)
    assert motion.place_m[0, :, 0] == pytest.approx([1.0, 2.0 - 0.1])
    assert motion.tilt_deg[0, 0] == pytest.approx(30.0)
    assert motion.cg_height_m[0, 0] == 3.0
    assert motion.yaw_rate_deg_s[0, 0] == pytest.approx(180.0)
    assert motion.sink_m_s[0, 0] == pytest.approx(0.4)
    assert motion.lateral_m_s[0, 0] == pytest.approx(np.hypot(0.6, 0.8 * np.cos(2.0 * half)))


def test_a_flight_that_was_not_to_land_and_never_touches_has_none():
    assert flight(landing(on_ground=np.zeros((EPOCHS, 1))), may_land_after_s=1e9) is None
    many = touchdown_of_flights(row_of(landing(on_ground=np.zeros((EPOCHS, 1))), may_land_after_s=1e9)[None, :])
    assert many is None


# -- rest ---------------------------------------------------------------------------------------------------------
def test_rest_begins_when_the_last_motion_ends_and_is_where_the_flight_ends():
    lateral = landing().lateral_m_s.copy()
    lateral[FLYING : FLYING + 20] = 0.2
    place = landing().place_m.copy()
    place[FLYING + 20 :] += np.array([0.0, 0.1])[:, None]
    rest = flight(landing(lateral_m_s=lateral, place_m=place))["rest"]
    assert rest["t_s"] == pytest.approx((FLYING + 20) * 0.02)
    assert rest["slide_m"] == pytest.approx(0.1)
    assert rest["distance_m"] == pytest.approx(np.hypot(3.0, 4.1))
    assert rest["tilt_deg"] == 0.5


@pytest.mark.parametrize(("moving", "rests"), [(50, True), (51, False)])
def test_a_second_without_motion_is_rest(moving, rests):
    rate = landing().yaw_rate_deg_s.copy()
    rate[FLYING : FLYING + moving] = 16.0
    found = flight(landing(yaw_rate_deg_s=rate))
    assert (found["rest"] is not None) == rests
    assert found["success"] == rests
    assert found["broken"] == []


# -- limits and crashes ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("sink_m_s", 2.1, "sink rate"),
        ("lateral_m_s", 0.7, "lateral speed"),
        ("tilt_deg", 11.0, "tilt"),
        ("yaw_rate_deg_s", 46.0, "yaw rate"),
    ],
)
def test_what_exceeds_a_limit_at_contact_is_a_crash_and_says_which(name, value, said):
    changed = getattr(landing(), name).copy()
    changed[:FLYING] = value
    found = flight(landing(**{name: changed}))
    assert found["broken"] == [said]
    assert not found["success"]
    changed[:FLYING] = 0.85 * value
    assert flight(landing(**{name: changed}))["success"]


def test_a_slide_beyond_the_limit_is_a_crash():
    place = landing().place_m.copy()
    place[-1] += 0.31 / np.sqrt(2.0)
    assert flight(landing(place_m=place))["broken"] == ["slide"]


def test_a_rollover_on_the_ground_is_a_crash_however_soft_the_contact_was():
    tilt = landing().tilt_deg.copy()
    tilt[FLYING + 10 :] = 179.0
    assert flight(landing(tilt_deg=tilt))["broken"] == ["rolled over"]
    tilt[FLYING + 10 :] = 29.0
    assert flight(landing(tilt_deg=tilt))["success"]


def test_a_vehicle_that_rolls_over_before_it_ever_flew_has_crashed():
    standing = np.ones((EPOCHS, 1))
    found = flight(landing(on_ground=standing, tilt_deg=np.full((EPOCHS, 1), 40.0)))
    assert (found["broken"], found["contact"]) == (["rolled over"], None)


@pytest.mark.parametrize("height_m", [-0.1, np.nan])
def test_below_the_ground_or_nowhere_is_a_crash(height_m):
    height = landing().cg_height_m.copy()
    height[50] = height_m
    assert flight(landing(cg_height_m=height))["broken"] == ["below the ground"]


def test_a_contact_before_landing_is_allowed_is_a_crash_and_no_touchdown():
    found = flight(landing(), may_land_after_s=2.5)
    assert (found["contact"], found["rest"], found["broken"]) == (None, None, ["before it may land"])


# -- what limits it ---------------------------------------------------------------------------------------------------
def test_guidance_estimate_and_pad_add_up_to_the_place():
    """The pad is last seen at 1 s, when the estimate in use is off by (0.3, 0); at contact it is off by (0.3, 0.4)."""
    error = np.zeros((EPOCHS, 2, 1))
    error[:51, 0] = 0.3
    error[51:] = np.array([[0.3], [0.4]])
    seen = (T_S <= 1.0).astype(float)[:, None]
    limited = flight(landing(), error=error, seen=seen)["limited_by"]
    assert limited == pytest.approx({"estimate_m": 0.4, "guidance_m": np.hypot(3.3, 4.4), "pad_m": 0.3})


def test_a_pad_that_is_seen_again_after_the_contact_was_last_seen_before_it():
    error = np.zeros((EPOCHS, 2, 1))
    error[:50, 0], error[FLYING:, 0] = 0.5, 9.0
    seen = np.ones((EPOCHS, 1))
    seen[40 : FLYING + 1] = 0.0
    limited = flight(landing(), error=error, seen=seen)["limited_by"]
    assert (limited["pad_m"], limited["estimate_m"]) == pytest.approx((0.5, 8.5))


# -- many flights --------------------------------------------------------------------------------
def rows(distances, crashed=(), missing=()):
    """Touchdowns at these distances, contact and rest alike."""
    found = np.zeros((len(distances), len(TOUCHDOWN_COLUMNS)))
    for name in ("contact.distance_m", "rest.distance_m"):
        found[:, TOUCHDOWN_COLUMNS.index(name)] = distances
    found[:, TOUCHDOWN_COLUMNS.index("expected")] = 1.0
    found[list(crashed), TOUCHDOWN_COLUMNS.index("broken")] = 6.0
    found[list(missing), TOUCHDOWN_COLUMNS.index("rest.distance_m")] = np.nan
    return found


def test_the_radius_of_many_counts_crashes_and_what_never_came_to_rest_as_infinitely_far_off():
    many = touchdown_of_flights(rows(np.arange(1.0, 101.0), missing=range(6)))
    assert many["contact"]["r95_m"] == 95.0
    assert (many["rest"]["r95_m"], many["rest"]["r95_interval_m"][1]) == (None, None)
    crashes = touchdown_of_flights(rows(np.arange(1.0, 101.0), crashed=range(3)))
    assert crashes["rest"]["r95_m"] == 98.0
    assert many["unfinished"] == {"never touched": 0, "never at rest": 6}
    assert crashes["unfinished"] == {"never touched": 0, "never at rest": 0}
    assert crashes["broken"] == {"sink rate": 3, "lateral speed": 3}
    low, high = crashes["contact"]["r95_interval_m"]
    assert low < 98.0
    assert high is None
    assert crashes["contact"]["distance_m"]["median"] == 50.5


def test_success_has_clopper_and_pearsons_interval():
    many = rows(np.ones(40), crashed=[3], missing=[7])
    assert succeeded(many).sum() == 38
    found = success(many)
    low, high = stats.beta.ppf(0.025, 38, 3), stats.beta.ppf(0.975, 39, 2)
    assert (found["rate"], found["low"], found["high"]) == pytest.approx((0.95, low, high))
    assert success(rows(np.ones(10)))["high"] == 1.0


@pytest.mark.parametrize(("height_m", "reason"), [
    (0.42, "waits at the gate of 0.3 m, 0.42 m over the ground when the flight ends"),
    (2.6, "looks for its pad from 2.5 m, 2.60 m over the ground when the flight ends"),
    (1.1, "1.10 m over the ground when the flight ends"),
])  # fmt: skip
def test_a_flight_that_was_to_land_and_never_touched_says_so_and_why(height_m, reason):
    never = row_of(landing(on_ground=np.zeros((EPOCHS, 1))))
    scores = with_reason(
        {"touchdown": touchdown_of_flight(never)}, height_m, {"align_height_m": 0.3, "search_height_m": 2.5}
    )
    said = scores["touchdown"]
    assert (said["verdict"], said["reason"]) == ("never landed", reason)
    assert (said["contact"]["distance_m"], said["rest"]["distance_m"], said["limited_by"]) == (None, None, None)
    landed = {"touchdown": touchdown_of_flight(row_of(landing()))}
    assert with_reason(landed, height_m, {}) == landed


def test_flights_that_were_to_land_and_did_not_are_failures_and_not_unsaid():
    never = row_of(landing(on_ground=np.zeros((EPOCHS, 1))))[None, :]
    many = touchdown_of_flights(np.repeat(never, 5, axis=0))
    assert many["success"]["rate"] == 0.0
    assert many["unfinished"] == {"never touched": 5, "never at rest": 0}
    assert many["contact"]["r95_m"] is None
    assert many["limited_by"] == {"estimate_m": None, "guidance_m": None, "pad_m": None}


# -- the pad that a camera was to find -----------------------------------------------------------------------------
@pytest.mark.parametrize(("radius_m", "verdict"), [(5.01, "landed"), (4.99, "beside the pad"), (np.inf, "landed")])
def test_who_stands_beside_the_pad_that_was_to_be_found_has_not_landed(radius_m, verdict):
    """The vehicle of `landing` stands 3 m north and 4 m east of the pad's middle."""
    row = row_of(landing(), limits=LIMITS._replace(pad_radius_m=radius_m))
    assert verdict_of(row) == verdict
    assert succeeded(row[None, :])[0] == (verdict == "landed")
    both = touchdown_of_flights(np.vstack([row, row_of(landing())]))
    assert both["success"]["rate"] == (1.0 if verdict == "landed" else 0.5)
    assert both["rest"]["r95_m"] == pytest.approx(5.0)  # the distance counts as it is
    assert both["unfinished"] == {"never touched": 0, "never at rest": 0}
    assert both["broken"] == {}
