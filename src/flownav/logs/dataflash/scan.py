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


class Scan(NamedTuple):
    """offset (n,) of every message's first byte, in file order, and type (n,); bytes in no message, and their gaps."""

    offset: Indices
    type: Bytes
    skipped_bytes: int
    gaps: int


def find_headers(content: Bytes) -> Indices:
    """Every place where the two header bytes stand and a type can follow, ascending."""
    found = []
    last = len(content) - HEADER_BYTES + 1
    for start in range(0, last, BLOCK_BYTES):
        first = np.flatnonzero(content[start : min(start + BLOCK_BYTES, last)] == HEAD[0]) + start
        found.append(first[content[first + 1] == HEAD[1]])
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def chain_messages(content: Bytes, headers: Indices, length: Indices) -> Scan:
    """The messages among the headers; length (256,) is each type's in bytes, header included, 0 where unknown."""
    kind = content[headers + 2]
    size = length[kind]
    known = (size > 0) & (headers + size <= len(content))
    start, kind, size = headers[known], kind[known], size[known]
    if not len(start):
        return Scan(start, kind, len(content), int(len(content) > 0))
    kept = _walk(content, start, start + size)
    start, kind, size = start[kept], kind[kept], size[kept]
    ends = np.concatenate([[0], start + size])
    gap = np.append(start, len(content)) - ends
    return Scan(start, kind, int(gap.sum()), int(np.count_nonzero(gap)))


def _walk(content: Bytes, start: Indices, end: Indices) -> NDArray[np.bool_]:
    """Which candidates the chain visits, as a mask.

    Most candidates end where the next one starts; only the others (breaks) are looked at one by one. A break's
    successor is the candidate at its end, or the next good one: one that ends at a header or with the file. A
    candidate that ends at nothing while a good one lies inside it was cut short, and is thrown away.
    """
    count = len(start)
    follows = np.append(end[:-1] == start[1:], False)
    breaks = np.flatnonzero(~follows)
    landing = np.searchsorted(start, end[breaks])
    meets = _at(start, landing) == end[breaks]
    leads_on = meets | _header_or_end_at(content, end[breaks])
    good = follows.copy()
    good[breaks] = leads_on
    places = np.append(np.flatnonzero(good), count)
    inside = places[np.searchsorted(places, breaks + 1)]
    after = places[np.searchsorted(places, np.minimum(landing, count))]
    successor = np.where(meets, landing, np.where(leads_on, after, inside))
    whole = leads_on | (_at(start, inside) >= end[breaks])
    return _visited(count, int(places[0]), breaks, successor, whole)


def _at(start: Indices, index: Indices) -> Indices:
    """start[index], a place beyond every file where the index is beyond the last."""
    return np.append(start, np.iinfo(np.int64).max)[index]


def _header_or_end_at(content: Bytes, place: Indices) -> NDArray[np.bool_]:
    """Whether the file ends there, or the two header bytes stand there (of whatever type)."""
    inside = place + 1 < len(content)
    at = np.where(inside, place, 0)
    header = inside & (content[at] == HEAD[0]) & (content[np.minimum(at + 1, len(content) - 1)] == HEAD[1])
    return np.asarray(header | (place == len(content)))


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
    edge = np.zeros(count + 1, np.int64)
    edge[run_starts] += 1
    ran = np.array(run_breaks, np.int64)
    np.add.at(edge, breaks[ran] + whole[ran], -1)
    return np.asarray(np.cumsum(edge[:-1]) > 0)
