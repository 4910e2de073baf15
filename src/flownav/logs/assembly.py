"""From a reader's columns to a Stream: in time order, what cannot be thrown away and counted, whatever the format."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.core.measurement import COLUMNS, Array, Sensor, Stream
from flownav.logs.fixes import Origin, local_position, near_the_rest, origin_of
from flownav.logs.rows import Rows, drop_duplicates, drop_strays, longest_ordered

# what a vehicle's sensor can say at most, in the unit of `measurement.COLUMNS`; beyond it a bit or a unit is wrong
MOST: dict[Sensor, tuple[float, ...]] = {
    Sensor.GPS_VELOCITY: (150.0,) * 3,
    Sensor.FLOW_RATE: (70.0,) * 4,
    Sensor.FLOW_VELOCITY: (150.0,) * 3,
    Sensor.RANGE: (1000.0,),
    Sensor.IMU: (70.0, 70.0, 70.0, 400.0, 400.0, 400.0),
    Sensor.BARO: (1e5,),
    Sensor.MAG: (100.0,) * 3,
    Sensor.POSE: (1e6,) * 3,
}
MOST_VARIANCE = 1e12
UNIT_LENGTH_WITHIN = 0.1
MOST_ALTITUDE_M = 1e5
MAY_LACK = {Sensor.FLOW_RATE: (2, 3), Sensor.FLOW_VELOCITY: (2,), Sensor.GPS_VELOCITY: (0, 1, 2)}  # NaN: not measured
SEA_LEVEL_PA = 101325.0
SCALE_HEIGHT_M, ALTITUDE_EXPONENT = 44330.77, 0.1902632  # the standard atmosphere's troposphere


def sensor_stream(
    sensor: Sensor, t_s: Array, value: Array, *, variance: Array | None = None, quality: Array | None = None,
    delay_s: float = 0.0, rejected: dict[str, int] | None = None,
) -> Stream | None:  # fmt: skip
    """A sensor's readings in time order; None where none is usable.

    t_s (n,), value (n, k), variance (n, k) and quality (n,) as in Stream. Variances that cannot be are as if
    unstated. Rows that are not finite, late, repeated, or beyond what a sensor can say are counted in `rejected`.
    """
    count, width = len(t_s), len(COLUMNS[sensor])
    value = np.asarray(value, float).reshape(count, width)
    columns = {f"value_{k}": value[:, k] for k in range(width)}
    stated = np.full((count, width), np.nan) if variance is None else np.array(variance, float).reshape(count, width)
    stated[~((stated > 0.0) & (stated < MOST_VARIANCE))] = np.nan
    columns |= {f"variance_{k}": stated[:, k] for k in range(width)}
    columns["quality"] = np.full(count, 255.0) if quality is None else np.asarray(quality, float)
    rows = Rows(np.asarray(t_s, float), columns, dict(rejected or {}))
    _check_values(rows, sensor, width)
    _check_order(rows)
    if not len(rows):
        return None
    names = [f"{what}_{k}" for what in ("value", "variance") for k in range(width)]
    table = rows.matrix(*names)
    return Stream.of(
        sensor, rows.t_s, table[:, :width], variance=table[:, width:], quality=np.clip(rows.columns["quality"], 0, 255),
        delay_s=delay_s, rejected=rows.rejected,
    )  # fmt: skip


def _check_values(rows: Rows, sensor: Sensor, width: int) -> None:
    """Rows without a number where one must be, and rows that no sensor can say."""
    names = [f"value_{k}" for k in range(width)]
    must = [name for k, name in enumerate(names) if k not in MAY_LACK.get(sensor, ())]
    finite = np.isfinite(rows.t_s) & np.isfinite(rows.columns["quality"])
    for name in must:
        finite &= np.isfinite(rows.columns[name])
    rows.keep(finite, "not_finite")
    inside = np.ones(len(rows), bool)
    for name, most in zip(names, MOST.get(sensor, ()), strict=False):
        inside &= ~(np.abs(rows.columns[name]) > most)
    if sensor == Sensor.RANGE:
        inside &= rows.columns["value_0"] > 0.0
    if sensor == Sensor.ATTITUDE:
        inside &= np.abs(np.linalg.norm(rows.matrix(*names), axis=1) - 1.0) < UNIT_LENGTH_WITHIN
    if sensor == Sensor.LANDED:
        inside &= (rows.columns["value_0"] == 0.0) | (rows.columns["value_0"] == 1.0)
    rows.keep(inside, "out_of_range")


def _check_order(rows: Rows) -> None:
    if np.any(np.diff(rows.t_s) < 0):
        rows.keep(longest_ordered(rows.t_s), "out_of_order")
    drop_strays(rows)
    drop_duplicates(rows)


def gps_streams(
    t_s: Array, fix_type: Array, place_deg_m: tuple[Array, Array, Array], velocity_ned_m_s: Array, *,
    position_variance: Array | None = None, velocity_variance: Array | None = None, delay_s: float = 0.0,
) -> tuple[list[Stream], Origin | None]:  # fmt: skip
    """Velocity, then position about the first fix, and that fix; nothing where no fix is 3-D (fix_type 3).

    place_deg_m: latitude, longitude, altitude. All (n,) but velocity and variances (n, 3), north, east, down; velocity
    is NaN where the receiver has none.
    """
    count = len(t_s)
    variances = [
        np.full((count, 3), np.nan) if each is None else each for each in (position_variance, velocity_variance)
    ]
    columns = dict(zip(("lat_deg", "lon_deg", "alt_m"), place_deg_m, strict=True))
    columns |= {f"vel_{k}": velocity_ned_m_s[:, k] for k in range(3)}
    columns |= {f"var_{which}_{k}": variance[:, k] for which, variance in enumerate(variances) for k in range(3)}
    fixes = Rows(np.asarray(t_s, float), {name: np.asarray(column, float) for name, column in columns.items()})
    fixes.keep(np.asarray(fix_type) >= 3, "no_fix")
    fixes.keep(
        np.isfinite(fixes.matrix("lat_deg", "lon_deg", "alt_m")).all(axis=1) & np.isfinite(fixes.t_s), "not_finite"
    )
    inside = (abs(fixes.columns["lat_deg"]) <= 90) & (abs(fixes.columns["lon_deg"]) <= 180)
    fixes.keep(inside & (abs(fixes.columns["alt_m"]) < MOST_ALTITUDE_M), "out_of_range")
    if len(fixes):
        fixes.keep(near_the_rest(fixes.columns["lat_deg"], fixes.columns["lon_deg"]), "out_of_range")
    _check_order(fixes)
    if not len(fixes):
        return [], None
    velocity = fixes.matrix("vel_0", "vel_1", "vel_2")
    velocity[(np.abs(velocity) > MOST[Sensor.GPS_VELOCITY][0]).any(axis=1)] = np.nan
    found = []
    for sensor, value, which in ((Sensor.GPS_VELOCITY, velocity, 1), (Sensor.GPS_POSITION, local_position(fixes), 0)):
        variance = fixes.matrix(*(f"var_{which}_{k}" for k in range(3)))
        variance[~((variance > 0.0) & (variance < MOST_VARIANCE))] = np.nan
        found.append(Stream.of(sensor, fixes.t_s, value, variance=variance, delay_s=delay_s, rejected=fixes.rejected))
    return found, origin_of(fixes)


def pressure_altitude_m(pressure_pa: Array) -> Array:
    """Height in the standard atmosphere [m]; NaN where the pressure cannot be."""
    possible = (pressure_pa > 1e3) & (pressure_pa < 2e5)
    ratio = np.where(possible, pressure_pa, SEA_LEVEL_PA) / SEA_LEVEL_PA
    return np.where(possible, SCALE_HEIGHT_M * (1.0 - ratio**ALTITUDE_EXPONENT), np.nan)


def content_of(path: Path, what: str, most_bytes: int = 4 << 30) -> bytes:
    """A file's bytes. InputError where it cannot be read or is larger than such a log ever is."""
    try:
        if an_input(path).stat().st_size > most_bytes:
            raise InputError(f"{path}: larger than {most_bytes >> 20} MB; cut the log into pieces")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give {what}") from error


def sha256_of(content: bytes) -> str:
    """The digest by which a record names its input."""
    return hashlib.sha256(content).hexdigest()
