"""How the vehicle moved over the ground by each of a log's own sensors, as a reference may be compared with it.

Horizontal vectors are complex numbers, first axis plus i second: forward and right of the body, or north and east of
level axes whose north may be any.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import GRAVITY_M_S2, heading_from_quaternion
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, Table
from flownav.logs.log import attitude_at, attitude_rates, integrated

Complex = NDArray[np.complex128]

HALF_S = 0.25  # half of the time over which a velocity is taken: chosen, against noise
HALF_LEVEL_S = 10.0  # of the time over which the specific force tells what is level
HALF_TILT_S = 2.5  # of the time over which a vehicle in flight tilts; a gyro that warms up drifts more slowly
HALF_RATE_S = 0.02  # of the time over which an attitude turns: about a reading of flow
LONGEST_GAP_S = 0.5  # between rows of a reference, and readings of a range
LONGEST_IMU_S = 0.1  # between readings of an accelerometer
GPS, FLOW, ACCELEROMETER = "GPS", "flow", "the accelerometer"


class Witness(NamedTuple):
    """A sensor's name, its instants t_s (n,), and its motion (n,) each: in the body's axes (None of GPS), and in level
    axes. order: 1 of a velocity [m/s], 2 of an acceleration [m/s2]. by_gyro: whether the IMU's gyro turned it level, so
    that a wrong sign of that is its own.
    """

    name: str
    t_s: Array
    body: Complex | None
    level: Complex
    order: int = 1
    by_gyro: bool = False


def witnesses_of(truth: Table, streams: Mapping[Sensor, Stream]) -> list[Witness]:
    """GPS, accelerometer and flow, each where the log has what it takes."""
    found = (_gps(streams), _accelerometer(streams), _flow(streams, truth))
    return [witness for witness in found if witness is not None and len(witness.t_s) > 1]


def tilt_change_rad(streams: Mapping[Sensor, Stream], begin_s: float, end_s: float) -> float:
    """By how much the gyro rolls or pitches the vehicle at most from its mean over 2 HALF_TILT_S, within a time, but
    for a bias [rad]; 0 without one.
    """
    imu = streams.get(Sensor.IMU)
    if imu is None:
        return 0.0
    t_s = imu.t_s - imu.delay_s
    inside = (t_s >= begin_s) & (t_s <= end_s) & np.isfinite(imu.value[:, :2]).all(axis=1)
    if np.count_nonzero(inside) < 3:
        return 0.0
    at_s, rates = t_s[inside], imu.value[inside, :2]
    turned = integrated(rates - rates.mean(axis=0), np.diff(at_s)) @ np.array([1.0, 1j])
    return float(np.nanmax(np.abs(turned - averaged(at_s, turned, at_s, HALF_TILT_S))))


def joined(at_s: Array, t_s: Array, value: Array) -> Array:
    """Linear between samples that lie close, at instants (n,); NaN in gaps and outside."""
    if len(t_s) < 2:
        return np.full(len(at_s), np.nan)
    place = np.clip(np.searchsorted(t_s, at_s, side="right"), 1, len(t_s) - 1)
    near = (t_s[place] - t_s[place - 1] <= LONGEST_GAP_S) & (at_s >= t_s[0]) & (at_s <= t_s[-1])
    return np.where(near, np.interp(at_s, t_s, value), np.nan)


def averaged(t_s: Array, values: Complex, grid: Array, half_s: float = HALF_S) -> Complex:
    """Means of readings (n,) within half_s of each instant of a grid; NaN where fewer than two are."""
    begin = np.searchsorted(t_s, grid - half_s)
    end = np.searchsorted(t_s, grid + half_s, side="right")
    sums = np.concatenate([[0.0], np.cumsum(values)])
    count = end - begin
    return np.where(count >= 2, (sums[end] - sums[begin]) / np.maximum(count, 1), np.nan)


def _gps(streams: Mapping[Sensor, Stream]) -> Witness | None:
    stream = streams.get(Sensor.GPS_VELOCITY)
    if stream is None:
        return None
    level = stream.value[:, 0] + 1j * stream.value[:, 1]
    known = np.isfinite(level) & (stream.quality > 0.0)
    return Witness(GPS, (stream.t_s - stream.delay_s)[known], None, level[known])


def _accelerometer(streams: Mapping[Sensor, Stream]) -> Witness | None:
    """The specific force without gravity, levelled by the IMU alone and averaged over 2 HALF_S.

    Of the tilt the quick part is the gyro's and the slow one, its mean over 2 HALF_LEVEL_S, is by the specific force,
    so that a gyro's bias does not count, nor what accelerates for as long. Tilts are small angles.
    """
    imu = streams.get(Sensor.IMU)
    if imu is None:
        return None
    good = np.isfinite(imu.value[:, :6]).all(axis=1)
    t_s, rates, force = (imu.t_s - imu.delay_s)[good], imu.value[good, :3], imu.value[good, 3:6]
    if len(t_s) < 2 or float(np.median(np.diff(t_s))) > LONGEST_IMU_S:
        return None
    if not 0.5 * GRAVITY_M_S2 < -float(np.median(force[:, 2])) < 2.0 * GRAVITY_M_S2:
        return None  # gravity is not in it
    yaw, tilt = _counted(t_s, rates)
    across = (force[:, 0] + 1j * force[:, 1]) * np.exp(1j * yaw)
    slow = averaged(t_s, across / -GRAVITY_M_S2 - tilt, t_s, HALF_LEVEL_S)
    level = averaged(t_s, across - (tilt + slow) * force[:, 2], t_s)
    known = np.isfinite(level)
    return Witness(ACCELEROMETER, t_s[known], (level * np.exp(-1j * yaw))[known], level[known], 2, True)


def _counted(t_s: Array, rates: Array) -> tuple[Array, Complex]:
    """Heading [rad] and down's horizontal part, in level axes of which the first is forward at the begin, as a gyro's
    rates (n, 3) count them from 0: for a small tilt, d(down)/dt = (-q + i p) exp(i yaw).
    """
    steps_s = np.diff(t_s)
    yaw = integrated(rates[:, 2], steps_s)
    turning = (-rates[:, 1] + 1j * rates[:, 0]) * np.exp(1j * yaw)
    return yaw, np.asarray(integrated(turning.real, steps_s) + 1j * integrated(turning.imag, steps_s))


def _flow(streams: Mapping[Sensor, Stream], truth: Table) -> Witness | None:
    """By flow at the range's height, or the reference's above its lowest, turned by a heading that the log has or that
    its gyro counts.
    """
    stream = streams.get(Sensor.FLOW_RATE) or streams.get(Sensor.FLOW_VELOCITY)
    if stream is None or not len(stream):
        return None
    t_s = stream.t_s - stream.delay_s
    yaw = _yaw_at(streams, t_s)
    if yaw is None:
        return None
    if stream.sensor == Sensor.FLOW_VELOCITY:
        body = stream.value[:, 0] + 1j * stream.value[:, 1]
    else:
        rates = _rates_at(streams, stream, t_s)
        height = _height_at(streams, t_s, truth)
        body = height * ((stream.value[:, 1] - rates[:, 1]) - 1j * (stream.value[:, 0] - rates[:, 0]))
    known = np.isfinite(body) & np.isfinite(yaw) & (stream.quality > 0.0)
    by_gyro = Sensor.ATTITUDE not in streams
    return Witness(FLOW, t_s[known], body[known], (body * np.exp(1j * yaw))[known], by_gyro=by_gyro)


def _rates_at(streams: Mapping[Sensor, Stream], flow: Stream, t_s: Array) -> Array:
    """Rates about body x and y at the flow's readings (n, 2): the sensor's own, the IMU's, or the attitude's."""
    own, imu, attitude = flow.value[:, 2:4], streams.get(Sensor.IMU), streams.get(Sensor.ATTITUDE)
    if np.isfinite(own).all(axis=1).mean() > 0.5:
        return own
    if imu is None or not len(imu):
        if attitude is None or len(attitude) < 2:
            return own
        at_s = t_s + attitude.delay_s
        return attitude_rates(attitude, at_s - HALF_RATE_S, at_s + HALF_RATE_S)[:, :2]
    at_s = imu.t_s - imu.delay_s
    return np.column_stack([np.interp(t_s, at_s, imu.value[:, axis]) for axis in (0, 1)])


def _height_at(streams: Mapping[Sensor, Stream], t_s: Array, truth: Table) -> Array:
    """Height over ground at instants (n,) [m]; NaN where it is not known."""
    stream = streams.get(Sensor.RANGE)
    if stream is None:
        down = np.asarray(truth[POSITION_NED[2]], float)
        return np.asarray(np.interp(t_s, np.asarray(truth["t_s"], float), down.max() - down, np.nan, np.nan))
    known = np.isfinite(stream.value[:, 0]) & (stream.value[:, 0] > 0.0) & (stream.quality > 0.0)
    return joined(t_s, (stream.t_s - stream.delay_s)[known], stream.value[known, 0])


def _yaw_at(streams: Mapping[Sensor, Stream], t_s: Array) -> Array | None:
    """The vehicle's heading at instants (n,) [rad], from any north; None without attitude and IMU."""
    attitude, imu = streams.get(Sensor.ATTITUDE), streams.get(Sensor.IMU)
    if attitude is not None and len(attitude) > 1:
        return np.asarray(heading_from_quaternion(*attitude_at(attitude, t_s + attitude.delay_s).T))
    if imu is None or len(imu) < 2:
        return None
    at_s, rate = imu.t_s - imu.delay_s, np.nan_to_num(imu.value[:, 2])
    return np.asarray(np.interp(t_s, at_s, integrated(rate, np.diff(at_s)), np.nan, np.nan))
