"""One flight: the simulator, the very `flownav live` beside it, a scenario, faults at their times."""

import json
import math
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from flownav.core.errors import InputError, arg
from flownav.live.sitl.ardupilot import ArduPilot
from flownav.live.sitl.keeping import Recording
from flownav.live.sitl.pad import PadCamera
from flownav.live.sitl.pilot import Case, NotFlown, Pilot
from flownav.live.sitl.px4 import Px4
from flownav.live.sitl.tables import Fault, faults_of
from flownav.live.sitl.wire import HOST, History

PILOTS: dict[str, type[Pilot]] = {"ardupilot": ArduPilot, "px4": Px4}
LIVE = "FLOWNAV_LIVE"  # another version's `flownav`, to fly it beside this one
ORIGIN, REQUEST = 49, 512  # GPS_GLOBAL_ORIGIN, MAV_CMD_REQUEST_MESSAGE
SENDS_S = 60.0  # so long flownav may take until it sends
ENDS_S = 30.0  # and to write its record
SIDE_M = 10.0


class Scenario(NamedTuple):
    """The scenario of a flight: seconds of hover, and whether a square follows. gps: its case unless the order names
    one. pad: whether a camera sees one where the vehicle took off.
    """

    hover_s: float
    square: bool
    gps: str
    says: str
    pad: bool = False


SCENARIOS = {
    "square": Scenario(60.0, True, "cut", "take off, hover for 60 s, a square of 10 m, land where it began"),
    "indoor": Scenario(60.0, True, "never", "the same without a GPS, ever"),
    "land": Scenario(10.0, False, "cut", "take off, hover for 10 s, land"),
    "hover": Scenario(60.0, False, "cut", "take off, hover for 60 s, land"),
    "tour": Scenario(10.0, True, "on", "take off, hover for 10 s, a square of 10 m, land where it began"),
    "pad": Scenario(10.0, True, "cut", "the same without GPS, and a camera sees a pad where it took off", pad=True),
    "sortie": Scenario(600.0, True, "cut", "the square after ten minutes of hover"),
}
GPS = ("on", "cut", "never")


class Struck(NamedTuple):
    """A fault at its time: seconds after the hover begins, and how long it lasts."""

    name: str
    at_s: float
    lasts_s: float


def struck_of(text: str, faults: dict[str, Fault]) -> Struck:
    """NAME@T or NAME@T+S. InputError where it is not that, or the make's simulator has no such fault."""
    name, at, when = text.partition("@")
    begin, _, lasts = when.partition("+")
    if name not in faults:
        raise InputError(f"{arg('fault')} {name}: this simulator has {', '.join(faults)}")
    try:
        at_s = float(begin) if at else 10.0
        lasts_s = float(lasts) if lasts else faults[name].lasts_s
    except ValueError:
        at_s = lasts_s = math.nan
    if not (0.0 <= at_s <= 1e4 and 0.0 <= lasts_s <= 1e4):
        raise InputError(f"{arg('fault')} {text}: NAME@T or NAME@T+S is needed, seconds of the hover, e.g. {name}@20+5")
    return Struck(name, at_s, lasts_s)


class Order(NamedTuple):
    """A flight that is asked for. live: more options of `flownav live`; link: whether the line is kept, as files."""

    autopilot: str
    scenario: str
    case: Case
    struck: tuple[Struck, ...] = ()
    live: tuple[str, ...] = ()
    link: bool = False


class Mark(NamedTuple):
    """When a part of the flight began, on our clock [s]."""

    name: str
    now_s: float


class Flown(NamedTuple):
    """A flight that was flown. why: why it was broken off, or ""; landed: disarmed by itself; lives: facts and CPU
    seconds of each `flownav live` that flew.
    """

    order: Order
    history: History
    marks: tuple[Mark, ...]
    path_ne_m: tuple[tuple[float, float], ...]
    origin_deg_m: tuple[float, float, float] | None
    landed: bool
    why: str
    lives: tuple[dict[str, Any], ...]


