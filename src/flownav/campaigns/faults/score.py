"""The effect of a fault on a navigator: time to notice, largest error of the estimate, time to recover.

Each figure is defined in docs/explanation/faults.md. A run with the fault is compared with one of the same
flight without it.
"""

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.faults.navigator import Navigated
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, Table
from flownav.core.text import finite_or_none
from flownav.scoring.course import first_contact

SIGMAS = 3.0
AS_GOOD_AS_WITHOUT_M = 0.1
STAYS_S = 1.0
SAME_S = 0.05  # happenings of two runs that lie no further apart are the same
BY_COLUMN = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY, Sensor.RANGE,
             Sensor.BARO, Sensor.POSE, Sensor.PAD)  # component k observes column k  # fmt: skip
FILTER = "filter"  # the source of the navigator's own reports


class FaultScores(NamedTuple):
    """The figures of one fault; None where there is none (never noticed, never back, no touchdown, not a number)."""

    detected_after_s: float | None
    moved_m: float | None
    max_error_m: float | None
    recovered_after_s: float | None
    wrongly_fused: int
    touchdown_error_m: float | None
    unflagged_above_3_sigma_s: float


class Course(NamedTuple):
    """A run's error against the truth: instants (n,), error NED (n, 3), its length (n,), beyond 3 sigma (n,)."""

    t_s: Array
    error_ned_m: Array
    error_m: Array
    beyond: NDArray[np.bool_]


def score(
    run: Navigated,
    without: Navigated,
    truth: Table,
    sensors: tuple[Sensor, ...],
    window_s: tuple[float, float],
    clean: Mapping[Sensor, Stream],
    faulty: Mapping[Sensor, Stream],
) -> FaultScores:
    """Score a run against the truth and the run `without` the fault.

    sensors: those that the fault strikes, in [t0, t1). clean and faulty: the streams that each run was given.
    """
    t0_s, t1_s = window_s
    course = course_of(run, truth)
    after = course.t_s >= t0_s
    return FaultScores(
        detected_after_s=detected_after(run, without, sensors, t0_s),
        moved_m=moved(run, without, window_s),
        max_error_m=finite_or_none(course.error_m[after].max(initial=0.0)),
        recovered_after_s=recovered_after(course, course_of(without, truth), t1_s),
        wrongly_fused=sum(
            wrongly_fused(run, clean[sensor], faulty[sensor]) for sensor in sensors if sensor in faulty
        ),
        touchdown_error_m=touchdown_error(course, truth),
        unflagged_above_3_sigma_s=unflagged(run, course, t0_s),
    )  # fmt: skip


def course_of(run: Navigated, truth: Table) -> Course:
    """The error over the instants that the truth covers; an estimate that is no number is infinitely wrong."""
    covered = (run.t_s >= truth["t_s"][0]) & (run.t_s <= truth["t_s"][-1])
    t_s = run.t_s[covered]
    true = np.column_stack([np.interp(t_s, truth["t_s"], truth[name]) for name in POSITION_NED])
    error = run.position_ned_m[covered] - true
    error = np.where(np.isfinite(error), error, np.inf)
    beyond = ~(np.abs(error) <= SIGMAS * run.sigma_ned_m[covered]).all(axis=1)
    return Course(t_s, error, np.linalg.norm(error, axis=1), beyond)


# -- noticed -----------------------------------------------------------------------------------------------
def detected_after(run: Navigated, without: Navigated, sensors: tuple[Sensor, ...], t0_s: float) -> float | None:
    """From t0 to the first rejection, event or flag of a struck sensor, or of the filter, that `without` has not."""
    known: dict[tuple[str, str], list[float]] = {}
    for t_s, source, kind in _signs(without, sensors):
        known.setdefault((source, kind), []).append(t_s)
    first = np.inf
    for t_s, source, kind in _signs(run, sensors):
        same = known.get((source, kind))
        if t0_s <= t_s < first and (same is None or np.abs(np.array(same) - t_s).min() > SAME_S):
            first = t_s
    return finite_or_none(first - t0_s)


def _signs(run: Navigated, sensors: tuple[Sensor, ...]) -> list[tuple[float, str, str]]:
    """Time, source and kind of every rejection, event and flag of some sensors and of the filter."""
    sources = {name for sensor in sensors for name in (sensor.name.lower(), sensor.name.lower().split("_")[0])}
    offers = run.offers
    rejected = np.flatnonzero(~offers.fused & np.isin(offers.sensor, [int(sensor) for sensor in sensors]))
    signs = [(float(offers.t_s[k]), Sensor(offers.sensor[k]).name.lower(), str(offers.reason[k])) for k in rejected]
    reported = [(event.t_s, event.source, event.kind) for event in run.events]
    reported += [(flag.t0_s, flag.source, flag.kind) for flag in run.flags]
    return signs + [sign for sign in reported if sign[1] in sources or sign[1] == FILTER]


