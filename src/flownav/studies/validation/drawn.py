"""The recorded flights that are flown again, and the sensors of one simulated flight, drawn for it."""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, get_type_hints
from zlib import crc32

import numpy as np
from pydantic import Field
from scipy.special import ndtri

from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.parameter_files import Number, ParameterModel, load, shipped
from flownav.logs.log import Log
from flownav.replays.session import table_windows
from flownav.sensors.range_sensor import RangeSensorSheet
from flownav.sensors.sheet import Lever
from flownav.sensors.sheets import SensorSheets, shipped_sheets
from flownav.simulation.dispersion import DispersionSection, drawn, uniforms
from flownav.simulation.ensemble import SHEETS, with_numbers
from flownav.simulation.noise import threefry
from flownav.simulation.truth import SENSOR_TABLE


def rate_hz(stream: Stream) -> float:
    """One over the median step of a stream."""
    return float(1.0 / np.median(np.diff(stream.t_s)))


# -- which flights -----------------------------------------------------------------------------------------------
SHIPPED_FILE = "validation.toml"

Window = tuple[float, float]


class RecordedFlight(ParameterModel):
    """A log's folder, and its GPS outages: `[T0, T1, LENGTH]` each, seconds of the log."""

    log: str  # name of the log's folder
    windows_s: tuple[tuple[Number, Number, Number], ...] = Field(min_length=1)  # from T0 on, each LENGTH long, to T1

    def windows(self) -> list[Window]:
        """Each outage [s]. InputError where one cannot be."""
        return [window for whole in self.windows_s for window in table_windows(*whole, option=f"{self.log}: windows_s")]


class AssumedVehicle(ParameterModel):
    """Data of a vehicle that sensor models need and a log lacks; path_bandwidth_hz: of the path that is flown."""

    thrust_n: Number = Field(gt=0.0, le=1e4)  # of all rotors, all the time; for the wash on the barometer
    rotor_radius_m: Number = Field(gt=0.0, le=10.0)  # of a disc as large as all rotors' together
    rotor_speed_rad_s: Number = Field(gt=0.0, le=1e4)  # of one rotor, for the tones of vibration
    rotor_speed_spread: Number = Field(ge=0.0, lt=1.0)  # flights differ by up to this share, either way
    blades: Number = Field(ge=1.0, le=12.0)  # of one rotor, for the tones of vibration
    hover_power_w: Number = Field(ge=0.0, le=1e5)  # electrical, all the time; for the field of its current
    path_bandwidth_hz: Number = Field(gt=0.1, le=5.0)  # of the path that is flown; quicker motion is left out
    flow_max_height_m: Number = Field(gt=0.0, le=1000.0)  # of the flow camera, instead of the sensor file's


class ValidationFile(ParameterModel):
    """The file of flights."""

    schema_version: Literal[1]  # of this kind of file; 1
    name: str  # of these flights
    provenance: str  # where the logs and figures come from
    flight: tuple[RecordedFlight, ...] = Field(min_length=1)
    vehicle: AssumedVehicle


def load_flights(path: Path | None = None) -> ValidationFile:
    """The flights of a file; the shipped ones where `path` is None. InputError names file, key and allowed range."""
    return load(path or shipped(SHIPPED_FILE), ValidationFile)


# -- what is drawn -----------------------------------------------------------------------------------------------
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
    """How many readings of an IMU stand behind each that the log holds."""
    return max(1, math.ceil(SLOWEST_INERTIAL_HZ / rate_hz(stream)))


def sheets_of(log: Log, vehicle: AssumedVehicle) -> SensorSheets:
    """The shipped datasheets at the log's rates; a lidar where the log reads nearer than a sonar can.

    Levers are unknown, and the navigator is given none: sensors sit at the centre of gravity.
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
            stated = _number_of(sheet, key)
            draw = float(entry.frozen().ppf(flight.uniform(name)))
            touched.setdefault(source, {})[key] = drawn(entry.mode, draw, stated, 0.0, 0.0)
    return sheets.model_copy(
        update={source: with_numbers(getattr(sheets, source), numbers, source) for source, numbers in touched.items()}
    )


def _number_of(sheet: Any, key: str) -> float:
    """The number at a dotted key."""
    for part in key.split("."):
        sheet = getattr(sheet, part)
    return float(sheet)


# -- readings ----------------------------------------------------------------------------------------------------
Seen = dict[Any, Any]  # records by their kinds


def readings(
    flight: Flight, name: str, drawn: str, p: Any, seen: Sequence[Seen], step: Callable[..., Any] | None = None
) -> list[Any]:
    """The readings of a carried sensor, one after the other, by the equations of its row.

    drawn: the name of its draws; p: its coefficients; step: its equation, where the row's takes more than the sensor's.
    """
    one = next(sensor for sensor in SENSOR_TABLE if sensor.name == name)
    step, values, kept = step or one.step, [], {one.parameters: p}
    kept[one.unit] = lawful(one.draw, kept | {one.unit: one.unit(*normals_of(flight, f"{drawn} unit", one.unit))})
    if one.start is not None:
        begun = {} if one.begun is None else {one.begun: one.begun(*normals_of(flight, f"{drawn} start", one.begun))}
        kept[one.state] = lawful(one.start, kept | begun | seen[0])
    normals = flight.normals(drawn, len(seen), len(one.normals._fields)).tolist()
    for now, of_this in zip(seen, normals, strict=True):
        read = lawful(step, kept | now | {one.normals: one.normals(*of_this)})
        if one.state is not None:
            kept[one.state], read = read
        values.append(read)
    return values


def lawful(law: Callable[..., Any], records: Seen) -> Any:
    """The result of a law on the records that its parameters are annotated with."""
    return law(*(records[kind] for name, kind in hints_of(law).items() if name != "return"))


hints_of = lru_cache(get_type_hints)


def normals_of(flight: Flight, name: str, record: Any) -> list[float]:
    """Standard normals of what is drawn once a flight, one for each field of a record."""
    drawn: list[float] = flight.normals(name, 1, len(record._fields))[0].tolist()
    return drawn
