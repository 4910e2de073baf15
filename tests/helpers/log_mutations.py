"""Damage to log files, decided by a seed: what broken cards, cut links and malice do to bytes."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

Mutation = Callable[[bytearray, bytes, Random], bytearray]

EXTREMES = (0, 1, 2, 3, 0x7F, 0x80, 0xFE, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
GIGABYTES = (10**9, 2**30, 2**31 - 1, 2**32 - 1, 2**62, 2**63, 2**64 - 1)
HEADERS = (
    b"\xa3\x95\x80",
    b"\xa3\x95",
    b"\xfd",
    b"\xfe",
    b"ULog\x01\x12\x35",
    b"\x2f\x73\x13\x20\x25\x0c\xbb\x12",
    b"\n",
    b",",
)
TEXTS = (
    b"nan",
    b"-inf",
    b"1e999",
    b"99999999999999999999",
    b"-0",
    b"\xff\xfe",
    b'"',
    b"\0",
    b"\r",
    b"0x10",
    b"1_0",
    b"",
)


def mutate(content: bytes, other: bytes, seed: int) -> bytes:
    """One to four kinds of damage, one after the other; `other` is what may be spliced in."""
    random = Random(seed)
    damaged = bytearray(content)
    for _ in range(random.choice((1, 1, 2, 4))):
        damaged = random.choice(MUTATIONS)(damaged, other, random)
    return bytes(damaged)


def _span(content: bytearray | bytes, random: Random, longest: int = 4096) -> tuple[int, int]:
    start = random.randrange(len(content) + 1)
    return start, min(len(content), start + int(longest ** random.random()))


def _truncated(content: bytearray, other: bytes, random: Random) -> bytearray:
    return content[: random.randrange(len(content) + 1)]


def _beheaded(content: bytearray, other: bytes, random: Random) -> bytearray:
    return content[random.randrange(len(content) + 1) :]


def _emptied(content: bytearray, other: bytes, random: Random) -> bytearray:
    return content[: random.choice((0, 0, 1, 2, 3, 16))]


def _bits_flipped(content: bytearray, other: bytes, random: Random) -> bytearray:
    for _ in range(random.choice((1, 1, 8, 64, 512)) if content else 0):
        content[random.randrange(len(content))] ^= 1 << random.randrange(8)
    return content


def _overwritten(content: bytearray, other: bytes, random: Random) -> bytearray:
    start, end = _span(content, random)
    fill = random.choice((random.randbytes(end - start), bytes(end - start), b"\xff" * (end - start)))
    content[start:end] = fill
    return content


def _inserted(content: bytearray, other: bytes, random: Random) -> bytearray:
    at, _ = _span(content, random)
    content[at:at] = random.choice(
        (random.randbytes(random.randrange(300)), random.choice(HEADERS) * random.randrange(300))
    )
    return content


def _lengths_lie(content: bytearray, other: bytes, random: Random) -> bytearray:
    """Numbers of one, two or four bytes set to the values that break sums."""
    for _ in range(random.choice((1, 4, 32))):
        width = random.choice((1, 2, 4))
        at = random.randrange(max(1, len(content) - width))
        content[at : at + width] = (random.choice(EXTREMES) & (256**width - 1)).to_bytes(width, "little")
    return content


def _headers_lie(content: bytearray, other: bytes, random: Random) -> bytearray:
    """The same where a file speaks of itself: in its first two kilobytes."""
    return _lengths_lie(content[:2048], other, random) + content[2048:]


def _claims_gigabytes(content: bytearray, other: bytes, random: Random) -> bytearray:
    at, _ = _span(content, random)
    claim = random.choice(GIGABYTES)
    spelt = random.choice(
        (claim.to_bytes(8, "little"), (claim & 0xFFFFFFFF).to_bytes(4, "little"), str(claim).encode())
    )
    content[at : at + len(spelt)] = spelt
    return content


def _duplicated(content: bytearray, other: bytes, random: Random) -> bytearray:
    start, end = _span(content, random)
    content[end:end] = content[start:end] * random.choice((1, 1, 5))
    return content


def _deleted(content: bytearray, other: bytes, random: Random) -> bytearray:
    start, end = _span(content, random)
    del content[start:end]
    return content


def _moved(content: bytearray, other: bytes, random: Random) -> bytearray:
    start, end = _span(content, random)
    block = content[start:end]
    del content[start:end]
    at, _ = _span(content, random)
    content[at:at] = block
    return content


def _spliced(content: bytearray, other: bytes, random: Random) -> bytearray:
    at, _ = _span(content, random)
    return content[:at] + other[random.randrange(len(other) + 1) :]


def _text_put_in(content: bytearray, other: bytes, random: Random) -> bytearray:
    for _ in range(random.choice((1, 3, 20))):
        at, _ = _span(content, random)
        text = random.choice(TEXTS)
        content[at : at + random.choice((0, len(text)))] = text
    return content


MUTATIONS: tuple[Mutation, ...] = (
    _truncated, _beheaded, _emptied, _bits_flipped, _overwritten, _inserted, _lengths_lie, _headers_lie,
    _claims_gigabytes, _duplicated, _deleted, _moved, _spliced, _text_put_in,
)  # fmt: skip
