"""The sensors of one simulated flight: kinds and rates as in the log, errors drawn from the shipped dispersion."""

from __future__ import annotations

import math
from typing import Any
from zlib import crc32

import numpy as np
from scipy.special import ndtri

from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.parameter_files import shipped
from flownav.logs.log import Log
from flownav.sensors.range_sensor import RangeSensorSheet
from flownav.sensors.sheet import Lever
from flownav.sensors.sheets import SensorSheets, shipped_sheets
from flownav.simulation.dispersion import DispersionSection, drawn, uniforms
from flownav.simulation.ensemble import SHEETS, with_numbers
from flownav.simulation.noise import threefry
from flownav.studies.validation.flights import AssumedVehicle
from flownav.studies.validation.rates import rate_hz

SLOWEST_INERTIAL_HZ = 100.0  # of the datasheets; a log that has less holds every second or third reading
LIDAR_BELOW_M = 0.25  # a sonar of this class reads 0.30 m for anything nearer


class Flight:
    """Who draws: a seed and a flight's number. Every draw is a function of both, a name and a place."""

    def __init__(self, seed: int, number: int) -> None:
        self.seed, self.number = seed, number

    def uniform(self, name: str) -> float:
        """One number in (0, 1)."""
        return float(uniforms(self.seed, [self.number], name)[0])

    def normals(self, name: str, count: int, width: int) -> Array:
        """Standard normals (count, width), by the noise counter."""
        place = np.arange(count * width, dtype=np.uint64)
        channel = np.uint64(crc32(name.encode())) << np.uint64(32)
        flights, seeds = np.full_like(place, self.number), np.full_like(place, self.seed)
        word, _ = threefry(flights, place + channel, seeds, np.zeros_like(place))
        return np.asarray(ndtri(((word >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53)).reshape(count, width)


def kept_of(stream: Stream) -> int:
    """Of how many readings of an IMU the log holds one."""
    return max(1, math.ceil(SLOWEST_INERTIAL_HZ / rate_hz(stream)))


def sheets_of(log: Log, vehicle: AssumedVehicle) -> SensorSheets:
    """The shipped datasheets at the log's rates; a lidar where the log reads nearer than a sonar can.

    Levers are unknown, and the navigator is told of none: sensors sit at the centre of gravity.
    """
    sheets = shipped_sheets()
    assert sheets.flow_sensor is not None
    limits = sheets.flow_sensor.limits.model_copy(update={"max_height_m": vehicle.flow_max_height_m})
    update: dict[str, Any] = {"flow_sensor": sheets.flow_sensor.model_copy(update={"limits": limits})}
    update["range_sensor"] = _ranger(log.streams.get(Sensor.RANGE))
    for name, sensor, lever in (
        ("gps_receiver", Sensor.GPS_POSITION, "antenna"),
        ("flow_camera", Sensor.FLOW_RATE, "lens"),
        ("barometer", Sensor.BARO, ""),
        ("magnetometer", Sensor.MAG, ""),
    ):
        if sensor in log.streams:
            rate = rate_hz(log.streams[sensor])
            numbers: dict[str, Any] = {"rate_hz": rate} | ({lever: Lever()} if lever else {})
            numbers |= {"exposure_s": 1.0 / rate} if name == "flow_camera" else {}
            update[name] = getattr(sheets, name).model_copy(update=numbers)
    if Sensor.IMU in log.streams:
        imu = log.streams[Sensor.IMU]
        update["inertial"] = sheets.inertial.model_copy(update={"rate_hz": rate_hz(imu) * kept_of(imu)})
    return sheets.model_copy(update=update)


def _ranger(stream: Stream | None) -> RangeSensorSheet:
    """The lidar's or the sonar's datasheet."""
    sonar = RangeSensorSheet.read()
    if stream is None:
        return sonar
    lidar = float(np.min(stream.value[:, 0], initial=np.inf)) < LIDAR_BELOW_M
    sheet = RangeSensorSheet.read(shipped("sensors/range_lidar.toml")) if lidar else sonar
    return sheet.model_copy(update={"rate_hz": rate_hz(stream), "lens": Lever()})


def drawn_sheets(sheets: SensorSheets, flight: Flight) -> SensorSheets:
    """The sheets with what the shipped dispersion draws about them for this flight."""
    touched: dict[str, dict[str, float]] = {}
    for name, entry in DispersionSection().entries().items():
        source, _, key = name.partition(".")
        sheet = getattr(sheets, source) if source in SHEETS else None
        if sheet is not None:
            told = _number_of(sheet, key)
            draw = float(entry.frozen().ppf(flight.uniform(name)))
            touched.setdefault(source, {})[key] = drawn(entry.mode, draw, told, 0.0, 0.0)
    return sheets.model_copy(
        update={source: with_numbers(getattr(sheets, source), numbers, source) for source, numbers in touched.items()}
    )


def _number_of(sheet: Any, key: str) -> float:
    """The number at a dotted key."""
    for part in key.split("."):
        sheet = getattr(sheet, part)
    return float(sheet)
