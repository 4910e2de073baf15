"""Requests to a vehicle: each stream at its rate, one command at a time, and a simulator's truth.

ArduPilot's simulator has parameters that no vehicle has (SIM_SPEEDUP), so it is asked for one; a vehicle answers
nothing, or that there is none. PX4's sets MAV_MODE_FLAG_HIL_ENABLED in its HEARTBEAT. A sender of unrequested truth is
one. A vehicle is not asked for a truth that it does not have: ArduPilot would complain to every ground station.
"""

from collections import Counter
from typing import Any, NamedTuple

from flownav.live.rates import Rates, Streams
from flownav.live.reception import Vehicle
from flownav.logs.mavlink.framing import ARDUPILOT, PX4, Message, name_of, request_read

HIL_FLAG = 32  # MAV_MODE_FLAG_HIL_ENABLED
OF_A_SIMULATOR = "SIM_SPEEDUP"
MOST_QUESTIONS, AGAIN_S = 4, 2.0
SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 511, 512  # MAV_CMD
ACCEPTED, TEMPORARILY_REJECTED, IN_PROGRESS = 0, 1, 5  # MAV_RESULT
# Chosen; after a reboot that leaves HEARTBEAT and TIMESYNC alone all streams are back within seconds (test_live_safety,
# test_live_recordings).
ANSWER_S = 0.5
TRIES = 3
SILENT_S = 2.0  # a stream without a message for this long is requested again
SILENT_PERIODS = 5.0  # and for this number of its periods
MOST_PATIENCE_S = 30.0  # a stream that has never come is asked for ever more seldom, down to this
ORIGIN, GLOBAL_ORIGIN = "GPS_GLOBAL_ORIGIN", 49  # sent when it is requested, and when it is set


class Truth(NamedTuple):
    """The message with the truth: its name, number and the rate to ask for [Hz]."""

    name: str
    number: int
    rate_hz: float


SIM_STATE = Truth("SIM_STATE", 108, 25.0)
HIL_STATE = Truth("HIL_STATE_QUATERNION", 115, 25.0)
TRUTHS = {truth.name: truth for truth in (SIM_STATE, HIL_STATE)}


class Simulator:
    """Whether the vehicle is a simulator. truth: the message to request; None while it is taken for a vehicle."""

    def __init__(self) -> None:
        self.truth: Truth | None = None
        self._tries = 0
        self._asked_s = float("-inf")

    def received(self, message: Message, vehicle: Vehicle) -> Truth | None:
        """The truth to ask for, where this message of the autopilot is the first sign of a simulator."""
        if self.truth is not None:
            return None
        name = message.msgname
        if name in TRUTHS:
            self.truth = TRUTHS[name]
        elif name == "PARAM_VALUE" and name_of(message) == OF_A_SIMULATOR:
            self.truth = SIM_STATE
        elif name == "HEARTBEAT" and vehicle.make == PX4 and message.base_mode & HIL_FLAG:
            self.truth = HIL_STATE
        return self.truth

    def due(self, mav: Any, vehicle: Vehicle, now_s: float) -> Message | None:
        """The question to an ArduPilot, a few times."""
        over = self.truth is not None or self._tries >= MOST_QUESTIONS or vehicle.make != ARDUPILOT
        if over or now_s - self._asked_s < AGAIN_S:
            return None
        self._asked_s = now_s
        self._tries += 1
        return request_read(mav, vehicle.system, vehicle.component, OF_A_SIMULATOR)


class _Stream(NamedTuple):
    """A stream that was asked for. heard_s: our clock, minus infinity before the first; wait_s: until asked again."""

    number: int
    rate_hz: float
    asked_s: float
    received_s: float
    wait_s: float


