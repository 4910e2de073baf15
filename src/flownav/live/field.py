"""PX4's magnetometer without what its EKF2 has learnt of it in flight.

HIGHRES_IMU gives the calibrated field less the bias that EKF2 estimates from its own heading. Where that heading
follows ours, an error of ours comes back as a field that agrees with it. SCALED_IMU gives the sensor's own field, which
is neither calibrated nor, of some sensors, turned into the vehicle's axes. The difference of the two is the calibration
and EKF2's bias: its change since the start is EKF2's, and is put back.
"""

import math
from collections import deque
from statistics import median

from flownav.core.frames import Vector
from flownav.logs.mavlink.framing import Message

MILLI = 1e-3  # SCALED_IMU is in thousandths of gauss
LEAST_PAIRS = 15  # by which the calibration is known: chosen, a second of PX4's magnetometer
APART_S = 0.1  # the two are of one instant: chosen
SMOOTH_S = 3.0  # of the difference; EKF2 learns over tens of seconds: chosen
MOST_SHARE = (
    0.25  # of the field: a sensor that differs by more may be turned, and its difference turns with the vehicle
)


class Field:
    """The sensor's own field, compared with the one that EKF2 has changed [gauss]."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self._own: Vector | None = None
        self._own_s = self._told_s = math.nan
        self._pairs: deque[Vector] = deque(maxlen=LEAST_PAIRS)
        self._first: Vector | None = None
        self._smooth: Vector = (0.0, 0.0, 0.0)
        self.comparable = True

    def sensed(self, message: Message, t_s: float) -> None:
        """A SCALED_IMU; three zeros are no magnetometer."""
        if message.xmag or message.ymag or message.zmag:
            self._own = MILLI * message.xmag, MILLI * message.ymag, MILLI * message.zmag
            self._own_s = t_s

    def restored(self, told: Vector, t_s: float) -> Vector:
        """The field of HIGHRES_IMU, with EKF2's subtraction since the start put back."""
        if self._own is not None and self.comparable and abs(t_s - self._own_s) <= APART_S:
            self._compare(told, _less(told, self._own), t_s)
        if self._first is None or not self.comparable:
            return told
        return _less(told, _less(self._smooth, self._first))

    def _compare(self, told: Vector, off: Vector, t_s: float) -> None:
        if self._first is not None:
            share = min(max(t_s - self._told_s, 0.0) / SMOOTH_S, 1.0)
            x, y, z = (a + share * (b - a) for a, b in zip(self._smooth, off, strict=True))
            self._smooth = x, y, z
        else:
            self._pairs.append(off)
            if len(self._pairs) == LEAST_PAIRS:
                x, y, z = map(median, zip(*self._pairs, strict=True))
                self._first = self._smooth = (x, y, z)
                self.comparable = math.hypot(x, y, z) <= MOST_SHARE * math.hypot(*told)
        self._told_s = t_s


def _less(one: Vector, other: Vector) -> Vector:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]
