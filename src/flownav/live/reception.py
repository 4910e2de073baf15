"""From bytes to the messages of one vehicle, and the vehicle's time now.

Whole frames, signed where a key is asked for, of the sources accepted; stamps laid on our monotonic clock, and TIMESYNC
where it answers.
"""

import re
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from flownav.core.errors import InputError, arg
from flownav.logs.mavlink import clock as stamps
from flownav.logs.mavlink.framing import INVALID_AUTOPILOT, Message, StreamFrames, coder, dialect
from flownav.logs.mavlink.signing import SignatureCheck

LONGEST_LOSS = 128  # half of the sequence's 256: a greater step is a sender that began anew
NAN = float("nan")
# Chosen, and held by recorded links (test_live_recordings): after a freeze of 1 s the sending goes on within 3, a
# TIMESYNC that lies by 0.9 s does not stop it; made ones (test_live_safety) have stamps of the future and clocks that
# jump.
LONGEST_ROUND_TRIP_S = 0.5
MOST_UNSEEN_S = 0.1  # of age when it is sent that a stamped message may have, beyond the wait on the link
COARSE_S = 0.02  # of stamps in milliseconds, and of crystals that drift for FRESH_S
LEAP_S = 0.3  # a stamp that is so much earlier than any before on the link: the clock leapt, or the stamp is wrong
STEP_S = 1.0  # TIMESYNC offsets that differ by more are of a vehicle that began anew
EXCHANGES_KEPT = 16
FRESH_S = 20.0
WINDOW_S = 0.5


class Vehicle(NamedTuple):
    """Who is listened to, and its make (MAV_AUTOPILOT)."""

    system: int
    component: int
    make: int


class Accepted(NamedTuple):
    """Who beside the autopilot may tell a message: a system (None: the vehicle's) and a component of it (None: any)."""

    message: str
    system: int | None = None
    component: int | None = None


# sensors that companions and gimbals of the vehicle's own system tell: a camera, a flow sensor, a range finder
BESIDE = tuple(map(Accepted, ("LANDING_TARGET", "OPTICAL_FLOW", "OPTICAL_FLOW_RAD", "DISTANCE_SENSOR")))


def accepted_of(text: str) -> Accepted:
    """MESSAGE=SYSTEM.COMPONENT, e.g. LANDING_TARGET=1.191; 0 stands for any. InputError where it is not that."""
    found = re.fullmatch(r"(?P<name>[A-Z][A-Z0-9_]*)=(?P<system>\d{1,3})\.(?P<component>\d{1,3})", text)
    if found is None or max(int(found["system"]), int(found["component"])) > 255:
        raise InputError(f"{arg('accept')} {text}: MESSAGE=SYSTEM.COMPONENT is needed, e.g. LANDING_TARGET=1.191")
    if not hasattr(dialect(), f"MAVLINK_MSG_ID_{found['name']}"):
        raise InputError(f"{arg('accept')} {text}: MAVLink has no message {found['name']}")
    return Accepted(found["name"], int(found["system"]) or None, int(found["component"]) or None)


def accepted_by(texts: Iterable[str]) -> tuple[Accepted, ...]:
    """What is accepted beside the autopilot: `accepted_of` each, in place of BESIDE for the messages that they name."""
    stated = tuple(map(accepted_of, texts))
    named = {entry.message for entry in stated}
    return (*stated, *(entry for entry in BESIDE if entry.message not in named))


