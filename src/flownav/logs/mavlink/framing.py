"""pymavlink's tables, and frames in the bytes of a link or a tlog, 8 bytes of arrival time before each of a tlog's.

Only a frame whose checksum holds is believed. After damage the search goes on at the next byte that could begin a
frame, so that nothing but the damaged frames is lost; what is lost is counted. A frame is 280 bytes at most, so no
length in a file can claim more. The dialect ardupilotmega includes all of MAVLink's common messages.

MAVLink 1: FE, length, sequence, system, component, id, payload, checksum.
MAVLink 2: FD, length, incompatibility flags, compatibility flags, sequence, system, component, id (3 bytes),
payload, checksum, and a signature of 13 bytes where flag 1 is set.

A parameter is one float field that two makes fill in two ways: ArduPilot casts every number to float; PX4 copies the
bytes of an integer into the field (mavlink.io, services/parameter, "Parameter encoding": C-cast and bytewise).
PARAM_VALUE has the type. Read as the other, PX4's 5 is 7e-45, and a 5.0 written to PX4 becomes 1084227584.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from operator import itemgetter
from types import ModuleType
from typing import Any, NamedTuple

from flownav.core.errors import InputError

# MAV_AUTOPILOT: the sender of a HEARTBEAT; a ground station and a camera state that they are none
ARDUPILOT, PX4, INVALID_AUTOPILOT = 3, 12, 8

Message = Any  # a message that pymavlink decoded or built
MAVLINK_1, MAVLINK_2 = 0xFE, 0xFD
HEADER_1, HEADER_2 = 6, 10
CHECKSUM_BYTES, SIGNATURE_BYTES = 2, 13
SIGNED_FLAG = 0x01
TIMESTAMP_BYTES = 8
LARGEST_FRAME = HEADER_2 + 255 + CHECKSUM_BYTES + SIGNATURE_BYTES
OPEN_END = re.compile(rb"\xfd.{0,8}\Z", re.DOTALL)  # the beginning of a header whose rest is still to come
BEGINNING = re.compile(rb"\xfd.[\x00\x01].{6}\x00|\xfe", re.DOTALL)  # ids of known messages fit in two bytes


def dialect() -> ModuleType:
    """The MAVLink 2 dialect module. InputError where pymavlink is not installed."""
    try:
        from pymavlink.dialects.v20 import ardupilotmega
    except ImportError as error:
        raise InputError("MAVLink needs pymavlink; install it with `pip install 'flownav[live]'`") from error
    return ardupilotmega  # type: ignore[no-any-return]


def coder(system: int = 1, component: int = 1) -> Any:
    """A pymavlink `MAVLink` that packs messages as this system and component, and decodes any."""
    return dialect().MAVLink(None, srcSystem=system, srcComponent=component)


# -- frames -------------------------------------------------------------------------------------------------
class Frame(NamedTuple):
    """Where a frame lies in the bytes (start, end), when it arrived [us], and the fields of its header."""

    start: int
    end: int
    arrival_us: int
    message_id: int
    system: int
    component: int
    signed: bool


def tlog_frames(content: bytes, damage: Counter[str]) -> Iterator[Frame]:
    """The frames of known messages, in order. `damage` counts by reason what is not among them.

    `bad_checksum`, `truncated` and `unknown_message` count frames, `skipped_bytes` bytes that belong to no frame.
    """
    check = Check()
    place, size = 0, len(content)
    while place < size:
        frame = check.frame(content, place + TIMESTAMP_BYTES, place)
        if isinstance(frame, str):
            damage[frame] += frame != "no_header"
            found = _resume(content, check, place)
            damage["skipped_bytes"] += (size if found is None else found.start - TIMESTAMP_BYTES) - place
            if found is None:
                return
            frame = found
        if check.known(frame.message_id):
            yield frame
        else:
            damage["unknown_message"] += 1
        place = frame.end


def _resume(content: bytes, check: Check, place: int) -> Frame | None:
    """The next frame whose checksum holds, with its timestamp in front, from just after `place`."""
    for match in BEGINNING.finditer(content, place + TIMESTAMP_BYTES + 1):
        frame = check.frame(content, match.start(), match.start() - TIMESTAMP_BYTES)
        if not isinstance(frame, str) and check.known(frame.message_id):
            return frame
    return None


class StreamFrames:
    """The frames in what arrives on a link, piece by piece. Holds no more than one frame's bytes between pieces.

    damage: as of `tlog_frames`.
    """

    def __init__(self) -> None:
        self.damage: Counter[str] = Counter()
        self.strange: list[
            tuple[Frame, int]
        ] = []  # of messages that nobody knows, of the last piece, and their numbers
        self._check = Check()
        self._rest = b""

    def feed(self, piece: bytes, *, whole: bool = False) -> Iterator[tuple[Frame, bytes]]:
        """Every whole frame of a known message, with its bytes. whole: a datagram, in which no frame is left open."""
        content = self._rest + piece
        self._rest = b""
        self.strange.clear()
        place = 0
        while place < len(content):
            frame = self._check.frame(content, place)
            if frame == "truncated" and not whole and len(content) - place < LARGEST_FRAME:
                self._rest = content[place:]
                return
            if isinstance(frame, str):
                self.damage[frame] += frame != "no_header"
                found = BEGINNING.search(content, place + 1) or OPEN_END.search(content, place + 1)
                following = found.start() if found else len(content)
                self.damage["skipped_bytes"] += following - place
                place = following
                continue
            if self._check.known(frame.message_id):
                yield frame, content[frame.start : frame.end]
            else:
                self.damage["unknown_message"] += 1
                self.strange.append((frame, sequence_of(content, frame.start)))
            place = frame.end


def sequence_of(content: bytes, start: int) -> int:
    """The number of a frame among its sender's."""
    return content[start + (4 if content[start] == MAVLINK_2 else 2)]


