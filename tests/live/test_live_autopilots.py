"""Which sender is taken for the vehicle's autopilot, whatever is received first: no single HEARTBEAT is believed for
good.
"""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from flownav.live.autopilots import COMPONENT, KNOWN, NONE, TURN_S, VEHICLE, Autopilots, standing
from flownav.live.filtering import Keeper
from flownav.live.options import Options
from flownav.logs.mavlink.framing import ARDUPILOT, INVALID_AUTOPILOT, PX4, coder
from live_ends import ORIGIN, Hover, Wire, hovering

QUADROTOR, GIMBAL, GCS, TRACKER, GENERIC = 2, 26, 6, 5, 0
MOVES, PLACES = 105, 24  # HIGHRES_IMU, GPS_RAW_INT


class Notes(Keeper):
    """The notes of the session."""

    def __init__(self) -> None:
        super().__init__()
        self.said: list[str] = []

    def note(self, t_s, source, kind, detail="", value=float("nan")):
        self.said.append(f"{source} {kind} {detail}")


@pytest.fixture
def wires():
    made = []

    def make(vehicle=None, **options):
        made.append(Wire(vehicle or Hover(), Options(**options), Notes()))
        return made[-1]

    yield make
    for wire in made:
        wire.close()


def beat(system, component, kind, make):
    mav = coder(system, component)
    return bytes(mav.heartbeat_encode(kind, make, 128, 0, 4, 3).pack(mav))


def beats(wire, *who, send=None):
    """A HEARTBEAT of each a second, from the vehicle's own socket or another."""
    steps = iter(range(100_000))
    send = send or wire.socket.send

    def due():
        if next(steps) % 100 == 0:
            for one in who:
                send(beat(*one))

    return due


@pytest.mark.parametrize(
    ("component", "kind", "make", "found"),
    [
        (1, QUADROTOR, ARDUPILOT, KNOWN),
        (1, QUADROTOR, PX4, KNOWN),
        (1, QUADROTOR, GENERIC, VEHICLE),
        (1, QUADROTOR, INVALID_AUTOPILOT, NONE),
        (154, QUADROTOR, ARDUPILOT, COMPONENT),
        (50, GENERIC, 1, COMPONENT),  # a bare PX4FLOW
        (154, GIMBAL, GENERIC, NONE),
        (154, GIMBAL, ARDUPILOT, NONE),
        (190, GCS, INVALID_AUTOPILOT, NONE),
        (1, TRACKER, ARDUPILOT, NONE),
    ],
)
def test_what_a_heartbeat_makes_of_its_sender(component, kind, make, found):
    assert standing(component, kind, make) == found


def test_one_that_is_asked_for_by_its_number_needs_no_more():
    assert standing(154, GIMBAL, ARDUPILOT, named=True) == KNOWN
    assert standing(154, GIMBAL, INVALID_AUTOPILOT, named=True) == NONE


IMPOSTORS = {
    "gimbal": (1, 154, GIMBAL, GENERIC),
    "gimbal that says it is a vehicle": (1, 154, QUADROTOR, ARDUPILOT),
    "another system": (9, 1, QUADROTOR, ARDUPILOT),
    "another system of another make": (9, 1, QUADROTOR, PX4),
    "tracker": (9, 1, TRACKER, ARDUPILOT),
}


@pytest.mark.parametrize("who", IMPOSTORS.values(), ids=IMPOSTORS)
def test_the_one_that_is_heard_first_is_not_the_vehicle(wires, who):
    """It says so once a second, seconds before the autopilot; that one's readings are what is sent from."""
    wire = wires()
    wire.fly(3.0, silent=True, beside=beats(wire, who))
    wire.fly(14.0, beside=beats(wire, who))
    assert wire.session.reception.vehicle[:2] == (1, 1)
    assert wire.session.reason == ""
    assert len(wire.estimates()) > 100
    assert (tuple(who[:2]) in wire.session.reception.others) is (who[2] not in (GIMBAL, TRACKER))


def test_from_another_address_too(wires):
    """A UDP port hears anyone: an impostor from its own address was the vehicle for ever."""
    wire = wires()
    stranger = wire.another()
    wire.fly(3.0, silent=True, beside=beats(wire, (9, 1, QUADROTOR, ARDUPILOT), send=stranger.send))
    assert wire.session.reception.vehicle[:2] == (9, 1)
    wire.fly(14.0, beside=beats(wire, (9, 1, QUADROTOR, ARDUPILOT), send=stranger.send))
    stranger.close()
    assert wire.session.reception.vehicle[:2] == (1, 1)
    assert wire.session.reason == ""
    assert "link restart 1.1 is taken for the autopilot, in place of 9.1" in wire.session.keeper.said


