"""One vehicle's readings in the order of their instants: a queue through the navigator, on one lane."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from flownav.core.compile import ONE_LANE, Work, equation, invoke, kernel, pointer
from flownav.core.measurement import MAX_VALUES, Array, EventQueue
from flownav.navigation.kernel_settings import (
    FROM_ATTITUDE,
    FROM_MAG,
    NO_STATED_NOISE,
    Equipment,
    FlowNoise,
    NavigatorSettings,
    carries_lag,
)
from flownav.navigation.memory import CLOCK, READING, new_work
from flownav.navigation.packed import pack
from flownav.navigation.records import Reading
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.take import navigator_unit
from flownav.navigation.tape import Output, Tape, room_of

STATED_VARIANCES = 3  # variances that a reading carries


class Running(NamedTuple):
    """A navigator at work on one lane: its settings, its lane buffer, and the tape it writes."""

    given: NavigatorSettings
    settings: Array
    work: Array
    tape: Tape

    @property
    def clock_s(self) -> float:
        """The instant that it has reached [s]."""
        return float(self.work[CLOCK])


Instead = Callable[[Running], int]  # the address of what takes a navigator's readings in its place


def start_navigator(
    equipment: Equipment, settings: NavigatorSettingsFile, tape: Tape, noise: FlowNoise = NO_STATED_NOISE
) -> Running:
    """A new navigator. noise: the flow's noise by a sensor file."""
    headed = equipment.heading in (FROM_MAG, FROM_ATTITUDE) or equipment.use_attitude
    given = settings.settings(equipment, noise)
    sigma = settings.start_sigma(
        has_heading=headed, compass=equipment.heading == FROM_MAG, scale=bool(np.isfinite(equipment.deadline_s))
    )
    return Running(given, pack(given, sigma), new_work(ONE_LANE), tape)


def run(queue: EventQueue, on: Running, *, compiled: bool = True, instead: int | None = None) -> None:
    """Feed every event of the queue, in its order, and write the results onto the tape.

    compiled False: in plain Python, step by step (tests; it is a thousand times slower). instead: the address of what
    takes the readings in place of the navigator (`navigation.take.UNIT_SIGNATURE`).
    """
    unit = navigator_unit(ONE_LANE, carries_lag(on.given.flow))
    take: Any = instead
    if instead is None:
        take = unit.address if compiled else unit.python
    entry: Any = feed_all
    feed = entry if compiled else entry.py_func
    tape, journal = on.tape, on.tape.journal
    written = Output(
        tape.estimate.reshape(-1), tape.innovation.reshape(-1), tape.event.reshape(-1), journal.entry.reshape(-1),
        journal.state.reshape(-1), journal.covariance.reshape(-1), room_of(tape), tape.used,
    )  # fmt: skip
    feed(take, queue, on.work, on.settings, written)


@kernel
def feed_all(take: Any, queue: EventQueue, work: Work, settings: Work, o: Output) -> None:
    """Reading by reading into the rows of READING, and on to the navigator at the address `take`."""
    for k in range(len(queue.t_s)):
        put_reading(
            pointer(work), queue.value[k], queue.variance[k], queue.quality[k], queue.arrived[k], queue.withheld[k]
        )
        invoke(
            take, pointer(work), pointer(settings), pointer(o.estimate), pointer(o.innovation), pointer(o.event),
            pointer(o.entry), pointer(o.state), pointer(o.covariance), pointer(o.room), pointer(o.used),
            queue.t_s[k], queue.sensor[k],
        )  # fmt: skip


@equation
def put_reading(
    work: Work, value: Array, variance: Array, quality: float, arrived: float, withheld: float
) -> None:  # fmt: skip
    """A queue's row as the reading at hand of one lane."""
    for i in range(MAX_VALUES):
        work[READING + i] = value[i]
    for i in range(STATED_VARIANCES):
        work[READING + MAX_VALUES + i] = variance[i]
    work[READING + MAX_VALUES + STATED_VARIANCES] = quality
    work[READING + MAX_VALUES + STATED_VARIANCES + 1] = arrived
    work[READING + MAX_VALUES + STATED_VARIANCES + 2] = withheld


assert Reading._fields[MAX_VALUES + STATED_VARIANCES :] == ("quality", "arrived", "withheld")
