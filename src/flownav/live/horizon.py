"""Readings on their way to the navigator: which source serves, how far streams lag, and alarms.

Of each kind of sensor one source serves, the preferred message that is alive. Readings wait until everything of their
instant must have arrived, as long as the slowest stream runs behind the newest reading, then go on in its order. A
sensor that is received and not used is an alarm, since the estimate then rests on less than the vehicle has.
"""

from collections import Counter, deque
from collections.abc import Iterable
from typing import NamedTuple

from flownav.core.measurement import Sensor
from flownav.estimation.gating import Reason
from flownav.logs.mavlink.messages import PREFERENCE
from flownav.navigation.reasons import HORIZONTAL, REFUSALS
from flownav.navigation.rows import InnovationRow

SILENT_S = 2.0  # a source that is silent for this long gives way
# Chosen, and held by test_live_recordings: ArduPilot repeats a fix of 5 Hz at 10 Hz, its first copy up to 0.1 s old;
# with a horizon that did not follow it, all fixes came too late on most starts.
WINDOW_S = 5.0
PATIENT_WINDOWS = 4  # a stream that comes in time again is waited for this number of windows longer
WATCHED = (*HORIZONTAL, Sensor.RANGE, Sensor.LANDED)
DOWNWARD = (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY, Sensor.RANGE)  # on the ground they need not serve
LATE = Reason.LATE.label
LEAST_READINGS = 10  # chosen: 2 s of a 5 Hz receiver
GONE_S = 2.0  # a sensor without a message for this long is silent, which the screen shows otherwise: chosen


class Source(NamedTuple):
    """The source of a reading: message, instance, and whether the autopilot itself sends it (False: another
    component).
    """

    message: str
    instance: int
    by_autopilot: bool = True


class _Chosen(NamedTuple):
    source: Source
    rank: tuple[int, bool, int]
    received_s: float


class Sources:
    """Whether a reading is of the source that serves. dropped counts, by sensor, readings of the others."""

    def __init__(self) -> None:
        self.dropped: Counter[Sensor] = Counter()
        self.barred: dict[Sensor, set[Source]] = {}
        self.first: dict[Sensor, str] = {}  # a message that goes before all others here
        self._chosen: dict[Sensor, _Chosen] = {}

    def chosen(self, sensor: Sensor) -> Source | None:
        """The source that serves; None where none has."""
        found = self._chosen.get(sensor)
        return found.source if found is not None else None

    def bar(self, sensor: Sensor, source: Source) -> None:
        """Bar a source from use; the next one that sends a reading takes its place."""
        self.barred.setdefault(sensor, set()).add(source)
        if self.chosen(sensor) == source:
            del self._chosen[sensor]

    def takes(self, sensor: Sensor, source: Source, t_s: float) -> bool:
        """Take a reading of a source at an instant. A better or a lone source takes over from a silent one."""
        if sensor == Sensor.FLOW_VELOCITY and self.alive(Sensor.FLOW_RATE, t_s):
            self.dropped[sensor] += 1  # the same flow, before it was multiplied by a range
            return False
        if source in self.barred.get(sensor, ()):
            self.dropped[sensor] += 1
            return False
        order = PREFERENCE.get(sensor, ())
        place = order.index(source.message) if source.message in order else len(order)
        place = -1 if source.message == self.first.get(sensor) else place
        rank = place, not source.by_autopilot, source.instance
        chosen = self._chosen.get(sensor)
        if chosen is not None and chosen.source != source and chosen.rank <= rank and self.alive(sensor, t_s):
            self.dropped[sensor] += 1
            return False
        self._chosen[sensor] = _Chosen(source, rank, t_s)
        return True

    def alive(self, sensor: Sensor, t_s: float) -> bool:
        """Whether the source that serves has spoken lately."""
        chosen = self._chosen.get(sensor)
        return chosen is not None and abs(t_s - chosen.received_s) <= SILENT_S

    def names(self) -> dict[str, str]:
        """The message that serves for each sensor."""
        return {sensor.name.lower(): chosen.source.message for sensor, chosen in sorted(self._chosen.items())}