class Reception:
    """Bytes in, messages of the vehicle out, and those that `accept` lets others tell.

    The vehicle is the first autopilot whose HEARTBEAT is heard, of the system and component that were asked for
    (None: any). What flownav itself sends (`own`) and another component of the vehicle's system repeats is not taken.
    counts: by reason, what was not listened to (`other_system`, `unsigned`, `bad_signature`, `replayed`,
    `bad_checksum`, `truncated`, `skipped_bytes`, `unknown_message`, `undecodable`, `before_heartbeat`), and `lost`, the
    vehicle's frames that never came, by its sequence numbers.
    """

    def __init__(
        self,
        system: int | None,
        component: int | None,
        key: bytes | None,
        unix_s: float,
        accept: Iterable[Accepted] = BESIDE,
        own: int = 0,
    ) -> None:
        self.vehicle: Vehicle | None = None
        self.received = 0
        self._counts: Counter[str] = Counter()
        self._wanted = system, component
        self._frames = StreamFrames()
        self._check = SignatureCheck(key, unix_s) if key else None
        self._coder: Any = coder()
        self._error = dialect().MAVError
        self._sequence: int | None = None
        self._others: set[tuple[int, int]] = set()
        self._own = own
        self._accepted: dict[int, list[Accepted]] = {}
        for entry in accept:
            number = int(getattr(dialect(), f"MAVLINK_MSG_ID_{entry.message}"))
            self._accepted.setdefault(number, []).append(entry)

    @property
    def counts(self) -> Counter[str]:
        """What was not listened to, by reason."""
        rejected = self._check.rejected if self._check else Counter[str]()
        return Counter({k: n for k, n in (self._counts + self._frames.damage + rejected).items() if n})

    @property
    def others(self) -> list[tuple[int, int]]:
        """Other autopilots that were heard: system and component."""
        return sorted(self._others)

    def feed(self, piece: bytes, *, whole: bool) -> Iterator[Message]:
        """The vehicle's messages in a piece of what arrived; whole: a datagram."""
        for frame, content in self._frames.feed(piece, whole=whole):
            if self._check is not None and not self._check.accepts(content):
                continue
            who = frame.system, frame.component
            if self.vehicle is not None and who != self.vehicle[:2] and self._accepts(frame.message_id, who):
                beside = self._decoded(content)
                if beside is not None:
                    yield beside
                continue
            if any(wanted not in (None, own) for wanted, own in zip(self._wanted, who, strict=True)):
                self._counts["other_system"] += 1
                continue
            if self.vehicle is not None and who != self.vehicle[:2]:
                self._counts["other_system"] += 1
                if frame.message_id == 0 and len(self._others) < LONGEST_LOSS:
                    self._others.add(who)
                continue
            message = self._decoded(content)
            if message is None:
                continue
            if self.vehicle is None:
                if message.msgname != "HEARTBEAT" or message.autopilot == INVALID_AUTOPILOT:
                    self._counts["before_heartbeat"] += 1
                    continue
                self.vehicle = Vehicle(*who, int(message.autopilot))
            self._note_losses(message.get_seq())
            self.received += 1
            yield message

    def is_of_vehicle(self, message: Message) -> bool:
        """Whether the autopilot itself told it."""
        return self.vehicle is not None and sender_of(message) == self.vehicle[:2]

    def _accepts(self, message_id: int, who: tuple[int, int]) -> bool:
        """Whether a component that is not the vehicle's autopilot may tell a message."""
        assert self.vehicle is not None
        if who == (self.vehicle.system, self._own):
            return False
        return any(
            who[0] == (entry.system or self.vehicle.system) and entry.component in (None, who[1])
            for entry in self._accepted.get(message_id, ())
        )

    def _decoded(self, content: bytes) -> Message | None:
        try:
            return self._coder.decode(bytearray(content))
        except (self._error, ValueError):
            self._counts["undecodable"] += 1
            return None

    def _note_losses(self, sequence: int) -> None:
        if self._sequence is not None:
            missing = (sequence - self._sequence - 1) % 256
            self._counts["lost"] += missing if missing < LONGEST_LOSS else 0
        self._sequence = sequence


def sender_of(message: Message) -> tuple[int, int]:
    """System and component."""
    return int(message.get_srcSystem()), int(message.get_srcComponent())


# -- the vehicle's time -------------------------------------------------------------------------------------
class Exchange(NamedTuple):
    """One TIMESYNC: when it ended on our clock, their boot clock less ours, and the round trip [s]."""

    now_s: float
    offset_s: float
    round_trip_s: float


