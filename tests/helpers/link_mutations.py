"""Damage to what a link delivers: bytes of frames, fields of sound frames, order, messages that nobody asked for."""

from __future__ import annotations

import math
import struct
from random import Random
from typing import Any

from flownav.logs.mavlink.framing import coder, dialect
from flownav.logs.mavlink.messages import CONVERTERS
from log_mutations import mutate
from mavlink_logs import packed_payload

NUMBERS = (math.nan, math.inf, -math.inf, 3e38, -3e38, 0.0, -0.0, 1e-40, 1.0, 1e4, -1e4)
WHOLE = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 62, (1 << 64) - 1)
BESIDE = ("HEARTBEAT", "TIMESYNC", "GPS_GLOBAL_ORIGIN", "COMMAND_ACK", "SIM_STATE", "SYSTEM_TIME", "STATUSTEXT",
          "PARAM_VALUE", "EXTENDED_SYS_STATE", "HIL_STATE_QUATERNION", "MESSAGE_INTERVAL")  # fmt: skip
NAMES = tuple(
    name for name in dict.fromkeys((*CONVERTERS, *BESIDE)) if hasattr(dialect(), f"MAVLink_{name.lower()}_message")
)


def mutate_piece(piece: bytes, earlier: bytes, random: Random) -> list[bytes]:
    """The datagrams that arrive in place of one."""
    kind = random.randrange(7)
    if kind == 0:
        return [mutate(piece, earlier, random.randrange(1 << 30))]
    if kind == 1:
        return [with_other_fields(piece, random)] * random.choice((1, 1, 3))
    if kind == 2:
        return [never_asked_for(random) for _ in range(random.choice((1, 5, 50)))]
    if kind == 3:
        return [earlier, piece]
    if kind == 4:
        return [piece] * random.choice((2, 20))
    if kind == 5:
        return [random.randbytes(random.choice((0, 1, 12, 300, 4000)))]
    return [piece[: len(piece) // 2], piece[len(piece) // 2 :]]


def with_other_fields(frame: bytes, random: Random) -> bytes:
    """The frame with a right checksum, in which some fields say what no sensor says."""
    message = _decoded(frame)
    if message is None:
        return frame
    raw = bytearray(message.unpacker.pack(*[getattr(message, name) for name in message.ordered_fieldnames])
                    if _is_plain(message) else bytes(message.unpacker.size))  # fmt: skip
    return packed_payload(message.msgname, bytes(_spoilt(raw, random)))


def never_asked_for(random: Random) -> bytes:
    """A message of any known kind, full of anything."""
    name = random.choice(NAMES)
    kind = getattr(dialect(), f"MAVLink_{name.lower()}_message")
    return packed_payload(name, bytes(_spoilt(bytearray(random.randbytes(kind.unpacker.size)), random)))


def _spoilt(raw: bytearray, random: Random) -> bytearray:
    for _ in range(random.choice((1, 1, 4))):
        if random.random() < 0.6 and len(raw) >= 4:
            at = 4 * random.randrange(len(raw) // 4)
            raw[at : at + 4] = struct.pack("<f", random.choice(NUMBERS))
        elif raw:
            width = min(len(raw), random.choice((1, 2, 4, 8)))
            at = random.randrange(len(raw) - width + 1)
            raw[at : at + width] = (random.choice(WHOLE) & (256**width - 1)).to_bytes(width, "little")
    return raw


def _decoded(frame: bytes) -> Any:
    try:
        return coder().decode(bytearray(frame))
    except Exception:  # damaged before
        return None


def _is_plain(message: Any) -> bool:
    return all(isinstance(getattr(message, name), int | float) for name in message.ordered_fieldnames)
