"""Does the flow see the motion that GPS sees? Wrong signs, swapped axes, a turned heading and a late clock show here.

Two witnesses. The flow must turn as the vehicle turns: with its signs and axes right, taking the rotation out leaves
the least sample-to-sample noise. And the compensated flow times range, turned by the attitude, must be the GPS
velocity: as complex numbers (north + i east) their correlation has a size (do they belong together) and an angle
(the heading's error); moved against each other in time, it peaks at the clock's error.

Only findings beyond doubt are reported: where the vehicle moves too little, or GPS is away, there is none.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import rotation_from_quaternion, velocity_from_flow
from flownav.core.measurement import COLUMNS, Array, Sensor, Stream
from flownav.logs.log import attitude_at, mean_over

# Chosen so that nothing is found in quad-px4flow-outdoor, whole or in any part of 30 to 120 s, and each of its twelve
# spoilt copies is found out (test_replay_sentinel). Halving or doubling any one of them changes no verdict on nine such
# parts and eleven copies, but for LEAST_OVERLAP, which beyond 1 silences all; that of the climb has but 40 intervals.
MOVING_M_S = 1.0
LEAST_MOVING_S = 10.0  # take-off and hover, 12 s of that log, show nothing
LEAST_MOVING_FOR_LAG_S = 20.0
LEAST_PAIRS = 30
SMOOTHING_S = 0.6
STALE_S = 1.0
LARGEST_LAG_S = 15.0
LAG_STEP_S = 0.1
LEAST_OVERLAP = 0.7
LARGEST_TILT_RAD = 0.8  # `tilt_limit_rad`, beyond which no flow is fused
RANGE_LIMITS_M = (0.02, 100.0)  # the navigator's default limits of a range
FASTEST_RATIO = 2.0  # times the speed by GPS: a faster flow reading is a spike
LIKE_RATIO = 1.3  # noise ratio up to which two ways to read the flow are as good as each other
CLEARLY_SHARE = 0.5  # a better explanation leaves less than this share of the power that the other leaves
UNEXPLAINED_SHARE = 0.4  # an explanation that leaves more than this share of the power is none
SLACK = (1.5, 0.05)  # a simpler explanation serves if it leaves no more than this: factor, and share of power
LEAST_HEADING_ERROR_RAD = 0.35  # 20 deg: outdoor's own yaw is 5 to 7 off its course
ABOUT_RAD = 2.6  # 149 deg
LEAST_CLOCK_ERROR_S = 0.8  # outdoor's receiver itself lags by 0.23 s or more (../shared/data/README.md)
CLIMB_INTERVAL_S = 2.0
LEAST_CLIMB_LIKENESS = 0.3
SIGNIFICANT_SIGMAS = 3.5  # standard errors: one in 4000 by chance

Matrix = tuple[tuple[int, int], tuple[int, int]]
AS_LOGGED: Matrix = ((1, 0), (0, 1))
# How the flow's two columns may have been logged, as the matrix that puts them right.
READINGS: dict[Matrix, str] = {
    AS_LOGGED: "",
    ((-1, 0), (0, -1)): "flow sign is inverted (both axes)",
    ((-1, 0), (0, 1)): "flow sign is inverted on the x axis",
    ((1, 0), (0, -1)): "flow sign is inverted on the y axis",
    ((0, 1), (1, 0)): "flow axes are swapped",
    ((0, -1), (-1, 0)): "flow axes are swapped and their signs inverted",
    ((0, -1), (1, 0)): "flow axes are swapped and the sign of one is inverted",
    ((0, 1), (-1, 0)): "flow axes are swapped and the sign of one is inverted",
}
TURNS = tuple(reading for reading in READINGS if reading[0][1] * reading[1][0] < 0)  # as a heading off by 90 deg


class Finding(NamedTuple):
    """An error found in a log, and its name. Two kinds are a bad verdict: the flow itself is wrong, or a horizontal
    sensor was received and never fused.
    """

    text: str
    flow_is_wrong: bool = False
    label: str = "Warning"
    unfused: bool = False


class Course(NamedTuple):
    """GPS velocity while moving, and the flow's; complex, north + i east [m/s]."""

    gps_t_s: Array
    gps: NDArray[np.complex128]
    flow_t_s: Array
    moving_s: float


class Fit(NamedTuple):
    """An explanation: the share of power it leaves, the heading's error (logged less true), the clock's."""

    unexplained: float
    heading_rad: float = 0.0
    clock_s: float = 0.0


