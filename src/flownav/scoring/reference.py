"""An estimate against a reference: laid on it, through an outage, from take-off to the end, and against its levels.

The outage error is defined once, here: horizontal position of the estimate minus that of the reference (the truth
where a log has one, else GPS), taken at the instant that the sample describes (its time less the GPS delay), less its
mean over the first five samples of the window; rms and maximum over the window. GPS noise puts a floor under it.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import turned_level
from flownav.core.measurement import Array

VELOCITY_SPAN_S = 0.1
LEAST_SPREAD_M = 0.2  # rms about the middle, of both paths: of less, noise and drift make the angle
LEAST_LIKENESS = 0.5


class Alignment(NamedTuple):
    """The transformation of the reference into the estimate's frame: first turned by yaw, then shifted.

    yaw_shown: whether the two paths move enough, and alike, to show the yaw; it is the best fit all the same.
    axis: the yaw's cosine and sine where they are known without it, which then are the same on every processor.
    """

    yaw_rad: float
    shift_ned_m: tuple[float, float, float]
    yaw_shown: bool = True
    axis: tuple[float, float] | None = None

    def turned(self, vectors_ned: Array) -> Array:
        """Vectors (n, 3) in the estimate's axes."""
        north, east, down = vectors_ned.T
        cosine, sine = self.axis or (np.cos(self.yaw_rad), np.sin(self.yaw_rad))
        return np.column_stack([*turned_level(north, east, cosine, sine), down])

    def moved(self, positions_ned_m: Array) -> Array:
        """Positions (n, 3) in the estimate's frame."""
        return np.asarray(self.turned(positions_ned_m) + np.array(self.shift_ned_m))


def align(estimate_ned_m: Array, reference_ned_m: Array) -> Alignment:
    """The yaw and the shift that bring a reference (n, 3) closest to an estimate (n, 3) at the same instants.

    Least squares over the horizontal plane (Umeyama 1991 in two dimensions, scale 1): the yaw is the angle of
    sum(conj(r) e) of the centred positions as complex numbers, whose parts are `along` and `across`.
    """
    mean_estimate, mean_reference = estimate_ned_m.mean(axis=0), reference_ned_m.mean(axis=0)
    ours, theirs = estimate_ned_m - mean_estimate, reference_ned_m - mean_reference
    along = float(np.sum(theirs[:, 0] * ours[:, 0] + theirs[:, 1] * ours[:, 1]))
    across = float(np.sum(theirs[:, 0] * ours[:, 1] - theirs[:, 1] * ours[:, 0]))
    length = float(np.sqrt(along * along + across * across))
    axis = (along / length, across / length) if length > 0.0 else (1.0, 0.0)
    turn = Alignment(float(np.arctan2(across, along)), (0.0, 0.0, 0.0), axis=axis)
    shift = mean_estimate - turn.turned(mean_reference[None, :])[0]
    spread = [float(np.sqrt(np.mean(np.sum(path[:, :2] ** 2, axis=1)))) for path in (ours, theirs)]
    likeness = length / max(len(ours) * spread[0] * spread[1], 1e-12)
    shown = min(spread) >= LEAST_SPREAD_M and likeness >= LEAST_LIKENESS
    return turn._replace(shift_ned_m=(float(shift[0]), float(shift[1]), float(shift[2])), yaw_shown=shown)


def velocity_of(t_s: Array, position_m: Array) -> Array:
    """Velocity (n, 3) of sampled positions, by differences over VELOCITY_SPAN_S about each instant."""
    late = np.minimum(t_s + 0.5 * VELOCITY_SPAN_S, t_s[-1])
    early = np.maximum(t_s - 0.5 * VELOCITY_SPAN_S, t_s[0])
    moved = [np.interp(late, t_s, column) - np.interp(early, t_s, column) for column in position_m.T]
    return np.asarray(np.column_stack(moved) / (late - early)[:, None])


# -- differences, and outages of GPS -----------------------------------------------------------------------------
ANCHOR_SAMPLES = 5


class OutageError(NamedTuple):
    """Horizontal error over [t0, t1); NaN where the window holds too few GPS samples or no estimate."""

    t0: float
    t1: float
    horizontal_rms_m: float
    horizontal_max_m: float


def outage_error(
    estimate_t_s: Array, estimate_ne_m: Array, gps_t_s: Array, gps_ne_m: Array, delay_s: float, t0: float, t1: float
) -> OutageError:
    """The outage error of one window.

    estimate_t_s (n,), estimate_ne_m (n, 2): the estimate; gps_t_s (m,), gps_ne_m (m, 2): all GPS samples at
    their arrival, withheld or not, or a truth as a receiver without error would have brought it.
    """
    inside = (gps_t_s >= t0) & (gps_t_s < t1)
    error = difference_at(estimate_t_s, estimate_ne_m, gps_t_s[inside] - delay_s, gps_ne_m[inside])
    if len(error) <= ANCHOR_SAMPLES:
        return OutageError(t0, t1, np.nan, np.nan)
    squares = np.sum((error - error[:ANCHOR_SAMPLES].mean(axis=0)) ** 2, axis=1)
    return OutageError(t0, t1, float(np.sqrt(squares.mean())), float(np.sqrt(squares.max())))


def horizontal_rms(estimate_t_s: Array, estimate: Array, reference_t_s: Array, reference: Array) -> float:
    """Root mean square of the length of estimate minus reference, (n, 2) and (m, 2); NaN without common time."""
    error = difference_at(estimate_t_s, estimate, reference_t_s, reference)
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1)))) if len(error) else float("nan")