def test_what_another_vehicle_said_of_its_place_is_forgotten_with_it(wires):
    """A helicopter's companion was received first, with its own receiver 30 m off and an origin in another town: the
    vehicle's own place was sent about them, 30 m and 44 km off, at quality 69."""
    wire, other, mav = wires(), Hover(boot_s=500.0, north_m=30.0), coder(1, 2)
    other.mav = mav

    def due():
        origin = mav.gps_global_origin_encode(round((ORIGIN[0] + 0.0003) * 1e7), round(ORIGIN[1] * 1e7), 400_000)
        wire.socket.send(bytes(origin.pack(mav)))
        for frame in other.frames(wire.t_s):
            wire.socket.send(frame)

    wire.fly(14.0, beside=due)
    assert wire.session.reception.vehicle[:2] == (1, 1)
    found = wire.estimates(12.0)
    assert len(found) > 50
    assert max(abs(message.x) for message in found) < 0.5
    assert wire.session.origin_deg_m == pytest.approx(ORIGIN, abs=1e-4)


def test_after_an_estimate_was_sent_a_better_one_is_only_said(wires):
    wire = wires().fly(6.0)
    assert wire.session.sent
    wire.fly(12.0, beside=beats(wire, (9, 1, QUADROTOR, ARDUPILOT)))
    assert wire.session.reception.vehicle[:2] == (1, 1)
    assert wire.session.reception.others == [(9, 1)]
    assert "link other_autopilot 9.1" in " ".join(wire.session.keeper.said)
    assert wire.session.reason == ""


def test_an_autopilot_that_sends_nothing_unasked_is_asked_in_its_turn(wires):
    """Two are received, and neither sends anything else: each is asked for its streams, one after the other."""
    wire = wires()
    wire.fly(3.0 * TURN_S, silent=True, beside=beats(wire, (9, 1, QUADROTOR, PX4), (1, 1, QUADROTOR, PX4)))
    asked = {m.target_system for m in wire.heard if m.msgname == "COMMAND_LONG"}
    assert asked == {1, 9}


# -- the choice alone ---------------------------------------------------------------------------------------
def heard(*who):
    autopilots = Autopilots()
    for system, component, make in who:
        autopilots.heartbeat((system, component), SimpleNamespace(type=QUADROTOR, autopilot=make))
    return autopilots


def test_one_alone_stays_whatever_it_tells():
    autopilots = heard((1, 1, GENERIC))
    assert all(autopilots.better((1, 1), now_s) is None for now_s in range(100))


def test_who_tells_all_stays_though_another_has_a_better_name():
    autopilots = heard((1, 1, GENERIC), (2, 1, ARDUPILOT))
    for number in (MOVES, PLACES):
        autopilots.received((1, 1), number)
    assert all(autopilots.better((1, 1), now_s) is None for now_s in range(100))


def test_who_tells_all_is_taken_from_one_that_tells_nothing():
    autopilots = heard((2, 1, ARDUPILOT), (1, 1, GENERIC))
    assert autopilots.better((2, 1), 0.0) is None
    for number in (MOVES, PLACES):
        autopilots.received((1, 1), number)
    assert autopilots.better((2, 1), 0.1).who == (1, 1)


def test_whose_turn_is_over_does_not_come_back_while_another_tells_more():
    autopilots = heard((2, 1, ARDUPILOT), (1, 1, ARDUPILOT))
    assert autopilots.better((2, 1), 0.0) is None
    assert autopilots.better((2, 1), TURN_S + 0.1).who == (1, 1)
    autopilots.received((1, 1), MOVES)
    assert all(autopilots.better((1, 1), TURN_S + 0.2 + now_s) is None for now_s in range(100))


def test_many_strangers_are_not_remembered_without_end():
    autopilots = heard(*((system, 1, ARDUPILOT) for system in range(1, 250)))
    assert len(autopilots.candidates) == 64


def test_the_vehicle_that_hovers_is_found_as_before():
    assert hovering(4).session.turns == 0


def test_messages_that_nobody_knows_are_no_losses(wires):
    """A vehicle of another dialect: 356 of its 357 frames were counted as lost."""
    wire = wires()
    strange = [0]

    def more():
        mav = wire.vehicle.mav
        wire.socket.send(bytes([0xFD, 4, 0, 0, mav.seq, 1, 1, 0x39, 0x30, 0, 1, 2, 3, 4, 5, 6]))  # number 12345
        mav.seq = (mav.seq + 1) % 256
        strange[0] += 1

    wire.fly(4.0, beside=more)
    assert strange[0] == 400
    assert wire.session.dropped["link: unknown_message"] == 400
    assert wire.session.dropped.get("link: lost", 0) == 0
    assert wire.session.reason == ""


def test_a_ground_station_is_no_other_autopilot(wires):
    wire = wires().fly(3.0, beside=None)
    wire.fly(3.0, beside=beats(wire, (255, 190, GCS, INVALID_AUTOPILOT)))
    assert wire.session.dropped["link: other_system"] >= 3
    assert wire.session.reception.others == []