class Requests:
    """Commands to a vehicle, one after the other. answers counts them: `accepted`, `refused`, `unanswered`.

    A stream that falls silent while the vehicle sends others is requested again: after a reboot all rates are 0. One
    that was refused is not, except the origin, which an autopilot has none of before its first fix.
    """

    def __init__(self, rates: Rates) -> None:
        self.answers: Counter[str] = Counter()
        self._rates = rates
        self.refused: list[str] = []
        self._streams: dict[str, _Stream] = {}
        self._left: list[str] = []
        self._sent_s = self._spoke_s = float("-inf")
        self._tries = 0

    def begin(self, vehicle: Vehicle, now_s: float) -> None:
        """Ask for everything, from the first on: at the start and when the vehicle comes back."""
        never = float("-inf")
        self._streams = {
            name: _Stream(number, rate, now_s, never, SILENT_S)
            for name, (number, rate) in self._rates.begin(vehicle.make).items()
        }
        self._streams[ORIGIN] = _Stream(GLOBAL_ORIGIN, 0.0, now_s, never, SILENT_S)
        self._left = list(self._streams)
        self._sent_s, self._tries = never, 0
        self.refused = []

    def revise(self, vehicle: Vehicle, now_s: float, beside: Streams | None = None) -> None:
        """Ask for what the plan of the rates has otherwise now. beside: streams to ask for as well from now on."""
        for name, (number, rate_hz) in self._rates.begin(vehicle.make, beside).items():
            before = self._streams.get(name)
            if name in self.refused or (before is not None and before.rate_hz == rate_hz):
                continue
            received_s = before.received_s if before is not None else float("-inf")
            self._streams[name] = _Stream(number, rate_hz, now_s, received_s, SILENT_S)
            if name not in self._left[bool(self._tries) :]:  # one that is under way was asked for at the old rate
                self._left.insert(bool(self._tries), name)  # what is asked for now is needed now

    @property
    def settled(self) -> bool:
        """Whether everything was asked for."""
        return not self._left

    def received(self, name: str, now_s: float) -> None:
        """A message of the vehicle."""
        self._spoke_s = now_s
        stream = self._streams.get(name)
        if stream is not None:
            wait_s = max(SILENT_S, SILENT_PERIODS / stream.rate_hz) if stream.rate_hz else float("inf")
            self._streams[name] = stream._replace(received_s=now_s, wait_s=wait_s)

    def due(self, mav: Any, vehicle: Vehicle, now_s: float) -> Message | None:
        """The command to send now, if any."""
        if self._left and now_s - self._sent_s >= ANSWER_S and self._tries >= TRIES:
            self._done("unanswered")
        if not self._left:
            self._left = self._silent(now_s)
        if not self._left or now_s - self._sent_s < ANSWER_S:
            return None
        name = self._left[0]
        stream = self._streams[name]
        self._streams[name] = stream._replace(asked_s=now_s)
        self._sent_s = now_s
        self._tries += 1
        command, period_us = (SET_MESSAGE_INTERVAL, 1e6 / stream.rate_hz) if stream.rate_hz else (REQUEST_MESSAGE, 0.0)
        return mav.command_long_encode(
            vehicle.system, vehicle.component, command, self._tries - 1, stream.number, period_us, *(0.0,) * 5
        )

    def _silent(self, now_s: float) -> list[str]:
        """The streams to ask for again, while anything comes from the vehicle at all."""
        if now_s - self._spoke_s > SILENT_S:
            return []
        found = [
            name
            for name, stream in self._streams.items()
            if (name not in self.refused or name == ORIGIN)
            and now_s - max(stream.asked_s, stream.received_s) > stream.wait_s
        ]
        for name in found:
            wait_s = min(2.0 * self._streams[name].wait_s, MOST_PATIENCE_S)
            self._streams[name] = self._streams[name]._replace(wait_s=wait_s)
        return found

    def acknowledged(self, message: Message) -> None:
        """COMMAND_ACK."""
        if not self._left or not self._tries:
            return
        name = self._left[0]
        if message.command != (SET_MESSAGE_INTERVAL if self._streams[name].rate_hz else REQUEST_MESSAGE):
            return
        if message.result in (TEMPORARILY_REJECTED, IN_PROGRESS):
            return
        if message.result != ACCEPTED and name not in self.refused:
            self.refused.append(name)
        self._done("accepted" if message.result == ACCEPTED else "refused")

    def _done(self, answer: str) -> None:
        self.answers[answer] += 1
        self._left.pop(0)
        self._sent_s, self._tries = float("-inf"), 0
