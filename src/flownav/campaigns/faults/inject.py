"""Sensor faults: streams with a fault in them, and the order in which a navigator is fed with them.

A receiver holds what arrives until a horizon has passed the instant that it describes, and feeds in the order of those
instants. A reading that comes after its turn is fed at once, for the navigator to refuse; one that is stamped ahead of
the receiver's own clock has not been measured yet, and is not fed.

An injector takes a stream and a `Strike`, which names the readings that it may change. Readings outside stay as they
are, value for value. Rows of a stream stand in the order of arrival, so after an injector that reorders rows or moves
time stamps `t_s` no longer increases: that is the fault.
"""

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flownav.core.measurement import Array, EventQueue, Sensor, Stream, merge

WAIT_S = 0.1  # beyond the largest delay
CLOCKS_DIFFER_S = 0.1


@dataclass(frozen=True)
class Restamped(Stream):
    """A stream whose time stamps are not when its readings arrived: that is arrival_s (n,)."""

    arrival_s: Array = field(default_factory=lambda: np.zeros(0))


def arrival_of(stream: Stream) -> Array:
    """When each reading arrived (n,): at its time stamp, but not before those that stand ahead of it."""
    return stream.arrival_s if isinstance(stream, Restamped) else np.maximum.accumulate(stream.t_s)


def stamped_ahead(stream: Stream) -> NDArray[np.bool_]:
    """The readings (n,) whose time stamps lie ahead of the receiver's clock."""
    return np.asarray(stream.t_s > arrival_of(stream) + CLOCKS_DIFFER_S)


def as_fed(streams: Mapping[Sensor, Stream]) -> EventQueue:
    """The events of all streams in the order in which a receiver feeds them, without those stamped ahead.

    A reading's turn comes when the horizon, the largest delay and WAIT_S, has passed its instant, or when it arrives.
    """
    queue = merge(streams.values())
    if not len(queue.t_s):
        return queue
    horizon_s = max(stream.delay_s for stream in streams.values()) + WAIT_S
    arrival, ahead = np.zeros(len(queue.t_s)), np.zeros(len(queue.t_s), bool)
    for sensor, stream in streams.items():
        here = queue.sensor == sensor
        arrival[here] = arrival_of(stream)[queue.row[here]]
        ahead[here] = stamped_ahead(stream)[queue.row[here]]
    turn = np.maximum(arrival, queue.t_s + horizon_s)
    order = np.lexsort((queue.t_s, turn))
    kept = order[~ahead[order]]
    columns: dict[str, Any] = {name: column[kept] for name, column in queue._asdict().items()}
    return EventQueue(**columns)


# -- injectors ---------------------------------------------------------------------------------------------------
FLOW_COLUMNS = slice(0, 2)  # the two channels, as rates and as velocities
ACCEL_COLUMNS = slice(3, 6)


@dataclass(frozen=True)
class Strike:
    """Where a fault strikes a stream.

    inside (n,): the readings it may touch, those that arrive in [t0_s, t1_s). rng: this fault's own draws for this
    sensor. streams: the whole log without the fault.
    """

    inside: NDArray[np.bool_]
    t0_s: float
    rng: np.random.Generator
    streams: Mapping[Sensor, Stream]


Injector = Callable[[Stream, Strike], Stream]


def struck(
    streams: Mapping[Sensor, Stream],
    injector: Injector,
    sensors: tuple[Sensor, ...],
    window_s: tuple[float, float],
    name: str,
    seed: int,
) -> dict[Sensor, Stream]:
    """The streams with a fault in those of `sensors`, over readings that arrive in [t0, t1); the others untouched.

    Draws depend on seed, name of the fault and sensor alone.
    """
    t0_s, t1_s = window_s

    def strike(stream: Stream) -> Stream:
        inside = (stream.t_s >= t0_s) & (stream.t_s < t1_s)
        if not inside.any():
            return stream
        rng = np.random.default_rng([seed, zlib.crc32(name.encode()), int(stream.sensor)])
        return injector(stream, Strike(inside, t0_s, rng, streams))

    return {sensor: strike(stream) if sensor in sensors else stream for sensor, stream in streams.items()}


