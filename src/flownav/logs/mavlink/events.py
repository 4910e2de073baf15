"""A vehicle's messages besides its sensors: mode, texts, parameters and their changes in flight.

Traps. PX4 sends a 32-bit integer parameter as the bits of a float (the "byte-wise" encoding of the parameter protocol),
ArduPilot sends its value. A STATUSTEXT longer than 50 characters comes in pieces with one id.
"""

import math
import struct

import numpy as np

from flownav.core.text import plain
from flownav.logs.happened import MODE, PARAMETER, Happened, changes, copter_mode, in_time, messages
from flownav.logs.mavlink.framing import ARDUPILOT, PX4, Message

INTEGERS = (1, 2, 3, 4, 5, 6)  # MAV_PARAM_TYPE of 8 to 32 bits
CUSTOM_MODE = 1  # of HEARTBEAT.base_mode
PX4_MAIN = {1: "Manual", 2: "Altitude", 3: "Position", 5: "Acro", 6: "Offboard", 7: "Stabilized"}
PX4_AUTO, PX4_SUB = 4, {2: "Takeoff", 3: "Hold", 4: "Mission", 5: "Return", 6: "Land", 8: "Follow", 9: "Precision land"}


class VehicleEvents:
    """The reports of one autopilot so far. parameters: as last received, by name."""

    def __init__(self, make: int) -> None:
        self.parameters: dict[str, float] = {}
        self._make = make
        self._modes: list[tuple[float, int]] = []
        self._messages: list[tuple[float, str]] = []
        self._set: list[Happened] = []

    def take(self, t_s: float, message: Message) -> None:
        """A HEARTBEAT, STATUSTEXT or PARAM_VALUE at its log time [s], NaN before a clock was received."""
        t_s = t_s if math.isfinite(t_s) else 0.0
        if message.msgname == "HEARTBEAT" and message.base_mode & CUSTOM_MODE:
            self._modes.append((t_s, int(message.custom_mode)))
        elif message.msgname == "STATUSTEXT":
            self._text(t_s, message)
        elif message.msgname == "PARAM_VALUE":
            name, value = str(message.param_id), parameter_value(message, self._make)
            if name in self.parameters and self.parameters[name] != value and math.isfinite(value):
                self._set.append(Happened(t_s, PARAMETER, name, value))
            self.parameters[name] = value

    def _text(self, t_s: float, message: Message) -> None:
        text = plain(str(message.text))
        if getattr(message, "chunk_seq", 0) and self._messages:
            text = self._messages.pop()[1] + text
        self._messages.append((t_s, text))

    def happened(self) -> tuple[Happened, ...]:
        """All reports, in order of time."""
        times, numbers = np.array([t for t, _ in self._modes]), np.array([float(mode) for _, mode in self._modes])
        modes = changes(MODE, times, numbers, lambda number: mode_name(number, self._make))
        return in_time([*modes, *self._set, *messages(self._messages)])


def mode_name(custom_mode: int, make: int) -> str:
    """The mode that HEARTBEAT.custom_mode is the number of."""
    if make == ARDUPILOT:
        return copter_mode(custom_mode)
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    if make == PX4:
        named = PX4_SUB.get(sub) if main == PX4_AUTO else PX4_MAIN.get(main)
        return named or f"mode {main}.{sub}"
    return f"mode {custom_mode}"


def parameter_value(message: Message, make: int) -> float:
    """PARAM_VALUE as a number."""
    if make == PX4 and message.param_type in INTEGERS:
        return float(struct.unpack("<i", struct.pack("<f", message.param_value))[0])
    return float(message.param_value)
