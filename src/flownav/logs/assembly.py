"""From a reader's columns to a Stream: rows in time order; what cannot be is thrown away and counted in any format."""

import hashlib
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.core.measurement import COLUMNS, Array, Sensor, Stream
from flownav.logs.holes import require_written

LATE_SHARE = 0.05  # more rows than this out of time order: not a late row here and there
LONGEST_GAP_S = 600.0  # a few rows further away than this carry a wrong time
FARTHEST_FIX_DEG = 0.5

Origin = tuple[float, float, float]  # latitude, longitude [deg], altitude [m]
# the most that a vehicle's sensor can measure, in the unit of `measurement.COLUMNS`; beyond it a bit or a unit is wrong
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
MOST_VARIANCE = 1e12  # stated; beyond it a bit is wrong, as in what comes by MAVLink
UNIT_LENGTH_WITHIN = 0.1
MOST_ALTITUDE_M = 1e5
MAY_LACK = {  # NaN: not measured
    Sensor.FLOW_RATE: (2, 3), Sensor.FLOW_VELOCITY: (2,), Sensor.GPS_VELOCITY: (0, 1, 2), Sensor.PAD: (2,),
}  # fmt: skip
PLACE = ("lat_deg", "lon_deg", "alt_m")
MOST_BYTES = 1 << 30  # of a log that is read whole, which takes two or three times as much memory
SLOW_S, HELD_S = 0.01, 0.1  # a slow sensor's value stands in every row: again only if it changed, or after this long
QUICK_S = 0.015  # rows that follow each other faster are a quick logger's: barometers give 50 readings a second at most
SEA_LEVEL_PA = 101325.0
SCALE_HEIGHT_M, ALTITUDE_EXPONENT = 44330.77, 0.1902632  # the standard atmosphere's troposphere


@dataclass
class Rows:
    """t_s (n,), columns by name (n,) each, counts of thrown-away rows by reason."""

    t_s: Array
    columns: dict[str, Array]
    rejected: dict[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.t_s)

    def column(self, name: str) -> Array:
        """A column; NaN where the table lacks it, which cannot be written to."""
        return self.columns.get(name, np.broadcast_to(np.nan, len(self.t_s)))

    def matrix(self, *names: str) -> Array:
        """Columns side by side, shape (n, len(names)); a column that the table lacks is NaN."""
        return np.column_stack([self.column(name) for name in names])

    def keep(self, good: NDArray[np.bool_] | np.bool_, reason: str) -> None:
        """Throw the other rows away and count them."""
        bad = int(np.count_nonzero(~good))
        if bad:
            self.rejected[reason] = self.rejected.get(reason, 0) + bad
            self.t_s = self.t_s[good]
            self.columns = {name: values[good] for name, values in self.columns.items()}


def drop_strays(rows: Rows) -> None:
    """Throw away the few rows at either end that a gap of many minutes parts from all others."""
    gaps = np.flatnonzero(np.diff(rows.t_s) > LONGEST_GAP_S) + 1
    few = max(1, int(LATE_SHARE * len(rows)))
    near = np.ones(len(rows), bool)
    for gap in gaps:
        if len(near) - gap <= few:
            near[gap:] = False
        elif gap <= few:
            near[:gap] = False
    rows.keep(near, "clock_jump")