def difference_at(estimate_t_s: Array, estimate: Array, reference_t_s: Array, reference: Array) -> Array:
    """Estimate minus reference at the reference's instants that the estimate covers, linear between estimates."""
    if not len(estimate_t_s):
        return np.zeros((0, reference.shape[1]))
    covered = (reference_t_s >= estimate_t_s[0]) & (reference_t_s <= estimate_t_s[-1])
    instants = reference_t_s[covered]
    at_instants = np.column_stack([np.interp(instants, estimate_t_s, column) for column in estimate.T])
    return np.asarray(at_instants - reference[covered])


# -- from take-off on --------------------------------------------------------------------------------------------
OFF_THE_GROUND_M = 0.05

Window = tuple[float, float]


class Motion(NamedTuple):
    """A path in its own frame: t_s (n,), position north, east, down [m] (n, 3), and its headings where it has some.

    heading_t_s (m,), heading_rad (m,): clockwise from the path's own north, any whole turns; empty without.
    """

    t_s: Array
    position: Array
    heading_t_s: Array
    heading_rad: Array


def flight_of(t_s: Array, down_m: Array) -> Window | None:
    """First and last instant at which a truth's height differs from its start by more than OFF_THE_GROUND_M [s].

    None where it never does.
    """
    away = np.flatnonzero(abs(down_m - down_m[0]) > OFF_THE_GROUND_M) if len(down_m) else np.zeros(0, int)
    return (float(t_s[away[0]]), float(t_s[away[-1]])) if len(away) else None


class Drift(NamedTuple):
    """The error of an estimate that was right at take-off: t_s (n,), horizontal and vertical [m], (n,) each."""

    t_s: Array
    horizontal_m: Array
    vertical_m: Array


def drift_of(estimate: Motion, truth: Motion, flight_s: Window | None = None) -> Drift | None:
    """The error at the truth's instants of flight that both cover; None without such a flight.

    flight_s: from when to when it flew; by the truth's height where it is not given.

    The truth is laid on the estimate at take-off, turned by the difference of headings there; without a heading of
    either by what fits the two paths best over the flight (least squares).
    """
    flight = flight_s or flight_of(truth.t_s, truth.position[:, 2])
    if flight is None or not len(estimate.t_s):
        return None
    inside = (truth.t_s >= max(flight[0], estimate.t_s[0])) & (truth.t_s <= min(flight[1], estimate.t_s[-1]))
    if np.count_nonzero(inside) < 2:
        return None
    t_s, position = truth.t_s[inside], truth.position[inside]
    ours = position + difference_at(estimate.t_s, estimate.position, t_s, position)
    turn = _heading_between(estimate, truth, float(t_s[0]))
    yaw = align(ours, position).yaw_rad if turn is None else turn
    moved = Alignment(yaw, (0.0, 0.0, 0.0)).turned(position - position[0])
    error = ours - ours[0] - moved
    return Drift(t_s, np.hypot(error[:, 0], error[:, 1]), abs(error[:, 2]))


def end_drift(estimate: Motion, truth: Motion, flight_s: Window | None = None) -> float | None:
    """Horizontal error [m] at the last instant of flight that both cover (`drift_of`); None without such a flight."""
    found = drift_of(estimate, truth, flight_s)
    return None if found is None else float(found.horizontal_m[-1])


def _heading_between(estimate: Motion, truth: Motion, at_s: float) -> float | None:
    """The estimate's heading less the truth's [rad]; None where one of them has none within its time."""
    ours, theirs = (_heading_at(path, at_s) for path in (estimate, truth))
    return None if ours is None or theirs is None else ours - theirs


def _heading_at(path: Motion, at_s: float) -> float | None:
    """Linear between the headings, over the turn's seam; None outside their time."""
    if not len(path.heading_t_s) or not path.heading_t_s[0] <= at_s <= path.heading_t_s[-1]:
        return None
    return float(np.interp(at_s, path.heading_t_s, np.unwrap(path.heading_rad)))


# -- protection levels -------------------------------------------------------------------------------------------
def protection_of(
    t_s: Array, levels_m: Array, flagged: NDArray[np.bool_], drift: Drift | None
) -> dict[str, Any] | None:
    """Levels of a flight, and the share of instants at which the horizontal error exceeds them without a warning.

    t_s (n,), levels_m (n, 2) horizontal and vertical, flagged (n,): whether a warning stands. The share is None
    without a truth; the whole is None where no level was computed.
    """
    known = np.isfinite(levels_m).all(axis=1)
    if not known.any():
        return None
    return {
        "horizontal_m": _summary(levels_m[known, 0]),
        "vertical_m": _summary(levels_m[known, 1]),
        "flagged_fraction": float(flagged[known].mean()),
        "exceeded_unsaid_fraction": None if drift is None else unwarned_share(t_s, levels_m[:, 0], flagged, drift),
    }


def unwarned_share(t_s: Array, level_m: Array, flagged: NDArray[np.bool_], drift: Drift) -> float:
    """The share of the truth's instants at which the error is above the newest level and no warning stands.

    A level that is no number protects from nothing.
    """
    newest = np.clip(np.searchsorted(t_s, drift.t_s, side="right") - 1, 0, len(t_s) - 1)
    return float(np.mean(~(drift.horizontal_m <= level_m[newest]) & ~flagged[newest]))


def _summary(level_m: Array) -> dict[str, float]:
    return {"median": float(np.median(level_m)), "p95": float(np.percentile(level_m, 95.0))}
