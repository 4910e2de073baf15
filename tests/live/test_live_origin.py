"""Where the autopilot's frame begins: one message moves nothing far, and what moves is counted as a jump."""

from __future__ import annotations

import itertools
import math

import pytest

from flownav.live.options import Options
from flownav.live.origin import AGREEMENTS, FAR_M, STEP_M, Origin
from flownav.logs.mavlink.position_messages import local_position_m
from live_ends import METRES_A_DEGREE, ORIGIN, Hover, Wire, hovering

HERE = (0.0, 0.0, 0.0)


def north_of(place, north_m, up_m=0.0):
    return place[0] + north_m / METRES_A_DEGREE, place[1], place[2] + up_m


def origin_message(wire, place):
    encoded = wire.vehicle.mav.gps_global_origin_encode(
        round(place[0] * 1e7), round(place[1] * 1e7), round(place[2] * 1e3)
    )
    return bytes(encoded.pack(wire.vehicle.mav))


def stands(wire, origin):
    """LOCAL_POSITION_NED of an autopilot whose frame begins at an origin, twice a second."""
    steps = iter(range(100_000))

    def due():
        if next(steps) % 50 == 0:
            place = local_position_m(ORIGIN, origin)
            wire.socket.send(
                bytes(wire.vehicle.mav.local_position_ned_encode(1, *place, 0, 0, 0).pack(wire.vehicle.mav))
            )

    return due


def jumps(wire, since_s):
    found = wire.estimates(since_s)
    return max(math.dist((a.x, a.y, a.z), (b.x, b.y, b.z)) for a, b in itertools.pairwise(found))


@pytest.mark.parametrize("north_m", [30.0, 500.0, 5000.0, 44_000.0])
def test_one_message_in_flight_moves_nothing(north_m):
    """5 km and 44 km moved what was sent by as much, at once, quality 69."""
    wire = hovering(6)
    wire.send(origin_message(wire, north_of(ORIGIN, north_m)))
    wire.fly(4.0)
    assert wire.session.reason == ""
    assert len(wire.estimates(6.0)) > 100
    assert jumps(wire, 5.0) < 0.2
    assert wire.session.resets == hovering(6).session.resets
    assert wire.session.intake.origin.as_facts()["doubted"] == pytest.approx(north_of(ORIGIN, north_m), abs=1e-3)
    asked = [m for m in wire.heard if m.msgname == "COMMAND_LONG" and m.param1 == 32]
    assert asked, "where the autopilot is in it"


@pytest.mark.parametrize("up_m", [-300.0, 300.0])
def test_nor_does_one_of_another_height(up_m):
    wire = hovering(6)
    wire.send(origin_message(wire, north_of(ORIGIN, 0.0, up_m)))
    wire.fly(3.0)
    assert jumps(wire, 5.0) < 0.2


def test_where_the_autopilot_stands_in_its_old_frame_it_is_refused():
    wire = hovering(6)
    wire.send(origin_message(wire, north_of(ORIGIN, 5000.0)))
    wire.fly(4.0, beside=stands(wire, ORIGIN))
    origin = wire.session.intake.origin
    assert (origin.refused, origin.moves, origin.doubted) == (1, 0, None)
    assert wire.session.dropped["origin: refused"] == 1
    assert jumps(wire, 5.0) < 0.2


def test_where_it_stands_in_the_new_one_it_is_followed_as_a_jump_that_is_counted():
    wire = hovering(6)
    before = wire.session.resets
    wire.send(origin_message(wire, north_of(ORIGIN, 5000.0)))
    wire.fly(4.0, beside=stands(wire, north_of(ORIGIN, 5000.0)))
    told = wire.estimates(6.0)
    assert told[0].x == pytest.approx(0.0, abs=3.0)
    assert told[-1].x == pytest.approx(-5000.0, abs=15.0)  # 5000 m by METRES_A_DEGREE
    assert (told[-1].reset_counter - told[0].reset_counter) % 256 == 1
    assert wire.session.resets == before + 1


def test_a_far_origin_before_the_first_estimate_is_waited_for():
    """The session began in flight, 5 km from where the autopilot did: it says so, and then it is sent."""
    for truth, north_m in ((north_of(ORIGIN, 5000.0), -5000.0), (ORIGIN, 0.0)):
        wire = Wire(Hover(), Options())
        wire.fly(0.1)
        wire.send(origin_message(wire, north_of(ORIGIN, 5000.0)))
        wire.fly(5.0)
        assert wire.session.reason == "origin_doubted"
        assert not wire.estimates()
        wire.fly(4.0, beside=stands(wire, truth))
        assert wire.session.reason == ""
        assert wire.estimates()[0].x == pytest.approx(north_m, abs=15.0)
        assert jumps(wire, 0.0) < 0.2
        wire.close()


# -- the judgement alone ------------------------------------------------------------------------------------
def settled():
    origin = Origin()
    origin.fixed(ORIGIN)
    return origin


def test_near_ones_are_followed_at_once():
    assert settled().received(north_of(ORIGIN, 0.9 * STEP_M), settled=True) == "moved"
    assert settled().received(north_of(ORIGIN, 0.9 * FAR_M)) == "moved"
    assert settled().received(north_of(ORIGIN, 1.1 * FAR_M)) == "doubted"
    assert settled().received(north_of(ORIGIN, 1.1 * STEP_M), settled=True) == "doubted"


def test_positions_that_contradict_each_other_decide_nothing():
    origin = settled()
    origin.received(north_of(ORIGIN, 400.0), settled=True)
    for _ in range(3):
        for north_m in (0.0, 0.0, -400.0, -400.0, -200.0):
            assert origin.stands((north_m, 0.0, 0.0)) == ""


def test_as_many_in_a_row_as_are_needed_decide():
    origin = settled()
    origin.received(north_of(ORIGIN, 400.0), settled=True)
    said = [origin.stands((-400.0, 0.0, 0.0)) for _ in range(AGREEMENTS)]
    assert said == [""] * (AGREEMENTS - 1) + ["moved"]
    assert origin.stands((-400.0, 0.0, 0.0)) == ""
    assert origin.offset_ned_m[0] == pytest.approx(-400.0, abs=2.0)


def test_the_one_in_use_told_again_ends_the_doubt():
    origin = settled()
    origin.received(north_of(ORIGIN, 400.0), settled=True)
    assert origin.received(ORIGIN, settled=True) == ""
    assert origin.doubted is None


def test_a_first_fix_in_flight_far_from_what_was_told_is_doubted_too():
    origin = Origin()
    origin.received(north_of(ORIGIN, 5000.0))
    assert origin.fixed(ORIGIN, (7.0, 0.0, -3.0)) == "doubted"
    assert origin.navigator_deg_m == pytest.approx(north_of(ORIGIN, -7.0, -3.0), abs=1e-3)
    assert origin.offset_ned_m == HERE
