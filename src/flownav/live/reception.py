"""From bytes to the messages of one vehicle: whole frames, signed where a key is asked for, of one system only."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

from flownav.mavlink.dialect import Message, coder, dialect
from flownav.mavlink.framing import StreamFrames
from flownav.mavlink.signing import SignatureCheck

INVALID_AUTOPILOT = 8  # MAV_AUTOPILOT: a ground station, a camera
LONGEST_LOSS = 128  # a greater step of the sequence is a sender that began anew


class Vehicle(NamedTuple):
    """Who is listened to, and its make (MAV_AUTOPILOT)."""

    system: int
    component: int
    make: int


class Reception:
    """Bytes in, messages of the vehicle out.

    The vehicle is the first autopilot whose HEARTBEAT is heard, of the system and component that were asked for
    (None: any). counts: by reason, what was not listened to (`other_system`, `unsigned`, `bad_signature`, `replayed`,
    `bad_checksum`, `truncated`, `skipped_bytes`, `unknown_message`, `undecodable`, `before_heartbeat`), and `lost`, the
    vehicle's frames that never came, by its sequence numbers.
    """

    def __init__(self, system: int | None, component: int | None, key: bytes | None, unix_s: float) -> None:
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
