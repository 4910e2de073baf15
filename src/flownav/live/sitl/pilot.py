"""A ground station that flies: commands, parameters, and where the vehicle is to go. What a make does its own way is
in `ardupilot` and `px4`.
"""

import math
import os
import signal
import subprocess
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from flownav.live.sitl.wire import NAN, Wire
from flownav.logs.mavlink.framing import Message, Value, decoded, name_of, request_read, set_value

ANSWER_S, TRIES = 2.0, 3  # of a command, and of a parameter
ARM_S, DISARM_S = 90.0, 90.0  # limits; a vehicle that needs longer is not ready, or has not noticed that it landed
REACHED_M, LEG_S = 0.6, 25.0  # of a leg: how near it must be, and the longest that it waits
LEAST_LEG_S = 6.0
ARM, INTERVAL, MODE, FAILURE, SOURCE_SET = 400, 511, 176, 420, 42007  # MAV_CMD
FORCE = 21196
POSITION_ONLY = 0b110111111000
POSITION_AND_YAW = 0b100111111000
TRUTH_HZ, LOCAL_HZ = 25.0, 10.0


class NotFlown(Exception):
    """A flight that cannot go on, and why, in the autopilot's own words where it has any."""


class Case(NamedTuple):
    """The conditions of a flight. gps: `on`, `cut` once it hovers, or `never`; wind_m_s from wind_deg; heading at
    the start [deg]; send: the message that flownav sends; pad: whether it lands on one that a camera sees.
    """

    vehicle: str
    gps: str
    wind_m_s: float = 0.0
    wind_deg: float = 0.0
    heading_deg: float = 0.0
    send: str = "odometry"
    seed: int = 1
    pad: bool = False


class Program(NamedTuple):
    """Processes that run, and their folder."""

    running: subprocess.Popen[bytes]
    folder: Path