class Check:
    """The dialect's checksum seeds and lengths, by message id."""

    def __init__(self) -> None:
        module = dialect()
        self._crc: Callable[[bytes], int] = module.mcrf4xx or (lambda content: module.x25crc(content).crc)
        self._seeds = {number: bytes([kind.crc_extra]) for number, kind in module.mavlink_map.items()}
        self._sizes = {number: kind.unpacker.size for number, kind in module.mavlink_map.items()}

    def known(self, message_id: int) -> bool:
        """Whether the dialect has the message."""
        return message_id in self._seeds

    def frame(self, content: bytes, start: int, timestamp: int | None = None) -> Frame | str:
        """The frame at `start`, or why there is none; its arrival time is at `timestamp` (None: it has none)."""
        size = len(content)
        if start >= size or content[start] not in (MAVLINK_1, MAVLINK_2):
            return "truncated" if start >= size else "no_header"
        header = HEADER_2 if content[start] == MAVLINK_2 else HEADER_1
        if start + header + CHECKSUM_BYTES > size:
            return "truncated"
        length, signed = content[start + 1], False
        if header == HEADER_2:
            if content[start + 2] & ~SIGNED_FLAG:
                return "no_header"
            signed = bool(content[start + 2])
            system, component = content[start + 5], content[start + 6]
            message_id = int.from_bytes(content[start + 7 : start + 10], "little")
        else:
            system, component, message_id = content[start + 3], content[start + 4], content[start + 5]
            if length > self._sizes.get(message_id, 255):
                return "no_header"
        checksum = start + header + length
        end = checksum + CHECKSUM_BYTES + (SIGNATURE_BYTES if signed else 0)
        if end > size:
            return "truncated"
        seed = self._seeds.get(message_id)
        if seed is None:  # its checksum needs its definition: believe it if another frame follows
            following = end + (0 if timestamp is None else TIMESTAMP_BYTES)
            if end != size and not (following < size and content[following] in (MAVLINK_1, MAVLINK_2)):
                return "bad_checksum"
        elif self._crc(content[start + 1 : checksum] + seed) != content[checksum] | content[checksum + 1] << 8:
            return "bad_checksum"
        arrival = b"" if timestamp is None else content[timestamp : timestamp + TIMESTAMP_BYTES]
        arrival_us = int.from_bytes(arrival, "big")
        return Frame(start, end, arrival_us, message_id, system, component, signed)


