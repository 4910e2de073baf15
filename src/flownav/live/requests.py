"""What a vehicle is asked for: each stream at its rate, one command at a time, until it is acknowledged."""

from __future__ import annotations

from collections import Counter
from typing import Any

from flownav.live.reception import Vehicle
from flownav.mavlink.dialect import Message

SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 511, 512  # MAV_CMD
ARDUPILOT = 3
ACCEPTED, TEMPORARILY_REJECTED, IN_PROGRESS = 0, 1, 5  # MAV_RESULT
ANSWER_S = 0.5
TRIES = 3
# message: id and rate [Hz]; the IMU moves the state, the others correct it
COMMON = {
    "ATTITUDE_QUATERNION": (31, 50),
    "DISTANCE_SENSOR": (132, 25),
    "GPS_RAW_INT": (24, 10),
    "SCALED_PRESSURE": (29, 10),
    "EXTENDED_SYS_STATE": (245, 5),
    "SYSTEM_TIME": (2, 1),
}
STREAMS = {
    True: {"RAW_IMU": (27, 100), "OPTICAL_FLOW": (100, 50), **COMMON},  # ArduPilot
    False: {"HIGHRES_IMU": (105, 100), "OPTICAL_FLOW_RAD": (106, 250), "OPTICAL_FLOW": (100, 250), **COMMON},
}
GLOBAL_ORIGIN = 49


class Requests:
    """Commands to a vehicle, one after the other. answers counts them: `accepted`, `refused`, `unanswered`."""

    def __init__(self) -> None:
        self.answers: Counter[str] = Counter()
        self.refused: list[str] = []
        self._left: list[tuple[str, int, float, float]] = []  # name, command, two parameters
        self._sent_s = float("-inf")
        self._tries = 0

    def begin(self, vehicle: Vehicle) -> None:
        """Ask for everything, from the first on: at the start and when the vehicle comes back."""
        streams = STREAMS[vehicle.make == ARDUPILOT]
        wanted = [(name, SET_MESSAGE_INTERVAL, number, 1e6 / rate) for name, (number, rate) in streams.items()]
        self._left = [*wanted, ("GPS_GLOBAL_ORIGIN", REQUEST_MESSAGE, GLOBAL_ORIGIN, 0.0)]
        self._sent_s, self._tries = float("-inf"), 0
        self.refused = []

    def due(self, mav: Any, vehicle: Vehicle, now_s: float) -> Message | None:
        """The command to send now, if any."""
        if self._left and now_s - self._sent_s >= ANSWER_S and self._tries >= TRIES:
            self._done("unanswered")
        if not self._left or now_s - self._sent_s < ANSWER_S:
            return None
        _, command, first, second = self._left[0]
        self._sent_s = now_s
        self._tries += 1
        return mav.command_long_encode(
            vehicle.system, vehicle.component, command, self._tries - 1, first, second, 0.0, 0.0, 0.0, 0.0, 0.0
        )

    def acknowledged(self, message: Message) -> None:
        """COMMAND_ACK."""
        if not self._left or not self._tries or message.command != self._left[0][1]:
            return
        if message.result in (TEMPORARILY_REJECTED, IN_PROGRESS):
            return
        if message.result != ACCEPTED:
            self.refused.append(self._left[0][0])
        self._done("accepted" if message.result == ACCEPTED else "refused")

    def _done(self, answer: str) -> None:
        self.answers[answer] += 1
        self._left.pop(0)
        self._sent_s, self._tries = float("-inf"), 0