def findings(streams: dict[Sensor, Stream], gps_outages_s: Iterable[tuple[float, float]]) -> list[Finding]:
    """The findings that GPS shows about the flow, the heading, the clock and its own climb rate. `streams` with their
    delays.
    """
    gps_streams: dict[Sensor, Stream] = {
        sensor: _kept(streams[sensor], gps_outages_s)
        for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
        if sensor in streams
    }
    found = _of_climb(streams, gps_streams)
    flow = streams.get(Sensor.FLOW_RATE) or streams.get(Sensor.FLOW_VELOCITY)
    if flow is None or Sensor.GPS_VELOCITY not in gps_streams or Sensor.ATTITUDE not in streams:
        return found
    flow = _usable(flow, streams)
    if len(flow) < LEAST_PAIRS:
        return found
    course = _course(gps_streams[Sensor.GPS_VELOCITY], flow)
    return found if course is None else _of_flow(course, flow, streams) + found


# -- flow, heading, clock ----------------------------------------------------------------------------------
def _of_flow(course: Course, flow: Stream, streams: dict[Sensor, Stream]) -> list[Finding]:
    velocity = {reading: _velocity(reading, flow, streams, course) for reading in READINGS}
    fits = {reading: _fits(course, velocity[reading]) for reading in READINGS}
    left = {reading: min(fit.unexplained for fit in fits[reading]) for reading in READINGS}
    rotation = _rotation_noise(flow)
    alike = [reading for reading in READINGS if rotation[reading] <= LIKE_RATIO * min(rotation.values())]
    if AS_LOGGED in alike:
        others = [reading for reading in alike if reading not in TURNS]
        level = {reading: fits[reading][0].unexplained for reading in others}
        best = min(level, key=lambda reading: level[reading])
        about = abs(fits[AS_LOGGED][1].heading_rad) > ABOUT_RAD  # as likely a heading as a flow of the wrong sign: flow
        mended = level[best] < CLEARLY_SHARE * (fits[AS_LOGGED][0].unexplained if about else left[AS_LOGGED])
        reading = best if mended else AS_LOGGED
    else:
        reading = min(alike, key=lambda reading: left[reading])
    if left[reading] > UNEXPLAINED_SHARE:
        return []
    sentences = (
        [Finding(f"{READINGS[reading]} against GPS; mend the log's flow columns", True)] if READINGS[reading] else []
    )
    return [*sentences, *map(Finding, _of_heading_and_clock(fits[reading]))]


def _of_heading_and_clock(fits: tuple[Fit, ...]) -> list[str]:
    """The words of the simplest explanation that fits: nothing wrong, one error, or both."""
    enough = SLACK[0] * min(fit.unexplained for fit in fits) + SLACK[1]
    as_it_is, turned, late, both = fits
    if as_it_is.unexplained <= enough:
        return []
    single = [fit for fit in (turned, late) if fit.unexplained <= enough]
    sentences = [_words(fit) for fit in sorted(single)] or [_words(both)]
    sentences = [words for words in sentences if words]
    return [", or ".join(sentences)] if sentences else []


def _words(fit: Fit) -> str:
    """Which of the two errors an explanation holds, with its size."""
    words = []
    if abs(fit.heading_rad) >= LEAST_HEADING_ERROR_RAD:
        side = "clockwise of" if fit.heading_rad > 0 else "anticlockwise of"
        degrees = abs(np.degrees(fit.heading_rad))
        words.append(f"heading is off by about {degrees:.0f} deg (the logged yaw lies {side} the course by GPS)")
    if abs(fit.clock_s) >= LEAST_CLOCK_ERROR_S:
        late = "late" if fit.clock_s > 0 else "early"
        words.append(f"GPS clock is {late} by about {abs(fit.clock_s):.1f} s (beyond the stated delay)")
    return " and ".join(words)


