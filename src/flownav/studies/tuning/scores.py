"""The score of one run of a log in each of its windows: how well it predicted its sensors, and its path error.

Both are in nats, so that they may be added: a reading predicted with errors smaller by a factor f, and stated so, is
worth ln f more, and an error of the path that is smaller by f counts the same ln f.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.measurement import Array, Sensor
from flownav.estimation.gating import Reason
from flownav.logs.log import Log
from flownav.navigation.kernel_settings import flow_gain
from flownav.navigation.rows import InnovationRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.judged import TESTED
from flownav.replays.prepare import FLOW, ReplayOptions
from flownav.replays.session import Replay, replay_again
from flownav.scoring.reference import difference_at, velocity_of
from flownav.studies.compare.tracks import Window
from flownav.studies.tuning.knobs import Knob, turned

STRETCH_S = 5.0  # over which innovations are summed: what lasts longer the filter carries as a state
HUBER_SIGMAS = 3.0  # standard deviations beyond which a surprise counts linearly
GPS_FLOOR_M = 0.4  # what GPS noise and quantisation leave of an outage error, whoever navigates
TRUTH_FLOOR_M_S = 0.03  # what a differenced truth leaves of a velocity error
COMPONENTS = 3
SENSORS = max(Sensor) + 1
UNSCORED = (Sensor.IMU, Sensor.LANDED)  # what moves the filter, and what is no sensor's reading
LEAST_SHARE = 0.8  # of the readings that the start could predict: who predicts fewer gets LOSS_NATS
LOSS_NATS = -1.0  # nats
WORTH_NATS = 0.02  # nats, 2 % of an error: less is not worth a setting
FLOW_FLOOR_RAD_S = 0.05  # noise of one flow reading at full quality
AGAINST_GPS, AGAINST_TRUTH, AGAINST_FLOW = "gps cuts", "truth velocity", "flow cuts"
UNITS = {AGAINST_GPS: "m", AGAINST_TRUTH: "m/s", AGAINST_FLOW: "rad/s"}


class Scores(NamedTuple):
    """One run's scores by window (w,): mean log density of each sensor's readings (w, SENSORS), NaN without any;
    how many readings that is; logarithm of the path's error, NaN where nothing shows it; the error itself, by UNITS.
    """

    density: Array
    readings: Array
    log_error: Array
    error: Array


class Gains(NamedTuple):
    """Over the start, by window (w,), in nats: of predictions, and of errors (NaN where nothing shows them)."""

    prediction: Array
    error: Array

    @property
    def total(self) -> Array:
        """Both together; a window without a reference is judged by its predictions alone."""
        return np.asarray(self.prediction + np.where(np.isfinite(self.error), self.error, 0.0))


def reference_name(log: Log) -> str | None:
    """The best reference that this log has for errors of its path; None without any.

    Without GPS and truth it is the flow: withheld in a window, it is predicted by what is left.
    """
    if Sensor.GPS_POSITION in log.streams:
        return AGAINST_GPS
    if log.truth is not None:
        return AGAINST_TRUTH
    return AGAINST_FLOW if any(sensor in log.streams for sensor in FLOW) else None


def with_cuts(log: Log, options: ReplayOptions, windows: Sequence[Window]) -> ReplayOptions:
    """Options of a replay that withholds in these windows what the path is measured against."""
    reference = reference_name(log)
    return replace(
        options,
        gps_outages_s=tuple(windows) if reference == AGAINST_GPS else (),
        flow_outages_s=tuple(windows) if reference == AGAINST_FLOW else (),
    )


def scores_of(flown: Replay, windows: Sequence[Window]) -> Scores:
    """A run with `with_cuts` in these windows."""
    density, readings = densities(as_reported(flown.innovation, flown.settings), windows)
    error, floor = path_errors(flown, windows)
    return Scores(density, readings, 0.5 * np.log(error**2 + floor**2), error)


def gains_of(run: Scores, start: Scores) -> Gains:
    """The gains of a run over the start, window by window; a reading that it no longer predicts costs LOSS_NATS."""
    counted = np.isfinite(start.density)
    found = np.where(run.readings >= LEAST_SHARE * start.readings, run.density - start.density, LOSS_NATS)
    found = _tempered(np.where(np.isfinite(found), found, LOSS_NATS))
    sensors = np.maximum(counted.sum(axis=1), 1)
    prediction = np.where(counted, found, 0.0).sum(axis=1) / sensors
    error = _tempered(np.where(np.isfinite(run.log_error), start.log_error - run.log_error, LOSS_NATS))
    return Gains(prediction, np.where(np.isfinite(start.log_error), error, np.nan))


def _tempered(gain: Array) -> Array:
    """A gain as it is near 0, by its logarithm far from it, so that one window does not outvote the others."""
    return np.asarray(np.sign(gain) * np.log1p(np.abs(gain)))


# -- predictions -------------------------------------------------------------------------------------------
def as_reported(innovation: Array, settings: NavigatorSettingsFile) -> Array:
    """Rows of a tape with the innovations of flow as the sensor reports it, and not divided by its gain.

    Densities by several gains are comparable there alone: divided by a larger gain, every error is smaller.
    """
    reported = innovation.copy()
    row = InnovationRow.of(reported)
    for sensor, component in product(FLOW, range(2)):
        gain = flow_gain(component, sensor == Sensor.FLOW_RATE, settings.flow_gain_x, settings.flow_gain_y)
        of_row = (row.sensor == sensor) & (row.component == component)
        row.innovation[of_row] *= gain
        row.innovation_variance[of_row] *= gain**2
    return reported


def densities(innovation: Array, windows: Sequence[Window]) -> tuple[Array, Array]:
    """Mean log density by window and sensor (w, SENSORS), NaN without a reading, and how many readings (w, SENSORS).

    innovation: rows of a tape's. Readings that were fused or gated are summed over STRETCH_S first: where the filter's
    model holds, innovations are white and their sum has the sum of their variances; an error that lasts is seen for
    what it is, and a noise that was stated large because its error lasts is not called pessimistic. A reading that was
    withheld is predicted over the whole cut, and counts by itself.
    """
    offered = InnovationRow.of(innovation)
    t_s, sensor, component, reason = offered.t_s, offered.sensor, offered.component, offered.reason
    news, variance = offered.innovation, offered.innovation_variance
    window = _window_of(t_s, windows)
    known = (window >= 0) & np.isfinite(news) & (variance > 0.0) & ~np.isin(sensor, UNSCORED)
    tested, withheld = known & np.isin(reason, TESTED), known & (reason == Reason.OUTAGE)
    stretches = _stretches(windows)
    starts, lengths = np.array([w[0] for w in windows]), np.array([w[1] - w[0] for w in windows])
    where = window[tested]
    part = np.minimum((t_s[tested] - starts[where]) / lengths[where] * stretches, stretches - 1).astype(int)
    shape = (len(windows), stretches, SENSORS, COMPONENTS)
    cell = np.ravel_multi_index((where, part, sensor[tested].astype(int), component[tested].astype(int)), shape)
    size = int(np.prod(shape))
    count = np.bincount(cell, minlength=size)
    sums, variances = (np.bincount(cell, column[tested], size).astype(float) for column in (news, variance))
    filled = count > 0
    by_sum = np.zeros(size)
    by_sum[filled] = _log_density(sums[filled], variances[filled]) + 0.5 * np.log(count[filled])
    total = by_sum.reshape(shape).sum(axis=(1, 3))
    cells = filled.reshape(shape).sum(axis=(1, 3)).astype(float)
    place = window[withheld] * SENSORS + sensor[withheld].astype(int)
    flat = len(windows) * SENSORS
    alone = np.bincount(place, _log_density(news[withheld], variance[withheld]), flat).reshape(-1, SENSORS)
    single = np.bincount(place, minlength=flat).reshape(-1, SENSORS)
    with np.errstate(invalid="ignore"):
        return (total + alone) / (cells + single), count.reshape(shape).sum(axis=(1, 3)) + single


def _window_of(t_s: Array, windows: Sequence[Window]) -> NDArray[np.int_]:
    """The number of the window in which each instant (n,) lies, -1 outside all; windows in order of time."""
    starts, ends = np.array([w[0] for w in windows]), np.array([w[1] for w in windows])
    number = np.searchsorted(starts, t_s, side="right") - 1
    return np.where((number >= 0) & (t_s < ends[np.maximum(number, 0)]), number, -1)


def _stretches(windows: Sequence[Window]) -> int:
    """How many sums a window is cut into."""
    return max(round((windows[0][1] - windows[0][0]) / STRETCH_S), 1)


def _log_density(value: Array, variance: Array) -> Array:
    """Log density of a normal distribution with Huber's tails, but for a constant that is of every scale."""
    z = np.abs(value) / np.sqrt(variance)
    surprise = np.where(z <= HUBER_SIGMAS, 0.5 * z**2, HUBER_SIGMAS * z - 0.5 * HUBER_SIGMAS**2)
    return np.asarray(-0.5 * np.log(variance) - surprise)


