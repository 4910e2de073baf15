"""A conversation with one vehicle over any link: its messages, our heartbeat, time limits, and its parameters.

Parameters are read and written a few at a time, asked for again, with an end.
"""

import struct
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from flownav.live.link import Link, waited
from flownav.live.reception import Reception, Vehicle
from flownav.logs.mavlink.framing import Message, Value, coder, decoded, encoded, name_of, request_read, set_value
from flownav.logs.mavlink.outgoing import ODOMETRY_COMPONENT, companion_heartbeat
from flownav.logs.mavlink.signing import sign_outgoing

ARMED_FLAG = 128  # MAV_MODE_FLAG_SAFETY_ARMED
BETTER_S = 2.5  # for an autopilot beside a gimbal that says it is one: chosen, two HEARTBEATs
FRESH_S = 3.0  # an older HEARTBEAT does not show whether the vehicle is armed: chosen, three of them
WAIT_S = 0.02  # chosen
HEARTBEAT_S = 1.0
AT_ONCE = 4  # requests under way: an autopilot's queue is short, and so is a slow link's; chosen
ANSWER_S = 0.5
TRIES = 8  # at 30 % loss each way one in 200 is still missed
LIMIT_S = 60.0  # chosen: reading ends although much never answers (test_live_setup)
UNKNOWN_PARAMETER = 1  # MAV_PARAM_ERROR_DOES_NOT_EXIST


class Talk:
    """The exchange of messages with a vehicle. clock and wait are the machine's unless a test gives its own."""

    def __init__(
        self,
        link: Link,
        *,
        system: int | None = None,
        component: int | None = None,
        key: bytes | None = None,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[Link, float], None] = waited,
    ) -> None:
        self._link, self._key, self.clock, self._wait = link, key, clock, wait
        self._unix_less_now_s = time.time() - clock()
        self.reception = Reception(system, component, key, time.time(), accept=())
        self.mav: Any = coder(1, ODOMETRY_COMPONENT)
        self._beat_s = self._armed_s = float("-inf")
        self._armed = False

    @property
    def vehicle(self) -> Vehicle | None:
        """The first autopilot that was received."""
        return self.reception.vehicle

    @property
    def armed(self) -> bool | None:
        """Whether the vehicle is armed; None where its last HEARTBEAT is too old to tell."""
        return self._armed if self.clock() - self._armed_s <= FRESH_S else None

    def say(self, message: Message) -> None:
        """Send a message, signed where there is a key."""
        if self._key is not None:
            sign_outgoing(self.mav, self._key, self.clock() + self._unix_less_now_s)
        self._link.write(bytes(message.pack(self.mav)))

    def hear(self, seconds: float = WAIT_S) -> list[Message]:
        """The vehicle's messages of at most so long; our heartbeat goes out meanwhile."""
        now_s = self.clock()
        if now_s - self._beat_s >= HEARTBEAT_S:
            self._beat_s = now_s
            self.say(companion_heartbeat(self.mav))
        self._wait(self._link, seconds)
        messages: list[Message] = []
        for piece, sender in self._link.read():
            before = self.reception.received
            messages += self.reception.feed(piece, whole=self._link.datagrams)
            if self.reception.received > before:
                self._link.believe(sender)
        for message in messages:
            if message.msgname == "HEARTBEAT":
                self._armed, self._armed_s = bool(message.base_mode & ARMED_FLAG), self.clock()
        if self.vehicle is not None:
            self.mav.srcSystem = self.vehicle.system
        return messages

    def meet(self, limit_s: float) -> Vehicle | None:
        """Wait for an autopilot's HEARTBEAT; None where none came. One of an unknown make may give way to a better."""
        end_s = self.clock() + limit_s
        while self.vehicle is None and self.clock() < end_s:
            self.hear()
        end_s = self.clock() + BETTER_S
        while self.vehicle is not None and not self.reception.known and self.clock() < end_s:
            self.hear()
            better = self.reception.better(self.clock())
            if better is not None:
                self.reception.take(better)
        return self.vehicle


class Change(NamedTuple):
    """A parameter that was to be written. after: the value that the vehicle reports now, None where it did not
    answer.
    """

    name: str
    before: float
    asked: float
    after: float | None

    @property
    def done(self) -> bool:
        """Whether the vehicle has what was asked for."""
        return self.after is not None and same(self.after, self.asked)


def same(one: float, other: float) -> bool:
    """Whether two numbers are the same 32-bit float."""
    return struct.pack("<f", one) == struct.pack("<f", other) or one == other


def read(talk: Talk, names: list[str], limit_s: float = LIMIT_S) -> dict[str, Value]:
    """The values of the parameters that the vehicle has. Those that never answered are not among them.

    Where the first few are not answered at all, no more are asked for.
    """
    vehicle = talk.vehicle
    assert vehicle is not None
    values: dict[str, Value] = {}
    left, asked_s, tries = list(names), dict.fromkeys(names, float("-inf")), dict.fromkeys(names, 0)
    end_s = talk.clock() + limit_s
    while left and talk.clock() < end_s:
        for name in left[:AT_ONCE]:
            if talk.clock() - asked_s[name] < ANSWER_S:
                continue
            if tries[name] >= TRIES:
                left.remove(name)
                if not values and len(names) - len(left) >= AT_ONCE:
                    return values
                continue
            asked_s[name] = talk.clock()
            tries[name] += 1
            talk.say(request_read(talk.mav, vehicle.system, vehicle.component, name))
        for message in talk.hear():
            if message.msgname == "PARAM_VALUE" and name_of(message) in tries:
                values[name_of(message)] = decoded(message, vehicle.make)
            elif message.msgname != "PARAM_ERROR" or message.error != UNKNOWN_PARAMETER:
                continue
            if name_of(message) in left:
                left.remove(name_of(message))
    return values


def write(talk: Talk, name: str, before: Value, number: float) -> Change | str:
    """Set a parameter and wait until the vehicle reports the new value. A sentence where it is not written at all."""
    vehicle = talk.vehicle
    assert vehicle is not None
    try:
        encoded(wanted := Value(number, before.kind), vehicle.make)
    except struct.error:
        return f"{name}: {number:g} does not fit into the vehicle's type of it"
    after: float | None = None
    for _ in range(TRIES):
        if refusal := why_not(talk):
            return refusal
        talk.say(set_value(talk.mav, vehicle.system, vehicle.component, name, wanted, vehicle.make))
        end_s = talk.clock() + ANSWER_S
        while talk.clock() < end_s:
            for message in talk.hear():
                if message.msgname == "PARAM_VALUE" and name_of(message) == name:
                    after = decoded(message, vehicle.make).number
            if after is not None and same(after, number):
                return Change(name, before.number, number, after)
    return Change(name, before.number, number, after)


def why_not(talk: Talk) -> str:
    """Why nothing is written to the vehicle now; "" where it may be."""
    if talk.armed is None:
        return "nothing is written: the vehicle's HEARTBEAT is too old to show that it is disarmed"
    return "nothing is written while the vehicle is armed: disarm it first" if talk.armed else ""
