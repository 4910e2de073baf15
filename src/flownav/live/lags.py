"""How far each stream runs behind the newest reading of all: that long the horizon has to wait."""

from __future__ import annotations

from collections import deque

from flownav.core.measurement import Sensor

WINDOW_S = 5.0
WINDOWS = 4  # a stream that comes in time again is waited for so many windows longer


class Lags:
    """The greatest lag of each sensor's readings over the last 15 to 20 s, on the vehicle's clock.

    A reading's lag is the newest instant that any sensor has described, less its own. It holds the sensor's own delay,
    the phase between a reading and the message that tells it, and what one message is faster on the link than another;
    a link that delivers in batches, or stands still, adds nothing, since it holds back all alike. One that is larger
    than `most_s` is not waited for.
    """

    def __init__(self, most_s: float = 1.0) -> None:
        self._most_s = most_s
        self._newest_s = float("-inf")
        self._windows: dict[Sensor, deque[tuple[float, float]]] = {}  # begin, greatest lag [s]

    def heard(self, sensor: Sensor, instant_s: float) -> None:
        """A reading that describes an instant."""
        self._newest_s = max(self._newest_s, instant_s)
        lag_s = self._newest_s - instant_s
        if lag_s > self._most_s:
            return  # nobody waits for so long; it comes too late, and is counted so
        windows = self._windows.setdefault(sensor, deque(maxlen=WINDOWS))
        if not windows or self._newest_s - windows[-1][0] >= WINDOW_S:
            windows.append((self._newest_s, lag_s))
        elif lag_s > windows[-1][1]:
            windows[-1] = windows[-1][0], lag_s

    def clear(self) -> None:
        """Begin anew."""
        self._newest_s = float("-inf")
        self._windows.clear()

    @property
    def newest_s(self) -> float:
        """The newest instant that was described; minus infinity before the first."""
        return self._newest_s

    @property
    def by_sensor(self) -> dict[Sensor, float]:
        """The lag to wait for, by sensor [s]; a sensor that has not spoken for all windows is not waited for."""
        oldest_s = self._newest_s - WINDOWS * WINDOW_S
        return {
            sensor: max(lag_s for _, lag_s in windows)
            for sensor, windows in self._windows.items()
            if windows[-1][0] >= oldest_s
        }

    def horizon_s(self, least_s: float, margin_s: float, most_s: float) -> float:
        """What to wait: the greatest lag and a margin, at least `least_s` and at most `most_s`."""
        return min(max(least_s, max(self.by_sensor.values(), default=0.0) + margin_s), most_s)
