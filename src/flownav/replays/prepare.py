"""From a log's streams to the event queue that the filter is fed: delays, flow's gyro and scale, GPS cuts.

Nothing here looks ahead of the instant a reading arrives, but for one decision a log: which gyro takes the
rotation out of the flow.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flownav.core.compile import kernel
from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array, EventQueue, Sensor, Stream, merge, merged_parts
from flownav.logs.log import Log, attitude_rates, mean_over
from flownav.navigation.feed import imu_serves
from flownav.navigation.kernel_settings import NO_STATED_NOISE, FlowNoise
from flownav.navigation.spikes import Witness
from flownav.sensors.datasheet import IdentifiedFlow, in_vehicle_axes

GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
FLOW = (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)
GYRO_BIAS_TIME_S = 10.0  # as PX4's EKF2 follows it at 10 Hz: 1 % a reading
LONGEST_FLOW_INTERVAL = 1.5  # medians: a longer step is a gap, not an exposure; chosen
OWN, IMU, TURNING = "sensor gyro", "imu gyro", "attitude"
SIGNIFICANT_SIGMAS = 3.0  # standard errors, one in 700 by chance: else the sensor's own gyro serves
LEAST_FLOW_ROWS = 50  # chosen: 5 s of a PX4FLOW at 9.5 Hz
KEPT_QUEUE = 1 << 20  # events of a queue that is kept for the next run: 150 MB
MERGED_EVENTS = 1 << 17  # events that are merged at a time where there are more
SCALE_LIMITS = (0.1, 10.0)  # chosen: recorded scales are 0.7 to 1 (../shared/data/README.md)
# PX4 writes it once a second, ArduPilot when it changes: not repeated, a vehicle that stands with its motors running
# wanders more than 20 m in a minute, and less than 3 as it is (test_landed)
HELD_S = 0.5


@dataclass(frozen=True)
class ReplayOptions:
    """The user's options of a replay."""

    gps_delay_s: float = 0.22  # ArduPilot's default lag of a u-blox
    gps_outages_s: tuple[tuple[float, float], ...] = ()
    use_flow: bool = True
    flow_scale: tuple[float, float] = (1.0, 1.0)
    identified: IdentifiedFlow | None = None  # from a sensor file: its axes and latency (the navigator has the gains)
    flow_noise: FlowNoise = NO_STATED_NOISE  # and its law of noise, where that is to be used
    flow_outages_s: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Prepared:
    """The streams as they are fed, and what was decided on the way (notes).

    FLOW_RATE has two columns more, the vehicle's IMU over each exposure; `flow_gyro_is_imu`: they serve best.
    """

    streams: dict[Sensor, Stream]
    notes: tuple[str, ...]
    flow_gyro_is_imu: bool = False

    @cached_property
    def queue(self) -> EventQueue:
        """The readings of all streams in one order, with nothing cut."""
        return merge(self.streams.values())

    def parts(self) -> Iterator[EventQueue]:
        """The queue in parts, which are not kept where there are many."""
        if sum(map(len, self.streams.values())) <= KEPT_QUEUE:
            yield self.queue
        else:
            yield from merged_parts(self.streams.values(), MERGED_EVENTS)

    @property
    def span_s(self) -> tuple[float, float]:
        """The first and the last instant that a reading describes [s]."""
        spoken = [stream for stream in self.streams.values() if len(stream)]
        first = min(float(stream.t_s[0] - stream.delay_s) for stream in spoken)
        return first, max(float(stream.t_s[-1] - stream.delay_s) for stream in spoken)

    @property
    def delays_s(self) -> dict[Sensor, float]:
        """Each stream's delay."""
        return {sensor: stream.delay_s for sensor, stream in self.streams.items()}


def prepare(log: Log, options: ReplayOptions) -> Prepared:
    """Delay, scale and complete the streams. InputError where an option cannot be."""
    _check(log, options)
    streams, notes, chosen = dict(log.streams), list(log.notes), Chosen(OWN, "")
    for sensor in GPS:
        if sensor in streams:
            streams[sensor] = replace(streams[sensor], delay_s=options.gps_delay_s)
    for sensor in FLOW:
        if sensor in streams:
            if options.identified is not None:
                streams[sensor] = put_right(streams[sensor], options.identified)
            streams[sensor] = _exposed(_scaled(streams[sensor], options.flow_scale))
    if Sensor.LANDED in streams:
        streams[Sensor.LANDED] = held(streams[Sensor.LANDED], log.span_s[1])
    if Sensor.FLOW_RATE in streams:
        streams[Sensor.FLOW_RATE], chosen = _with_gyro(streams[Sensor.FLOW_RATE], streams)
        notes.append(chosen.note)
    if options.identified is not None:
        for sensor in FLOW:
            if sensor in streams:
                streams[sensor] = replace(streams[sensor], delay_s=options.identified.latency_s)
    return Prepared(streams, tuple(notes), chosen.name == IMU)