def drop_duplicates(rows: Rows) -> None:
    """Remove rows that repeat the row before at the same time; two readings at one time both stay."""
    again = np.zeros(len(rows), bool)
    again[1:] = np.diff(rows.t_s) == 0
    for values in rows.columns.values():
        again[1:] &= (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    rows.keep(~again, "duplicate")


def fresh_rows(t_s: Array, value: Array) -> NDArray[np.bool_]:
    """Mask of the rows that are new readings of a slow sensor, logged at the rate of a fast one: value (n, k).

    A changed value, or the same after HELD_S; SLOW_S apart at the least.
    """
    changed = np.append(True, (np.diff(value, axis=0) != 0).any(axis=1))
    keep = np.zeros(len(t_s), bool)
    taken = -np.inf
    pending = False
    for row, t in enumerate(t_s.tolist()):
        pending = pending or bool(changed[row])
        if t < taken or (pending and t - taken >= SLOW_S) or t - taken >= HELD_S:
            keep[row], taken, pending = True, t, False
    return keep


def readings_once(t_s: Array, value: Array) -> NDArray[np.bool_]:
    """The fresh rows of a slow sensor where its rows come quicker than it measures; all of them where they do not.

    Repeated, a barometer of 25 Hz counted as 950 readings a second, and its noise as averaged away.
    """
    if len(t_s) < 2 or not np.median(np.diff(t_s)) < QUICK_S:
        return np.ones(len(t_s), bool)
    return fresh_rows(t_s, value)


def longest_ordered(t_s: Array) -> NDArray[np.bool_]:
    """The largest set of rows whose times never run back (patience sorting), as a mask."""
    keep = np.zeros(len(t_s), bool)
    tails: list[float] = []
    tail_rows: list[int] = []
    before = np.full(len(t_s), -1)
    for row, t in enumerate(t_s.tolist()):
        place = bisect_right(tails, t)
        before[row] = tail_rows[place - 1] if place else -1
        if place == len(tails):
            tails.append(t)
            tail_rows.append(row)
        else:
            tails[place], tail_rows[place] = t, row
    row = tail_rows[-1] if tail_rows else -1
    while row >= 0:
        keep[row] = True
        row = int(before[row])
    return keep


# -- geodetic positions -------------------------------------------------------------------------------------
def near_the_rest(latitude_deg: Array, longitude_deg: Array) -> NDArray[np.bool_]:
    """Fixes within half a degree of the middle one: a receiver's first are at times 0, 0 or where it was last used."""
    north = latitude_deg - np.sort(latitude_deg)[len(latitude_deg) // 2]
    east = (longitude_deg - np.sort(longitude_deg)[len(longitude_deg) // 2] + 180.0) % 360.0 - 180.0
    return np.asarray(np.hypot(north, east) < FARTHEST_FIX_DEG)


def origin_of(fixes: Rows) -> Origin:
    """The first fix. Rows have columns lat_deg, lon_deg, alt_m."""
    first = fixes.matrix(*PLACE)[0]
    return float(first[0]), float(first[1]), float(first[2])


def local_position(fixes: Rows) -> Array:
    """North, east, down [m] about the first fix (n, 3). Rows have columns lat_deg, lon_deg, alt_m."""
    return local_ned(fixes.matrix(*PLACE), origin_of(fixes))


def local_ned(geodetic_deg_m: Array, origin: Origin) -> Array:
    """North, east, down [m] about an origin; latitude, longitude [deg] and altitude [m] in, shape (n, 3) both."""
    import pymap3d

    return np.column_stack(pymap3d.geodetic2ned(*geodetic_deg_m.T, *origin))


# -- streams ------------------------------------------------------------------------------------------------
def sensor_stream(
    sensor: Sensor, t_s: Array, value: Array, *, variance: Array | None = None, quality: Array | None = None,
    delay_s: float = 0.0, rejected: dict[str, int] | None = None,
) -> Stream | None:  # fmt: skip
    """A sensor's readings in time order; None where none is usable.

    t_s (n,), value (n, k), variance (n, k) and quality (n,) as in Stream. Variances that cannot be are as if
    unstated. Rows that are not finite, late, repeated, or beyond a sensor's possible values are counted in `rejected`.
    """
    count, width = len(t_s), len(COLUMNS[sensor])
    value = np.asarray(value, float).reshape(count, width)
    names = [f"value_{k}" for k in range(width)]
    spreads = [f"variance_{k}" for k in range(width)]
    columns = dict(zip(names, value.T, strict=True))
    stated = np.full((count, width), np.nan) if variance is None else np.array(variance, float).reshape(count, width)
    columns |= dict(zip(spreads, possible_variance(stated).T, strict=True))
    columns["quality"] = np.full(count, 255.0) if quality is None else np.asarray(quality, float)
    rows = Rows(np.asarray(t_s, float), columns, dict(rejected or {}))
    keep_possible(rows, sensor, names)
    put_in_order(rows)
    if not len(rows):
        return None
    return Stream.of(
        sensor, rows.t_s, rows.matrix(*names), variance=rows.matrix(*spreads),
        quality=np.clip(rows.columns["quality"], 0, 255), delay_s=delay_s, rejected=rows.rejected,
    )  # fmt: skip


def stream_of_rows(sensor: Sensor, rows: Rows, names: Sequence[str], delay_s: float) -> Stream:
    """The columns `names` of rows that are in order, within the sensor's possible values; the rest is counted."""
    keep_possible(rows, sensor, names)
    return Stream.of(sensor, rows.t_s, rows.matrix(*names), delay_s=delay_s, rejected=rows.rejected)


def keep_possible(rows: Rows, sensor: Sensor, names: Sequence[str]) -> None:
    """Leave the rows with a number where one must be, within the sensor's possible values; names: as COLUMNS has its
    values.
    """
    finite = np.isfinite(rows.t_s) & np.isfinite(rows.columns.get("quality", 0.0))
    for k, name in enumerate(names):
        if k not in MAY_LACK.get(sensor, ()):
            finite &= np.isfinite(rows.columns[name])
    rows.keep(finite, "not_finite")
    inside = np.ones(len(rows), bool)
    for name, most in zip(names, MOST.get(sensor, ()), strict=False):
        inside &= ~(np.abs(rows.columns[name]) > most)
    if sensor == Sensor.RANGE:
        inside &= rows.columns[names[0]] > 0.0
    if sensor == Sensor.ATTITUDE:
        inside &= np.abs(np.linalg.norm(rows.matrix(*names), axis=1) - 1.0) < UNIT_LENGTH_WITHIN
    if sensor == Sensor.LANDED:
        inside &= (rows.columns[names[0]] == 0.0) | (rows.columns[names[0]] == 1.0)
    rows.keep(inside, "out_of_range")


def counted(**bad: NDArray[np.bool_]) -> dict[str, int]:
    """How many rows are thrown away for each reason; reasons without any are left out."""
    return {reason: int(np.count_nonzero(rows)) for reason, rows in bad.items() if rows.any()}


def possible_variance(variance: Array) -> Array:
    """Variances with NaN, which is unstated, in place of those that cannot be; changes what it is given."""
    variance[~((variance > 0.0) & (variance < MOST_VARIANCE))] = np.nan
    return variance


def put_in_order(rows: Rows) -> None:
    """Throw late rows away, stray ones and repeated ones, and count them."""
    if np.any(np.diff(rows.t_s) < 0):
        rows.keep(longest_ordered(rows.t_s), "out_of_order")
    drop_strays(rows)
    drop_duplicates(rows)


def gps_streams(
    t_s: Array, fix_type: Array, place_deg_m: tuple[Array, Array, Array], velocity_ned_m_s: Array, *,
    position_variance: Array, delay_s: float = 0.0,
) -> tuple[list[Stream], Origin | None]:  # fmt: skip
    """Velocity, then position about the first fix, and that fix; nothing where no fix is 3-D (fix_type 3).

    place_deg_m: latitude, longitude, altitude. All (n,) but velocity and variance (n, 3), north, east, down; velocity
    is NaN where the receiver has none.
    """
    velocities, spreads = [f"vel_{k}" for k in range(3)], [f"var_{k}" for k in range(3)]
    named = zip((*PLACE, *velocities, *spreads), (*place_deg_m, *velocity_ned_m_s.T, *position_variance.T), strict=True)
    fixes = Rows(np.asarray(t_s, float), {name: np.asarray(column, float) for name, column in named})
    keep_fixes(fixes, np.asarray(fix_type))
    put_in_order(fixes)
    velocity, variance = fixes.matrix(*velocities), fixes.matrix(*spreads)
    velocity[(np.abs(velocity) > MOST[Sensor.GPS_VELOCITY][0]).any(axis=1)] = np.nan
    return streams_of_fixes(fixes, velocity, np.full_like(variance, np.nan), variance, delay_s)


def keep_fixes(fixes: Rows, fix_type: Array) -> None:
    """Leave the 3-D fixes (fix_type 3) on the earth and near the others; rows have the columns PLACE."""
    fixes.keep(fix_type >= 3, "no_fix")
    fixes.keep(np.isfinite(fixes.matrix(*PLACE)).all(axis=1) & np.isfinite(fixes.t_s), "not_finite")
    inside = (abs(fixes.columns["lat_deg"]) <= 90) & (abs(fixes.columns["lon_deg"]) <= 180)
    fixes.keep(inside & (abs(fixes.columns["alt_m"]) < MOST_ALTITUDE_M), "out_of_range")
    if len(fixes):
        fixes.keep(near_the_rest(fixes.columns["lat_deg"], fixes.columns["lon_deg"]), "out_of_range")


def streams_of_fixes(
    fixes: Rows, velocity: Array, velocity_variance: Array, position_variance: Array, delay_s: float
) -> tuple[list[Stream], Origin | None]:
    """Velocity (n, 3), then position about the first of the fixes, and that fix; nothing without one.

    No velocity where the receiver never sends one: it is a sensor that is not there, not one that fails.
    """
    if not len(fixes):
        return [], None
    wanted_streams = [(Sensor.GPS_POSITION, local_position(fixes), position_variance)]
    if np.isfinite(velocity).any():
        wanted_streams.insert(0, (Sensor.GPS_VELOCITY, velocity, velocity_variance))
    return [
        Stream.of(
            sensor, fixes.t_s, value, variance=possible_variance(variance), delay_s=delay_s, rejected=fixes.rejected
        )
        for sensor, value, variance in wanted_streams
    ], origin_of(fixes)


def pressure_altitude_m(pressure_pa: Array) -> Array:
    """Height in the standard atmosphere [m]; NaN where the pressure cannot be."""
    possible = (pressure_pa > 1e3) & (pressure_pa < 2e5)
    ratio = np.where(possible, pressure_pa, SEA_LEVEL_PA) / SEA_LEVEL_PA
    return np.where(possible, SCALE_HEIGHT_M * (1.0 - ratio**ALTITUDE_EXPONENT), np.nan)


def checked_size(path: Path, most_bytes: int = MOST_BYTES) -> int:
    """A file's bytes. InputError where they are more than a log ever has, or many of them were never written; OSError
    where there is no file.
    """
    size = an_input(path).stat().st_size
    if size > most_bytes:
        raise InputError(f"{path}: larger than {most_bytes >> 20} MB; cut the log into pieces")
    require_written(path, size)
    return size


def content_of(path: Path, what: str, most_bytes: int = MOST_BYTES) -> bytes:
    """A file's bytes. InputError where it cannot be read, or is larger than such a log ever is or than the memory."""
    try:
        size = checked_size(path, most_bytes)
        with path.open("rb") as file:
            return file.read(size)
    except MemoryError as error:
        raise InputError(f"{path}: {size >> 20} MB do not fit into the memory; cut the log into pieces") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give {what}") from error


def sha256_of(content: bytes) -> str:
    """The digest by which a record names its input."""
    return hashlib.sha256(content).hexdigest()
