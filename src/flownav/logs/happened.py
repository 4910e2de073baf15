"""Events in a vehicle's log besides its sensor readings: modes, source sets, messages, sensors used by its own filter.

The values of `Log.happened`, one row each. A state stands there when it is first reported and whenever it changes.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array

MODE = "mode"  # text: its name; value: its number
MESSAGE = "message"  # text: as the vehicle sent it to its pilot
PARAMETER = "parameter"  # text: its name; value: what it was set to in flight
SOURCE_SET = "source set"  # value: 1, 2, 3 of ArduPilot's EK3_SRCn
FUSES_FLOW = "fuses flow"  # value: 1 where the autopilot's filter takes its flow, else 0
CLIPPING = "clipping"  # value: accelerometer samples at the end of their range so far, all axes
VIBRATION = "vibration"  # value: the vehicle's own level of its accelerometer's vibration [m/s2], in steps of 5
MOST_ROWS = 2000  # of one kind: a log with more has little information in each


class Happened(NamedTuple):
    """One thing that happened: when [s], of what kind, in words and as a number (NaN where there is none)."""

    t_s: float
    kind: str
    text: str
    value: float


def changes(
    kind: str, t_s: Array, value: Array, words: Callable[[int], str] = str, least_s: float = 0.0
) -> Iterator[Happened]:
    """A state's rows: the first, and those where it changes, no nearer than least_s; t_s (n,) in order, value (n,)."""
    rows = np.flatnonzero(np.concatenate([[True], np.diff(value) != 0.0])) if len(value) else np.zeros(0, int)
    last_s, count = -np.inf, 0
    for row in rows:
        if t_s[row] - last_s >= least_s and count < MOST_ROWS:
            last_s, count = float(t_s[row]), count + 1
            yield Happened(last_s, kind, words(int(value[row])), float(value[row]))


def messages(texts: Iterable[tuple[float, str]]) -> Iterator[Happened]:
    """Messages by time and text, as far as they are few; a text that is repeated at once stands there once."""
    before, count = "", 0
    for t_s, text in texts:
        if text and text != before and count < MOST_ROWS:
            before, count = text, count + 1
            yield Happened(t_s, MESSAGE, text, float("nan"))


def in_time(rows: Iterable[Happened]) -> tuple[Happened, ...]:
    """In order of time; rows of one time keep theirs."""
    return tuple(sorted(rows, key=lambda row: row.t_s))


# -- modes by number ---------------------------------------------------------------------------------------------
PX4_MODES = {
    0: "Manual", 1: "Altitude", 2: "Position", 3: "Mission", 4: "Hold", 5: "Return", 10: "Acro", 12: "Descend",
    13: "Termination", 14: "Offboard", 15: "Stabilized", 17: "Takeoff", 18: "Land", 19: "Follow", 20: "Precision land",
    21: "Orbit",
}  # fmt: skip
COPTER_MODES = {
    0: "Stabilize", 1: "Acro", 2: "AltHold", 3: "Auto", 4: "Guided", 5: "Loiter", 6: "RTL", 7: "Circle", 9: "Land",
    11: "Drift", 13: "Sport", 14: "Flip", 15: "AutoTune", 16: "PosHold", 17: "Brake", 18: "Throw", 20: "Guided_NoGPS",
    21: "SmartRTL", 22: "FlowHold", 23: "Follow", 24: "ZigZag",
}  # fmt: skip


def px4_mode(number: int) -> str:
    """The name of a navigation state (vehicle_status.nav_state)."""
    return PX4_MODES.get(number, f"mode {number}")


def copter_mode(number: int) -> str:
    """The name of a mode of ArduCopter, a traditional helicopter's too."""
    return COPTER_MODES.get(number, f"mode {number}")
