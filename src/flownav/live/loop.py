"""The loop between a link and a session, and between a simulated vehicle and its link: select, clock, signals.

Before it begins kernels are loaded, and the process asks to run before others where the system permits it.
"""

import gc
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Self

import numpy as np

from flownav.core.compile import announce_compilation
from flownav.core.measurement import COLUMNS, Sensor
from flownav.live.answers import estimate_of
from flownav.live.filtering import Filtering, Keeper
from flownav.live.link import Link, waited
from flownav.live.options import Options
from flownav.live.session import Session
from flownav.live.simulated import SimulatedVehicle
from flownav.logs.mavlink.framing import coder
from flownav.logs.mavlink.outgoing import odometry
from flownav.logs.mavlink.position_messages import local_position_m
from flownav.navigation.rings import Given, numbers_of

PRIORITY = 1  # the least of the real-time ones: before every ordinary process, behind the system's own
NICE = -10
SWITCH_S = 0.0005  # a tenth of Python's own: chosen, beside a journal's and a screen's threads
WAIT_S = 0.005  # chosen: what arrives wakes it sooner (0.7 ms to the estimate in the median, live.md)
SILENT_S = 3.0  # after this long without the vehicle any sender on a UDP port is accepted: chosen, three HEARTBEATs
SCREEN_S = 0.25  # chosen, for readers
COLLECT_S = 0.1  # chosen: garbage is collected after an estimate, not where Python would
NAN = float("nan")
EDGES_S = np.geomspace(1e-6, 10.0, 281)  # of the latency's histogram, 40 a decade


def run_before_others() -> str:
    """Ask for real-time scheduling, else for a higher priority; what was given, in words.

    Threads made later inherit it: the journal's must not be held up while it holds Python's lock.
    """
    sys.setswitchinterval(SWITCH_S)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        return f"real time (SCHED_FIFO {PRIORITY})"
    except OSError:
        pass
    try:
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
        return f"priority (nice {NICE})"
    except OSError:
        return "ordinary (more is not permitted)"


