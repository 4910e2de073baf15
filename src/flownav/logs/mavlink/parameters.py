"""Parameters in MAVLink's parameter protocol: one float field that two makes fill in two ways.

ArduPilot casts every number to float; PX4 copies the bytes of an integer into the field (mavlink.io,
services/parameter, "Parameter encoding": C-cast and bytewise). PARAM_VALUE says the type. Read as the other, PX4's 5
is 7e-45, and a 5.0 written to PX4 becomes 1084227584.
"""

import struct
from typing import Any, NamedTuple

from flownav.logs.mavlink.framing import HEADER_1, HEADER_2, MAVLINK_2, PX4, Message

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
