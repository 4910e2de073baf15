"""An autopilot that has parameters: both makes' encodings, answers that are lost, and others who answer beside it."""

from __future__ import annotations

import random
import struct
import time
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any

from flownav.live.link import Link
from flownav.logs.mavlink.framing import StreamFrames, coder
from flownav.logs.mavlink.signing import sign_outgoing

ARDUPILOT, PX4 = 3, 12
INT8, INT32, REAL32 = 2, 6, 9
ARMED = 128
REQUEST, RUN_CHECKS = 512, 401  # MAV_CMD


def kind_of(number: float, make: int) -> int:
    """The type that a make gives to a number as it is written in a table: 3 is an integer, 0.3 is not."""
    if isinstance(number, float):
        return REAL32
    return INT32 if make == PX4 else INT8


@dataclass
class FakeAutopilot:
    """parameters: as written in a table, an int is of an integer type. loss: share of frames lost, each way.

    stubborn: parameters that keep their value whatever is set. gimbal: a component that answers for itself, with
    values of its own. origin: of its EKF, as it tells it (1e-7 deg, 1e-7 deg, mm); takes_origin: whether it lets it be
    set. says: its texts when its checks are run.
    """

    make: int
    parameters: dict[str, float]
    loss: float = 0.0
    armed: bool = False
    deaf: bool = False
    gimbal: bool = False
    tells_unknown: bool = False
    stubborn: tuple[str, ...] = ()
    origin: tuple[int, int, int] | None = None
    takes_origin: bool = True
    says: tuple[str, ...] = ()
    key: bytes | None = None
    counts: Counter[str] = field(default_factory=Counter)
    noise: random.Random = field(default_factory=lambda: random.Random(7))

    def __post_init__(self) -> None:
        self.mav: Any = coder(1, 1)
        self.other: Any = coder(1, 154)
        self._frames, self._coder = StreamFrames(), coder()
        if self.key is not None:
            sign_outgoing(self.mav, self.key, time.time())
        self.kinds = {name: kind_of(number, self.make) for name, number in self.parameters.items()}

    def heartbeat(self) -> bytes:
        return bytes(self.mav.heartbeat_encode(4, self.make, ARMED if self.armed else 0, 0, 4, 3).pack(self.mav))

    def hear(self, piece: bytes) -> list[bytes]:
        answers = []
        for _, content in self._frames.feed(piece):
            if self.noise.random() < self.loss:
                continue
            message = self._coder.decode(bytearray(content))
            self.counts[message.msgname] += 1
            if message.msgname in ("PARAM_REQUEST_READ", "PARAM_SET") and not self.deaf:
                answers += self._answer(message)
            elif message.msgname == "SET_GPS_GLOBAL_ORIGIN" and self.takes_origin:
                self.origin = message.latitude, message.longitude, message.altitude
            elif message.msgname == "COMMAND_LONG" and message.command == REQUEST and self.origin is not None:
                answers.append(bytes(self.mav.gps_global_origin_encode(*self.origin).pack(self.mav)))
            elif message.msgname == "COMMAND_LONG" and message.command == RUN_CHECKS:
                answers += [bytes(self.mav.statustext_encode(2, text.encode()).pack(self.mav)) for text in self.says]
        return [answer for answer in answers if self.noise.random() >= self.loss]

    def _answer(self, message: Any) -> list[bytes]:
        name = message.param_id.rstrip("\0")
        if name not in self.parameters:
            error = self.mav.param_error_encode(255, 0, name.encode(), -1, 1)
            return [bytes(error.pack(self.mav))] if self.tells_unknown else []
        if message.msgname == "PARAM_SET" and name not in self.stubborn:
            assert message.param_type == self.kinds[name]
            self.parameters[name] = self._read(message.param_value, self.kinds[name])
        beside = [self._value(self.other, name, 77.0, REAL32)] if self.gimbal else []
        return [*beside, self._value(self.mav, name, self.parameters[name], self.kinds[name])]

    def _read(self, sent: float, kind: int) -> float:
        if kind == REAL32:
            return sent
        return struct.unpack("<i", struct.pack("<f", sent))[0] if self.make == PX4 else int(sent)

    def _value(self, mav: Any, name: str, number: float, kind: int) -> bytes:
        if self.make == PX4 and kind == INT32:
            number = struct.unpack("<f", struct.pack("<i", int(number)))[0]
        return bytes(mav.param_value_encode(name.encode(), number, kind, len(self.parameters), 65535).pack(mav))


class FakeLink(Link):
    """The wire to a fake autopilot, on a clock of its own: `wait` is where time passes."""

    def __init__(self, autopilot: FakeAutopilot | None) -> None:
        super().__init__()
        self.autopilot, self.now_s, self._beat_s = autopilot, 100.0, 0.0
        self._to_us: deque[bytes] = deque()

    def clock(self) -> float:
        return self.now_s

    def wait(self, link: Link, seconds: float) -> None:
        self.now_s += seconds
        if self.autopilot is not None and self.now_s - self._beat_s >= 1.0:
            self._beat_s = self.now_s
            self._to_us.append(self.autopilot.heartbeat())

    def fileno(self) -> int:
        return -1

    def read(self) -> list[Any]:
        pieces = [(piece, None) for piece in self._to_us]
        self._to_us.clear()
        return pieces

    def write(self, frame: bytes) -> None:
        if self.autopilot is not None:
            self._to_us.extend(self.autopilot.hear(frame))
