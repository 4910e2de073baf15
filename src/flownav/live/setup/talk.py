"""A conversation with one vehicle over any link: its messages, our heartbeat, and time limits."""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from typing import Any

from flownav.live.link import Link
from flownav.live.reception import Reception, Vehicle
from flownav.mavlink.dialect import INVALID_AUTOPILOT, Message, coder
from flownav.mavlink.sensors_outgoing import MAVLINK_VERSION
from flownav.mavlink.signing import sign_outgoing

COMPANION = 197  # MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY, which `live` speaks as
ONBOARD_CONTROLLER, ACTIVE = 18, 4  # MAV_TYPE, MAV_STATE
ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
FRESH_S = 3.0  # an older HEARTBEAT does not say whether the vehicle is armed
WAIT_S = 0.02
HEARTBEAT_S = 1.0


def waited(link: Link, seconds: float) -> None:
    """Until something arrives, or so long."""
    if link.fileno() < 0:
        time.sleep(seconds)
    else:
        select.select([link.fileno()], [], [], seconds)


class Talk:
    """Who is spoken with, and what is said. clock and wait are the machine's unless a test gives its own."""

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
        self.mav: Any = coder(1, COMPANION)
        self._beat_s = self._armed_s = float("-inf")
        self._armed = False

    @property
    def vehicle(self) -> Vehicle | None:
        """The first autopilot that was heard."""
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
            self.say(self.mav.heartbeat_encode(ONBOARD_CONTROLLER, INVALID_AUTOPILOT, 0, 0, ACTIVE, MAVLINK_VERSION))
        self._wait(self._link, seconds)
        messages: list[Message] = []
        for piece, sender in self._link.read():
            before = self.reception.received
            messages += self.reception.feed(piece, whole=self._link.datagrams)
            if self.reception.received > before:
                self._link.believe(sender)
        for message in messages:
            if message.msgname == "HEARTBEAT":
                self._armed, self._armed_s = bool(message.base_mode & ARMED), self.clock()
        if self.vehicle is not None:
            self.mav.srcSystem = self.vehicle.system
        return messages

    def meet(self, limit_s: float) -> Vehicle | None:
        """Wait for an autopilot's HEARTBEAT; None where none came."""
        end_s = self.clock() + limit_s
        while self.vehicle is None and self.clock() < end_s:
            self.hear()
        return self.vehicle
