"""Which sender on a link is the vehicle's autopilot: by the type in its HEARTBEAT, and by the messages it sends.

One HEARTBEAT is one witness. A gimbal may announce itself as an autopilot, and another vehicle's may be received first;
an autopilot that is asked sends its motion and its position. Until an estimate is sent, a better one replaces the
first; from then on it is only reported.
"""

from dataclasses import dataclass

from flownav.logs.mavlink.framing import ARDUPILOT, INVALID_AUTOPILOT, PX4, Message, dialect

Who = tuple[int, int]  # system and component
AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
# MAV_TYPE of what is no vehicle: antenna tracker, ground station, onboard controller, gimbal, ADS-B, camera, charging
# station, FLARM, servo, remote identification, battery, parachute, log, OSD, IMU, GPS, winch, illuminator
NO_VEHICLES = {5, 6, 18, 26, 27, 30, 31, 32, 33, 34, 36, 37, 38, 39, 40, 41, 42, 44}
NONE, COMPONENT, VEHICLE, KNOWN = range(4)  # what a HEARTBEAT makes of its sender, the better later
MOVES = ("HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3", "ATTITUDE", "ATTITUDE_QUATERNION")
PLACES = ("GPS_RAW_INT", "OPTICAL_FLOW", "OPTICAL_FLOW_RAD")
TURN_S = 5.0  # to send both: chosen; an autopilot that answers was asked for all within 2 s (test_live_recordings)
MOST = 64  # that are remembered: chosen


def standing(component: int, kind: int, make: int, *, named: bool = False) -> int:
    """The standing of a sender by its HEARTBEAT; kind: MAV_TYPE, make: MAV_AUTOPILOT.

    NONE: no autopilot. COMPONENT: an autopilot by its type, with another component's number. VEHICLE: an autopilot
    by its number as well. KNOWN: of a make whose streams we know. named: it was asked for by its number, which is
    enough.
    """
    if make == INVALID_AUTOPILOT:
        return NONE
    if kind in NO_VEHICLES and not named:
        return NONE
    if component != AUTOPILOT and not named:
        return COMPONENT
    return KNOWN if make in (ARDUPILOT, PX4) else VEHICLE


@dataclass
class Candidate:
    """A sender that may be the autopilot.

    moves, places: whether it sent its motion and its position. turn_s: our clock when it was taken, None while it
    never was.
    """

    who: Who
    make: int
    standing: int
    moves: bool = False
    places: bool = False
    turn_s: float | None = None

    @property
    def needs_met(self) -> int:
        """The number of the two needed kinds of message (motion, position) that it has sent: 0, 1 or 2."""
        return self.moves + self.places

    def may_serve(self, now_s: float, *, taken: bool) -> bool:
        """Whether it has sent both, or still has time to; taken: it is the one in use."""
        return self.needs_met == 2 or self.turn_s is None or (taken and now_s - self.turn_s <= TURN_S)


class Autopilots:
    """All senders received so far. component: the one that is asked for, if any."""

    def __init__(self, component: int | None = None) -> None:
        self._named = component is not None
        self.candidates: dict[Who, Candidate] = {}
        self._moves, self._places = map(_numbers, (MOVES, PLACES))

    def heartbeat(self, who: Who, message: Message) -> Candidate | None:
        """Note its sender; None where that is no autopilot."""
        make = int(message.autopilot)
        found = standing(who[1], int(message.type), make, named=self._named)
        if found == NONE or (who not in self.candidates and len(self.candidates) >= MOST):
            return None
        known = self.candidates.setdefault(who, Candidate(who, make, found))
        known.standing = max(known.standing, found)
        return known

    def received(self, who: Who, number: int) -> None:
        """A message of one of them."""
        known = self.candidates.get(who)
        if known is not None:
            known.moves = known.moves or number in self._moves
            known.places = known.places or number in self._places

    def better(self, who: Who, now_s: float) -> Candidate | None:
        """Who is to be taken in place of the one that is; None where nobody is better."""
        current, candidates = self.candidates.get(who), list(self.candidates.values())
        if current is None:
            return None
        current.turn_s = now_s if current.turn_s is None else current.turn_s
        serving = [one for one in candidates if one.may_serve(now_s, taken=one is current)]
        if serving:
            best = max(serving, key=lambda one: (one.needs_met == 2, one.standing, one.needs_met, one is current))
        else:  # of those that send neither one after the other is asked
            best = max(
                candidates, key=lambda one: (one.needs_met, one is current and one.needs_met > 0, -(one.turn_s or 0.0))
            )
        if best is current:
            return None
        best.turn_s = now_s
        return best


def _numbers(names: tuple[str, ...]) -> frozenset[int]:
    return frozenset(int(getattr(dialect(), f"MAVLINK_MSG_ID_{name}")) for name in names)
