"""Measurements: timed readings of one sensor with their noise, delay and validity.

Every source (simulation, a log, a live link) yields them and every filter takes them. One reading is a
`Measurement`; a whole sensor's readings are a `Stream`, the same fields as columns, which is how logs are
read, records are kept and kernels are fed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Sensor(IntEnum):
    """The kind of a measurement's source. The values are stable: they are written to records and read by kernels."""

    GPS_POSITION = 1  # north, east, down of the local frame [m]
    GPS_VELOCITY = 2  # north, east, down [m/s]
    FLOW_RATE = 3  # flow_x, flow_y, gyro_x, gyro_y [rad/s], PX4 convention: flow_x = w_x - v_y/r, flow_y = w_y + v_x/r
    FLOW_VELOCITY = 4  # forward, right, down of the body frame [m/s]; down is NaN where the sensor has none
    RANGE = 5  # along the boresight [m]
    IMU = 6  # gyro x, y, z [rad/s], specific force x, y, z [m/s2], body FRD
    ATTITUDE = 7  # quaternion w, x, y, z, body FRD to earth NED
    BARO = 8  # altitude, positive up [m]
    MAG = 9  # field x, y, z, body FRD [gauss]
    POSE = 10  # an external position: north, east, down [m]
    YAW = 11  # an external heading, from true north, clockwise from above [rad]
    PAD = 12  # the pad from the lens: tangents of the angles towards body forward and right, and the distance [m]
    LANDED = 13  # 1 on the ground, 0 in flight


COLUMNS: dict[Sensor, tuple[str, ...]] = {
    Sensor.GPS_POSITION: ("pos_n_m", "pos_e_m", "pos_d_m"),
    Sensor.GPS_VELOCITY: ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s"),
    Sensor.FLOW_RATE: ("flow_x_rad_s", "flow_y_rad_s", "gyro_x_rad_s", "gyro_y_rad_s"),
    Sensor.FLOW_VELOCITY: ("vel_u_m_s", "vel_v_m_s", "vel_w_m_s"),
    Sensor.RANGE: ("range_m",),
    Sensor.IMU: (
        "gyro_x_rad_s",
        "gyro_y_rad_s",
        "gyro_z_rad_s",
        "accel_x_m_s2",
        "accel_y_m_s2",
        "accel_z_m_s2",
    ),
    Sensor.ATTITUDE: ("qw", "qx", "qy", "qz"),
    Sensor.BARO: ("alt_m",),
    Sensor.MAG: ("mag_x_gauss", "mag_y_gauss", "mag_z_gauss"),
    Sensor.POSE: ("pos_n_m", "pos_e_m", "pos_d_m"),
    Sensor.YAW: ("yaw_rad",),
    Sensor.PAD: ("tan_forward", "tan_right", "distance_m"),
    Sensor.LANDED: ("landed",),
}
MAX_VALUES = max(len(names) for names in COLUMNS.values())


class Measurement(NamedTuple):
    """One reading. `t_s` is when it arrived; it describes the vehicle at `t_s - delay_s`.

    value: as COLUMNS[sensor] names it. variance: of each value; NaN where the sensor states none and the
    filter's own model serves. quality: 0..255, 0 = no data (255 where the sensor has no such figure).
    """

    t_s: float
    sensor: Sensor
    value: tuple[float, ...]
    variance: tuple[float, ...]
    delay_s: float = 0.0
    quality: float = 255.0