def _fits(course: Course, velocity: NDArray[np.complex128]) -> tuple[Fit, Fit, Fit, Fit]:
    """The flow's velocity as it is, with the heading turned, with the clock moved, with both."""
    now = _likeness(course, velocity, 0.0)
    as_it_is, turned = Fit(_left(now.real)), Fit(_left(abs(now)), -float(np.angle(now)))
    nothing = Fit(1.0)
    if course.moving_s < LEAST_MOVING_FOR_LAG_S:
        return as_it_is, turned, nothing, nothing
    lags = LAG_STEP_S * np.arange(-round(LARGEST_LAG_S / LAG_STEP_S), round(LARGEST_LAG_S / LAG_STEP_S) + 1)
    likeness = np.array([_likeness(course, velocity, lag) for lag in lags])
    late, both = int(np.argmax(likeness.real)), int(np.argmax(abs(likeness)))
    moved = Fit(_left(likeness[late].real), 0.0, float(lags[late]))
    turned_and_moved = Fit(_left(abs(likeness[both])), -float(np.angle(likeness[both])), float(lags[both]))
    inside = range(1, len(lags) - 1)  # a best lag at the end of the search is none
    return as_it_is, turned, moved if late in inside else nothing, turned_and_moved if both in inside else nothing


def _left(likeness: float) -> float:
    """The share of power that a correlation leaves; all of it where the correlation is negative."""
    return float(1.0 - max(likeness, 0.0) ** 2)


def _likeness(course: Course, velocity: NDArray[np.complex128], lag_s: float) -> complex:
    """Complex correlation of the GPS velocity with the flow's `lag_s` before; 0 where too few meet."""
    t_s = course.gps_t_s - lag_s
    met = _near(course.flow_t_s, t_s)
    if np.count_nonzero(met) < LEAST_OVERLAP * len(t_s):
        return 0.0
    flow, gps = np.interp(t_s[met], course.flow_t_s, velocity), course.gps[met]
    power = float(np.sum(abs(flow) ** 2) * np.sum(abs(gps) ** 2))
    return complex(np.sum(gps * np.conj(flow)) / np.sqrt(power)) if power > 0 else 0.0


def _course(gps: Stream, flow: Stream) -> Course | None:
    """The moving part of the GPS velocity that the flow covers; None where that is too little."""
    t_s = gps.t_s - gps.delay_s
    north_east = gps.value[:, 0] + 1j * gps.value[:, 1]
    moving = np.isfinite(north_east) & (abs(np.nan_to_num(north_east)) > MOVING_M_S)
    flow_t_s = flow.t_s - flow.delay_s
    moving &= _near(flow_t_s, t_s)
    count = int(np.count_nonzero(moving))
    if count < LEAST_PAIRS:
        return None
    moving_s = count * float(np.median(np.diff(t_s)))
    if moving_s < LEAST_MOVING_S:
        return None
    return Course(t_s[moving], north_east[moving], flow_t_s, moving_s)


def _near(samples_s: Array, t_s: Array) -> NDArray[np.bool_]:
    """Which instants have a sample no further than STALE_S away."""
    after = np.clip(np.searchsorted(samples_s, t_s), 1, len(samples_s) - 1)
    return np.asarray(np.minimum(abs(t_s - samples_s[after - 1]), abs(samples_s[after] - t_s)) <= STALE_S)


def _usable(flow: Stream, streams: dict[Sensor, Stream]) -> Stream:
    """Readings of quality above 0, upright, with a range near."""
    t_s = flow.t_s - flow.delay_s
    good = (flow.quality > 0) & np.isfinite(flow.value[:, :2]).all(axis=1)
    good &= rotation_from_quaternion(*attitude_at(streams[Sensor.ATTITUDE], t_s).T)[8] > np.cos(LARGEST_TILT_RAD)
    if flow.sensor == Sensor.FLOW_RATE:
        good &= np.isfinite(flow.value[:, :4]).all(axis=1)
        ranges = _ranges(streams)
        good &= _near(ranges[0], t_s) if len(ranges[0]) > 1 else False
    value = flow.value[good, : len(COLUMNS[flow.sensor])]
    return Stream.of(flow.sensor, flow.t_s[good], value, quality=flow.quality[good], delay_s=flow.delay_s)


def _ranges(streams: dict[Sensor, Stream]) -> tuple[Array, Array]:
    """Instants and metres of the ranges that can be."""
    if Sensor.RANGE not in streams:
        return np.zeros(0), np.zeros(0)
    stream = streams[Sensor.RANGE]
    range_m = stream.value[:, 0]
    good = (range_m >= RANGE_LIMITS_M[0]) & (range_m <= RANGE_LIMITS_M[1])
    return stream.t_s[good] - stream.delay_s, range_m[good]