# -- readings that do not come, or not as they should ------------------------------------------------------
def lost(stream: Stream, strike: Strike) -> Stream:
    """No readings."""
    return _rows(stream, np.flatnonzero(~strike.inside))


def doubled(stream: Stream, strike: Strike) -> Stream:
    """Every reading arrives twice."""
    return _rows(stream, np.repeat(np.arange(len(stream)), 1 + strike.inside.astype(int)))


def reversed_in_blocks(readings: int) -> Injector:
    """Each block of `readings` readings arrives last first, each with its own time stamp."""

    def inject(stream: Stream, strike: Strike) -> Stream:
        rows = np.flatnonzero(strike.inside)
        order = np.arange(len(stream))
        for first in range(0, len(rows), readings):
            block = rows[first : first + readings]
            order[block] = block[::-1]
        return _rows(stream, order)

    return inject


def restamped(jump_s: float) -> Injector:
    """The clock is off: every time stamp is moved by so much; readings arrive when they always did."""

    def inject(stream: Stream, strike: Strike) -> Stream:
        stamps = np.where(strike.inside, stream.t_s + jump_s, stream.t_s)
        return Restamped(**vars(stream) | {"t_s": stamps}, arrival_s=stream.t_s)

    return inject


def late(delay_s: float) -> Injector:
    """Each reading has the content of `delay_s` earlier; its arrival time and the delay it states stay."""

    def inject(stream: Stream, strike: Strike) -> Stream:
        rows = np.arange(len(stream))
        earlier = np.searchsorted(stream.t_s, stream.t_s - delay_s, side="right") - 1
        return replace(_rows(stream, np.where(strike.inside, np.maximum(earlier, 0), rows)), t_s=stream.t_s)

    return inject


def not_a_number(burst_s: float, every_s: float) -> Injector:
    """Every value is NaN in bursts, the first at the first reading."""

    def inject(stream: Stream, strike: Strike) -> Stream:
        since_s = stream.t_s - stream.t_s[strike.inside][0]
        in_burst = strike.inside & (np.mod(since_s, every_s) < burst_s)
        return replace(stream, value=np.where(in_burst[:, None], np.nan, stream.value))

    return inject


# -- GPS ---------------------------------------------------------------------------------------------------
def displaced(offset_m: float, rate_m_s: float) -> Injector:
    """Horizontally, in a direction drawn by the seed: at once by an offset, and on at a rate since the start."""

    def inject(stream: Stream, strike: Strike) -> Stream:
        course = strike.rng.uniform(0.0, 2.0 * np.pi)
        away_m = offset_m + rate_m_s * (stream.t_s - strike.t0_s)
        moved = stream.value.copy()
        moved[:, 0] += away_m * np.cos(course)
        moved[:, 1] += away_m * np.sin(course)
        return _inside(stream, strike, moved)

    return inject


# -- flow --------------------------------------------------------------------------------------------------
def flow_through(matrix: ArrayLike) -> Injector:
    """Both flow channels through a 2x2 matrix: signs, axes, scale. A flow sensor's own gyro stays right."""
    through = np.asarray(matrix, float)

    def inject(stream: Stream, strike: Strike) -> Stream:
        read = stream.value.copy()
        read[:, FLOW_COLUMNS] = stream.value[:, FLOW_COLUMNS] @ through.T
        return _inside(stream, strike, read)

    return inject


def garbage(largest: float) -> Injector:
    """Both flow channels are drawn anew each reading, evenly up to `largest` [rad/s or m/s], at full quality."""

    def inject(stream: Stream, strike: Strike) -> Stream:
        read = stream.value.copy()
        read[:, FLOW_COLUMNS] = strike.rng.uniform(-largest, largest, (len(stream), 2))
        return _inside(stream, strike, read, quality=255.0)

    return inject


