"""Readings that a stream repeats: ArduPilot sends a flow of 10 Hz at 50, a fix of 5 Hz at 10, stamped anew each time.

A copy that is taken for a reading makes five of one, and its exposure a fifth. Copies are known by their content: the
same as before, sooner than this source usually has a new reading. A reading that reads the same as the last, as
on the ground, comes when it is time for one. Inertial readings are samples of what goes on, and a copy is a sample too.
"""

import math
from collections import deque
from statistics import median_high
from typing import NamedTuple

from flownav.core.measurement import Sensor
from flownav.live.horizon import Source
from flownav.logs.mavlink.framing import Message

# The sensor of each message, and its fields except the time of sending; a time of measuring is content.
# ArduPilot's OPTICAL_FLOW has its filter's height in ground_distance, which is new in every copy.
CONTENT: dict[str, tuple[Sensor, tuple[str, ...]]] = {
    "OPTICAL_FLOW": (Sensor.FLOW_RATE, ("flow_rate_x", "flow_rate_y", "flow_comp_m_x", "flow_comp_m_y", "quality")),
    "OPTICAL_FLOW_RAD": (Sensor.FLOW_RATE, ("integrated_x", "integrated_y", "integrated_xgyro", "quality")),
    "DISTANCE_SENSOR": (Sensor.RANGE, ("current_distance", "orientation", "signal_quality")),
    "RANGEFINDER": (Sensor.RANGE, ("distance", "voltage")),
    "SCALED_PRESSURE": (Sensor.BARO, ("press_abs", "temperature")),
    "GPS_RAW_INT": (Sensor.GPS_POSITION, ("time_usec", "lat", "lon", "alt", "vel", "cog", "fix_type")),
    "ATTITUDE_QUATERNION": (Sensor.ATTITUDE, ("q1", "q2", "q3", "q4")),
    "ATTITUDE": (Sensor.ATTITUDE, ("roll", "pitch", "yaw")),
}
KEPT = 9  # times from one content to the next of which the median is taken: chosen, odd
LEAST_KEPT = 3  # chosen
CROWDED_S = 0.0005  # chosen: MAVLink's inertial streams reach 1 kHz; 20 000 a second were more than is fused in time
EARLY = 0.9  # of the usual time; a stream's own step shifts what is new by a tenth
LONGEST_S = 0.25  # a slower sensor's copies are all taken, or one that stands still would fall silent: chosen
NAN = float("nan")


class _Content(NamedTuple):
    """A source's last content, since when, when it was last taken, and the times between contents [s]."""

    content: tuple[float, ...]
    since_s: float
    taken_s: float
    steps_s: deque[float]


class Repeats:
    """Finds messages that repeat the last content of their source."""

    def __init__(self) -> None:
        self._contents: dict[Source, _Content] = {}
        self._sampled_s: dict[Source, float] = {}  # when an inertial source was taken last

    def is_crowded(self, source: Source, t_s: float) -> bool:
        """Whether an inertial reading is of the instant of the one before."""
        before_s = self._sampled_s.get(source, math.nan)
        if abs(t_s - before_s) < CROWDED_S:
            return True
        self._sampled_s[source] = t_s
        return False

    def is_old(self, message: Message, source: Source, t_s: float) -> bool:
        """Whether it is a copy. t_s: when it came, or is stamped [s], on one clock."""
        if message.msgname not in CONTENT or not math.isfinite(t_s):
            return False
        names = CONTENT[message.msgname][1]
        content = tuple(getattr(message, name) for name in names)
        before = self._contents.get(source)
        if before is None or t_s < before.since_s:
            self._contents[source] = _Content(content, t_s, t_s, deque(maxlen=KEPT))
            return False
        if content != before.content:
            before.steps_s.append(t_s - before.since_s)
            self._contents[source] = _Content(content, t_s, t_s, before.steps_s)
            return False
        if message.msgname == "GPS_RAW_INT" and message.time_usec:
            return True  # it has the time of its measuring
        if t_s - before.taken_s < EARLY * self.usual_s(source):
            return True
        self._contents[source] = before._replace(taken_s=t_s)
        return False

    def usual_s(self, source: Source) -> float:
        """The time from one content of a source to the next [s]; 0 where it is not known, or longer than LONGEST_S."""
        content_known = self._contents.get(source)
        if content_known is None or len(content_known.steps_s) < LEAST_KEPT:
            return 0.0
        usual_s = median_high(content_known.steps_s)
        return usual_s if usual_s <= LONGEST_S else 0.0