# -- errors of the path --------------------------------------------------------------------------------------
def path_errors(flown: Replay, windows: Sequence[Window]) -> tuple[Array, float]:
    """Rms error in each window (w,), NaN where nothing shows it, and the floor under it, by UNITS."""
    reference = reference_name(flown.log)
    if reference == AGAINST_GPS:
        return np.array([flown.outage(*window).horizontal_rms_m for window in windows]), GPS_FLOOR_M
    if reference == AGAINST_TRUTH:
        return _truth_errors(flown, windows), TRUTH_FLOOR_M_S
    return _flow_errors(flown.innovation, windows), FLOW_FLOOR_RAD_S


def _flow_errors(innovation: Array, windows: Sequence[Window]) -> Array:
    """Difference of flow that was withheld from what was expected of it [rad/s]."""
    offered = InnovationRow.of(innovation)
    news = offered.innovation
    cut = np.isin(offered.sensor, FLOW) & (offered.reason == Reason.OUTAGE) & np.isfinite(news)
    window = np.where(cut, _window_of(offered.t_s, windows), -1)
    chosen = window >= 0
    squares = np.bincount(window[chosen], news[chosen] ** 2, len(windows))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.sqrt(squares / np.bincount(window[chosen], minlength=len(windows))))


def _truth_errors(flown: Replay, windows: Sequence[Window]) -> Array:
    """Horizontal velocity against the truth's, turned onto the path by least squares [m/s]."""
    placed, truth = flown.truth_alignment, flown.log.truth
    if placed is None or truth is None:
        return np.full(len(windows), np.nan)
    t_s, position = np.asarray(truth["t_s"], float), flown.truth_position
    moving = placed.turned(velocity_of(t_s, position))[:, :2]
    found, estimate_rows = [], flown.estimate_rows
    for t0, t1 in windows:
        inside = (t_s >= t0) & (t_s < t1) & np.isfinite(moving).all(axis=1)
        error = difference_at(estimate_rows.t_s, estimate_rows.vel_ned_m_s[:, :2], t_s[inside], moving[inside])
        found.append(np.sqrt(np.mean(np.sum(error**2, axis=1))) if len(error) else np.nan)
    return np.array(found)


