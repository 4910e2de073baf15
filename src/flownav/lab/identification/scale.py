"""A flow sensor's scale and axes from the distance that it reports, and whether the scale changes with speed.

Regressing velocity on velocity is biased: noise, lag and tilt in the regressor pull the slope down (0.7 to 0.8 for
one axis of the outdoor log, whose true scale is near 1). Here the reference's noise stays on the left-hand side,

    p_ref(t + lag) = p_0 + Rz(yaw) M d(t) + noise,    d = the flow's velocity, turned to earth and integrated

M is 2 by 2 in body axes, so a swapped or inverted axis shows as it is. In d the flow's noise is averaged over the
time that the reference's noise makes worth using, seconds, by which the bias of its variance falls below 1 %: it is
computed and reported. Lag and M are estimated together, since a wrong lag looks like a wrong scale in each turn.

The noise is white (the reference) plus a random walk (the flow's error integrated, GPS wander): the differences
of the data are a moving average of order one, which one recursive filter with gain g whitens. g is the one that
makes the innovations smallest. Covariance by clusters of CLUSTER_S, so that slower errors count as well.

Flow and reference are compared as means over WINDOW_S, in body axes, along the reference's direction:

    flow . u = (g + k (s - s_0)) s,    s = |reference|, u = reference / s

with s_0 the middle speed. Means average the flow's noise away and keep the reference's share of the power small; what
is slower than the reference's noise is left out, since it would read as a scale that rises. Intervals by leaving out
one stretch of CLUSTER_S at a time (jackknife): one turn or one climb that is off counts as one.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.lab.identification.flight import Flight
from flownav.lab.identification.quantities import Interval
from flownav.lab.identification.reference_motion import Motion, on_grid

GAINS = np.geomspace(0.01, 0.95, 24)
LAG_RANGE_S = (-0.5, 1.0)
LAG_STEP_S = 0.1
CLUSTER_S = 10.0
LEAST_REFERENCE = 50
LEAST_TRAVEL_M = 0.3


class Match(NamedTuple):
    """The track matched.

    mixing (2, 2): true body velocity = mixing @ flow velocity, rotation by the reference's yaw left in;
    covariance (5, 5) of (m11, m21, m12, m22, lag); lag_s: reference behind the flow; whitening the filter's gain;
    innovation_m its innovations' rms; attenuation (2,): share by which noise in d shrinks each column, at most.
    """

    mixing: Array
    covariance: Array
    lag_s: float
    whitening: float
    innovation_m: float
    clusters: int
    attenuation: tuple[float, float]


class _Track(NamedTuple):
    """One stretch: flow times, earth velocity by body x and by body y and by the climb, each (n, 2), and integrals."""

    t_s: Array
    velocity: Array  # (n, 6)
    travelled: Array  # (n, 6)
    reference_t_s: Array
    reference_m: Array  # (m, 2)


def _whitened(columns: Array, gain: float) -> Array:
    """Innovations of x[k+1] = x[k] + gain (z[k] - x[k]), column by column, started at the first row; (n - 1, k)."""
    from scipy.signal import lfilter  # two seconds to load, and `flownav info` asks for nothing here

    return np.asarray(lfilter([1.0], [1.0, gain - 1.0], np.diff(columns, axis=0), axis=0))


def match(flown: Flight, latency_s: float, corrected: Array | None = None) -> Match:
    """Match the flow's track to the reference's.

    latency_s: how old a flow reading is when it arrives. corrected: flow velocity (n, 2) to use instead of the
    log's (axes put right). InputError where the reference overlaps too little or nothing moves.
    """
    tracks = _tracks(flown, latency_s, flown.velocity_m_s if corrected is None else corrected)
    lags = np.arange(LAG_RANGE_S[0], LAG_RANGE_S[1] + 1e-9, LAG_STEP_S)
    gain = 0.2
    for _ in range(2):
        lag = _refined(tracks, lags, gain)
        costs = [_solve(tracks, lag, g)[1] for g in GAINS]
        gain = float(GAINS[int(np.argmin(costs))])
    return _finished(tracks, _refined(tracks, lags, gain), gain, flown)


def _tracks(flown: Flight, latency_s: float, velocity: Array) -> list[_Track]:
    t_s, good = flown.t_s[flown.good] - latency_s, velocity[flown.good]
    rotation = flown.rotation(t_s)
    tilt = rotation[:, :2, 2] / rotation[:, 2:3, 2]
    down = _climb(flown, t_s)
    earth = np.concatenate([
        (rotation[:, :2, 0] - tilt * rotation[:, 2:3, 0]) * good[:, :1],
        (rotation[:, :2, 1] - tilt * rotation[:, 2:3, 1]) * good[:, 1:],
        tilt * down[:, None],
    ], axis=1)  # fmt: skip
    tracks = []
    for part in flown.segments():
        t, v = t_s[part], earth[part]
        if len(t) < 3:
            continue
        steps = 0.5 * (v[1:] + v[:-1]) * np.diff(t)[:, None]
        travelled = np.vstack([np.zeros(6), np.cumsum(steps, axis=0)])
        inside = (flown.reference_t_s >= t[0] + LAG_RANGE_S[1]) & (flown.reference_t_s <= t[-1] + LAG_RANGE_S[0])
        if np.count_nonzero(inside) >= 10:
            tracks.append(_Track(t, v, travelled, flown.reference_t_s[inside], flown.reference_m[inside, :2]))
    count = sum(len(track.reference_t_s) for track in tracks)
    if count < LEAST_REFERENCE:
        raise InputError(
            f"{flown.name}: {count} samples of the reference ({flown.reference}) lie in flight with usable flow; at "
            f"least {LEAST_REFERENCE} are needed"
        )
    moved = max(float(np.linalg.norm(np.ptp(track.reference_m, axis=0))) for track in tracks)
    if moved < LEAST_TRAVEL_M:
        raise InputError(f"{flown.name}: the reference moves {moved:.2f} m; at least {LEAST_TRAVEL_M} m are needed")
    return tracks


def _climb(flown: Flight, t_s: Array) -> Array:
    """Downward velocity from the reference's height over a second, zero outside it."""
    late, early = t_s + 0.5, t_s - 0.5
    down = flown.reference_m[:, 2]
    return np.asarray(np.interp(late, flown.reference_t_s, down) - np.interp(early, flown.reference_t_s, down))