class VehicleClock:
    """Session time: the vehicle's time since boot, which goes on through a reboot (see mavlink/clock.py).

    Of stamps alone, the least wait on the link passes for none; a TIMESYNC exchange tells it, to within half its round
    trip. The stamps of the last second rule: an exchange that contradicts them is of a clock that has been stopped or
    set since, or a lie, and does not serve. counts: `clock_jump`, `wrapped`, exchanges not believed
    (`timesync_refused`), and steps of a second or more between exchanges (`timesync_step`).
    """

    def __init__(self, system: int, component: int) -> None:
        self._state = stamps.ClockState((system, component, "boot"))
        self._leads: deque[tuple[float, float]] = deque(maxlen=2)  # since when, and session time less ours [s]
        self._exchanges: deque[Exchange] = deque(maxlen=EXCHANGES_KEPT)
        self._leaping, self._leap_s = 0, NAN  # stamps in a row that are ahead of our clock, and by how much
        self._told_s = self._doubted_s = NAN  # offset that TIMESYNC tells, and one that differs by a step
        self.counts: Counter[str] = Counter()

    def stamped(self, message: Message, system: int, component: int, now_s: float) -> stamps.Aligned:
        """The session time of a message that arrived at `now_s` of our clock."""
        stamp = stamps.stamp_of(message, system, component, self._state.reference_s)
        state, aligned = stamps.align(self._state, now_s, stamp)
        if self._leaps(stamp, aligned, now_s):
            self.counts["ahead"] += 1
            return stamps.Aligned(NAN, "stale_time")
        self._state = state
        if aligned.event:
            self.counts[aligned.event] += 1
        if stamp is not None and stamp.clock == self._state.reference and not aligned.reason:
            if aligned.event == "clock_jump":
                self._exchanges.clear()
                self._leads = deque(maxlen=2)
            self._note_lead(aligned.t_s - now_s, now_s)
        return aligned

    def _leaps(self, stamp: stamps.Stamp | None, aligned: stamps.Aligned, now_s: float) -> bool:
        """Whether the autopilot's clock has leapt ahead of ours in this one message: some in a row must agree on it."""
        if stamp is None or stamp.clock != self._state.reference or aligned.reason or aligned.event:
            return False
        leap_s = aligned.t_s - now_s - self._offset_s
        agrees = abs(leap_s - self._leap_s) <= LEAP_S
        self._leaping = (self._leaping + 1 if agrees else 1) if leap_s > LEAP_S else 0
        self._leap_s = leap_s
        return 0 < self._leaping < stamps.CONFIRMATIONS

    def _note_lead(self, lead_s: float, now_s: float) -> None:
        """The least wait on the link is the greatest lead; it is remembered for two windows."""
        if not self._leads or now_s - self._leads[-1][0] >= WINDOW_S:
            self._leads.append((now_s, lead_s))
        elif lead_s > self._leads[-1][1]:
            self._leads[-1] = self._leads[-1][0], lead_s

    @property
    def _offset_s(self) -> float:
        """Session time less ours, by the least wait seen; NaN before the first stamp."""
        return max((lead_s for _, lead_s in self._leads), default=NAN)

    def told_unix(self, message: Message, system: int, component: int) -> None:
        """SYSTEM_TIME."""
        if message.time_boot_ms:
            clock = (system, component, "unix")
            self._state = stamps.told_unix_time(
                self._state, clock, message.time_unix_usec * 1e-6, message.time_boot_ms * 1e-3
            )

    def exchanged(self, tc1_ns: int, ts1_ns: int, now_s: float) -> bool:
        """A TIMESYNC reply to a request that we sent at `ts1_ns` of our clock; True where it tells of a new start."""
        exchange = Exchange(now_s, *stamps.timesync_offset_s(tc1_ns, ts1_ns, round(now_s * 1e9)))
        if not 0.0 <= exchange.round_trip_s <= LONGEST_ROUND_TRIP_S:
            self.counts["timesync_refused"] += 1
            return False
        stepped = self._stepped(exchange.offset_s)
        if stepped:
            self.counts["timesync_step"] += 1
        if self._serves(exchange):
            self._exchanges.append(exchange)
        else:
            self.counts["timesync_refused"] += 1
        return stepped

    def _stepped(self, offset_s: float) -> bool:
        """Whether two exchanges in a row agree on an offset that is more than STEP_S from the one told before."""
        if not abs(offset_s - self._told_s) > STEP_S:
            self._told_s, self._doubted_s = offset_s, NAN
            return False
        if not abs(offset_s - self._doubted_s) <= STEP_S:
            self._doubted_s = offset_s
            return False
        self._told_s, self._doubted_s = offset_s, NAN
        return True

    def _serves(self, exchange: Exchange) -> bool:
        """Whether an exchange agrees with the stamps: they say a later time by no more than its own uncertainty, and an
        earlier one by no more than the wait on the link and a reading's own age when it is sent."""
        ahead_s = exchange.offset_s + self._shift_s - self._offset_s
        return -0.5 * exchange.round_trip_s - COARSE_S <= ahead_s <= exchange.round_trip_s + MOST_UNSEEN_S

    @property
    def _shift_s(self) -> float:
        """Session time less the vehicle's time since boot: not 0 after a reboot."""
        clock = self._state.clocks.get(self._state.reference)
        return clock.offset_s if clock else 0.0

    def best(self, now_s: float) -> Exchange | None:
        """The exchange with the shortest round trip among the fresh ones that agree with the stamps."""
        fresh = [e for e in self._exchanges if now_s - e.now_s <= FRESH_S and self._serves(e)]
        return min(fresh, key=lambda exchange: exchange.round_trip_s, default=None)

    def now_s(self, now_s: float) -> float:
        """Session time at an instant of our clock; NaN before the vehicle's clock was heard. Never behind a stamp."""
        best = self.best(now_s)
        return now_s + (self._offset_s if best is None else max(best.offset_s + self._shift_s, self._offset_s))

    def boot_s(self, t_s: float) -> float:
        """The vehicle's time since boot at a session time."""
        return t_s - self._shift_s
