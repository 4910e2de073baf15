"""The figures by which a simulated flight is held against a recorded one, each taken from a replay in the same way."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, sosfiltfilt, welch

from flownav.core.measurement import Array, Sensor
from flownav.logs.log import Log
from flownav.navigation.rows import EstimateRow, EventRow, InnovationRow
from flownav.navigation.tape import EVENT_NAMES
from flownav.replays.judged import TESTED
from flownav.replays.session import Replay
from flownav.scoring.consistency import consistency_of, lag_one
from flownav.studies.validation.drawn import rate_hz
from flownav.studies.validation.path import DOWN, ground_of, rotation_of

AIRBORNE_M = 0.5  # of the range sensor over the ground
REACH_M = 4.0  # up to here the range sensors of such vehicles receive their echo, and the height is well known
BEYOND_M = 6.0  # from here on none of the logs' range sensors can
OUTLIER_M = 0.3  # of a range from the smoothed height
LEAST_HIGH_S = 10.0
BAROMETER_S = 60.0  # slower errors cannot be distinguished from the smoothed altitude's own
LATEST_FLOW_S, FLOW_STEP_S = 0.4, 0.01  # lags of the flow that are tried
LEAST_ROWS = 100  # of flow in flight
SLOW_SHARE = 0.1  # of the Nyquist frequency: below it white noise has a tenth of its power
SEGMENT_ROWS = 256
BANDS_HZ = {"0.5_5_hz": (0.5, 5.0), "above_5_hz": (5.0, None)}
TO_SIGMA = 1.4826  # from a median absolute deviation
GYRO, ACCEL = slice(0, 3), slice(3, 6)


@dataclass(frozen=True)
class Smoothed:
    """A replay's smoothed estimate at given times."""

    rows: Array  # of `navigation.rows.EstimateRow`

    @property
    def estimate_rows(self) -> EstimateRow[Array]:
        """The columns."""
        return EstimateRow.of(self.rows)

    def velocity_frd(self, t_s: Array) -> Array:
        """(n, 3) body velocity [m/s]."""
        return np.column_stack(
            [np.interp(t_s, self.estimate_rows.t_s, column) for column in self.estimate_rows.vel_frd_m_s.T]
        )

    def height_m(self, t_s: Array) -> Array:
        """Over the ground [m]."""
        return np.asarray(
            np.interp(t_s, self.estimate_rows.t_s, ground_of(self.rows) - self.estimate_rows.pos_ned_m[:, DOWN])
        )

    def tilt_cosine(self, t_s: Array) -> Array:
        """Cosine of the angle between body z and the vertical."""
        rotation = rotation_of(self.estimate_rows).as_matrix()
        return np.asarray(np.interp(t_s, self.estimate_rows.t_s, rotation[:, DOWN, DOWN]))


class FlowFit(NamedTuple):
    """The fit of the flow by the velocity: gain, lag [s]; and of its residual: robust deviation [rad/s], its colour."""

    gain: float
    lag_s: float
    noise_rad_s: float
    noise_lag_one: float


def figures_of(flown: Replay) -> dict[str, float]:
    """Everything but the outages' drift, by the figure's name; NaN where the log does not show it."""
    assert flown.smoothed is not None
    smoothed = Smoothed(flown.smoothed)
    return {
        **innovation_figures(flown),
        **event_figures(flown),
        **flow_figures(flown, smoothed),
        **range_figures(flown.log, smoothed),
        **barometer_figures(flown.log, smoothed),
        **inertial_figures(flown.log, smoothed),
    }


