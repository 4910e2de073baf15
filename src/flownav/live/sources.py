"""One source for each kind of sensor, while the readings come: the preferred message that is alive."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from flownav.core.measurement import Sensor
from flownav.mavlink.messages import PREFERENCE

SILENT_S = 2.0  # a source that says nothing for so long gives way


class Source(NamedTuple):
    """Who measured: message, instance, and whether the autopilot itself tells it (False: another component)."""

    message: str
    instance: int
    by_autopilot: bool = True


class _Chosen(NamedTuple):
    source: Source
    rank: tuple[int, bool, int]
    heard_s: float


class Sources:
    """Whether a reading is of the source that serves. dropped counts, by sensor, readings of the others."""

    def __init__(self) -> None:
        self.dropped: Counter[Sensor] = Counter()
        self._chosen: dict[Sensor, _Chosen] = {}

    def takes(self, sensor: Sensor, source: Source, t_s: float) -> bool:
        """Take a reading of a source at an instant. A better or a lone source takes over from a silent one."""
        if sensor == Sensor.FLOW_VELOCITY and self._alive(Sensor.FLOW_RATE, t_s):
            self.dropped[sensor] += 1  # the same flow, before it was multiplied by a range
            return False
        order = PREFERENCE.get(sensor, ())
        place = order.index(source.message) if source.message in order else len(order)
        rank = place, not source.by_autopilot, source.instance
        chosen = self._chosen.get(sensor)
        if chosen is not None and chosen.source != source and chosen.rank <= rank and self._alive(sensor, t_s):
            self.dropped[sensor] += 1
            return False
        self._chosen[sensor] = _Chosen(source, rank, t_s)
        return True

    def _alive(self, sensor: Sensor, t_s: float) -> bool:
        chosen = self._chosen.get(sensor)
        return chosen is not None and abs(t_s - chosen.heard_s) <= SILENT_S

    def names(self) -> dict[str, str]:
        """The message that serves for each sensor."""
        return {sensor.name.lower(): chosen.source.message for sensor, chosen in sorted(self._chosen.items())}