def withhold(log: Log, queue: EventQueue, options: ReplayOptions) -> EventQueue:
    """The queue with what the options take away marked: GPS and flow that arrive in [t0, t1) of an outage, and flow.

    A flow reading of no data is none that could be withheld.
    """
    withheld = queue.withheld.copy()
    for sensors, outages in ((GPS, options.gps_outages_s), (FLOW, options.flow_outages_s)):
        for sensor in sensors:
            if outages and sensor in log.streams:
                rows = np.flatnonzero((queue.sensor == sensor) & ((queue.quality > 0.0) | (sensors == GPS)))
                arrival = log.streams[sensor].t_s[queue.row[rows]]
                for t0, t1 in outages:
                    withheld[rows[(arrival >= t0) & (arrival < t1)]] = 1.0
    if not options.use_flow:
        withheld[np.isin(queue.sensor, [int(sensor) for sensor in FLOW])] = 1.0
    return queue._replace(withheld=withheld)


def _check(log: Log, options: ReplayOptions) -> None:
    if not 0.0 <= options.gps_delay_s <= 5.0:
        raise InputError(f"{arg('gps_delay_s')} {options.gps_delay_s:g}: seconds from 0 to 5 are needed")
    if not all(SCALE_LIMITS[0] <= scale <= SCALE_LIMITS[1] for scale in options.flow_scale):
        raise InputError(
            f"{arg('flow_scale')} {options.flow_scale[0]:g},{options.flow_scale[1]:g}: factors from "
            f"{SCALE_LIMITS[0]:g} to {SCALE_LIMITS[1]:g} are needed; a wrong sign belongs mended in the log"
        )
    check_windows(log, options.gps_outages_s, arg("gps_outages"))


def check_windows(log: Log, windows: Iterable[tuple[float, float]], option: str) -> None:
    """InputError where a GPS cut cannot be made in a log; `option` asked for it."""
    start, end = log.span_s
    for t0, t1 in windows:
        if Sensor.GPS_POSITION not in log.streams:
            raise InputError(f"{option}: {log.path} has no GPS to cut")
        if not t0 < t1:
            raise InputError(f"{option} {t0:g}:{t1:g}: the end must come after the start")
        if t1 <= start or t0 >= end:
            raise InputError(
                f"{option}: {t0:g} to {t1:g} s is outside the log, which covers {start:.1f} to {end:.1f} s"
            )


# -- on the ground -----------------------------------------------------------------------------------------
def held(landed: Stream, end_s: float) -> Stream:
    """Landed is a state until take-off: of a log with the change alone it is repeated every HELD_S, up to its end.

    Without it a vehicle that stands with its motors running, and has neither GPS nor flow there, runs away.
    """
    until = np.append(landed.t_s[1:], end_s)
    on_ground = landed.value[:, 0] > 0.5
    more = np.where(on_ground, np.maximum(np.ceil((until - landed.t_s) / HELD_S - 1.5), 0.0), 0.0).astype(int)
    rows = np.repeat(np.arange(len(landed)), more + 1)
    count = np.arange(len(rows)) - np.repeat(np.cumsum(more + 1) - (more + 1), more + 1)
    return replace(
        landed,
        t_s=landed.t_s[rows] + HELD_S * count,
        value=landed.value[rows],
        variance=landed.variance[rows],
        quality=landed.quality[rows],
    )


# -- flow --------------------------------------------------------------------------------------------------
def _exposed(stream: Stream) -> Stream:
    """A flow reading is a mean since the last one: it describes the middle of that time."""
    return replace(stream, delay_s=0.5 * _period(stream.t_s))


def _period(t_s: Array) -> float:
    """The usual time between readings [s]; that of a 10 Hz sensor where there are not two."""
    steps = np.diff(t_s)
    return float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.1


def _scaled(stream: Stream, scale: tuple[float, float]) -> Stream:
    """Factors on the first two values: flow_x and flow_y before the gyro is taken off, or velocity u and v."""
    value = stream.value.copy()
    value[:, :2] *= scale
    return replace(stream, value=value)


def put_right(stream: Stream, identified: IdentifiedFlow) -> Stream:
    """The stream in the vehicle's axes: for a sensor that is turned or wired otherwise, by its file."""
    angular = stream.sensor == Sensor.FLOW_RATE
    return replace(stream, value=in_vehicle_axes(stream.value, identified, angular=angular))


class Chosen(NamedTuple):
    """The gyro that takes the rotation out of the flow, and a note of why."""

    name: str
    note: str


