"""What belongs together in a block of flights: its lanes and their noise, the navigator on board, how far it is."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import Lanes, Work
from flownav.core.measurement import Array
from flownav.navigation.tape import Output, Tape
from flownav.simulation.draws import Noise


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
    """taken: the next slot's number; following: that of the next reading that the navigator takes; heard: how many
    inertial readings there were.
    """

    taken: int
    following: int
    heard: int


class Buffers(NamedTuple):
    """The scratch of one block. room: rows of estimate, innovation, event, entry, journal estimates and what is fed."""

    work: Array
    nav: Array
    tape: Tape
    fed: Array
    room: NDArray[np.int64]
    history: Array