def low_texture(share: float, noise_rad_s: float, quality: float) -> Injector:
    """The output of block matching over low texture: a share of the flow, noise, and some quality.

    noise_rad_s: of each reading; a velocity has it times the last range, or times a metre without one.
    """

    def inject(stream: Stream, strike: Strike) -> Stream:
        noise = noise_rad_s * strike.rng.standard_normal((len(stream), 2))
        if stream.sensor == Sensor.FLOW_VELOCITY:
            noise *= _range_at(strike.streams, stream.t_s)[:, None]
        read = stream.value.copy()
        read[:, FLOW_COLUMNS] = share * stream.value[:, FLOW_COLUMNS] + noise
        return _inside(stream, strike, read, quality=quality)

    return inject


def _range_at(streams: Mapping[Sensor, Stream], t_s: Array) -> Array:
    """The last range before each instant [m]; 1 where there is none."""
    ranges = streams.get(Sensor.RANGE)
    if ranges is None or not len(ranges):
        return np.ones(len(t_s))
    row = np.searchsorted(ranges.t_s, t_s, side="right") - 1
    return np.asarray(np.where(row >= 0, ranges.value[np.maximum(row, 0), 0], 1.0))


# -- range -------------------------------------------------------------------------------------------------
def stuck(stream: Stream, strike: Strike) -> Stream:
    """Every reading repeats the last one before the fault."""
    first = int(np.argmax(strike.inside))
    held = np.broadcast_to(stream.value[max(first - 1, 0)], stream.value.shape)
    return _inside(stream, strike, held)


def always(value: float) -> Injector:
    """Every reading is this."""

    def inject(stream: Stream, strike: Strike) -> Stream:
        return _inside(stream, strike, np.full_like(stream.value, value))

    return inject


def spikes(probability: float, low: float, high: float) -> Injector:
    """Some readings, by chance, are drawn anew, evenly between two values."""

    def inject(stream: Stream, strike: Strike) -> Stream:
        hit = strike.rng.random(len(stream)) < probability
        drawn = strike.rng.uniform(low, high, stream.value.shape)
        return _inside(stream, strike, np.where(hit[:, None], drawn, stream.value))

    return inject


# -- IMU ---------------------------------------------------------------------------------------------------
def biased(rate_rad_s: ArrayLike, accel_m_s2: ArrayLike) -> Injector:
    """Constant errors of gyro and accelerometer, body FRD."""
    bias = np.concatenate([np.asarray(rate_rad_s, float), np.asarray(accel_m_s2, float)])

    def inject(stream: Stream, strike: Strike) -> Stream:
        return _inside(stream, strike, stream.value + bias)

    return inject


def rectified(bias_m_s2: float, noise_m_s2: float) -> Injector:
    """Vibration beyond the accelerometer's range: noise on its three axes, and a bias along body down."""

    def inject(stream: Stream, strike: Strike) -> Stream:
        shaken = stream.value.copy()
        shaken[:, ACCEL_COLUMNS] += noise_m_s2 * strike.rng.standard_normal((len(stream), 3))
        shaken[:, ACCEL_COLUMNS.stop - 1] += bias_m_s2
        return _inside(stream, strike, shaken)

    return inject


# -- parts -------------------------------------------------------------------------------------------------
def _rows(stream: Stream, rows: NDArray[np.intp]) -> Stream:
    return replace(
        stream,
        t_s=stream.t_s[rows],
        value=stream.value[rows],
        variance=stream.variance[rows],
        quality=stream.quality[rows],
    )


def _inside(stream: Stream, strike: Strike, value: Array, quality: float | None = None) -> Stream:
    """The stream with these values, and this quality, where the fault strikes."""
    read = np.where(strike.inside[:, None], value, stream.value)
    stated = stream.quality if quality is None else np.where(strike.inside, quality, stream.quality)
    return replace(stream, value=read, quality=stated)