def _columns(track: _Track, lag_s: float) -> tuple[Array, Array]:
    """At the reference's samples: design (m, 2, 5) for north and east, and the reference less the climb (m, 2).

    A body-x velocity that is really along y moves the track at right angles: column m21 is d_x turned by 90 deg.
    """
    at = track.reference_t_s - lag_s
    travelled = np.column_stack([np.interp(at, track.t_s, column) for column in track.travelled.T])
    velocity = np.column_stack([np.interp(at, track.t_s, column) for column in track.velocity.T])
    x, y = travelled[:, 0:2], travelled[:, 2:4]
    turned_x, turned_y = np.column_stack([-x[:, 1], x[:, 0]]), np.column_stack([y[:, 1], -y[:, 0]])
    slope = -(velocity[:, 0:2] + velocity[:, 2:4])
    return np.stack([x, turned_x, turned_y, y, slope], axis=2), track.reference_m - travelled[:, 4:6]


def _stacked(tracks: list[_Track], lag_s: float, gain: float) -> tuple[Array, Array, Array]:
    """Whitened design (k, 5), whitened reference (k,) and the time of each row."""
    designs, values, times = [], [], []
    for track in tracks:
        design, value = _columns(track, lag_s)
        for axis in (0, 1):
            columns = np.column_stack([design[:, axis, :], value[:, axis]])
            columns = _whitened(columns - columns[0], gain)
            designs.append(columns[:, :5])
            values.append(columns[:, 5])
            times.append(track.reference_t_s[1:])
    return np.vstack(designs), np.concatenate(values), np.concatenate(times)