@dataclass(frozen=True)
class Stream:
    """All readings of one sensor, in order of arrival.

    t_s (n,), value (n, k) with k = len(COLUMNS[sensor]), variance (n, k) NaN where unstated, quality (n,)
    0..255, delay_s one number. `rejected` counts what the reader threw away, by reason.
    """

    sensor: Sensor
    t_s: Array
    value: Array
    variance: Array
    quality: Array
    delay_s: float = 0.0
    rejected: dict[str, int] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        sensor: Sensor,
        t_s: Array,
        value: Array,
        *,
        variance: Array | None = None,
        quality: Array | None = None,
        delay_s: float = 0.0,
        rejected: dict[str, int] | None = None,
    ) -> Stream:
        """A stream from arrays; unstated variances are NaN, unstated quality is 255. ValueError on a wrong shape.

        What is not stated takes no memory: one number stands for all, and cannot be written to.
        """
        count, width = len(t_s), len(COLUMNS[sensor])
        value = np.asarray(value, float).reshape(count, -1 if count else width)
        if value.shape != (count, width):
            raise ValueError(f"{sensor.name} takes {width} values a reading, got {value.shape[1]}")
        return cls(
            sensor,
            np.asarray(t_s, float),
            value,
            np.broadcast_to(np.nan, (count, width)) if variance is None else np.asarray(variance, float),
            np.broadcast_to(255.0, count) if quality is None else np.asarray(quality, float),
            delay_s,
            dict(rejected or {}),
        )

    def __len__(self) -> int:
        return len(self.t_s)

    def __iter__(self) -> Iterator[Measurement]:
        for t, value, variance, quality in zip(self.t_s, self.value, self.variance, self.quality, strict=True):
            yield Measurement(float(t), self.sensor, tuple(value), tuple(variance), self.delay_s, float(quality))


class EventQueue(NamedTuple):
    """Every stream's readings in one time order, as the kernels take them.

    t_s (n,) the instant each reading describes (arrival less delay); sensor (n,) int64; value and variance
    (n, MAX_VALUES), unused columns NaN; quality (n,); row (n,) the row in its own stream; withheld (n,) 1.0 where the
    user takes the reading away, which is then judged and noted, but not fused; arrived (n,) 0.0 where the sensor was
    due and stayed silent, which brings the filter to that instant and no more.
    """

    t_s: Array
    sensor: NDArray[np.int64]
    value: Array
    variance: Array
    quality: Array
    row: NDArray[np.int64]
    withheld: Array
    arrived: Array


def merge(streams: Iterable[Stream]) -> EventQueue:
    """Readings of all streams ordered by the instant they describe; ties keep the order of the streams."""
    listed = list(streams)
    return next(merged_parts(listed, max(1, sum(map(len, listed)))))


def merged_parts(streams: Iterable[Stream], longest: int) -> Iterator[EventQueue]:
    """Parts of the queue, of `longest` events at most, one at least: a long log's is larger than the log itself."""
    streams = [s for s in streams if len(s)]
    firsts = np.cumsum([0, *map(len, streams)])
    order = np.argsort(np.concatenate([np.zeros(0), *(s.t_s - s.delay_s for s in streams)]), kind="stable")
    for begin in range(0, max(1, len(order)), longest):
        yield _part(streams, firsts, order[begin : begin + longest])


def _part(streams: list[Stream], firsts: NDArray[np.int64], places: NDArray[np.int64]) -> EventQueue:
    """The events at these places of all streams laid one after the other."""
    count = len(places)
    of = np.searchsorted(firsts, places, side="right") - 1
    part = EventQueue(
        np.empty(count), np.empty(count, np.int64), np.full((count, MAX_VALUES), np.nan),
        np.full((count, MAX_VALUES), np.nan), np.empty(count), np.empty(count, np.int64), np.zeros(count),
        np.ones(count),
    )  # fmt: skip
    for number, stream in enumerate(streams):
        mine = np.flatnonzero(of == number)
        row, width = places[mine] - firsts[number], stream.value.shape[1]
        part.t_s[mine] = stream.t_s[row] - stream.delay_s
        part.sensor[mine] = int(stream.sensor)
        part.value[mine, :width] = stream.value[row]
        if stream.variance.strides[0]:  # stated, reading by reading
            part.variance[mine, : stream.variance.shape[1]] = stream.variance[row]
        elif len(stream):
            part.variance[mine, : stream.variance.shape[1]] = stream.variance[0]
        part.quality[mine] = stream.quality[row]
        part.row[mine] = row
    return part
