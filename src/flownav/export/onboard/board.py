"""The library's own code run here, compiled for this process: the output of a board or a browser must equal this
one's.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.export.onboard.code import addresses, code_here
from flownav.navigation import onboard, progress, waiting, waiting_records
from flownav.navigation.now import NOW_NUMBERS, NowRow, now_row
from flownav.navigation.rings import Given, numbers_of
from flownav.navigation.rows import EVENT_COLUMNS, INNOVATION_COLUMNS


class Outcome(NamedTuple):
    """Outcome of a call: the numbers of `onboard.OutcomeHead`, and rows of innovations and of events."""

    head: onboard.OutcomeHead[float]
    innovation: Array
    event: Array


class Board:
    """A navigator as the library has it. settings: packed, with the numbers of an `progress.Pace` behind them."""

    def __init__(self, settings: Array, sizes: waiting_records.Sizes, *, lag: bool = False) -> None:
        self.work = np.zeros(progress.BOARD_ROWS)
        self.rings = waiting.new_rings(sizes)
        self.settings = np.ascontiguousarray(settings)
        self._at, self._reading = np.zeros(2), np.zeros(waiting_records.READING)
        self._head = np.zeros(len(onboard.OutcomeHead._fields))
        self._innovation = np.zeros((onboard.MOST_INNOVATIONS, INNOVATION_COLUMNS))
        self._event = np.zeros((onboard.MOST_EVENTS, EVENT_COLUMNS))
        self._now, self._digest = np.zeros(NOW_NUMBERS), np.zeros(1)
        self._code = code_here(lag)
        own = self.work, self.rings, self.settings
        self._taken = addresses(*own, self._at, self._reading, self._head, self._innovation, self._event)
        self._addresses = addresses(*own, self._at, self._now)
        self._code["begin"](*addresses(*own))

    def take(self, given: Given) -> Outcome:
        """A reading in, as `flownav_take`; of sensor 0, as `flownav_work`."""
        self._at[:] = given.t_s, given.sensor
        self._reading[:] = given.numbers
        self._code["take"](*self._taken)
        head = onboard.OutcomeHead(*map(float, self._head))
        return Outcome(head, self._innovation[: int(head.innovations)].copy(), self._event[: int(head.events)].copy())

    def finish(self) -> None:
        """All the work that is left."""
        while self.take(NOTHING).head.parts > 0.0:
            pass

    def now(self, t_s: float) -> NowRow[Array]:
        """The state at an instant, as `flownav_now`."""
        self._at[0] = t_s
        self._code["now"](*self._addresses)
        row: NowRow[Array] = now_row(self._now.copy())
        return row

    def digest(self) -> int:
        """As `flownav_digest`."""
        self._code["digest"](*addresses(self.work, self._digest))
        return int(self._digest.view(np.uint64)[0])


NOTHING = Given(0.0, 0, numbers_of(()))
UNTOUCHED = 0xA5  # what a stack is painted with, to see how much of it is used