def _solve(tracks: list[_Track], lag_s: float, gain: float) -> tuple[Array, float]:
    """M's four entries at a lag, and the mean square of the innovations."""
    design, value, _ = _stacked(tracks, lag_s, gain)
    mixing = np.linalg.lstsq(design[:, :4], value, rcond=None)[0]
    return np.asarray(mixing), float(np.mean((value - design[:, :4] @ mixing) ** 2))


def _refined(tracks: list[_Track], lags: Array, gain: float) -> float:
    """The lag of least innovations: on a grid, then by a parabola through ever nearer neighbours."""
    costs = [_solve(tracks, float(lag), gain)[1] for lag in lags]
    best, step = float(lags[int(np.argmin(costs))]), float(lags[1] - lags[0])
    while step > 1e-3:
        below, here, above = (_solve(tracks, best + shift, gain)[1] for shift in (-step, 0.0, step))
        bend = below - 2.0 * here + above
        best += float(np.clip(0.5 * step * (below - above) / bend, -step, step)) if bend > 0.0 else 0.0
        step /= 3.0
    return best


def _finished(tracks: list[_Track], lag_s: float, gain: float, flown: Flight) -> Match:
    design, value, times = _stacked(tracks, lag_s, gain)
    mixing = np.linalg.lstsq(design[:, :4], value, rcond=None)[0]
    residual = value - design[:, :4] @ mixing
    turn = np.array([[mixing[0], mixing[2]], [mixing[1], mixing[3]]])
    jacobian = design.copy()
    jacobian[:, 4] *= float(np.sqrt(abs(np.linalg.det(turn))))  # dp/dlag = -M v, to the size of M
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    cluster = np.floor(times / CLUSTER_S).astype(int)
    labels = np.unique(cluster)
    scores = np.array([jacobian[cluster == label].T @ residual[cluster == label] for label in labels])
    few = len(labels) / max(1, len(labels) - 5)
    covariance = few * inverse @ (scores.T @ scores) @ inverse
    plain = inverse * float(residual @ residual) / max(1, len(residual) - 5)
    floor = np.sqrt(np.maximum(1.0, np.diag(plain) / np.maximum(np.diag(covariance), 1e-300)))
    covariance = covariance * np.outer(floor, floor)
    return Match(
        turn, covariance, lag_s, gain, float(np.sqrt(np.mean(residual**2))), len(labels),
        _attenuation(design, tracks, gain, flown),
    )  # fmt: skip


def _attenuation(design: Array, tracks: list[_Track], gain: float, flown: Flight) -> tuple[float, float]:
    """Share of the whitened regressors' power that is flow noise: the bias of errors in variables, at most.

    The flow's white noise, from its second differences, integrates to a random walk; after the whitening filter a
    walk of variance q a second has the variance q T/(1 - (1 - gain)^2), T the reference's period.
    """
    period = float(np.median(np.concatenate([np.diff(track.reference_t_s) for track in tracks])))
    step = float(np.median(np.concatenate([np.diff(track.t_s) for track in tracks])))
    shares = []
    for axis, column in ((0, 0), (1, 3)):
        values = flown.velocity_m_s[flown.good, axis]
        second = values[2:] - 2.0 * values[1:-1] + values[:-2]
        walk = float(np.mean(second**2)) / 6.0 * step
        noise = 0.5 * walk * period / (1.0 - (1.0 - gain) ** 2)  # one of two earth axes at a time
        shares.append(noise / max(float(np.mean(design[:, column] ** 2)), 1e-12))
    return shares[0], shares[1]


# -- scale against speed -----------------------------------------------------------------------------------------
WINDOW_S = {"truth": 1.0, "gps": 2.0}
SLOWEST_M_S = {"truth": 0.15, "gps": 0.7}
LEAST_WINDOWS, LEAST_CLUSTERS = 20, 4
LEAST_SPREAD = 1.5  # fast over slow: of less, no law shows
LEAST_CHANGE = 0.03  # from slow to fast, of the scale: less is not reported


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
