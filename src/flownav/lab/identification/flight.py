"""A flight log for identification: usable flow, a range to go by, a reference track, the motion between.

A range is not believed where it sticks to its floor or stands far from the median of those around. What is left may
still jump: a sonar whose echo comes now from the ground, now from something else. Its doubt, the share of steps that
jump times their usual size over the range, is an error of every gain that the log shows, and no length of log takes it
out.

The sensor's velocity along body x and y comes from angular rates times range (`prepare` takes the rotation out), or as
the sensor reports it, in flight only. The reference is the log's truth (or visual odometry), GPS without one. The IMU's
earth acceleration ties both to the vehicle's clock: it gives the flow's latency as an autopilot needs it, and shows
swapped or inverted axes even where the reference's heading is unknown.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError, arg
from flownav.core.frames import GRAVITY_M_S2 as GRAVITY_M_S2
from flownav.core.frames import rotation_from_quaternion, velocity_from_flow
from flownav.core.measurement import Array, Sensor, Stream
from flownav.lab.identification.range_truth import untrue
from flownav.logs.log import Log, attitude_at
from flownav.replays.bundle import turned_sensor, with_attitude
from flownav.replays.judged import flying_at
from flownav.replays.prepare import ReplayOptions, prepare

FLOOR_SHARE = 0.01  # of the readings at the lowest range: a rangefinder stuck at its floor
FLOOR_MARGIN = 1.03
SPIKE_WINDOW, SPIKE_SHARE, SPIKE_M = 51, 0.3, 0.1
JUMP_M, JUMP_SHARE = 0.3, 0.1  # from a reading to the next: no vehicle climbs so fast
FAST_M_S = 5.0
LEAST_STEPS = 50
STALE_S = 0.5

Flags = NDArray[np.bool_]


class Ranges(NamedTuple):
    """Believed ranges: t_s (n,), range_m (n,); jumping: share of steps in flight that jump; doubt: relative error."""

    t_s: Array
    range_m: Array
    jumping: float
    doubt: float


def believed(where: str, distance: Stream, flying: Flags) -> Ranges:
    """The ranges to go by; flying (n,) of its readings. InputError where hardly any is left."""
    t_s, range_m = distance.t_s - distance.delay_s, distance.value[:, 0]
    aloft = flying & (range_m > 0.0)
    jumping, doubt = jumps(t_s[aloft], range_m[aloft])
    good = aloft & (range_m > _floor(range_m))
    if np.count_nonzero(good) < LEAST_STEPS:
        raise InputError(
            f"{where}: {np.count_nonzero(good)} of {len(range_m)} ranges are in flight and above the rangefinder's "
            f"floor; at least {LEAST_STEPS} are needed for the flow's scale and height"
        )
    t_s, range_m = t_s[good], range_m[good]
    kept = ~spikes(range_m)
    return Ranges(t_s[kept], range_m[kept], jumping, doubt)


def jumps(t_s: Array, range_m: Array) -> tuple[float, float]:
    """Share of steps that jump, and the error that they make: that share times the middle jump over the range."""
    if len(range_m) < LEAST_STEPS:
        return 0.0, 0.0
    step, lower = np.abs(np.diff(range_m)), np.minimum(range_m[1:], range_m[:-1])
    jump = step > JUMP_M + JUMP_SHARE * lower + FAST_M_S * np.minimum(np.diff(t_s), STALE_S)
    if not jump.any():
        return 0.0, 0.0
    share = float(jump.mean())
    return share, share * min(1.0, float(np.median(step[jump])) / float(np.median(range_m)))


def beside(ranges: Ranges, t_s: Array) -> tuple[Array, Flags]:
    """The range at instants (n,) by straight lines between believed ones, and where one is near."""
    after = np.clip(np.searchsorted(ranges.t_s, t_s), 1, len(ranges.t_s) - 1)
    away = np.minimum(np.abs(t_s - ranges.t_s[after - 1]), np.abs(ranges.t_s[after] - t_s))
    return np.interp(t_s, ranges.t_s, ranges.range_m), np.asarray(away <= STALE_S)


def spikes(range_m: Array) -> Flags:
    """Readings whose range is far from the median of those around: a sonar's echo of something else."""
    width = min(SPIKE_WINDOW, len(range_m) - 1 + len(range_m) % 2)
    padded = np.pad(range_m, width // 2, mode="reflect")
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    return np.asarray(np.abs(range_m - median) > SPIKE_SHARE * median + SPIKE_M)


def _floor(range_m: Array) -> float:
    """The range that counts as too near: just above the lowest one, where many readings stick to it."""
    lowest = float(np.min(range_m))
    stuck = np.mean(range_m <= lowest + 0.005) > FLOOR_SHARE
    return lowest * FLOOR_MARGIN + 0.005 if stuck else 0.0


# -- the flight --------------------------------------------------------------------------------------------------
MOST_JUMPING = 0.6
LEAST_FLOW = 200
LONGEST_GAP_S = 0.5
REFERENCES = ("truth", "gps")
IMU_NAME = "the IMU"


@dataclass(frozen=True)
class Flight:
    """A flight's data for identification.

    t_s (n,) arrival of each flow reading, velocity_m_s (n, 2) along body x and y, age_s the age of a reading on arrival
    by the log (half its exposure), quality (n,), range_m (n,), good (n,) usable readings; reference_t_s (m,),
    reference_m (m, 3) north, east, down of a frame that may be turned, reference ("truth" or "gps") and its own
    velocity where it has one; imu None without one; range_jumping, range_doubt as `usable.Ranges`.
    """

    name: str
    t_s: Array
    velocity_m_s: Array
    age_s: float
    quality: Array
    range_m: Array
    good: NDArray[np.bool_]
    attitude: Stream
    imu: Stream | None
    reference: str
    reference_t_s: Array
    reference_m: Array
    reference_velocity: Stream | None
    flow_limit_rad_s: float
    notes: tuple[str, ...]
    reference_name: str = ""  # in words
    range_jumping: float = 0.0
    range_doubt: float = 0.0
    attitude_is_own: bool = False  # the navigator's, for want of one in the log

    def rotation(self, instants_s: Array) -> Array:
        """Body to earth, (n, 3, 3)."""
        rows = rotation_from_quaternion(*attitude_at(self.attitude, instants_s).T)
        return np.stack(rows, axis=1).reshape(-1, 3, 3)

    def segments(self) -> list[slice]:
        """Stretches of readings without a gap; readings that are not good are left out before."""
        t_s = self.t_s[self.good]
        cuts = np.flatnonzero(np.diff(t_s) > max(LONGEST_GAP_S, 5.0 * float(np.median(np.diff(t_s))))) + 1
        edges = [0, *cuts.tolist(), len(t_s)]
        return [slice(a, b) for a, b in pairwise(edges)]


def flight(log: Log, reference: str = "auto", axes: Array | None = None) -> Flight:
    """A flight out of a log; axes as `with_attitude`. InputError names what is missing: flow, range, a reference."""
    sensor = next((s for s in (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY) if s in log.streams), None)
    if sensor is None:
        raise InputError(f"{log.path}: no flow readings; a log with a flow sensor's is needed to identify it")
    if Sensor.RANGE not in log.streams:
        raise InputError(f"{log.path}: no range readings; a range is needed for the flow's scale and height")
    chosen, reference_t_s, reference_m = _reference(log, reference)
    name = {"truth": log.truth_name, "gps": "GPS", "imu": IMU_NAME}[chosen]
    log, found = with_attitude(log, axes)
    turned = axes is not None and sensor == Sensor.FLOW_RATE and bool(np.isnan(log.streams[sensor].value[:, 2:]).all())
    identified = turned_sensor(log, axes) if axes is not None and turned else None  # another's gyro: right it before
    prepared = prepare(log, ReplayOptions(gps_delay_s=0.0, identified=identified))
    mine = prepared.queue.sensor == sensor
    value, quality = prepared.queue.value[mine], prepared.queue.quality[mine]
    age_s = prepared.delays_s[sensor]
    t_s = prepared.queue.t_s[mine] + age_s
    shared = (t_s >= reference_t_s[0]) & (t_s <= reference_t_s[-1])
    if np.count_nonzero(shared) < LEAST_FLOW:
        raise InputError(
            f"{log.path}: the reference ({name}) covers {reference_t_s[0]:.1f} to {reference_t_s[-1]:.1f} s, where "
            f"{np.count_nonzero(shared)} flow readings lie; at least {LEAST_FLOW} are needed, on one clock"
        )
    ranges, untrue_notes = _ranges(log)
    range_m, near = beside(ranges, t_s - age_s)
    velocity, rate = _velocity_and_rate(sensor, value, range_m)
    velocity = velocity @ axes.T if axes is not None and turned else velocity  # back in the sensor's own axes
    good = shared & (quality > 0) & np.isfinite(velocity).all(axis=1) & near & flying_at(log, t_s - age_s)
    good &= np.any(velocity != 0.0, axis=1) & np.concatenate([[True], np.diff(t_s) > 0.0])
    if np.count_nonzero(good) < LEAST_FLOW:
        raise InputError(
            f"{log.path}: {np.count_nonzero(good)} of {len(good)} flow readings are usable (in flight, quality above "
            f"0, a range near that can be believed, not exactly zero); at least {LEAST_FLOW} are needed"
            + "".join(f"; {line}" for line in untrue_notes)
        )
    if not np.all(np.ptp(velocity[good], axis=0) > 0.0):
        raise InputError(f"{log.path}: the flow is constant; a flight that moves is needed")
    return Flight(
        str(log.path), t_s, velocity, age_s, quality, range_m, good, log.streams[Sensor.ATTITUDE],
        log.streams.get(Sensor.IMU), chosen, reference_t_s, reference_m, _velocity(log) if chosen == "gps" else None,
        float(np.quantile(np.abs(rate[good]), 0.999)),
        tuple(note for note in (*prepared.notes, found, *untrue_notes) if note), name,
        ranges.jumping, ranges.doubt, bool(found),
    )  # fmt: skip


def _ranges(log: Log) -> tuple[Ranges, tuple[str, ...]]:
    """The ranges of the flight to go by, and what is wrong with the others.

    InputError where they jump most of the time, or are hardly any.
    """
    distance = log.streams[Sensor.RANGE]
    flying = flying_at(log, distance.t_s - distance.delay_s)
    wrong = untrue(log, flying)
    aloft = flying & (distance.value[:, 0] > 0.0)
    jumping, _ = jumps(distance.t_s[aloft] - distance.delay_s, distance.value[aloft, 0])
    if jumping > MOST_JUMPING:
        raise InputError(
            f"{log.path}: the range jumps in {jumping:.0%} of its steps in flight; a range that can be believed "
            "is needed for the flow's scale and height"
        )
    try:
        return believed(str(log.path), distance, flying & ~wrong.flags), wrong.notes
    except InputError as error:
        raise InputError("; ".join([str(error), *wrong.notes])) from None


def _velocity_and_rate(sensor: Sensor, value: Array, range_m: Array) -> tuple[Array, Array]:
    """The sensor's velocity along body x and y (n, 2), and the flow that it saw [rad/s]; value as prepared."""
    if sensor == Sensor.FLOW_RATE:
        flow_x, flow_y = (value[:, :2] - value[:, 2:4]).T
        return np.column_stack(velocity_from_flow(flow_x, flow_y, range_m)), value[:, :2]
    return value[:, :2], value[:, :2] / np.maximum(range_m, 0.1)[:, None]


def _reference(log: Log, wanted: str) -> tuple[str, Array, Array]:
    if wanted not in ("auto", "imu", *REFERENCES):
        raise InputError(
            f"{arg('reference')} {wanted}: auto, truth (truth.csv) or gps (gps.csv) are possible for a flight"
        )
    if wanted == "imu" and Sensor.IMU in log.streams:
        t_s = log.streams[Sensor.IMU].t_s
        return "imu", t_s, np.zeros((len(t_s), 3))
    if wanted in ("auto", "truth") and log.truth is not None:
        columns = [np.asarray(log.truth[name], float) for name in ("pos_n_m", "pos_e_m", "pos_d_m")]
        return "truth", np.asarray(log.truth["t_s"], float), np.column_stack(columns)
    if wanted in ("auto", "gps") and Sensor.GPS_POSITION in log.streams:
        stream = log.streams[Sensor.GPS_POSITION]
        return "gps", stream.t_s, stream.value
    missing = {"truth": "truth.csv", "gps": "gps.csv"}.get(wanted, "a reference (truth.csv, gps.csv)")
    raise InputError(f"{log.path}: no reference to identify against; {missing} is needed")


def _velocity(log: Log) -> Stream | None:
    """GPS velocity, where most of its readings have one."""
    stream = log.streams.get(Sensor.GPS_VELOCITY)
    if stream is None:
        return None
    known = np.isfinite(stream.value).all(axis=1)
    return Stream.of(stream.sensor, stream.t_s[known], stream.value[known]) if known.mean() > 0.5 else None