def innovation_figures(flown: Replay) -> dict[str, float]:
    """By sensor: NIS a degree of freedom, whether white (1 or 0), lag-one correlation, share of slow power."""
    tested = np.isin(flown.offered.reason, TESTED)
    found: dict[str, float] = {}
    for sensor in flown.log.streams:
        rows = InnovationRow.of(flown.innovation[tested & (flown.offered.sensor == sensor)])
        component, news, variance = rows.component, rows.innovation, rows.innovation_variance
        judged = consistency_of(component, news, variance)
        if judged is None:
            continue
        known = np.isfinite(news) & np.isfinite(variance) & (variance > 0.0)
        normal, kind = news[known] / np.sqrt(variance[known]), component[known]
        each = [normal[kind == one] for one in np.unique(kind)]
        name = sensor.name.lower()
        found[f"{name}_nis_per_dof"] = judged.nis_per_dof
        found[f"{name}_white"] = float(judged.white)
        found[f"{name}_lag_one"] = float(np.mean([lag_one(one) for one in each]))
        found[f"{name}_slow_share"] = _mean([slow_share(one) for one in each])
    return found


def _mean(values: list[float]) -> float:
    """Mean of those that are known; NaN without one."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def event_figures(flown: Replay) -> dict[str, float]:
    """How often the navigator called its heading refuted."""
    happened = EventRow.of(flown.written.event)
    kinds = [EVENT_NAMES[int(kind)][:2] for kind in happened.kind if int(kind) < len(EVENT_NAMES)]
    return {"heading_refuted_times": float(kinds.count(("heading", "refuted")))}


def slow_share(values: Array) -> float:
    """Share of the power of (n,) even samples below a tenth of the Nyquist frequency (Welch, mean left in)."""
    if len(values) < 8:
        return float("nan")
    frequency, power = welch(values, nperseg=min(SEGMENT_ROWS, len(values)), detrend=False)
    return float(power[frequency < 0.5 * SLOW_SHARE].sum() / max(power.sum(), np.finfo(float).tiny))


def flow_figures(flown: Replay, smoothed: Smoothed) -> dict[str, float]:
    """Gain and lag of the flow against the smoothed velocity, what is left, and how often it saw nothing in flight."""
    stream = flown.prepared.streams.get(Sensor.FLOW_RATE)
    if stream is None:
        return {}
    height_m = smoothed.height_m(stream.t_s)
    airborne = height_m > AIRBORNE_M
    seen = airborne & (height_m < REACH_M) & (stream.quality > 0.0)
    gyro = stream.value[:, 4:6] if flown.prepared.flow_gyro_is_imu else stream.value[:, 2:4]
    turned = stream.value[:, :2] - gyro
    known = seen & np.isfinite(turned).all(axis=1)
    blind = float(np.mean(stream.quality[airborne] <= 0.0)) if airborne.any() else float("nan")
    slant_m = height_m / smoothed.tilt_cosine(stream.t_s)
    ahead = np.column_stack([turned[:, 1], -turned[:, 0]])
    fit = fit_flow(stream.t_s[known], ahead[known], slant_m[known], smoothed)
    return {f"flow_{name}": value for name, value in fit._asdict().items()} | {"flow_blind_share": blind}


def fit_flow(t_s: Array, ahead_rad_s: Array, slant_m: Array, smoothed: Smoothed) -> FlowFit:
    """Flow (n, 2), forward and right, as gain times the velocity of `lag` ago over the slant; the best such lag."""
    best, least = FlowFit(*[float("nan")] * 4), np.inf
    if len(t_s) < LEAST_ROWS:
        return best
    for lag_s in np.arange(0.0, LATEST_FLOW_S, FLOW_STEP_S):
        expected = smoothed.velocity_frd(t_s - lag_s)[:, :2] / slant_m[:, None]
        gain = float(np.sum(expected * ahead_rad_s) / np.sum(expected**2))
        left = ahead_rad_s - gain * expected
        size = float(np.mean(np.abs(left)))
        if size < least:
            coloured = float(np.mean([lag_one(column) for column in left.T]))
            least, best = size, FlowFit(gain, float(lag_s), robust_sigma(left), coloured)
    return best


def robust_sigma(values: Array) -> float:
    """Standard deviation that strays do not touch: from the median absolute deviation about the median."""
    return float(TO_SIGMA * np.median(np.abs(values - np.median(values)))) if values.size else float("nan")


def range_figures(log: Log, smoothed: Smoothed) -> dict[str, float]:
    """Ranges in flight from the smoothed height: share of strays, how long they last, noise of the others."""
    stream = log.streams.get(Sensor.RANGE)
    if stream is None:
        return {}
    height_m = smoothed.height_m(stream.t_s)
    flying = (height_m > AIRBORNE_M) & (height_m < REACH_M)
    if not flying.any():
        return {}
    slant_m = height_m / smoothed.tilt_cosine(stream.t_s)
    off_m = (stream.value[:, 0] - slant_m)[flying]
    stray = np.abs(off_m) > OUTLIER_M
    near = off_m[~stray]
    return {
        "range_outlier_share": float(np.mean(stray)),
        "range_outlier_run": run_length(stray),
        "range_noise_m": robust_sigma(np.diff(near)) / np.sqrt(2.0) if len(near) > 1 else float("nan"),
        **beyond_reach(stream.t_s, smoothed),
    }


def beyond_reach(t_s: Array, smoothed: Smoothed) -> dict[str, float]:
    """Readings a second where there is no echo, of a flight that goes there for LEAST_HIGH_S."""
    rows_s = smoothed.estimate_rows.t_s
    high = smoothed.height_m(rows_s) > BEYOND_M
    high_s = float(np.sum(np.diff(rows_s)[high[1:]]))
    if high_s < LEAST_HIGH_S:
        return {}
    return {"range_beyond_reach_hz": float(np.count_nonzero(smoothed.height_m(t_s) > BEYOND_M)) / high_s}


def barometer_figures(log: Log, smoothed: Smoothed) -> dict[str, float]:
    """The barometer from the smoothed altitude: deviation of what changes within a minute, and for how long it lasts.

    The time is that after which a first-order Gauss-Markov process of the same neighbours is down to 1/e.
    """
    stream = log.streams.get(Sensor.BARO)
    if stream is None:
        return {}
    off_m = stream.value[:, 0] - np.interp(
        stream.t_s, smoothed.estimate_rows.t_s, -smoothed.estimate_rows.pos_ned_m[:, DOWN]
    )
    window = max(int(BAROMETER_S * rate_hz(stream)), 1)
    if len(off_m) <= 2 * window:
        return {}
    quick = off_m - uniform_filter1d(off_m, window, mode="nearest")
    step_s = 1.0 / rate_hz(stream)
    kept = min(max(lag_one(quick), 0.0), 1.0 - 1e-9)
    return {"baro_error_m": float(np.std(quick)), "baro_error_lasts_s": -step_s / np.log(kept) if kept > 0.0 else 0.0}


def run_length(flags: NDArray[np.bool_]) -> float:
    """Mean length of the runs of true in (n,) flags, readings; 0 without one."""
    starts = np.count_nonzero(np.diff(np.concatenate([[False], flags]).astype(int)) == 1)
    return float(np.count_nonzero(flags) / starts) if starts else 0.0


def inertial_figures(log: Log, smoothed: Smoothed) -> dict[str, float]:
    """Root mean square of gyro and accelerometer in flight, an axis, in two bands of their spectrum."""
    stream = log.streams.get(Sensor.IMU)
    if stream is None:
        return {}
    fs = rate_hz(stream)
    flying = smoothed.height_m(stream.t_s) > AIRBORNE_M
    found = {}
    for band, (low, high) in BANDS_HZ.items():
        if not flying.any() or low >= 0.45 * fs or (high or 0.0) >= 0.45 * fs:
            continue
        sections = butter(4, [low, high] if high else low, "bandpass" if high else "highpass", fs=fs, output="sos")
        passed = sosfiltfilt(sections, stream.value, axis=0)[flying]
        found[f"gyro_{band}_rad_s"] = float(np.sqrt(np.mean(passed[:, GYRO] ** 2)))
        found[f"accel_{band}_m_s2"] = float(np.sqrt(np.mean(passed[:, ACCEL] ** 2)))
    return found