class Lags:
    """The greatest lag of each sensor's readings over the last 15 to 20 s, on the vehicle's clock.

    A reading's lag is the newest instant that any sensor has described, less its own. It holds the sensor's own delay,
    the phase between a reading and its message, and the difference of the messages' times on the link;
    a link that delivers in batches, or stands still, adds nothing, since it holds back all alike. One that is larger
    than `most_s` is not waited for.
    """

    def __init__(self, most_s: float = 1.0) -> None:
        self._most_s = most_s
        self._newest_s = float("-inf")
        self._windows: dict[Sensor, deque[tuple[float, float]]] = {}  # begin, greatest lag [s]
        self._greatest: dict[Sensor, tuple[float, float]] = {}  # begin of the last window, greatest lag of all [s]

    def received(self, sensor: Sensor, instant_s: float) -> None:
        """A reading that describes an instant."""
        self._newest_s = max(self._newest_s, instant_s)
        lag_s = self._newest_s - instant_s
        if lag_s > self._most_s:
            return  # nobody waits for so long; it comes too late, and is counted so
        windows = self._windows.setdefault(sensor, deque(maxlen=PATIENT_WINDOWS))
        if not windows or self._newest_s - windows[-1][0] >= WINDOW_S:
            windows.append((self._newest_s, lag_s))
        elif lag_s > windows[-1][1]:
            windows[-1] = windows[-1][0], lag_s
        else:
            return
        self._greatest[sensor] = windows[-1][0], max(lag_s for _, lag_s in windows)

    def clear(self) -> None:
        """Begin anew."""
        self._newest_s = float("-inf")
        self._windows.clear()
        self._greatest.clear()

    @property
    def newest_s(self) -> float:
        """The newest instant that was described; minus infinity before the first."""
        return self._newest_s

    @property
    def by_sensor(self) -> dict[Sensor, float]:
        """The lag to wait for, by sensor [s]; a sensor that has not spoken for all windows is not waited for."""
        oldest_s = self._newest_s - PATIENT_WINDOWS * WINDOW_S
        return {sensor: lag_s for sensor, (since_s, lag_s) in self._greatest.items() if since_s >= oldest_s}

    def horizon_s(self, least_s: float, margin_s: float, most_s: float) -> float:
        """The time to wait [s]: the greatest lag and a margin, at least `least_s` and at most `most_s`."""
        return min(max(least_s, max(self.by_sensor.values(), default=0.0) + margin_s), most_s)


class Refused(NamedTuple):
    """A spell in which no reading of a sensor was fused: since and until when, how many, and why the last."""

    since_s: float
    until_s: float
    readings: int
    why: str


class Serving:
    """Periods in which readings were received and not fused, by sensor, on the vehicle's clock."""

    def __init__(self) -> None:
        self._spells: dict[Sensor, Refused] = {}
        self._landed = self._denied = False

    def refused(self, sensor: Sensor, t_s: float, why: str) -> None:
        """A reading that never got to the navigator."""
        if sensor not in WATCHED or (self._landed and not self._denied and sensor in DOWNWARD):
            return
        before = self._spells.get(sensor)
        if before is None or t_s - before.until_s > GONE_S:
            before = Refused(t_s, t_s, 0, why)
        self._spells[sensor] = Refused(before.since_s, max(t_s, before.until_s), before.readings + 1, why)

    def judged(self, offered: Iterable[InnovationRow[float]]) -> None:
        """Update the periods from the navigator's verdicts on readings."""
        for row in offered:
            sensor, component, reason = Sensor(int(row.sensor)), int(row.component), int(row.reason)
            if sensor == Sensor.LANDED:
                self._denied = reason == Reason.INNOVATION_GATE
            if reason == Reason.FUSED and component < 2:
                self._spells.pop(sensor, None)
            elif reason in REFUSALS and component == 0:
                self.refused(sensor, row.t_s, Reason(reason).label)

    def landed(self, on_ground: bool) -> None:
        """Take the autopilot's landed state; the navigator may contradict it (`judged`)."""
        self._landed = on_ground
        if on_ground and not self._denied:
            for sensor in DOWNWARD:
                self._spells.pop(sensor, None)

    def clear(self) -> None:
        """The navigation begins anew."""
        self._spells.clear()
        self._landed = self._denied = False

    def alarms(self, t_s: float, after_s: float) -> dict[Sensor, Refused]:
        """Sensors of which nothing was fused for `after_s` although they send readings."""
        return {
            sensor: spell
            for sensor, spell in self._spells.items()
            if spell.readings >= LEAST_READINGS
            and spell.until_s - spell.since_s >= after_s
            and t_s - spell.until_s <= GONE_S
        }
