"""The traffic of the companion's line, kept as a recording that tests and `flownav replay` can play.

from_vehicle.tlog as it reached flownav, from_flownav.tlog as it left (8 bytes of UNIX microseconds, big-endian, before
each frame), truth.csv on the vehicle's time since boot.
"""

import csv
import struct
import time
from pathlib import Path

from flownav.core.frames import euler_from_quaternion
from flownav.live.sitl.wire import History
from flownav.logs.mavlink.position_messages import local_position_m

COLUMNS = (
    *("boot_s", "pos_n_m", "pos_e_m", "pos_d_m", "vel_n_m_s", "vel_e_m_s", "vel_d_m_s"),
    *("roll_rad", "pitch_rad", "yaw_rad"),
)


class Recording:
    """Two files in a folder, written as frames pass."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files = {to_vehicle: (folder / name).open("wb") for to_vehicle, name in NAMES.items()}

    def take(self, frame: bytes, to_vehicle: bool) -> None:
        """A frame that passes."""
        self._files[to_vehicle].write(struct.pack(">Q", time.time_ns() // 1000) + frame)

    def close(self, history: History) -> None:
        """Close the files; the truth beside them."""
        for each in self._files.values():
            each.close()
        if not history.truth:
            return
        home = history.truth[0].state.position_deg_m
        with (self._folder / "truth.csv").open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(COLUMNS)
            for truth in history.truth:
                north_m, east_m, _ = local_position_m(truth.state.position_deg_m, home)
                place = north_m, east_m, home[2] - truth.state.position_deg_m[2]
                angles = euler_from_quaternion(*truth.state.quaternion)
                numbers = (truth.now_s + history.boot_less_now_s, *place, *truth.state.vel_ned_m_s, *angles)
                rows.writerow([f"{number:.4f}" for number in numbers])


NAMES = {False: "from_vehicle.tlog", True: "from_flownav.tlog"}
