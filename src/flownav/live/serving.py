"""Which sensors are heard and do not serve: an alarm, since what is sent then rests on less than the vehicle has."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from flownav.core.measurement import Sensor
from flownav.estimation.gating import Reason
from flownav.navigation.reasons import HORIZONTAL, REFUSALS
from flownav.navigation.rows import InnovationRow

WATCHED = (*HORIZONTAL, Sensor.RANGE)
DOWNWARD = (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY, Sensor.RANGE)  # on the ground they need not serve
LATE = Reason.LATE.label
LEAST_READINGS = 10
GONE_S = 2.0  # a sensor that has said nothing for so long is silent, which the screen shows otherwise


class Refused(NamedTuple):
    """A spell in which no reading of a sensor was fused: since and until when, how many, and why the last."""

    since_s: float
    until_s: float
    readings: int
    why: str


class Serving:
    """Spells of readings that were heard and not fused, by sensor, on the vehicle's clock."""

    def __init__(self) -> None:
        self._spells: dict[Sensor, Refused] = {}
        self._landed = False

    def refused(self, sensor: Sensor, t_s: float, why: str) -> None:
        """A reading that never got to the navigator."""
        if sensor not in WATCHED or (self._landed and sensor in DOWNWARD):
            return
        before = self._spells.get(sensor)
        if before is None or t_s - before.until_s > GONE_S:
            before = Refused(t_s, t_s, 0, why)
        self._spells[sensor] = Refused(before.since_s, max(t_s, before.until_s), before.readings + 1, why)

    def judged(self, offered: Iterable[InnovationRow[float]]) -> None:
        """What became of readings in the navigator."""
        for row in offered:
            sensor, component, reason = Sensor(int(row.sensor)), int(row.component), int(row.reason)
            if reason == Reason.FUSED and component < 2:
                self._spells.pop(sensor, None)
            elif reason in REFUSALS and component == 0:
                self.refused(sensor, row.t_s, Reason(reason).label)

    def landed(self, on_ground: bool) -> None:
        """What the autopilot says of the ground."""
        self._landed = on_ground
        if on_ground:
            for sensor in DOWNWARD:
                self._spells.pop(sensor, None)

    def clear(self) -> None:
        """The navigation begins anew."""
        self._spells.clear()
        self._landed = False

    def alarms(self, t_s: float, after_s: float) -> dict[Sensor, Refused]:
        """Sensors of which nothing was fused for `after_s` although they speak."""
        return {
            sensor: spell
            for sensor, spell in self._spells.items()
            if spell.readings >= LEAST_READINGS
            and spell.until_s - spell.since_s >= after_s
            and t_s - spell.until_s <= GONE_S
        }
