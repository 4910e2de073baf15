"""How readings are spoilt: one function for each `does` of a list of faults, from streams to streams.

Each takes the sound log (for the truth that moves a sensor, such as height or thrust), its own numbers and a generator
of chance. A reading is struck that arrives in the window.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from flownav.core.measurement import Array, Sensor, Stream
from flownav.logs.log import Log

GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
Streams = dict[Sensor, Stream]


class Case(NamedTuple):
    """The input of a spoiling function: the sound log, chance, and the window [s]."""

    log: Log
    rng: np.random.Generator
    window_s: tuple[float, float]

    def inside(self, stream: Stream) -> Array:
        """Which readings (n,) are struck."""
        return (stream.t_s >= self.window_s[0]) & (stream.t_s < self.window_s[1])

    def truth(self, name: str, t_s: Array) -> Array:
        """A column of the truth at instants (n,)."""
        assert self.log.truth is not None
        return np.interp(t_s, self.log.truth["t_s"], np.asarray(self.log.truth[name], float))

    def height(self, t_s: Array) -> Array:
        """Of the lens over the ground [m], as the first metre of the log has it 0."""
        return np.maximum(-self.truth("pos_d_m", t_s) - 0.1, 0.0)


def spoilt(log: Log, readings: list[dict[str, Any]], seed: int) -> Streams:
    """A log's streams after every entry of a fault's `readings`, in their order."""
    streams = dict(log.streams)
    for number, entry in enumerate(readings):
        own = dict(entry)
        does = WAYS[own.pop("does")]
        window = tuple(own.pop("window_s", (-np.inf, np.inf)))
        does(streams, Case(log, np.random.default_rng([seed, number, 11]), window), **own)
    return streams


def _set(streams: Streams, sensor: Sensor, value: Array, inside: Array, quality: Any = None) -> None:
    one = streams[sensor]
    told = one.quality if quality is None else np.where(inside, quality, one.quality)
    streams[sensor] = replace(one, value=np.where(inside[:, None], value, one.value), quality=np.asarray(told, float))


def _keep(streams: Streams, sensor: Sensor, kept: Array) -> None:
    one = streams[sensor]
    streams[sensor] = replace(
        one, t_s=one.t_s[kept], value=one.value[kept], variance=one.variance[kept], quality=one.quality[kept]
    )


# -- flow --------------------------------------------------------------------------------------------------------
def flow_turned(streams: Streams, case: Case, deg: float, gyro_too: bool = True) -> None:
    """A sensor mounted turned about its boresight, clockwise from above; its own gyro turns with it."""
    one, angle = streams[Sensor.FLOW_RATE], np.radians(deg)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    value = one.value.copy()
    value[:, :2] = one.value[:, :2] @ turn.T
    if gyro_too:
        value[:, 2:4] = one.value[:, 2:4] @ turn.T
    _set(streams, Sensor.FLOW_RATE, value, case.inside(one))


def flow_flipped(streams: Streams, case: Case, x: float = 1.0, y: float = 1.0, gyro_too: bool = False) -> None:
    """A driver with a wrong sign."""
    one = streams[Sensor.FLOW_RATE]
    value = one.value * np.array([x, y, x if gyro_too else 1.0, y if gyro_too else 1.0])
    _set(streams, Sensor.FLOW_RATE, value, case.inside(one))


def flow_swapped(streams: Streams, case: Case, gyro_too: bool = False) -> None:
    """A driver that has the axes the other way round: x is y and y is x, which no turn undoes."""
    one = streams[Sensor.FLOW_RATE]
    _set(streams, Sensor.FLOW_RATE, one.value[:, [1, 0, 3, 2] if gyro_too else [1, 0, 2, 3]], case.inside(one))


def flow_scaled(streams: Streams, case: Case, x: float, y: float) -> None:
    """The flow reads too much or too little; its gyro stays right."""
    one = streams[Sensor.FLOW_RATE]
    _set(streams, Sensor.FLOW_RATE, one.value * np.array([x, y, 1.0, 1.0]), case.inside(one))


def flow_over_time(streams: Streams, case: Case, factor: float) -> None:
    """The angles of flow and gyro are divided by a time that is wrong by a factor."""
    one = streams[Sensor.FLOW_RATE]
    _set(streams, Sensor.FLOW_RATE, one.value / factor, case.inside(one))


def flow_offset(streams: Streams, case: Case, x: float, y: float) -> None:
    """The flow reads so much where nothing moves [rad/s]; its gyro stays right."""
    one = streams[Sensor.FLOW_RATE]
    _set(streams, Sensor.FLOW_RATE, one.value + np.array([x, y, 0.0, 0.0]), case.inside(one))


def flow_late(streams: Streams, case: Case, by_s: float) -> None:
    """Flow and gyro come so much later than ever, stamped on arrival as before."""
    one = streams[Sensor.FLOW_RATE]
    rows = np.maximum(np.searchsorted(one.t_s, one.t_s - by_s, side="right") - 1, 0)
    _set(streams, Sensor.FLOW_RATE, one.value[rows], case.inside(one), one.quality[rows])


def flow_stamped(streams: Streams, case: Case, by_s: float) -> None:
    """The stamps are another clock's: readings bear a time that is so much too late."""
    one = streams[Sensor.FLOW_RATE]
    streams[Sensor.FLOW_RATE] = replace(one, t_s=one.t_s + np.where(case.inside(one), by_s, 0.0))


