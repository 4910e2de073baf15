"""MAVLink 2 signing: only frames signed with the 32-byte key are accepted.

A signature is the first 6 bytes of SHA-256 over the key, the frame and a time stamp: 48 bits of 10 microseconds
since 1 January 2015. A stream (link, system, component) must always move on in time, or an old packet could be
played again. pymavlink signs; what arrives is verified here, since pymavlink remembers a packet's time before it
has checked the signature, so that one forged packet would silence the true sender.
"""

import binascii
import hashlib
import hmac
import os
import re
import stat
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.logs.mavlink import framing

KEY_BYTES = 32
EPOCH_UNIX_S = 1_420_070_400  # 2015-01-01 UTC
TICKS_PER_S = 100_000
NEW_STREAM_TICKS = 60 * TICKS_PER_S  # a stream not received before may be this much behind the newest
MOST_KEY_FILE_BYTES = 1024
READ_BY_OTHERS = stat.S_IRGRP | stat.S_IROTH

_warned: set[Path] = set()


def load_key(path: Path) -> bytes:
    """A key file: 32 raw bytes, or 64 hexadecimal digits (blanks and line ends ignored).

    A file that others may read is named on standard error, once. InputError where it cannot be read or is neither. The
    key itself is never part of a message.
    """
    try:
        with an_input(path).open("rb") as file:
            _warn_of_readers(path, os.fstat(file.fileno()).st_mode)
            content = file.read(MOST_KEY_FILE_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give a signing key's file") from error
    digits = b"".join(content.split())
    if re.fullmatch(rb"[0-9a-fA-F]{64}", digits):
        return binascii.unhexlify(digits)
    if len(content) == KEY_BYTES:
        return content
    size = f"{len(content)} bytes" if len(content) <= MOST_KEY_FILE_BYTES else f"over {MOST_KEY_FILE_BYTES} bytes"
    raise InputError(
        f"{path}: {size} are no signing key; {KEY_BYTES} raw bytes or {2 * KEY_BYTES} hexadecimal digits "
        "are needed (`openssl rand -hex 32`)"
    )


def _warn_of_readers(path: Path, mode: int) -> None:
    """Warn of a key that other users can read: it commands the vehicle. Windows does not show this in the mode."""
    if os.name == "posix" and mode & READ_BY_OTHERS and path not in _warned:
        _warned.add(path)
        print(f"flownav: {path}: other users can read this signing key; chmod 600 keeps it yours", file=sys.stderr)


def timestamp_at(unix_s: float) -> int:
    """The signature's time stamp at a UNIX time: units of 10 microseconds since 2015."""
    return max(0, int((unix_s - EPOCH_UNIX_S) * TICKS_PER_S))


def sign_outgoing(mav: Any, key: bytes, unix_s: float, *, link_id: int = 0) -> None:
    """Have a pymavlink `MAVLink` sign all it packs from now on. Call again with the time to keep its stamps fresh.

    Stamps never run back: where the clock did, they go on from the last. Decode with another `MAVLink`: one that
    holds a key verifies too, in its own way. ValueError where the key has no 32 bytes.
    """
    if len(key) != KEY_BYTES:
        raise ValueError(f"a signing key has {KEY_BYTES} bytes, not {len(key)}")
    mav.signing.secret_key = key
    mav.signing.link_id = link_id
    mav.signing.timestamp = max(mav.signing.timestamp, timestamp_at(unix_s))
    mav.signing.sign_outgoing = True


class SignatureCheck:
    """The strict policy for what arrives: signed with the key, and newer than all of its stream before.

    A stream that was not received before may be a minute behind the newest time: now, or the newest stamp received
    (MAVLink 2 message signing, "Timestamp Handling"). So a fresh session takes nothing that was recorded earlier.
    clock: seconds that pass, from `unix_s` on. rejected counts by reason: `unsigned`, `bad_signature`, `replayed`. A
    forged packet changes nothing but a count.
    """

    def __init__(self, key: bytes, unix_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        if len(key) != KEY_BYTES:
            raise ValueError(f"a signing key has {KEY_BYTES} bytes, not {len(key)}")
        self._key = key
        self._clock, self._unix_less_clock_s = clock, unix_s - clock()
        self._newest = timestamp_at(unix_s)
        self._streams: dict[tuple[int, int, int], int] = {}
        self.rejected: Counter[str] = Counter()
        self.accepted = 0

    def accepts(self, frame: bytes) -> bool:
        """Whether one whole frame, from its first byte to its last, may be listened to; counted either way."""
        reason = self._reason(bytes(frame))
        if reason:
            self.rejected[reason] += 1
            return False
        self.accepted += 1
        return True

    def _reason(self, frame: bytes) -> str:
        least = framing.HEADER_2 + framing.CHECKSUM_BYTES + framing.SIGNATURE_BYTES
        if (
            len(frame) < least
            or frame[0] != framing.MAVLINK_2
            or not frame[2] & framing.SIGNED_FLAG
            or len(frame) != least + frame[1]
        ):
            return "unsigned"
        expected = hashlib.sha256(self._key + frame[:-6]).digest()[:6]
        if not hmac.compare_digest(expected, frame[-6:]):
            return "bad_signature"
        link, low, high = struct.unpack("<BIH", frame[-framing.SIGNATURE_BYTES : -6])
        timestamp, stream = low | high << 32, (link, frame[5], frame[6])
        self._newest = max(self._newest, timestamp_at(self._clock() + self._unix_less_clock_s))
        oldest = self._streams.get(stream, self._newest - NEW_STREAM_TICKS - 1)
        if timestamp <= oldest:
            return "replayed"
        self._streams[stream] = timestamp
        self._newest = max(self._newest, timestamp)
        return ""