class Live:
    """`flownav live` in a process of its own."""

    def __init__(self, port: int, record: Path, arguments: tuple[str, ...]) -> None:
        own = [sys.executable, "-m", "flownav"]
        command = [*(shlex.split(os.environ[LIVE]) if os.environ.get(LIVE) else own), "live", f"udp:{HOST}:{port}"]
        self._began_s = time.monotonic()
        self._words = (record.with_suffix(".txt")).open("wb+")
        self._running = subprocess.Popen(
            [*command, "--record", str(record), "--json", *arguments], stdin=subprocess.DEVNULL,
            stdout=self._words, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip

    def end(self, number: int = signal.SIGINT, pump: Callable[[float], None] = time.sleep) -> dict[str, Any]:
        """End it; its own figures, with the seconds of a processor that it took and its exit status."""
        self._running.send_signal(number)
        end_s = time.monotonic() + ENDS_S
        while True:
            found, status, usage = os.wait4(self._running.pid, os.WNOHANG)
            if found:
                break
            if time.monotonic() > end_s:
                self._running.kill()
            pump(0.05)
        self._running.returncode = os.waitstatus_to_exitcode(status)
        lasted_s = time.monotonic() - self._began_s
        self._words.seek(0)
        lines = self._words.read().decode(errors="replace").splitlines()
        self._words.close()
        facts: dict[str, Any] = {}
        for line in lines:
            if line.startswith("{"):
                facts = json.loads(line)
        return facts | {
            "cpu_s": usage.ru_utime + usage.ru_stime, "ran_s": lasted_s, "status": self._running.returncode,
            "words": [line for line in lines if not line.startswith("{")],
        }  # fmt: skip


def fly(order: Order, binary: Path, folder: Path, slot: int) -> Flown:
    """Fly it. folder: where its record goes; slot: which of those that fly beside each other."""
    return _Flight(order, binary, folder, slot).flown()


class _Flight:
    """A flight on its way."""

    def __init__(self, order: Order, binary: Path, folder: Path, slot: int) -> None:
        self.order, self.folder = order, folder
        folder.mkdir(parents=True, exist_ok=True)
        self.pilot = PILOTS[order.autopilot](binary, folder / "simulator", slot, order.case)
        self.wire = self.pilot.wire
        self.marks: list[Mark] = []
        self.lives: list[dict[str, Any]] = []
        self.path: list[tuple[float, float]] = [(0.0, 0.0)]
        self.live: Live | None = None
        self.faults = faults_of(order.autopilot)
        self.due = [(struck.at_s, "begin", struck) for struck in order.struck]
        self.due += [(struck.at_s + struck.lasts_s, "end", struck) for struck in order.struck]
        self.due.sort(key=lambda entry: entry[0])
        self.busy = False
        self.wire.turns.append(self.strike)
        self.recording = Recording(folder) if order.link else None
        self.pilot.logs = order.link
        if self.recording is not None:
            self.wire.kept = self.recording.take

    def flown(self) -> Flown:
        """Fly the whole flight, and return its result however it ends."""
        why, landed = "", False
        try:
            landed = self.steps()
        except NotFlown as error:
            why = str(error)
        finally:
            if self.live is not None:
                self.lives.append(self.live.end(pump=self.wire.pump))
            self.pilot.close()
            if self.recording is not None:
                self.recording.close(self.wire.history)
                self.pilot.keep_log(self.folder)
        return Flown(
            self.order, self.wire.history, tuple(self.marks), tuple(self.path), self.origin, landed, why,
            tuple(self.lives),
        )  # fmt: skip

    origin: tuple[float, float, float] | None = None

    def mark(self, name: str) -> None:
        """A part begins."""
        self.marks.append(Mark(name, time.monotonic()))
        self.pilot.note("begins:", name)

    def begin_live(self) -> None:
        """Start `flownav live`."""
        record = self.folder / f"live-{len(self.lives)}.fnr"
        arguments = ("--send", self.order.case.send, *self.pilot.live_arguments, *self.order.live)
        self.live = Live(self.wire.live_port, record, arguments)

    def steps(self) -> bool:
        """Fly the scenario's steps; whether the vehicle landed."""
        scenario, pilot, case = SCENARIOS[self.order.scenario], self.pilot, self.order.case
        self.mark("start")
        pilot.start()
        if case.pad:
            PadCamera(self.wire, pilot.system, case.seed)
        self.begin_live()
        if not self.wire.until(lambda: self.wire.sends, SENDS_S):
            if case.gps == "never":
                raise NotFlown("flownav sends nothing, so nobody can arm without GPS")
            pilot.note("flownav sends nothing yet")
        self.mark("take-off")
        pilot.take_off(pilot.height_m)
        self.mark("on flownav")
        pilot.fly_on_flownav()
        self.wire.pump(4.0)
        if case.gps == "cut":
            pilot.lose_gps()
        self.ask_origin()
        self.mark("hover")
        self.wire.pump(scenario.hover_s)
        home = pilot.local_ned_m
        if scenario.square:
            self.mark("square")
            for north_m, east_m in ((SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M), (0.0, 0.0)):
                self.path.append((north_m, east_m))
                pilot.go((home[0] + north_m, home[1] + east_m, home[2]))
        self.mark("land")
        landed = pilot.land()
        self.wire.pump(2.0)
        self.mark("end")
        return landed

    def ask_origin(self) -> None:
        """Where the autopilot's frame begins, about which flownav sends."""
        self.pilot.command(REQUEST, ORIGIN)
        origin_message = self.wire.latest.get("GPS_GLOBAL_ORIGIN")
        if origin_message is not None:
            self.origin = (
                origin_message.latitude * 1e-7,
                origin_message.longitude * 1e-7,
                origin_message.altitude * 1e-3,
            )

    # -- faults ------------------------------------------------------------------------------------------------
    def strike(self, now_s: float) -> None:
        """Start and end the faults that are due, from the hover on."""
        if self.busy or not self.due or not self.marks or all(mark.name != "hover" for mark in self.marks):
            return
        since_s = next(mark.now_s for mark in self.marks if mark.name == "hover")
        while self.due and now_s - since_s >= self.due[0][0]:
            _, what, struck = self.due.pop(0)
            self.busy = True
            try:
                self.turn_fault(struck.name, self.faults[struck.name], on=what == "begin")
            finally:
                self.busy = False

    def turn_fault(self, name: str, fault: Fault, *, on: bool) -> None:
        """Begin or end it."""
        self.marks.append(Mark(f"{'fault' if on else 'over'}: {name}", time.monotonic()))
        self.pilot.note("fault begins:" if on else "fault ends:", fault.says)
        self.pilot.afflict(name, on=on)
        if fault.loss:
            self.wire.line.loss = fault.loss if on else 0.0
        if fault.freeze_s:
            self.pilot.halt(signal.SIGSTOP if on else signal.SIGCONT)
        if fault.restart and on and self.live is not None:
            self.lives.append(self.live.end(signal.SIGKILL, pump=self.wire.pump))
            self.begin_live()
