"""PX4's magnetometer without what its EKF2 has learnt of it in flight.

HIGHRES_IMU has the calibrated field less the bias that EKF2 estimates from its own heading. Where that heading
follows ours, an error of ours comes back as a field that agrees with it. SCALED_IMU has the sensor's own field, which
is neither calibrated nor, of some sensors, turned into the vehicle's axes. The difference of the two is

    (S - 1) own - offset - bias,

with PX4's calibration, a matrix S and an offset, which stand still, and EKF2's bias, which creeps. What the difference
changes with the vehicle's attitude is S, and stays; what creeps since the start is EKF2's, and is put back. Recursive
least squares separate the two: S is within SCALED_BY, and the bias moves by CREEPS in a second.

The noise of the own field is in the difference as well, with the other sign. A single reading would so be taken for a
sensor that PX4 scales down: in a hover S - 1 went to -0.3, and the heading 4 deg off. Both fields are averaged first.
"""

import math
from collections import deque
from statistics import median

import numpy as np

from flownav.core.frames import Vector
from flownav.core.measurement import Array
from flownav.logs.mavlink.framing import Message

MILLI = 1e-3  # SCALED_IMU has thousandths of gauss
LEAST_PAIRS = 15  # whose median is the difference at the start: chosen, a second of PX4's magnetometer
APART_S = 0.1  # the two are of one instant: chosen
AVERAGED_S = 0.5  # time constant of both fields' average: chosen, noise of .03 gauss at 50 Hz is .004 then
SETTLED_S = 1.5  # until the averages have forgotten the first reading: chosen, three time constants
GAP_S = 1.0  # after one the average begins anew: chosen
SCALED_BY = 0.1  # sigma of each element of S - 1: chosen, PX4's own calibrations are within it
FIRST_GAUSS = 0.002  # sigma of the difference at the start: chosen
CREEPS = 0.005  # sigma of what EKF2's bias moves [gauss/sqrt(s)]: chosen, it learns .06 gauss in tens of seconds
NOISE_GAUSS = 0.05  # of one difference: chosen, so that the bias is followed within 3 s
MOST_SHARE = (
    0.25  # of the field: a sensor that differs by more may be turned, and its difference turns with the vehicle
)


class Field:
    """The sensor's own field compared with the one that EKF2 has changed [gauss], vehicle's axes (FRD)."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self._own: Vector | None = None  # both are averages
        self._stated: Vector | None = None
        self._own_s = self._stated_s = self._read_s = self._since_s = math.nan
        self._pairs: deque[tuple[Vector, Vector]] = deque(maxlen=LEAST_PAIRS)  # own field and difference
        self._first: Vector | None = None  # the difference at the start, of the field _first_own
        self._first_own: Vector = (0.0, 0.0, 0.0)
        self._known = np.zeros((4, 3))  # by axis: the difference at the first field, and S - 1
        self._covariance = np.diag([FIRST_GAUSS**2, *[SCALED_BY**2] * 3])  # of each column
        self.comparable = True

    def sensed(self, message: Message, t_s: float) -> None:
        """A SCALED_IMU; three zeros are no magnetometer."""
        if message.xmag or message.ymag or message.zmag:
            own = MILLI * message.xmag, MILLI * message.ymag, MILLI * message.zmag
            self._own, self._own_s = averaged(self._own, own, t_s - self._own_s), t_s

    def restored(self, stated: Vector, t_s: float) -> Vector:
        """A field of HIGHRES_IMU, with what EKF2 has taken off since the start put back."""
        average = averaged(self._stated, stated, t_s - self._stated_s)
        self._stated, self._stated_s = average, t_s
        if self._own is not None and self.comparable and abs(t_s - self._own_s) <= APART_S:
            self._compare(self._own, _less(average, self._own), math.hypot(*stated), t_s)
        if self._first is None or not self.comparable:
            return stated
        x, y, z = self._known[0].tolist()
        return _less(stated, _less((x, y, z), self._first))

    def _compare(self, own: Vector, off: Vector, strength: float, t_s: float) -> None:
        if self._first is not None:
            self._covariance[0, 0] += CREEPS**2 * max(t_s - self._read_s, 0.0)
            regressors = np.array([1.0, *_less(own, self._first_own)])
            self._known, self._covariance = learnt(self._known, self._covariance, regressors, np.array(off))
        else:
            self._since_s = t_s if not self._pairs else self._since_s
            self._pairs.append((own, off))
            if len(self._pairs) == LEAST_PAIRS and t_s - self._since_s >= SETTLED_S:
                owns, offs = zip(*self._pairs, strict=True)
                self._first_own, self._first = _middle(owns), _middle(offs)
                self._known[0] = self._first
                self.comparable = math.hypot(*self._first) <= MOST_SHARE * strength
        self._read_s = t_s


def averaged(before: Vector | None, value: Vector, step_s: float) -> Vector:
    """The running average of a field after a value that came step_s after the last."""
    if before is None or not 0.0 <= step_s < GAP_S:
        return value
    share = -math.expm1(-step_s / AVERAGED_S)
    x, y, z = (a + share * (b - a) for a, b in zip(before, value, strict=True))
    return x, y, z


def learnt(known: Array, covariance: Array, regressors: Array, value: Array) -> tuple[Array, Array]:
    """One step of recursive least squares: known (n, axes) with covariance (n, n) of each column, after a value (axes,)
    that is regressors (n,) times it, with noise of NOISE_GAUSS."""
    spread = covariance @ regressors
    gain = spread / (regressors @ spread + NOISE_GAUSS**2)
    return known + np.outer(gain, value - regressors @ known), covariance - np.outer(gain, spread)


def _middle(vectors: tuple[Vector, ...]) -> Vector:
    x, y, z = map(median, zip(*vectors, strict=True))
    return x, y, z


def _less(one: Vector, other: Vector) -> Vector:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]
