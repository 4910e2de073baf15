"""Parts of a block of flights: its lanes and their noise, the navigator on board, and its progress.

Normals are drawn by the noise counter, each sensor's on its own channels, into rows of the lane buffer.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import Lanes, Work, bits_from_float, equation, float_from_bits, procedure
from flownav.core.measurement import Array
from flownav.navigation.tape import Output, Tape
from flownav.simulation import layout
from flownav.simulation.noise import normal_pair


class Block(NamedTuple):
    """Flights side by side in one lane buffer, numbers `first` and up of a campaign `seed`, and the noise they meet."""

    work: Work
    lanes: Lanes
    seed: int
    first: int
    noise: Noise


class Aboard(NamedTuple):
    """The navigator of a block: its lane buffer, how it is called, its settings, packed, and its tape.

    take: its address; on a device the marker of its build. fed: a copy of what it is fed, where there is room.
    """

    nav: Work
    take: Any
    settings: Work
    o: Output
    fed: Work


class Progress(NamedTuple):
    """taken: the next slot's number; following: that of the next reading that the navigator takes; inertial: number
    of inertial readings so far.
    """

    taken: int
    following: int
    inertial: int


class Buffers(NamedTuple):
    """The scratch of one block. room: rows of estimate, innovation, event, entry, journal estimates and what is fed."""

    work: Array
    nav: Array
    tape: Tape
    fed: Array
    room: NDArray[np.int64]
    history: Array


# channels of the noise counter, pairs of normals; below lie those of wind and of the paper's sensors, from 40 on those
# of the sensors that a vehicle carries (`carried`)
RECIRCULATION_CHANNEL = 36

KEYED_EPOCHS = 2  # a lane's noise stream may change every 40 ms; at 100 a step of rare events' walk moves too much


class Noise(NamedTuple):
    """Which noise the lanes of a block meet.

    streams (spans, lanes): where in the noise counter each lane draws from, counted from the block's first flight, in
    each KEYED_EPOCHS epochs (the last row from there on). start (START_END - START_NORMALS rows of `layout`, lanes):
    the normals before the first epoch; of no rows where they are drawn, too.
    """

    streams: NDArray[np.uint64]
    start: Array


def plain_noise(lanes: int) -> Noise:
    """Each lane's own flight, from its start to its end."""
    return Noise(np.arange(lanes, dtype=np.uint64)[None, :], np.zeros((0, lanes)))


@equation
def stream_of(work: Work, lanes: Lanes, flight: int, lane: int) -> Any:
    """The flight whose noise a lane meets now; `flight` is the number of the block's first."""
    return np.uint64(flight) + bits_from_float(work[layout.STREAM * len(lanes) + lane])


@procedure
def key_lanes(work: Work, lanes: Lanes, streams: NDArray[np.uint64], epoch: int) -> None:
    """Each lane's noise stream in this epoch."""
    span = min(epoch // KEYED_EPOCHS, streams.shape[0] - 1)
    for lane in range(len(lanes)):
        work[layout.STREAM * len(lanes) + lane] = float_from_bits(streams[span, lane])


@procedure
def put_start(work: Work, lanes: Lanes, start: Array) -> None:
    """The normals before the first epoch in the place of those that were drawn, where they are given."""
    for row in range(start.shape[0]):
        for lane in range(len(lanes)):
            work[(layout.START_NORMALS + row) * len(lanes) + lane] = start[row, lane]


@procedure
def draw(work: Work, lanes: Lanes, row: int, count: int, seed: int, flight: int, step: int, channel: int) -> None:
    """`count` (even) standard normals into rows from `row` on, of the channels from `channel` on."""
    for pair in range(count // 2):
        for lane in range(len(lanes)):
            first, second = normal_pair(seed, stream_of(work, lanes, flight, lane), step, channel + pair)
            work[(row + 2 * pair) * len(lanes) + lane] = first
            work[(row + 2 * pair + 1) * len(lanes) + lane] = second
