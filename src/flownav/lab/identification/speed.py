"""Does the sensor's scale change with speed? A motion that the matching cannot follow whole reads short.

Flow and reference are compared as means over WINDOW_S, in body axes, along the reference's direction:

    flow . u = (g + k (s - s_0)) s,    s = |reference|, u = reference / s

with s_0 the middle speed. Means average the flow's noise away and keep the reference's share of the power small; what
is slower than the reference's noise is left out, since it would read as a scale that rises. Intervals by leaving out
one stretch of CLUSTER_S at a time (jackknife): one turn or one climb that is off counts as one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.lab.identification.flight import Flight
from flownav.lab.identification.quantities import Interval
from flownav.lab.identification.reference_motion import Motion, on_grid

WINDOW_S = {"truth": 1.0, "gps": 2.0}
SLOWEST_M_S = {"truth": 0.15, "gps": 0.7}
CLUSTER_S = 10.0
LEAST_WINDOWS, LEAST_CLUSTERS = 20, 4
LEAST_SPREAD = 1.5  # fast over slow: of less, no law shows
LEAST_CHANGE = 0.03  # from slow to fast, of the scale: of less, nobody needs to know


class SpeedLaw(NamedTuple):
    """Scale against speed: per_m_s its slope; at slow and fast (10 and 90 % of the windows) the scale; in words."""

    per_m_s: Interval
    slow_m_s: float
    at_slow: Interval
    fast_m_s: float
    at_fast: Interval
    verdict: str

    @property
    def matters(self) -> bool:
        """Whether the scale changes beyond its interval, and by enough to know."""
        beyond = self.per_m_s.low > 0.0 or self.per_m_s.high < 0.0
        return beyond and abs(self.at_fast.value - self.at_slow.value) > LEAST_CHANGE * abs(self.at_slow.value)


def against_speed(flown: Flight, moved: Motion, velocity: Array, delay_s: float) -> SpeedLaw | None:
    """The law of a flight; velocity (n, 2) of the sensor with its axes put right, delay_s of its readings.

    None where the flight has too few windows at speeds too much alike.
    """
    t_s, speed, along = _windows(flown, moved, velocity, delay_s)
    if len(speed) < LEAST_WINDOWS:
        return None
    slow, fast = (float(q) for q in np.quantile(speed, (0.1, 0.9)))
    clusters = np.floor(t_s / CLUSTER_S).astype(int)
    if fast < LEAST_SPREAD * slow or len(np.unique(clusters)) < LEAST_CLUSTERS:
        return None
    middle = 0.5 * (slow + fast)
    design = np.column_stack([speed, speed * (speed - middle)])
    law, covariance = _jackknife(design, along, clusters)
    found = []
    for weights in ((0.0, 1.0), (1.0, slow - middle), (1.0, fast - middle)):
        of = np.array(weights)
        found.append(Interval.of(float(of @ law), float(np.sqrt(of @ covariance @ of))))
    judged = SpeedLaw(found[0], slow, found[1], fast, found[2], "")
    return judged._replace(verdict=_sentence(judged))


def _windows(flown: Flight, moved: Motion, velocity: Array, delay_s: float) -> tuple[Array, Array, Array]:
    """Windows' times, the reference's speed and the flow along it (m,), where the flow covers half of them or more."""
    width, slowest = WINDOW_S[flown.reference], SLOWEST_M_S[flown.reference]
    t_s, flow = flown.t_s[flown.good], velocity[flown.good]
    reference = on_grid(moved.t_s, moved.in_body(flown, moved.t_s), t_s - delay_s)[:, :2]
    number = np.floor((t_s - t_s[0]) / width).astype(int)
    count = np.bincount(number)
    whole = count >= 0.5 * width / float(np.median(np.diff(t_s)))
    shares = np.maximum(count, 1)
    means = [np.bincount(number, weights=column) / shares for column in (*flow.T, *reference.T)]
    speed = np.hypot(means[2], means[3])
    kept = whole & (speed >= slowest)
    along = (means[0] * means[2] + means[1] * means[3]) / np.maximum(speed, 1e-9)
    return (t_s[0] + width * np.flatnonzero(kept)), speed[kept], along[kept]


def _jackknife(design: Array, value: Array, clusters: Array) -> tuple[Array, Array]:
    """Least squares and its covariance from leaving out one cluster at a time."""
    law = np.linalg.lstsq(design, value, rcond=None)[0]
    labels = np.unique(clusters)
    left_out = np.array([
        np.linalg.lstsq(design[clusters != label], value[clusters != label], rcond=None)[0] for label in labels
    ])  # fmt: skip
    away = left_out - left_out.mean(axis=0)
    return np.asarray(law), np.asarray((len(labels) - 1) / len(labels) * away.T @ away)


def _sentence(law: SpeedLaw) -> str:
    ends = f"{law.at_slow.value:.2f} at {law.slow_m_s:.1f} m/s, {law.at_fast.value:.2f} at {law.fast_m_s:.1f} m/s"
    if law.matters:
        return f"the scale {'falls' if law.per_m_s.value < 0.0 else 'rises'} with speed: {ends}"
    widest = 0.5 * (law.per_m_s.high - law.per_m_s.low) * (law.fast_m_s - law.slow_m_s)
    return f"no change of the scale with speed beyond {max(widest, LEAST_CHANGE):.2f}: {ends}"