# -- taken in ----------------------------------------------------------------------------------------------
def wrongly_fused(run: Navigated, clean: Stream, faulty: Stream) -> int:
    """Readings of a stream of which the fault altered, or added, a component that was fused all the same.

    A reading is known by sensor and time stamp; where a good one has the same stamp, only what was fused beyond it
    counts.
    """
    offers = run.offers
    here = np.flatnonzero((offers.sensor == int(clean.sensor)) & offers.fused)
    fused = Counter((_stamp(offers.t_s[k]), int(offers.component[k])) for k in here)
    wrong: dict[int, int] = {}
    for component in {component for _, component in fused}:
        given, good = Counter(_reported(faulty, component)), Counter(_reported(clean, component))
        bad: Counter[int] = Counter()
        fine: Counter[int] = Counter()
        for reported, count in given.items():
            right = min(count, good[reported])
            fine[reported[0]] += right
            bad[reported[0]] += count - right
        for stamp, count in bad.items():
            taken = min(count, max(0, fused[stamp, component] - fine[stamp]))
            wrong[stamp] = max(taken, wrong.get(stamp, 0))
    return sum(wrong.values())


def _reported(stream: Stream, component: int) -> list[tuple[int, bytes]]:
    """Time stamp and bytes of each reading's component; of the whole reading where a component belongs to all of it."""
    columns = slice(component, component + 1) if stream.sensor in BY_COLUMN else slice(None)
    content = np.column_stack([stream.value[:, columns], stream.variance[:, columns], stream.quality])
    return [(_stamp(t_s), row.tobytes()) for t_s, row in zip(stream.t_s, content, strict=True)]


def _stamp(t_s: float) -> int:
    """A time stamp in tenths of a millisecond: what survives a navigator's own arithmetic."""
    return round(float(t_s) * 1e4)


# -- how far, and back -------------------------------------------------------------------------------------
def recovered_after(course: Course, without: Course, t1_s: float) -> float | None:
    """From t1 to the first instant from which the error is right again for a second, or to the end of the log.

    Right: no more than 0.1 m above the error without the fault at that instant, and within 3 sigma unless the run
    without the fault is not either.
    """
    after = course.t_s >= t1_s
    if not after.any() or not len(without.t_s):
        return None
    t_s = course.t_s[after]
    usual_m = np.interp(t_s, without.t_s, without.error_m)
    usually_beyond = np.interp(t_s, without.t_s, without.beyond.astype(float)) > 0.0
    right = course.error_m[after] <= usual_m + AS_GOOD_AS_WITHOUT_M
    right &= ~course.beyond[after] | usually_beyond
    wrong_s = t_s[~right]
    for start in t_s[right & np.r_[True, ~right[:-1]]]:
        later = wrong_s[wrong_s > start]
        if not len(later) or later[0] - start > STAYS_S:
            return float(start - t1_s)
    return None


def moved(run: Navigated, without: Navigated, window_s: tuple[float, float]) -> float | None:
    """How far the fault moved the estimate while it lasted: the largest distance from the run without it."""
    lasting = (run.t_s >= window_s[0]) & (run.t_s < window_s[1])
    t_s = run.t_s[lasting]
    if not len(t_s):
        return 0.0
    usual = np.column_stack([np.interp(t_s, without.t_s, axis) for axis in without.position_ned_m.T])
    return finite_or_none(np.linalg.norm(run.position_ned_m[lasting] - usual, axis=1).max())


def touchdown_error(course: Course, truth: Table) -> float | None:
    """Horizontal error at the first ground contact of a flight; None where it does not land."""
    contact = first_contact(np.asarray(truth["on_ground"], float)[:, None])[0]
    contact_s = float(truth["t_s"][contact]) if contact >= 0 else np.inf
    if not len(course.t_s) or not course.t_s[0] <= contact_s <= course.t_s[-1]:
        return None
    north, east = (np.interp(contact_s, course.t_s, course.error_ned_m[:, axis]) for axis in range(2))
    return finite_or_none(np.hypot(north, east))


def unflagged(run: Navigated, course: Course, t0_s: float) -> float:
    """The longest time from t0 on that the error is beyond 3 sigma before any event or flag."""
    reported = np.array([event.t_s for event in run.events] + [flag.t0_s for flag in run.flags])
    longest = 0.0
    for first, last in _stretches(course.beyond & (course.t_s >= t0_s)):
        start, end = course.t_s[first], course.t_s[last]
        if any(flag.t0_s <= start < flag.t1_s for flag in run.flags):
            continue
        in_it = reported[(reported >= start) & (reported <= end)]
        longest = max(longest, float(in_it.min(initial=end) - start))
    return longest


def _stretches(true: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of every stretch of True."""
    edges = np.flatnonzero(np.diff(np.r_[False, true, False].astype(int)))
    return [(int(first), int(end) - 1) for first, end in edges.reshape(-1, 2)]