def _velocity(reading: Matrix, flow: Stream, streams: dict[Sensor, Stream], course: Course) -> NDArray[np.complex128]:
    """The flow's velocity over level earth, were its columns to be read so; spikes held down, smoothed."""
    t_s, value = course.flow_t_s, flow.value
    first, second = np.array(reading, float) @ value[:, :2].T
    if flow.sensor == Sensor.FLOW_RATE:
        range_m = np.interp(t_s, *_ranges(streams))
        first, second = velocity_from_flow(first - value[:, 2], second - value[:, 3], range_m)
    rotation = rotation_from_quaternion(*attitude_at(streams[Sensor.ATTITUDE], t_s).T)
    third = -(rotation[6] * first + rotation[7] * second) / rotation[8]
    north = rotation[0] * first + rotation[1] * second + rotation[2] * third
    east = rotation[3] * first + rotation[4] * second + rotation[5] * third
    fastest = FASTEST_RATIO * float(np.quantile(abs(course.gps), 0.95))
    held = np.minimum(1.0, fastest / np.maximum(np.hypot(north, east), 1e-9))
    north_east = np.column_stack([north * held, east * held])
    smooth = mean_over(t_s, north_east, t_s - 0.5 * SMOOTHING_S, t_s + 0.5 * SMOOTHING_S)
    return np.asarray(smooth[:, 0] + 1j * smooth[:, 1])


def _rotation_noise(flow: Stream) -> dict[Matrix, float]:
    """The sample-to-sample noise that each reading of the axes leaves when rotation is removed; all alike for a
    velocity.
    """
    if flow.sensor != Sensor.FLOW_RATE:
        return dict.fromkeys(READINGS, 1.0)
    squares = {}
    for reading in READINGS:
        left = flow.value[:, :2] @ np.array(reading, float).T - flow.value[:, 2:4]
        squares[reading] = np.sum((left[2:] - 2.0 * left[1:-1] + left[:-2]) ** 2, axis=1)
    limit = np.quantile(np.concatenate(list(squares.values())), 0.95)  # spikes weigh no more than this
    return {reading: float(np.sqrt(np.mean(np.minimum(square, limit)))) for reading, square in squares.items()}


# -- climb -------------------------------------------------------------------------------------------------
def _of_climb(streams: dict[Sensor, Stream], gps_streams: dict[Sensor, Stream]) -> list[Finding]:
    """GPS vertical velocity against the rate of GPS altitude, and of the range."""
    if len(gps_streams) < 2:
        return []
    position, velocity = gps_streams[Sensor.GPS_POSITION], gps_streams[Sensor.GPS_VELOCITY]
    known = np.isfinite(velocity.value[:, 2])
    if np.count_nonzero(known) < LEAST_PAIRS:
        return []
    t_s, down = velocity.t_s[known], velocity.value[known, 2:]
    edges = np.arange(t_s[0], t_s[-1], CLIMB_INTERVAL_S)
    start, end = edges[:-1], edges[1:]
    covered = _near(t_s, 0.5 * (start + end))
    start, end = start[covered], end[covered]
    if len(start) < LEAST_PAIRS:
        return []
    stated = mean_over(t_s, down, start, end)[:, 0]
    height = [(position.t_s, position.value[:, 2])]
    instants, range_m = _ranges(streams)
    if len(instants) > 1:
        height.append((instants + velocity.delay_s, -range_m))
    signs = [_likeness_of_rates(stated, (np.interp(end, *to) - np.interp(start, *to))) for to in height]
    if min(signs) <= -SIGNIFICANT_SIGMAS and max(signs) < 0.0:
        return [Finding("vel_d of GPS has the wrong sign: it runs against the GPS altitude; down is positive")]
    return []


def _likeness_of_rates(stated: Array, moved: Array) -> float:
    """Correlation in standard errors; 0 where it is small or nothing moves."""
    if not (np.ptp(stated) > 0 and np.ptp(moved) > 0):
        return 0.0
    likeness = float(np.clip(np.corrcoef(stated, moved)[0, 1], -0.999, 0.999))
    if abs(likeness) < LEAST_CLIMB_LIKENESS:
        return 0.0
    return likeness * float(np.sqrt((len(stated) - 2) / (1.0 - likeness**2)))


def _kept(stream: Stream, gps_outages_s: Iterable[tuple[float, float]]) -> Stream:
    """The stream without the readings that a GPS cut takes away, and those of quality 0."""
    good = stream.quality > 0
    for t0, t1 in gps_outages_s:
        good &= (stream.t_s < t0) | (stream.t_s >= t1)
    return Stream.of(stream.sensor, stream.t_s[good], stream.value[good], delay_s=stream.delay_s)