class Pilot(ABC):
    """A make's vehicle, flown. folder: where its simulator writes; slot: which of several beside each other."""

    vehicles: ClassVar[tuple[str, ...]]
    live_arguments: ClassVar[tuple[str, ...]] = ()
    height_m: ClassVar[float] = 5.0
    flow_sigma_rad_s: ClassVar[float]  # noise of the flow sensor that the flight has, and its readings a second
    flow_hz: ClassVar[float]
    log_pattern: ClassVar[str]  # of the autopilot's own logs below its folder
    logs = False  # whether it writes one

    def __init__(self, binary: Path, folder: Path, slot: int, case: Case) -> None:
        self.binary, self.folder = binary.absolute(), folder.absolute()  # the simulator runs in its own folder
        self.slot, self.case = slot, case
        self.wire = self.connected()
        self.wire.received.append(self._received)
        self.wire.beats.append(self._beat)
        self.program: Program | None = None
        self.target: tuple[float, float, float] | None = None
        self._acks: dict[int, int] = {}
        self._values: dict[str, Value] = {}
        self._turn = 0

    # -- a make's own ------------------------------------------------------------------------------------------
    @abstractmethod
    def connected(self) -> Wire:
        """The wire to its ports."""

    @abstractmethod
    def start(self) -> None:
        """Start the simulator, and wait until it is received. NotFlown where it is not."""

    @abstractmethod
    def take_off(self, height_m: float) -> None:
        """Arm and climb. NotFlown where it does not."""

    @abstractmethod
    def fly_on_flownav(self) -> None:
        """Make the autopilot use flownav's estimate from now on."""

    @abstractmethod
    def lose_gps(self) -> None:
        """No GPS any more, for the autopilot nor for flownav."""

    @abstractmethod
    def land_mode(self) -> None:
        """Ask it to land where it is."""

    @abstractmethod
    def afflict(self, fault: str, *, on: bool) -> None:
        """Begin or end a fault of its table. KeyError where it has none of the name."""

    @property
    def system(self) -> int:
        """MAVLink's number of the vehicle."""
        return self.slot + 1

    # -- what all do alike -------------------------------------------------------------------------------------
    def spawn(self, command: Sequence[str], environment: dict[str, str] | None = None) -> None:
        """Run the simulator in its folder, its words in a file there."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / "simulator.txt").open("ab") as words:
            running = subprocess.Popen(
                list(command), cwd=self.folder, stdin=subprocess.DEVNULL, stdout=words, stderr=words,
                env={**os.environ, **(environment or {})}, start_new_session=True,
            )  # fmt: skip
        self.program = Program(running, self.folder)

    def halt(self, number: int) -> None:
        """A signal to the simulator."""
        if self.program is not None:
            with suppress(ProcessLookupError):
                os.killpg(self.program.running.pid, number)

    def close(self) -> None:
        """End the simulator."""
        self.halt(signal.SIGCONT)
        self.halt(signal.SIGTERM)
        if self.program is not None:
            try:
                self.program.running.wait(5.0)
            except subprocess.TimeoutExpired:
                self.halt(signal.SIGKILL)
                self.program.running.wait()
        self.wire.close()

    def keep_log(self, folder: Path) -> None:
        """The autopilot's own log, the longest that it wrote, into a folder as `autopilot` with its suffix."""
        found = max(self.folder.glob(self.log_pattern), key=lambda path: path.stat().st_size, default=None)
        if found is None:
            self.note("the autopilot wrote no log")
        else:
            found.replace(folder / f"autopilot{found.suffix.lower()}")

    def note(self, *words: object) -> None:
        """Into the flight's words."""
        self.wire.history.say("pilot", " ".join(map(str, words)))

    def _received(self, message: Message) -> None:
        if message.msgname == "COMMAND_ACK":
            self._acks[message.command] = message.result
        elif message.msgname == "PARAM_VALUE":
            self._values[name_of(message)] = decoded(message, int(self.wire.latest["HEARTBEAT"].autopilot))

    def command(self, number: int, *values: float) -> int | None:
        """MAV_CMD by COMMAND_LONG; the result that is acknowledged, None where nothing is."""
        padded = (*values, *(0.0,) * (7 - len(values)))
        for attempt in range(TRIES):
            self._acks.pop(number, None)
            self.wire.say(self.wire.mav.command_long_encode(self.system, 1, number, attempt, *padded))
            if self.wire.until(lambda: number in self._acks, ANSWER_S):
                return self._acks[number]
        return None

    def value_of(self, name: str) -> Value | None:
        """A parameter's value as the vehicle reports it."""
        for _ in range(TRIES):
            self._values.pop(name, None)
            self.wire.say(request_read(self.wire.mav, self.system, 1, name))
            if self.wire.until(lambda: name in self._values, 1.0):
                return self._values[name]
        return None

    def set(self, **parameters: float) -> None:
        """Set parameters, each until the vehicle confirms it. NotFlown where it does not."""
        make = int(self.wire.latest["HEARTBEAT"].autopilot)
        for name, number in parameters.items():
            self._set(name, number, make)
        self.note("set", parameters)

    def _set(self, name: str, number: float, make: int) -> None:
        known = self.value_of(name)
        if known is None:
            raise NotFlown(f"the vehicle has no parameter {name}")
        for _ in range(2 * TRIES):
            self._values.pop(name, None)
            self.wire.say(set_value(self.wire.mav, self.system, 1, name, Value(number, known.kind), make))
            if self.wire.until(lambda: name in self._values, 0.7):
                break
        has = self._values.get(name)
        if has is None or not math.isclose(has.number, number, rel_tol=1e-3, abs_tol=1e-6):
            raise NotFlown(f"{name} does not become {number:g}")

    def streams(self, rates_hz: dict[int, float]) -> None:
        """Ask for messages at rates."""
        for number, rate_hz in rates_hz.items():
            self.command(INTERVAL, number, 1e6 / rate_hz)

    def arm(self) -> None:
        """Arm, however often it takes. NotFlown, with the autopilot's words, where it never does."""
        end_s = time.monotonic() + ARM_S
        while time.monotonic() < end_s:
            if self.command(ARM, 1.0) == 0 and self.wire.until(lambda: self.wire.armed, 3.0):
                return
            self.wire.pump(1.0)
        reasons = [what for _, who, what in self.wire.history.words if who == "autopilot"][-3:]
        raise NotFlown("never armed: " + "; ".join(dict.fromkeys(reasons)))

    @property
    def local_ned_m(self) -> tuple[float, float, float]:
        """Where the autopilot believes it is, about its own origin."""
        if not self.wire.history.local:
            return NAN, NAN, NAN
        return self.wire.history.local[-1][1].pos_ned_m

    def go(self, place: tuple[float, float, float], least_s: float = LEAST_LEG_S) -> None:
        """To a place of the autopilot's own frame; it goes on after the leg's limit, wherever it is."""
        self.target = place
        began_s = time.monotonic()
        self.wire.until(
            lambda: time.monotonic() - began_s >= least_s and math.dist(self.local_ned_m, place) < REACHED_M, LEG_S
        )
        self.note("at", *(f"{value:.2f}" for value in self.local_ned_m))

    def land(self) -> bool:
        """Land where it is; whether it then disarmed by itself."""
        self.target = None
        self.note("lands")
        self.land_mode()
        landed = self.wire.until(lambda: not self.wire.armed, DISARM_S)
        self.note("landed" if landed else "has not landed")
        return landed

    def _beat(self, mav: Any) -> list[Message]:
        """Ten times a second: the target, as often as the make wants it."""
        self._turn += 1
        if self.target is None or self._turn % self.target_every:
            return []
        yaw = math.radians(self.case.heading_deg)
        place = (*self.target, *(0.0,) * 6, yaw, 0.0)
        return [mav.set_position_target_local_ned_encode(0, self.system, 1, 1, self.target_mask, *place)]

    target_every: ClassVar[int] = 5
    target_mask: ClassVar[int] = POSITION_ONLY
