"""From bytes to the messages of one vehicle: whole frames, signed where a key is asked for, of the sources accepted."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from flownav.core.errors import InputError, arg
from flownav.live.autopilots import KNOWN, Autopilots, Who
from flownav.logs.mavlink.framing import Decoder, Message, StreamFrames, dialect
from flownav.logs.mavlink.signing import SignatureCheck

HEARTBEAT = 0
LONGEST_LOSS = 128  # half of the sequence's 256: a greater step is a sender that began anew
NAN = float("nan")


class Vehicle(NamedTuple):
    """Who is listened to, and its make (MAV_AUTOPILOT)."""

    system: int
    component: int
    make: int


class Accepted(NamedTuple):
    """A sender other than the autopilot that may send a message: a system (None: the vehicle's) and a component of
    it (None: any).
    """

    message: str
    system: int | None = None
    component: int | None = None


# sensors that companions and gimbals of the vehicle's own system send: a camera, a flow sensor, a range finder
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
    """The senders accepted next to the autopilot: `accepted_of` each text, in place of BESIDE for the messages they
    name.
    """
    stated = tuple(map(accepted_of, texts))
    named = {entry.message for entry in stated}
    return (*stated, *(entry for entry in BESIDE if entry.message not in named))


class Reception:
    """Bytes in, messages of the vehicle out, and those that `accept` allows of other senders.

    The vehicle is the first autopilot whose HEARTBEAT is received, of the system and component that were asked for
    (None: any), until a better one is taken (autopilots). flownav's own messages (`own`) that another component of the
    vehicle's system repeats are not taken. counts: the messages that were not taken, by reason (`other_system`,
    `unsigned`, `bad_signature`, `replayed`, `bad_checksum`, `truncated`, `skipped_bytes`, `unknown_message`,
    `undecodable`, `before_heartbeat`), and `lost`, the vehicle's frames that never came, by its sequence numbers.
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
        self._autopilots = Autopilots(component)
        self._counts: Counter[str] = Counter()
        self._wanted = system, component
        self._frames = StreamFrames()
        self._check = SignatureCheck(key, unix_s) if key else None
        self._decoder = Decoder()
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
        """Number of messages that were not taken, by reason."""
        rejected = self._check.rejected if self._check else Counter[str]()
        return Counter({k: n for k, n in (self._counts + self._frames.damage + rejected).items() if n})

    @property
    def others(self) -> list[tuple[int, int]]:
        """Other autopilots that were received: system and component."""
        return sorted(self._others)

    def feed(self, piece: bytes, *, whole: bool) -> Iterator[Message]:
        """The vehicle's messages in a piece of what arrived; whole: a datagram."""
        for frame, content in self._frames.feed(piece, whole=whole):
            self._pass_strange()
            if self._check is not None and not self._check.accepts(content):
                continue
            who = frame.system, frame.component
            self._autopilots.received(who, frame.message_id)
            if self.vehicle is not None and who != self.vehicle[:2] and self._accepts(frame.message_id, who):
                beside = self._decoded(content)
                if beside is not None:
                    yield beside
                continue
            if any(wanted not in (None, own) for wanted, own in zip(self._wanted, who, strict=True)):
                self._note_other(frame.message_id, content, who)
                continue
            if self.vehicle is not None and who != self.vehicle[:2]:
                self._note_other(frame.message_id, content, who)
                continue
            message = self._decoded(content)
            if message is None:
                continue
            found = self._autopilots.heartbeat(who, message) if message.msgname == "HEARTBEAT" else None
            if self.vehicle is None:
                if found is None:
                    self._counts["before_heartbeat"] += 1
                    continue
                self.vehicle = Vehicle(*who, found.make)
            self._note_losses(message.get_seq())
            self.received += 1
            yield message
        self._pass_strange()

    def _pass_strange(self) -> None:
        """Frames of the vehicle that nobody knows are not lost."""
        for frame, sequence in self._frames.strange:
            if self.vehicle is not None and (frame.system, frame.component) == self.vehicle[:2]:
                self._note_losses(sequence)
        self._frames.strange.clear()

    def _note_other(self, message_id: int, content: bytes, who: Who) -> None:
        """Somebody else; autopilots among them are remembered, ground stations and cameras are not."""
        self._counts["other_system"] += 1
        asked = message_id == HEARTBEAT and len(self._others) < LONGEST_LOSS
        message = self._decoded(content) if asked else None
        if message is not None and self._autopilots.heartbeat(who, message) is not None:
            self._others.add(who)

    def overhear(self, piece: bytes) -> None:
        """Take note of a datagram from another address than the vehicle's: another autopilot may send there."""
        for frame, content in StreamFrames().feed(piece, whole=True):
            who = frame.system, frame.component
            wanted = all(wanted in (None, own) for wanted, own in zip(self._wanted, who, strict=True))
            if self.vehicle is None or who == self.vehicle[:2] or not wanted:
                continue
            if self._check is None or self._check.accepts(content):
                self._autopilots.received(who, frame.message_id)
                self._note_other(frame.message_id, content, who)

    @property
    def known(self) -> bool:
        """Whether the vehicle is an autopilot by its number, and of a make whose streams we know."""
        found = self._autopilots.candidates.get(self.vehicle[:2]) if self.vehicle is not None else None
        return found is not None and found.standing == KNOWN

    def better(self, now_s: float) -> Vehicle | None:
        """An autopilot that is to be taken in place of the vehicle, if any."""
        found = self._autopilots.better(self.vehicle[:2], now_s) if self.vehicle is not None else None
        return Vehicle(*found.who, found.make) if found is not None else None

    def take(self, vehicle: Vehicle) -> None:
        """Listen to this one from now on."""
        assert self.vehicle is not None
        self._others.discard(vehicle[:2])
        self._others.add(self.vehicle[:2])
        self.vehicle, self._sequence = vehicle, None

    def is_of_vehicle(self, message: Message) -> bool:
        """Whether the autopilot itself sent the message."""
        return self.vehicle is not None and sender_of(message) == self.vehicle[:2]

    def _accepts(self, message_id: int, who: tuple[int, int]) -> bool:
        """Whether a component that is not the vehicle's autopilot may send a message."""
        assert self.vehicle is not None
        if who == (self.vehicle.system, self._own):
            return False
        return any(
            who[0] == (entry.system or self.vehicle.system) and entry.component in (None, who[1])
            for entry in self._accepted.get(message_id, ())
        )

    def _decoded(self, content: bytes) -> Message | None:
        try:
            return self._decoder.decode(content)
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
