"""The state of a live session as it lies in a folder of `flownav app`, without a session."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any

STATE = {
    "live_status": 1, "url": "udp:14550", "record": "flight.fnr", "process": 1, "lasted_s": 61.0,
    "vehicle": {"system": 1, "component": 1}, "send": "odometry", "listens": False, "reason": "", "why": "",
    "for_s": 4.0, "velocity_only": False, "sent": 1234, "withheld": {"the vehicle is being listened to": 12},
    "protection_m": [1.5, 0.7], "suspected": "", "limits": {"protection_m": 20.0}, "here_ned_m": [3.0, -4.0, -5.0],
    "pad_m": [0.0, 0.0], "quality_percent": 73, "three_sigma_m": [0.4, 0.5, 0.3], "vel_ned_m_s": [0.3, 0.4, 0.0],
    "three_sigma_m_s": [0.1, 0.1, 0.1], "path": [[0, 0, 0], [1, -1, 0], [2, -3, 1], [3, -4, 1]],
    "sensors": [["flow_rate", "50", "0.01", "0.02", "0.1", "0.2", ""]], "alarms": [], "lines": ["recording: x"],
}  # fmt: skip
FRESH_S = -3600.0  # a state that does not grow old while a test on a loaded machine looks at it


class Written:
    """A session's state, written as a session would; a rename, so that nobody reads half of it."""

    def __init__(self, folder: Path, name: str = "flight.live.json") -> None:
        self.path = folder / name

    def state(self, age_s: float = 0.0, **changed: Any) -> None:
        part = self.path.with_suffix(".part")
        part.write_text(json.dumps({**STATE, **changed}))
        os.utime(part, (time.time() - age_s,) * 2)
        part.rename(self.path)