# -- logs flown again by other settings --------------------------------------------------------------------------
WORKERS = 2


@dataclass(frozen=True)
class Course:
    """A log prepared once, the settings that it starts from, its windows, and what the start is worth in them."""

    flown: Replay
    windows: tuple[Window, ...]
    start: Scores

    def scores(self, keys: dict[str, float]) -> Scores:
        """By the starting settings with some keys changed. InputError where the filter never starts."""
        return _scores(self.flown, self.windows, keys)

    def gains(self, keys: dict[str, float]) -> Gains:
        """Over the start; a filter that no longer starts loses everywhere."""
        try:
            return gains_of(self.scores(keys), self.start)
        except InputError:
            lost = np.full(len(self.windows), LOSS_NATS)
            return Gains(lost, np.where(np.isfinite(self.start.log_error), LOSS_NATS, np.nan))


def course_of(flown: Replay, windows: Sequence[Window]) -> Course:
    """A log on these windows, with `scores.with_cuts` in them and nowhere else."""
    return Course(flown, tuple(windows), _scores(flown, windows, {}))


def _scores(flown: Replay, windows: Sequence[Window], keys: dict[str, float]) -> Scores:
    settings = NavigatorSettingsFile.model_validate(flown.settings.model_dump(exclude_unset=True) | keys)
    options = with_cuts(flown.log, flown.options, windows)
    return scores_of(replay_again(flown, options, settings), windows)


class Trials:
    """Several courses flown by the same factors; a pair of factors is flown once."""

    def __init__(
        self, courses: Sequence[Course], knobs: Sequence[Knob], settings: NavigatorSettingsFile,
        on_progress: Callable[[int], None],
    ) -> None:  # fmt: skip
        self.courses = list(courses)
        self.knobs = list(knobs)
        self._settings = settings
        self._on_progress = on_progress
        self._known: dict[tuple[float, ...], list[Gains]] = {}

    @property
    def flown(self) -> int:
        """How many different factors were flown."""
        return len(self._known)

    def gains(self, log_factors: Array) -> list[Gains]:
        """Course by course."""
        factors = tuple(round(float(factor), 6) for factor in log_factors)
        if factors not in self._known:
            keys = turned(self._settings, self.knobs, factors)
            with ThreadPoolExecutor(WORKERS) as pool:
                self._known[factors] = list(pool.map(lambda course: course.gains(keys), self.courses))
            self._on_progress(len(self.courses))
        return self._known[factors]
