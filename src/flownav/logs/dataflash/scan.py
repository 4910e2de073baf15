"""Where a DataFlash file's messages lie: headers found by the whole array, then chained by the messages' lengths.

A message is 0xA3 0x95, its type, and a body whose length its type alone decides. Two header bytes also occur inside
bodies, so a header counts only where the chain of lengths arrives at it. Where the chain breaks (lost or damaged
bytes) it starts anew at the next header that leads on to another, and the bytes between are counted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

HEAD = (0xA3, 0x95)
HEADER_BYTES = 3
BLOCK_BYTES = 1 << 20  # what is looked through at once stays in the cache

Bytes = NDArray[np.uint8]
Indices = NDArray[np.int64]


class Headers(NamedTuple):
    """offset (n,) of every place where the two header bytes stand, ascending, and the type (n,) that follows them."""

    offset: Indices
    type: Bytes


class Scan(NamedTuple):
    """offset (n,) of every message's first byte, in file order, and type (n,); bytes in no message, and their gaps."""

    offset: Indices
    type: Bytes
    skipped_bytes: int
    gaps: int


def find_headers(content: Bytes) -> Headers:
    """Everything in a file that looks like a header."""
    found = [np.zeros(0, np.int64)]
    last = len(content) - HEADER_BYTES + 1
    for start in range(0, last, BLOCK_BYTES):
        first = np.flatnonzero(content[start : min(start + BLOCK_BYTES, last)] == HEAD[0]) + start
        found.append(first[content[1:][first] == HEAD[1]])
    offset = np.concatenate(found)
    return Headers(offset, content[2:][offset])


def chain_messages(content: Bytes, headers: Headers, length: Indices) -> Scan:
    """The messages among the headers; length (256,) is each type's in bytes, header included, 0 where unknown."""
    start, kind = headers
    possible = (length > 0)[kind]
    near_end = int(np.searchsorted(start, len(content) - int(length.max())))
    possible[near_end:] &= start[near_end:] + length[kind[near_end:]] <= len(content)
    start, kind = _only(possible, start, kind)
    if len(start):
        start, kind = _only(_walk(content, start, start + length[kind]), start, kind)
    if not len(start):
        return Scan(start, kind, len(content), int(len(content) > 0))
    end = start + length[kind]
    gaps = int(start[0] > 0) + int(np.count_nonzero(end[:-1] != start[1:])) + int(end[-1] < len(content))
    return Scan(start, kind, len(content) - int(length[kind].sum()), gaps)


def _only(chosen: NDArray[np.bool_], start: Indices, kind: Bytes) -> tuple[Indices, Bytes]:
    return (start, kind) if chosen.all() else (start[chosen], kind[chosen])


def _walk(content: Bytes, start: Indices, end: Indices) -> NDArray[np.bool_]:
    """Which candidates the chain visits, as a mask.

    Most candidates end where the next one starts; only the others (breaks) are looked at one by one. A break's
    successor is the candidate at its end, or the next good one: one that ends at a header or with the file. A
    candidate that ends at nothing while a good one lies inside it was cut short, and is thrown away.
    """
    count = len(start)
    breaks = np.append(np.flatnonzero(end[:-1] != start[1:]), count - 1)
    landing = np.searchsorted(start, end[breaks])
    meets = _at(start, landing) == end[breaks]
    leads_on = meets | _header_or_end_at(content, end[breaks])
    bad = breaks[~leads_on]
    inside = _next_good(breaks + 1, bad)
    successor = np.where(meets, landing, np.where(leads_on, _next_good(landing, bad), inside))
    whole = leads_on | (_at(start, inside) >= end[breaks])
    first = int(_next_good(np.zeros(1, np.int64), bad)[0])
    return _visited(count, first, breaks, successor, whole)


def _at(start: Indices, index: Indices) -> Indices:
    """start[index], a place beyond every file where the index is beyond the last."""
    return np.where(index < len(start), start[np.minimum(index, len(start) - 1)], np.iinfo(np.int64).max)


def _next_good(index: Indices, bad: Indices) -> Indices:
    """The first candidate from an index on that is not bad; bad ascending."""
    if not len(bad):
        return index
    run_ends = np.append(np.diff(bad) > 1, True)
    after_run = (bad[run_ends] + 1)[np.cumsum(run_ends) - run_ends]
    place = np.minimum(np.searchsorted(bad, index), len(bad) - 1)
    return np.where(bad[place] == index, after_run[place], index)


def _header_or_end_at(content: Bytes, place: Indices) -> NDArray[np.bool_]:
    """Whether the file ends there, or the two header bytes stand there (of whatever type)."""
    inside = place + 1 < len(content)
    at = np.where(inside, place, 0)
    return np.asarray((place == len(content)) | (inside & (content[at] == HEAD[0]) & (content[1:][at] == HEAD[1])))


def _visited(
    count: int, first: int, breaks: Indices, successor: Indices, whole: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Mask of the candidates from the first on: runs up to each break, then on from its successor."""
    next_break = np.searchsorted(breaks, successor).tolist()
    run_starts, run_breaks = [], []
    at, position = first, int(np.searchsorted(breaks, first))
    successors = successor.tolist()
    while at < count:
        run_starts.append(at)
        run_breaks.append(position)
        at, position = successors[position], next_break[position]
    edge = np.zeros(count + 1, np.int8)
    edge[run_starts] += 1
    ran = np.array(run_breaks, np.int64)
    np.add.at(edge, breaks[ran] + whole[ran], -1)
    return np.cumsum(edge[:-1], dtype=np.int8).astype(bool)
