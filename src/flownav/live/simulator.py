"""Whether the vehicle is a simulator: then it is asked for the truth, which goes into the record.

ArduPilot's simulator has parameters that no vehicle has (SIM_SPEEDUP), so it is asked for one; a vehicle answers
nothing, or that there is none. PX4's says so in its HEARTBEAT (MAV_MODE_FLAG_HIL_ENABLED). Who tells the truth unasked
is one. A vehicle is not asked for a truth that it does not have: ArduPilot would complain to every ground station.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flownav.live.reception import Vehicle
from flownav.mavlink.dialect import ARDUPILOT, PX4, Message
from flownav.mavlink.parameters import name_of, request_read

HIL = 32  # MAV_MODE_FLAG_HIL_ENABLED
OF_A_SIMULATOR = "SIM_SPEEDUP"
TRIES, AGAIN_S = 4, 2.0


class Truth(NamedTuple):
    """The message that tells the truth: its name, number and the rate to ask for [Hz]."""

    name: str
    number: int
    rate_hz: float


SIM_STATE = Truth("SIM_STATE", 108, 25.0)
HIL_STATE = Truth("HIL_STATE_QUATERNION", 115, 25.0)
TRUTHS = {truth.name: truth for truth in (SIM_STATE, HIL_STATE)}


class Simulator:
    """What is known of the vehicle being one. truth: what to ask it for; None while it is taken for a vehicle."""

    def __init__(self) -> None:
        self.truth: Truth | None = None
        self._tries = 0
        self._asked_s = float("-inf")

    def heard(self, message: Message, vehicle: Vehicle) -> Truth | None:
        """The truth to ask for, where this message of the autopilot is the first to tell of a simulator."""
        if self.truth is not None:
            return None
        name = message.msgname
        if name in TRUTHS:
            self.truth = TRUTHS[name]
        elif name == "PARAM_VALUE" and name_of(message) == OF_A_SIMULATOR:
            self.truth = SIM_STATE
        elif name == "HEARTBEAT" and vehicle.make == PX4 and message.base_mode & HIL:
            self.truth = HIL_STATE
        return self.truth

    def due(self, mav: Any, vehicle: Vehicle, now_s: float) -> Message | None:
        """The question to an ArduPilot, a few times."""
        over = self.truth is not None or self._tries >= TRIES or vehicle.make != ARDUPILOT
        if over or now_s - self._asked_s < AGAIN_S:
            return None
        self._asked_s = now_s
        self._tries += 1
        return request_read(mav, vehicle.system, vehicle.component, OF_A_SIMULATOR)