def run_as_others() -> None:
    """Run this thread at normal priority, so that work after the flight does not hold up the rest of the machine."""
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def warm_up() -> None:
    """One reading of each kind through a navigator that nobody listens to, and one message there and back.

    A second of loading while a vehicle talks would overflow the socket's buffer.
    """
    filtering = Filtering(Options(), Keeper())
    readings = [
        Given(0.1 * step, int(sensor), numbers_of((0.1,) * len(COLUMNS[sensor]), exposure_s=0.1))
        for step, sensor in enumerate([Sensor.ATTITUDE, Sensor.IMU, Sensor.IMU, *Sensor])
    ]
    with announce_compilation("live"):
        for reading in readings:
            filtering.rings.take(reading)
        filtering.rings.take_back(0.15)
        filtering.begin(gps_received=True)
        filtering.feed(math.inf)
        assert filtering.running is not None
        estimate = estimate_of(filtering.running, filtering.now(1.0), 1.0, 1.0, 0)
    local_position_m((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    mav = coder()
    mav.decode(bytearray(odometry(mav, estimate).pack(mav)))
    gc.collect()
    gc.freeze()  # what is loaded by now stays; the collector need not look at it again


class Latency:
    """How long it takes from a flow reading's arrival to the estimate's departure: a histogram, which does not grow."""

    def __init__(self) -> None:
        self.counts = np.zeros(len(EDGES_S) + 1, np.int64)
        self.longest_s = 0.0

    def take(self, latency_s: float) -> None:
        """One more."""
        self.counts[np.searchsorted(EDGES_S, latency_s)] += 1
        self.longest_s = max(self.longest_s, latency_s)

    def quantile_s(self, share: float) -> float:
        """The latency that this share stays below (the upper edge of its bin, 6 % wide); NaN without any."""
        total = int(self.counts.sum())
        if not total:
            return float("nan")
        place = int(np.searchsorted(np.cumsum(self.counts), share * total))
        return float(min(EDGES_S[min(place, len(EDGES_S) - 1)], self.longest_s))


class Collector:
    """Python's garbage collector by our own schedule: off while a session runs, but for the turns that it is given.

    What the session itself makes is freed without it; the screen's and the libraries' cycles are not.
    """

    def __init__(self, now_s: float) -> None:
        self._at_s = now_s
        self._turns = 0

    def __enter__(self) -> Self:
        self._was_on = gc.isenabled()
        gc.disable()
        return self

    def __exit__(self, *raised: object) -> None:
        if self._was_on:
            gc.enable()

    def turn(self, now_s: float) -> None:
        """Called when the estimate has been sent: the youngest ten times a second, the older seldom."""
        if now_s - self._at_s >= COLLECT_S:
            self._at_s = now_s
            self._turns += 1
            gc.collect(2 if self._turns % 300 == 0 else 1 if self._turns % 20 == 0 else 0)


@contextmanager
def stoppable() -> Iterator[Callable[[], bool]]:
    """Whether Ctrl-C, a termination or the terminal's end was asked for; a second one breaks off at once.

    Except the terminal's end, which may be signalled twice.
    """
    asked: list[int] = []
    handled = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

    def note(number: int, frame: FrameType | None) -> None:
        if asked and number != signal.SIGHUP:
            raise KeyboardInterrupt
        asked.append(number)

    before = [signal.signal(number, note) for number in handled]
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in zip(handled, before, strict=True):
            signal.signal(number, handler)


def run_session(
    session: Session,
    link: Link,
    latency: Latency,
    stop: Callable[[], bool],
    shows: Iterable[Callable[[float], None]] = (),
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Run until `stop`: pass on bytes as they arrive, and send the session's frames.

    shows: called with our clock four times a second, between two readings; none of them may wait for anything.
    """
    shown_s = spoke_s = clock()
    flow_s = NAN  # when the flow reading came that no estimate has answered yet

    def tick() -> float:
        before, now_s = session.sent, clock()
        session.tick(now_s)
        while session.outbox:
            link.write(session.outbox.popleft())
        if session.due:
            return flow_s
        if session.sent > before and flow_s == flow_s:
            latency.take(clock() - flow_s)
        return NAN

    turns = 0
    with Collector(spoke_s) as collector:
        while not stop():
            waited(link, WAIT_S)
            if session.turns > turns:  # the vehicle is another one, which may send from elsewhere
                turns = session.turns
                link.forget()
            for piece, sender in link.read():
                now_s = clock()
                flow = session.due
                if session.take(piece, now_s, whole=link.datagrams):
                    link.believe(sender)
                    spoke_s = now_s
                if session.due and not flow:
                    flow_s = NAN if session.reason else now_s  # where nothing is sent, nothing waits
                    flow_s = tick()
            for piece in link.overheard():
                session.overhear(piece)
            flow_s, now_s = tick(), clock()
            if now_s - spoke_s > SILENT_S:
                link.forget()
                spoke_s = now_s
            if now_s - shown_s >= SCREEN_S:
                shown_s = now_s
                for show in shows:
                    show(now_s)
            collector.turn(now_s)


def run_vehicle(
    vehicle: SimulatedVehicle,
    link: Link,
    speed: float,
    stop: Callable[[], bool],
    clock: Callable[[], float] = time.monotonic,
) -> float:
    """Send the flight at `speed` times its pace until it ends or `stop`; the time of the flight that was reached [s].

    Stamps are of the flight, so that at another speed than 1 the vehicle's clock runs faster than ours.
    """
    start_s, unix_s = clock(), time.time()
    t_s = 0.0
    while not stop() and not vehicle.finished:
        waited(link, WAIT_S)
        now_s = clock()
        t_s = speed * (now_s - start_s)
        answers = [frame for piece, _ in link.read() for frame in vehicle.hear(piece, t_s)]
        for frame in [*answers, *vehicle.due(t_s, unix_s + now_s - start_s)]:
            link.write(frame)
    return t_s
