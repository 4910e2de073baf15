"""The flow sensor's own gyro against the vehicle's: both turn with one body, so the slope of one on the other is 1.

It needs no reference. A slope of 0.5 means that the sensor's angles are divided by a time twice too long, where the
flow itself reads half as well, or where nothing is known of it; it is the gyro's own scale where the flow reads as it
should. A scaler on the flow mends neither: autopilots scale the flow alone, and not the rotation that they take out of
it.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array, Sensor, Stream
from flownav.lab.identification.output_error import Z_95
from flownav.lab.identification.quantities import Interval
from flownav.logs.log import Log, mean_over

LAGS_S = np.arange(-0.1, 0.4, 0.01)
CLUSTER_S = 3.0  # what lasts longer than this counts as independent
LEAST_READINGS, LEAST_CLUSTERS = 200, 4
ALIKE_WITHIN = (0.8, 1.25)  # of a scale: within, two readings of one thing agree
LEAST_LIKENESS = 0.5  # of the two gyros: less is no common turning, or other axes
TURNED_RAD = 0.45  # a sensor that is turned by more is a matter of its axes
OUTLIER = 8.0  # spreads


class OwnGyro(NamedTuple):
    """slope: the flow's gyro over the IMU's, with its 95 % interval; lag_s: how old a reading is; likeness: how alike.

    likeness is the correlation of the two. turn_rad: by how much its axes are turned about the boresight.
    """

    slope: Interval
    lag_s: float
    likeness: float
    turn_rad: float

    @property
    def is_known(self) -> bool:
        """Whether the two turned together so that the slope is known."""
        return self.likeness >= LEAST_LIKENESS and abs(self.turn_rad) < TURNED_RAD

    @property
    def is_off(self) -> bool:
        """Whether the whole interval lies beyond what counts as alike."""
        low, high = ALIKE_WITHIN
        return self.is_known and (self.slope.high < low or self.slope.low > high)

    def sentence(self, gain: float | None) -> str:
        """Verdict in words; "" where nothing is wrong. gain: the flow's own over the true one, None where unknown."""
        if not self.is_off:
            return ""
        slope, low, high = self.slope
        turns = f"the flow's own gyro turns {slope:.3f} [{low:.3f}, {high:.3f}] times as fast as the IMU's"
        if gain is not None and not self.is_of_time(gain):
            flow = f"and the flow reads {gain:.2f} of what it should"
            return f"{turns}, {flow}: the gyro's own scale is wrong by {slope:.2f}"
        factor = max(slope, 1.0 / slope)
        stated = "long" if slope < 1.0 else "short"
        flow = "" if gain is None else f", and the flow reads {gain:.2f} of what it should"
        return f"{turns}{flow}: integration time wrong by {factor:.2g} (stated too {stated}); no scaler mends that"

    def is_of_time(self, gain: float) -> bool:
        """Whether a flow of this gain is off as the gyro is: then the time that both are divided by is wrong."""
        low, high = ALIKE_WITHIN
        return low <= gain / self.slope.value <= high


def own_gyro(log: Log) -> OwnGyro | None:
    """The slope; None where the flow sensor has no gyro, the log no IMU, or nothing turned."""
    flow, imu = log.streams.get(Sensor.FLOW_RATE), log.streams.get(Sensor.IMU)
    if flow is None or imu is None or flow.value.shape[1] < 4:
        return None
    known = np.isfinite(flow.value[:, 2:4]).all(axis=1) & (flow.t_s >= imu.t_s[0]) & (flow.t_s <= imu.t_s[-1])
    t_s, turned = flow.t_s[known], flow.value[known, 2:4]
    if len(t_s) < LEAST_READINGS:
        return None
    limit = OUTLIER * np.maximum(1.4826 * np.median(np.abs(turned - np.median(turned, axis=0)), axis=0), 0.05)
    sound = (np.abs(turned - np.median(turned, axis=0)) < limit).all(axis=1)
    t_s, turned = t_s[sound], turned[sound]
    if len(t_s) < LEAST_READINGS or not np.ptp(turned, axis=0).all():
        return None
    return _fitted(t_s, turned, imu)


def _fitted(t_s: Array, turned: Array, imu: Stream) -> OwnGyro | None:
    """The slope at the shift that explains most. t_s (n,) arrival, turned (n, 2) the sensor's gyro."""
    step_s = float(np.median(np.diff(t_s)))
    y = (turned - turned.mean(axis=0)) @ np.array([1.0, 1j])
    found = []
    for lag in LAGS_S:
        means = mean_over(imu.t_s, imu.value[:, :2], t_s - lag - 0.5 * step_s, t_s - lag + 0.5 * step_s)
        x = (means - means.mean(axis=0)) @ np.array([1.0, 1j])
        cross, size = complex(np.sum(np.conj(x) * y)), float(np.sqrt(np.sum(np.abs(x) ** 2) * np.sum(np.abs(y) ** 2)))
        found.append((abs(cross) / max(size, 1e-12), lag, cross, x))
    likeness, lag, cross, x = max(found, key=lambda one: one[0])
    power = float(np.sum(np.abs(x) ** 2))
    labels = np.unique(np.floor(t_s / CLUSTER_S).astype(int), return_inverse=True)[1]
    if power <= 0.0 or labels.max() + 1 < LEAST_CLUSTERS:
        return None
    turn = float(np.angle(cross))
    slope = abs(cross) / power
    straight = y * np.exp(-1j * turn)
    scores = np.bincount(labels, weights=np.real(np.conj(x) * (straight - slope * x)))
    few = len(scores) / (len(scores) - 1)
    sigma = float(np.sqrt(few * np.sum(scores**2))) / power
    high = (slope + Z_95 * sigma) / likeness**2  # what differs may all be noise of the IMU's rate, which pulls it down
    return OwnGyro(Interval(slope, slope - Z_95 * sigma, high), float(lag), likeness, turn)
