"""A simulated flight as the log that its vehicle would have recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flownav.frames import rotation_from_quaternion
from flownav.logs.log import Log
from flownav.measurement import COLUMNS, Array, Sensor, Stream
from flownav.record import QUATERNION, Record
from flownav.sensors.flow import SMALLEST_COSINE, SMALLEST_RANGE_M
from flownav.simulation.assemble import Setup


def log_of(record: Record, setup: Setup, *, flow: Sensor = Sensor.FLOW_VELOCITY, attitude: bool = False) -> Log:
    """The log of a recorded flight of `setup`, with the flight's truth beside it.

    flow: FLOW_VELOCITY as the PX4FLOW publishes it (no vertical velocity), or FLOW_RATE before it is scaled by the
    range, with the IMU's gyro for the sensor's own. attitude: whether the INS's is in it. ValueError where the flight
    has no IMU (the paper's filter flies without one) or `flow` is no flow.
    """
    if "imu" not in record.tables:
        raise ValueError("the flight has no IMU; fly it with the landing filter")
    streams = [_imu(record), *_gps(record, setup), _range(record, setup), _landed(record)]
    if flow == Sensor.FLOW_VELOCITY:
        streams.append(_flow_velocity(record))
    elif flow == Sensor.FLOW_RATE:
        streams.append(_flow_rate(record, setup))
    else:
        raise ValueError(f"{flow.name} is no flow")
    if attitude:
        streams.append(_late(_stream(record, Sensor.ATTITUDE, "attitude"), setup))
    if "pad" in record.tables:
        streams.append(_pad(record, setup))
    sonar, sensor = setup.scenario.rangefinder, setup.flight.sensors.flow
    return Log(
        Path(f"{setup.scenario.name} (simulated)"),
        {stream.sensor: stream for stream in streams},
        truth=record.tables["truth"],
        limits={
            "range_m": (float(sonar.floor_m), float(sonar.ceiling_m)),
            "flow_height_m": (sensor.min_height_m, sensor.max_height_m),
            "flow_rad_s": (0.0, sensor.max_flow_rad_s),
        },
    )


def _stream(record: Record, sensor: Sensor, table: str, variance: Array | None = None) -> Stream:
    """A table of the record as a stream; `variance` of each value, the same for every reading."""
    value = record.matrix(table, COLUMNS[sensor])
    stated = None if variance is None else np.broadcast_to(variance, value.shape)
    columns = record.tables[table]
    return Stream.of(sensor, columns["t_s"], value, variance=stated, quality=columns["quality"])


def _late(stream: Stream, setup: Setup) -> Stream:
    """The GPS/INS's own delay. A late unit's first reading is left out: it is of the instant of the second."""
    delay_s = setup.scenario.gps.delay_s
    rows = slice(1 if delay_s > 0.0 else 0, None)
    return Stream.of(
        stream.sensor, stream.t_s[rows], stream.value[rows],
        variance=stream.variance[rows], quality=stream.quality[rows], delay_s=delay_s,
    )  # fmt: skip


def _imu(record: Record) -> Stream:
    return _stream(record, Sensor.IMU, "imu")


def _gps(record: Record, setup: Setup) -> list[Stream]:
    """Position, and velocity where the unit offers one, with the accuracy that it states: of its whole error."""
    gps = setup.scenario.gps
    position = np.square(np.array(gps.position_sigma_m))
    streams = [_late(_stream(record, Sensor.GPS_POSITION, "gps_position", position), setup)]
    if "gps_velocity" in record.tables:
        velocity = np.full(3, gps.velocity_sigma_total_m_s**2)
        streams.append(_late(_stream(record, Sensor.GPS_VELOCITY, "gps_velocity", velocity), setup))
    return streams


def _range(record: Record, setup: Setup) -> Stream:
    sonar = setup.scenario.rangefinder
    return _stream(record, Sensor.RANGE, "range", np.array([sonar.sigma_m**2 + sonar.resolution_m**2 / 12.0]))


def _landed(record: Record) -> Stream:
    """The skid switch, every epoch."""
    truth = record.tables["truth"]
    return Stream.of(Sensor.LANDED, truth["t_s"], truth["on_ground"])


def _flow_velocity(record: Record) -> Stream:
    """What the PX4FLOW publishes: 0 where its quality is 0, and no vertical velocity."""
    stream = _stream(record, Sensor.FLOW_VELOCITY, "flow_velocity")
    value = np.where(stream.quality[:, None] > 0.0, stream.value, 0.0)
    value[:, 2] = np.nan
    return Stream.of(stream.sensor, stream.t_s, value, quality=stream.quality)


def _flow_rate(record: Record, setup: Setup) -> Stream:
    """flow_x = w_x - v/r, flow_y = w_y + u/r; r as the sensor scaled by it: its sonar's, not below its floor."""
    velocity = _flow_velocity(record)
    gyro = record.matrix("imu", ("gyro_x_rad_s", "gyro_y_rad_s"))
    seen_m = np.maximum(_lens_range(record, setup), max(setup.flight.sensors.flow.sonar_floor_m, SMALLEST_RANGE_M))
    u, v = velocity.value[:, 0], velocity.value[:, 1]
    engaged = velocity.quality > 0.0
    flow_x = np.where(engaged, gyro[:, 0] - v / seen_m, 0.0)
    flow_y = np.where(engaged, gyro[:, 1] + u / seen_m, 0.0)
    return Stream.of(
        Sensor.FLOW_RATE, velocity.t_s, np.column_stack([flow_x, flow_y, gyro]), quality=velocity.quality
    )  # fmt: skip


def _lens_range(record: Record, setup: Setup) -> Array:
    """True distance from the lens to the ground along the boresight [m]."""
    truth = record.tables["truth"]
    cosine = np.asarray(rotation_from_quaternion(*record.matrix("truth", QUATERNION).T)[8])
    height_m = -truth["pos_d_m"] - setup.flight.sensors.lens_below_cg_m * cosine
    return np.asarray(height_m / np.maximum(cosine, SMALLEST_COSINE))


def _pad(record: Record, setup: Setup) -> Stream:
    """Pad fixes. A line of sight with noise s across it has tangents of variance s2 (1 + a2 + b2)(1 + a2)."""
    fix = setup.scenario.pad_fix
    assert fix is not None  # the record has a table of it
    stream = _stream(record, Sensor.PAD, "pad")
    squares = stream.value[:, :2] ** 2
    angles = fix.angle_sigma_rad**2 * (1.0 + squares.sum(axis=1, keepdims=True)) * (1.0 + squares)
    distance = (fix.distance_sigma * stream.value[:, 2:]) ** 2
    variance = np.column_stack([angles, distance])
    return Stream.of(stream.sensor, stream.t_s, stream.value, variance=variance, quality=stream.quality)