class Decoder:
    """From frames whose checksum holds to messages, as pymavlink's `MAVLink.decode` makes them, in a third of its time:
    it looks at the checksum once more, and at each field's place. Messages with arrays or texts are left to it.
    """

    def __init__(self) -> None:
        module = dialect()
        self._coder: Any = coder()
        self._header: Any = module.MAVLink_header
        self._plain = {
            number: (kind, itemgetter(*kind.orders), kind.unpacker)
            for number, kind in module.mavlink_map.items()
            if 1 < len(kind.orders) == sum(kind.lengths) and "s" not in kind.unpacker.format
        }

    def decode(self, frame: bytes) -> Message:
        """The message of one frame. MAVError where pymavlink cannot decode it."""
        number = int.from_bytes(frame[7:10], "little") if frame[0] == MAVLINK_2 else -1
        if number not in self._plain or frame[2]:  # of the first version, with texts, or signed
            return self._coder.decode(bytearray(frame))
        kind, ordered, fields = self._plain[number]
        payload = frame[HEADER_2:-CHECKSUM_BYTES].ljust(fields.size, b"\0")[: fields.size]
        message = kind(*ordered(fields.unpack(payload)))
        message._msgbuf = bytearray(frame)
        message._payload = message._msgbuf[HEADER_1:-CHECKSUM_BYTES]
        message._crc = int.from_bytes(frame[-CHECKSUM_BYTES:], "little")
        message._header = self._header(number, frame[2], frame[3], frame[1], frame[4], frame[5], frame[6])
        return message


REAL32 = 9  # MAV_PARAM_TYPE
INTEGERS = {1: "<B", 2: "<b", 3: "<H", 4: "<h", 5: "<I", 6: "<i"}  # MAV_PARAM_TYPE: its bytes


class Value(NamedTuple):
    """A parameter's number, and its type (MAV_PARAM_TYPE)."""

    number: float
    kind: int = REAL32


def bytewise(make: int) -> bool:
    """Whether a make (MAV_AUTOPILOT) copies integers' bytes."""
    return make == PX4


def decoded(message: Message, make: int) -> Value:
    """The number of a PARAM_VALUE that arrived. Integers' bytes are read in its frame: a NaN may not keep them."""
    kind = int(message.param_type)
    if bytewise(make) and kind in INTEGERS:
        frame = bytes(message.get_msgbuf())
        start = HEADER_2 if frame[0] == MAVLINK_2 else HEADER_1  # param_value is the first field on the wire
        return Value(float(struct.unpack_from(INTEGERS[kind], frame, start)[0]), kind)
    number = float(message.param_value)
    return Value(float(f"{number:.7g}") if kind == REAL32 else number, kind)  # 0.2, not the double next to its float


def encoded(value: Value, make: int) -> float:
    """The float field that carries a value to a make. struct.error where an integer type cannot hold it."""
    if bytewise(make) and value.kind in INTEGERS:
        content = struct.pack(INTEGERS[value.kind], round(value.number))
        return float(struct.unpack("<f", content.ljust(4, b"\0"))[0])
    return float(round(value.number)) if value.kind in INTEGERS else value.number


def name_of(message: Message) -> str:
    """The name in a PARAM_ message."""
    found = message.param_id
    return (found.decode("ascii", "replace") if isinstance(found, bytes) else str(found)).rstrip("\0")


def request_read(mav: Any, system: int, component: int, name: str) -> Message:
    """PARAM_REQUEST_READ by name."""
    return mav.param_request_read_encode(system, component, name.encode("ascii"), -1)


def set_value(mav: Any, system: int, component: int, name: str, value: Value, make: int) -> Message:
    """PARAM_SET in the make's way."""
    return mav.param_set_encode(system, component, name.encode("ascii"), encoded(value, make), value.kind)
