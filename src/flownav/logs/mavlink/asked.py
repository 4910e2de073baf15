"""The autopilot's set-points and battery in MAVLink messages: neither is fused, both stand on the page.

Traps. A bit that is set in a `type_mask` means that a component is to be ignored. NAV_CONTROLLER_OUTPUT has no time of
its own; ArduCopter puts its target attitude into it (GCS_MAVLINK_Copter::send_nav_controller_output).
"""

import math

import numpy as np

from flownav.core.frames import quaternion_from_euler
from flownav.core.record import POSITION_NED, QUATERNION, Table
from flownav.logs.mavlink.framing import ARDUPILOT, Message

LOCAL_NED = 1  # MAV_FRAME
PLACE_BITS = (1, 2, 4)  # POSITION_TARGET_TYPEMASK_X_IGNORE and on
ATTITUDE_IGNORED = 128  # ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
ASKING = ("POSITION_TARGET_LOCAL_NED", "ATTITUDE_TARGET", "NAV_CONTROLLER_OUTPUT", "SYS_STATUS")
FARTHEST_M = 1e6
UNKNOWN_MV = 65535


class Asked:
    """The set-points and battery of one autopilot so far, message by message."""

    def __init__(self, make: int) -> None:
        self._make = make
        self._rows: dict[str, list[tuple[float, ...]]] = {name: [] for name in ASKING}

    def take(self, t_s: float, message: Message) -> None:
        """A message of ASKING at its log time [s]; a message without set-points is left out."""
        row = self._values(message)
        if math.isfinite(t_s) and row is not None:
            self._rows[message.msgname].append((t_s, *row))

    def _values(self, message: Message) -> tuple[float, ...] | None:
        name = message.msgname
        if name == "POSITION_TARGET_LOCAL_NED":
            return place_of(message)
        if name == "ATTITUDE_TARGET":
            q = tuple(map(float, message.q))
            sound = not message.type_mask & ATTITUDE_IGNORED and abs(math.hypot(*q) - 1.0) < 0.1
            return q if sound else None
        if name == "NAV_CONTROLLER_OUTPUT":
            angles = (message.nav_roll, message.nav_pitch, message.nav_bearing)
            known = self._make == ARDUPILOT and all(map(math.isfinite, angles))
            return quaternion_from_euler(*map(math.radians, angles)) if known else None
        volts, known = 1e-3 * message.voltage_battery, 0 < message.voltage_battery < UNKNOWN_MV
        current = 1e-2 * message.current_battery if message.current_battery >= 0 else math.nan
        left = float(message.battery_remaining) if message.battery_remaining >= 0 else math.nan
        return (volts, current, left) if known else None

    def setpoints(self) -> tuple[Table, ...]:
        """Position in the autopilot's local frame, and attitude; a component that it did not ask for is NaN."""
        attitude = "ATTITUDE_TARGET" if self._rows["ATTITUDE_TARGET"] else "NAV_CONTROLLER_OUTPUT"
        each = (("POSITION_TARGET_LOCAL_NED", POSITION_NED), (attitude, QUATERNION))
        return tuple(table for name, columns in each if (table := self._table(name, columns)) is not None)

    def battery(self) -> Table | None:
        """The battery's voltage, current and remaining charge [%]; None where no voltage was sent."""
        return self._table("SYS_STATUS", ("voltage_v", "current_a", "remaining_percent"))

    def _table(self, name: str, columns: tuple[str, ...]) -> Table | None:
        rows = self._rows[name]
        if not rows:
            return None
        values = np.array(sorted(rows, key=lambda row: row[0]))
        return {"t_s": values[:, 0], **dict(zip(columns, values[:, 1:].T, strict=True))}


def place_of(message: Message) -> tuple[float, ...] | None:
    """The position of a POSITION_TARGET_LOCAL_NED, NaN where it is to be ignored; None where nothing is left."""
    place = (float(message.x), float(message.y), float(message.z))
    components = tuple(
        math.nan if message.type_mask & bit or not abs(x) < FARTHEST_M else x
        for x, bit in zip(place, PLACE_BITS, strict=True)
    )
    return components if message.coordinate_frame == LOCAL_NED and any(map(math.isfinite, components)) else None