def flow_drifts(streams: Streams, case: Case, from_s: float, share: float) -> None:
    """The sensor's clock is set right at from_s and runs too fast by a share of the time after."""
    one = streams[Sensor.FLOW_RATE]
    streams[Sensor.FLOW_RATE] = replace(one, t_s=one.t_s + share * np.maximum(one.t_s - from_s, 0.0))


def flow_dark(streams: Streams, case: Case, quality: float, blind_share: float, keeps: float) -> None:
    """Too little light: stretches without data, in between a share of the flow with poor quality."""
    one = streams[Sensor.FLOW_RATE]
    blind = np.repeat(case.rng.random(len(one) // 25 + 1) < blind_share, 25)[: len(one)]
    value = one.value.copy()
    value[:, :2] = keeps * value[:, :2] + 0.15 * case.rng.standard_normal((len(one), 2))
    value[blind, :2] = 0.0
    told = np.where(blind, 0.0, np.clip(quality + 8.0 * case.rng.standard_normal(len(one)), 1.0, 255.0))
    _set(streams, Sensor.FLOW_RATE, value, case.inside(one), told)


def flow_blank(streams: Streams, case: Case, zero_share: float, quality: float) -> None:
    """Frames that report no motion at all although there is some, at a quality that does not say so."""
    one = streams[Sensor.FLOW_RATE]
    zero = case.rng.random(len(one)) < zero_share
    value = one.value.copy()
    value[zero, :2] = 0.0
    _set(
        streams,
        Sensor.FLOW_RATE,
        value,
        case.inside(one),
        np.clip(quality + 5.0 * case.rng.standard_normal(len(one)), 1, 255),
    )


def flow_quality(streams: Streams, case: Case, low: float, high: float) -> None:
    """Flow as ever; the sensor's quality lies between two numbers."""
    one = streams[Sensor.FLOW_RATE]
    told = np.where(one.quality > 0.0, case.rng.uniform(low, high, len(one)), 0.0)
    _set(streams, Sensor.FLOW_RATE, one.value, case.inside(one), told)


def flow_poor(streams: Streams, case: Case, above_m: float, share: float, noise_rad_s: float, quality: float) -> None:
    """Above a height a share of the flow, noise, poor quality."""
    one = streams[Sensor.FLOW_RATE]
    value = one.value.copy()
    value[:, :2] = share * value[:, :2] + noise_rad_s * case.rng.standard_normal((len(one), 2))
    high = case.inside(one) & (case.height(one.t_s) > above_m)
    _set(streams, Sensor.FLOW_RATE, value, high, np.clip(quality + 5.0 * case.rng.standard_normal(len(one)), 1, 255))


def flow_noisy(streams: Streams, case: Case, noise_rad_s: float) -> None:
    """White noise on each reading, at a quality that does not say so."""
    one = streams[Sensor.FLOW_RATE]
    value = one.value.copy()
    value[:, :2] += noise_rad_s * case.rng.standard_normal((len(one), 2))
    _set(streams, Sensor.FLOW_RATE, value, case.inside(one))


def flow_unfocused(
    streams: Streams, case: Case, below_m: float, noise_rad_s: float, share: float, quality: float
) -> None:
    """Below a height the picture is blurred: a share of the flow and noise, at a quality that does not show it."""
    one = streams[Sensor.FLOW_RATE]
    value = one.value.copy()
    value[:, :2] = share * value[:, :2] + noise_rad_s * case.rng.standard_normal((len(one), 2))
    near = case.inside(one) & (case.height(one.t_s) < below_m) & (case.height(one.t_s) > 0.02)
    _set(streams, Sensor.FLOW_RATE, value, near, quality)


def flow_gyro(
    streams: Streams, case: Case, x: float = 1.0, y: float = 1.0, bias: tuple[float, float] = (0.0, 0.0)
) -> None:
    """The sensor's own gyro times a factor an axis, and off by a bias [rad/s]."""
    one = streams[Sensor.FLOW_RATE]
    value = one.value.copy()
    value[:, 2:4] = value[:, 2:4] * np.array([x, y]) + np.asarray(bias)
    _set(streams, Sensor.FLOW_RATE, value, case.inside(one))


def flow_lost(streams: Streams, case: Case) -> None:
    """No flow at all."""
    _keep(streams, Sensor.FLOW_RATE, ~case.inside(streams[Sensor.FLOW_RATE]))


# -- range -------------------------------------------------------------------------------------------------------
def range_ceiling(streams: Streams, case: Case, most_m: float) -> None:
    """No valid range beyond a distance."""
    one = streams[Sensor.RANGE]
    _keep(streams, Sensor.RANGE, ~(case.inside(one) & (one.value[:, 0] > most_m)))


def range_spikes(streams: Streams, case: Case, share: float, low_m: float, high_m: float) -> None:
    """Some ranges are anything between two distances."""
    one = streams[Sensor.RANGE]
    hit = case.inside(one) & (case.rng.random(len(one)) < share)
    _set(streams, Sensor.RANGE, case.rng.uniform(low_m, high_m, one.value.shape), hit)


def range_stuck(streams: Streams, case: Case) -> None:
    """The last range before the window is repeated."""
    one = streams[Sensor.RANGE]
    inside = case.inside(one)
    held = one.value[max(int(np.argmax(inside)) - 1, 0)]
    _set(streams, Sensor.RANGE, np.broadcast_to(held, one.value.shape), inside)


def range_covered(streams: Streams, case: Case, range_m: float, noise_m: float) -> None:
    """Something before the lens: one distance and the sensor's noise, whatever the height."""
    one = streams[Sensor.RANGE]
    _set(streams, Sensor.RANGE, range_m + noise_m * case.rng.standard_normal(one.value.shape), case.inside(one))


def range_says_most(streams: Streams, case: Case, beyond_m: float, says_m: float) -> None:
    """Without an echo, beyond a distance, the sensor says its longest range, and calls it good."""
    one = streams[Sensor.RANGE]
    _set(streams, Sensor.RANGE, np.full_like(one.value, says_m), case.inside(one) & (one.value[:, 0] > beyond_m))


def range_short(streams: Streams, case: Case, share: float, low: float, high: float) -> None:
    """Tall grass: of some ranges only a part, from low to high of it, is read."""
    one = streams[Sensor.RANGE]
    hit = case.inside(one) & (case.rng.random(len(one)) < share)
    _set(streams, Sensor.RANGE, one.value * case.rng.uniform(low, high, one.value.shape), hit)


def range_lost(streams: Streams, case: Case) -> None:
    """No range."""
    _keep(streams, Sensor.RANGE, ~case.inside(streams[Sensor.RANGE]))


def terrain(streams: Streams, case: Case, height_m: float) -> None:
    """Something so high stands below while the window lasts; flow is then nearer to it, too."""
    one, flow = streams[Sensor.RANGE], streams[Sensor.FLOW_RATE]
    near = np.maximum(one.value - height_m, 0.1)
    _set(streams, Sensor.RANGE, near, case.inside(one))
    before = np.maximum(case.height(flow.t_s), 0.15)
    factor = np.minimum(before / np.maximum(before - height_m, 0.15), 4.0)
    value = flow.value.copy()
    value[:, :2] = (value[:, :2] - value[:, 2:4]) * factor[:, None] + value[:, 2:4]
    _set(streams, Sensor.FLOW_RATE, value, case.inside(flow))


# -- GPS ---------------------------------------------------------------------------------------------------------
def gps_lost(streams: Streams, case: Case) -> None:
    """No GPS."""
    for sensor in GPS:
        _keep(streams, sensor, ~case.inside(streams[sensor]))


def gps_moved(streams: Streams, case: Case, north_m: float, east_m: float) -> None:
    """Positions are so far off; the velocity stays right."""
    one = streams[Sensor.GPS_POSITION]
    _set(streams, Sensor.GPS_POSITION, one.value + np.array([north_m, east_m, 0.0]), case.inside(one))


def gps_walked(streams: Streams, case: Case, north_m: float, east_m: float) -> None:
    """Reflections: positions walk off within the first half of the window and back in the second, velocity is right."""
    one = streams[Sensor.GPS_POSITION]
    first, last = case.window_s
    share = 1.0 - np.abs(np.clip((one.t_s - first) / (last - first), 0.0, 1.0) * 2.0 - 1.0)
    _set(
        streams,
        Sensor.GPS_POSITION,
        one.value + share[:, None] * np.array([north_m, east_m, 0.0]),
        case.inside(one),
    )


def gps_late(streams: Streams, case: Case, by_s: float) -> None:
    """Fixes are so much older than ever when they arrive."""
    for sensor in GPS:
        one = streams[sensor]
        rows = np.maximum(np.searchsorted(one.t_s, one.t_s - by_s, side="right") - 1, 0)
        _set(streams, sensor, one.value[rows], case.inside(one))


# -- field, pressure, inertia ------------------------------------------------------------------------------------
def mag_turned(streams: Streams, case: Case, deg: float) -> None:
    """A compass mounted turned about body down, clockwise from above."""
    one, angle = streams[Sensor.MAG], np.radians(deg)
    turn = np.array([[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    _set(streams, Sensor.MAG, one.value @ turn.T, case.inside(one))


def mag_pushed(streams: Streams, case: Case, gauss: list[float]) -> None:
    """The motors' current adds a field that grows with the thrust; so much in hover."""
    one = streams[Sensor.MAG]
    thrust = case.truth("thrust_n", one.t_s) / 13.2
    _set(streams, Sensor.MAG, one.value + thrust[:, None] * np.asarray(gauss), case.inside(one))


def mag_offset(streams: Streams, case: Case, gauss: list[float]) -> None:
    """Iron that was mounted after the calibration."""
    one = streams[Sensor.MAG]
    _set(streams, Sensor.MAG, one.value + np.asarray(gauss), case.inside(one))


def baro_wash(streams: Streams, case: Case, thrust_m: float, ground_m: float, ground_scale_m: float) -> None:
    """Altitude off with the thrust, and with the ground's nearness while the rotors turn."""
    one = streams[Sensor.BARO]
    thrust = case.truth("thrust_n", one.t_s) / 13.2
    off = thrust * (thrust_m + ground_m * np.exp(-case.height(one.t_s) / ground_scale_m))
    noise = 0.25 * np.abs(thrust) * np.convolve(case.rng.standard_normal(len(one)), np.ones(12) / np.sqrt(12.0), "same")
    _set(streams, Sensor.BARO, one.value + (off + noise)[:, None], case.inside(one))


def accel_shaken(streams: Streams, case: Case, noise_m_s2: float, clip_m_s2: float, shift_m_s2: list[float]) -> None:
    """Vibration beyond what the accelerometer can read, and what is rectified of it."""
    one = streams[Sensor.IMU]
    value = one.value.copy()
    shaken = value[:, 3:] + noise_m_s2 * case.rng.standard_normal((len(one), 3)) + np.asarray(shift_m_s2)
    value[:, 3:] = np.clip(shaken, -clip_m_s2, clip_m_s2)
    _set(streams, Sensor.IMU, value, case.inside(one))


def accel_biased(streams: Streams, case: Case, m_s2: list[float], ramp_s: float) -> None:
    """The accelerometer's bias goes off within ramp_s, and stays."""
    one = streams[Sensor.IMU]
    share = np.clip((one.t_s - max(case.window_s[0], one.t_s[0])) / max(ramp_s, 1e-3), 0.0, 1.0)
    value = one.value.copy()
    value[:, 3:] += share[:, None] * np.asarray(m_s2)
    _set(streams, Sensor.IMU, value, case.inside(one))


def accel_held(streams: Streams, case: Case, m_s2: float) -> None:
    """The accelerometer says one value on all axes."""
    one = streams[Sensor.IMU]
    value = one.value.copy()
    value[:, 3:] = m_s2
    _set(streams, Sensor.IMU, value, case.inside(one))


def imu_gap(streams: Streams, case: Case) -> None:
    """No inertial readings."""
    _keep(streams, Sensor.IMU, ~case.inside(streams[Sensor.IMU]))


def landed_said(streams: Streams, case: Case) -> None:
    """The vehicle says that it has landed."""
    one = streams[Sensor.LANDED]
    _set(streams, Sensor.LANDED, np.ones_like(one.value), case.inside(one))


WAYS: dict[str, Callable[..., None]] = {
    way.__name__: way
    for way in (
        flow_turned,
        flow_flipped,
        flow_swapped,
        flow_scaled,
        flow_over_time,
        flow_offset,
        flow_late,
        flow_stamped,
        flow_drifts,
        flow_dark,
        flow_blank,
        flow_quality,
        flow_poor,
        flow_noisy,
        flow_unfocused,
        flow_gyro,
        flow_lost,
        range_ceiling,
        range_spikes,
        range_stuck,
        range_covered,
        range_says_most,
        range_short,
        range_lost,
        terrain,
        gps_lost,
        gps_moved,
        gps_walked,
        gps_late,
        mag_turned,
        mag_pushed,
        mag_offset,
        baro_wash,
        accel_shaken,
        accel_biased,
        accel_held,
        imu_gap,
        landed_said,
    )
}