def _with_gyro(flow: Stream, streams: dict[Sensor, Stream]) -> tuple[Stream, Chosen]:
    """The flow with the rates that serve best in its gyro columns and the IMU's after them, and what was chosen.

    Candidates are the sensor's own gyro, the vehicle's IMU (both with their bias followed against the attitude)
    and the attitude's own turning. A vehicle has mass, so its velocity is smooth: the gyro that leaves the least
    sample-to-sample noise in the compensated flow has seen the same rotation as the flow did. The sensor's own
    stays unless another is significantly better, or it is absent or dead.
    """
    seen = _imu_over(flow, streams, _exposure(flow)) if imu_serves(streams) else None
    candidates = _gyro_candidates(flow, streams, seen)
    roughness = {name: _roughness(flow, rates) for name, rates in candidates.items()}
    limit = np.quantile(np.concatenate([*roughness.values(), [0.0]]), 0.95)  # spikes weigh no more than this
    roughness = {name: np.minimum(squares, limit) for name, squares in roughness.items()}
    noises = {name: float(np.sqrt(squares.mean())) for name, squares in roughness.items() if len(squares)}
    best = min(noises, key=lambda name: noises[name], default=min(candidates))
    chosen = best if _significant(roughness.get(OWN), roughness[best]) else OWN
    imu = np.full((len(flow), 2), np.nan) if seen is None else seen
    value = np.column_stack([flow.value[:, :2], candidates[chosen], imu])
    listed = ", ".join(f"{name} {noise:.4f}" for name, noise in sorted(noises.items()))
    note = f"flow is compensated with the {chosen} (noise left, rad/s: {listed})"
    return replace(flow, value=value), Chosen(chosen, note)


def _exposure(flow: Stream) -> Array:
    """How long each reading looked [s]."""
    period = _period(flow.t_s)
    steps = np.concatenate([[period], np.diff(flow.t_s)])
    return np.asarray(np.clip(steps, 0.2 * period, LONGEST_FLOW_INTERVAL * period))


def _imu_over(flow: Stream, streams: dict[Sensor, Stream], exposure_s: Array) -> Array:
    """Mean rates of the vehicle's IMU about x and y over each exposure, (n, 2) [rad/s]."""
    imu = streams[Sensor.IMU]
    kept = Witness().keeps(np.column_stack([imu.t_s, imu.value]))
    return mean_over(imu.t_s[kept], imu.value[kept, :2], flow.t_s - exposure_s, flow.t_s)


def _gyro_candidates(flow: Stream, streams: dict[Sensor, Stream], by_imu: Array | None) -> dict[str, Array]:
    """Mean rates about x and y over each flow reading's exposure, by source; never none at all.

    by_imu: those of the vehicle's IMU, where it serves.
    """
    exposure_s = _exposure(flow)
    candidates: dict[str, Array] = {}
    turning = None
    if Sensor.ATTITUDE in streams:
        turning = attitude_rates(streams[Sensor.ATTITUDE], flow.t_s - exposure_s, flow.t_s)[:, :2]
    if turning is not None and by_imu is None:
        candidates[TURNING] = turning
    if by_imu is not None:
        candidates[IMU] = by_imu if turning is None else by_imu - _followed(flow, by_imu - turning)
    own = flow.value[:, 2:4]
    known = np.asarray(np.isfinite(own).all(axis=1))
    if not candidates or (known.mean() > 0.5 and np.all(np.ptp(own[known], axis=0))):
        spare = next(iter(candidates.values()), np.zeros_like(own))
        filled = np.where(known[:, None], own, spare)
        candidates[OWN] = filled if turning is None else filled - _followed(flow, filled - turning)
    return candidates


def _followed(flow: Stream, difference: Array) -> Array:
    """A first-order low-pass of a gyro's difference from the attitude's rates: its bias, as known at each instant.

    A reading of no data (quality 0) may hold zeros for its gyro too, and is left out.
    """
    good = flow.quality != 0.0
    gain = 1.0 - np.exp(-np.diff(flow.t_s, prepend=flow.t_s[0]) / GYRO_BIAS_TIME_S)
    gain = np.maximum(gain, 1.0 / np.maximum(np.cumsum(good), 1))
    followed = np.empty_like(difference)
    _low_pass(difference, np.where(good, gain, 0.0), followed)
    return followed


@kernel
def _low_pass(value: Array, gain: Array, followed: Array) -> None:
    """y += gain (value - y), column by column; value and result (n, k), gain (n,)."""
    for column in range(value.shape[1]):
        state = 0.0
        for row in range(value.shape[0]):
            state += gain[row] * (value[row, column] - state)
            followed[row, column] = state


def _roughness(flow: Stream, rates: Array) -> Array:
    """Squared noise of the compensated flow [rad2/s2], reading by reading (second differences); may be empty."""
    good = (flow.quality > 0) & np.isfinite(flow.value[:, :2]).all(axis=1)
    if np.count_nonzero(good) < LEAST_FLOW_ROWS:
        return np.zeros(0)
    compensated = flow.value[good, :2] - rates[good]
    second = compensated[2:] - 2.0 * compensated[1:-1] + compensated[:-2]
    return np.asarray(np.mean(second**2, axis=1) / 6.0)


def _significant(own: Array | None, other: Array) -> bool:
    """Whether another gyro leaves less noise than the sensor's own, beyond chance (neighbours share readings)."""
    if own is None:
        return True
    gain = own - other
    return len(gain) > 0 and bool(gain.mean() > SIGNIFICANT_SIGMAS * gain.std() / np.sqrt(len(gain) / 3.0))
