"""A receiver whose place walks off from its own velocity: it is led away, or something near it reflects.

Place less the way that its velocities make stands still in a receiver that is right, but for noise. Where it slopes,
the place is not believed while flow agrees with the inertial sensors: the two say that the vehicle does not go there.
"""

import math
from collections import deque
from collections.abc import Iterable

from flownav.core.measurement import Measurement, Sensor
from flownav.logs.mavlink.converted import Outcome

LOOK_S = 3.0  # over which the slope is taken: chosen, a walk of 1 m/s is found within 1.5 s
LEAST_FIXES = 8  # of it: chosen
WALKS_M_S = 0.4  # chosen: place and velocity of one receiver differ by less in the flights of ../shared/data
SURE = 5.0  # of the slope by chance
GOES_M_S = 0.15  # with less over the whole look it is believed again: chosen


class Walking:
    """Whether a receiver's place walks off. walks: it does, by the fixes so far."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self.walks = False
        self._left: deque[tuple[float, float, float]] = deque()  # time [s], place less way, north and east [m]
        self._way_m = (0.0, 0.0)
        self._before: Measurement | None = None

    def take(self, place: Measurement, velocity: Measurement) -> bool:
        """A fix in local NED and its velocity, of one time; whether the receiver walks off."""
        before, t_s = self._before, place.t_s
        since_s = t_s - before.t_s if before is not None else math.inf
        if not 0.0 < since_s <= LOOK_S or not all(map(math.isfinite, (*place.value[:2], *velocity.value[:2]))):
            self.clear()
        elif before is not None:
            north_m, east_m = (
                way_m + 0.5 * since_s * (one + other)
                for way_m, one, other in zip(self._way_m, before.value[:2], velocity.value[:2], strict=True)
            )
            self._way_m = north_m, east_m
        self._before = velocity._replace(t_s=t_s)
        self._left.append((t_s, place.value[0] - self._way_m[0], place.value[1] - self._way_m[1]))
        while self._left[0][0] < t_s - LOOK_S:
            self._left.popleft()
        slope_m_s, by_chance = slope_of(self._left)
        if slope_m_s > max(WALKS_M_S, SURE * by_chance):
            self.walks = True
        elif slope_m_s < GOES_M_S and t_s - self._left[0][0] > 0.8 * LOOK_S:
            self.walks = False
        return self.walks


def fix_of(outcomes: Iterable[Outcome]) -> tuple[Measurement, Measurement] | None:
    """Place and velocity of one message; None where it lacks one."""
    found = {one.sensor: one for one in outcomes if isinstance(one, Measurement)}
    place, velocity = found.get(Sensor.GPS_POSITION), found.get(Sensor.GPS_VELOCITY)
    return (place, velocity) if place is not None and velocity is not None else None


def slope_of(left: deque[tuple[float, float, float]]) -> tuple[float, float]:
    """The level slope of the rows [m/s], and one standard deviation of it by chance; 0, 0 for too few."""
    count = len(left)
    if count < LEAST_FIXES:
        return 0.0, 0.0
    middle_s = sum(t_s for t_s, _, _ in left) / count
    times = [t_s - middle_s for t_s, _, _ in left]
    spread = sum(t_s * t_s for t_s in times)
    slopes, squares = [], 0.0
    for axis in (1, 2):
        values = [row[axis] for row in left]
        mean = sum(values) / count
        slope = sum(t_s * value for t_s, value in zip(times, values, strict=True)) / spread
        squares += sum((value - mean - slope * t_s) ** 2 for t_s, value in zip(times, values, strict=True))
        slopes.append(slope)
    return math.hypot(*slopes), math.sqrt(0.5 * squares / (count - 2) / spread)
