"""The flight that the sample logs are of, its log, what writers need of one, and the plainer logs written.

The folder of CSV files is what `logs/csv_folder.py` reads (docs/reference/csv-folder.md); a ground station's MAVLink
log holds the messages of the simulated vehicle of `live`, a time before each frame.
"""

import struct
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from flownav.campaigns.faults.table import log_of
from flownav.campaigns.local import fly_recorded
from flownav.core.measurement import COLUMNS, Array, Sensor
from flownav.core.parameter_files import shipped
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record, Table
from flownav.logs.log import Log
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario, with_vehicle

ORIGIN_DEG_M = (25.31, 55.49, 20.0)  # Sharjah, where the shipped magnetometer's field is from
SCENARIO, SENSOR = "samples/flight.toml", "samples/flow_sensor.toml"
RECORD_SCENARIO, VEHICLE = "pad_return", "quad-450"  # of the sample record; flown by the same kernel

MILLIGAUSS_PER_GAUSS = 1e3
FIX_3D = 3.0
Columns = dict[str, Array]
START_US = 1_767_225_600_000_000  # 2026-01-01: of the ground station's clock, which no flight was flown by
STEP_S = 0.002
LINK_S = 0.004  # from the vehicle to the ground station


@lru_cache(maxsize=2)
def sample_log(seed: int) -> Log:
    """The log of the sample flight: streams at their arrival, the truth, and the estimate that the autopilot used."""
    setup = assemble(load_scenario(str(shipped(SCENARIO))))
    return replace(log_of(fly_recorded(setup, seed), setup), origin_deg_m=ORIGIN_DEG_M)


def sample_record(seed: int) -> Record:
    """A flight of `pad_return` by the same vehicle; it states no time, so that a seed gives the same bytes."""
    setup = assemble(with_vehicle(load_scenario(RECORD_SCENARIO), VEHICLE))
    record = fly_recorded(setup, seed)
    record.manifest["command"] = f"flownav fly {RECORD_SCENARIO} --vehicle {VEHICLE} --seed {seed}"
    record.manifest["provenance"].pop("written_utc", None)
    return record


class Fixes(NamedTuple):
    """Fixes by arrival: t_s, lat_deg, lon_deg, alt_m (n,), velocity_ned_m_s (n, 3), and one standard deviation of each.

    sigma_m (n, 2): horizontal of one axis and vertical. sigma_m_s (n,). age_s: of a fix when it arrives.
    """

    t_s: Array
    lat_deg: Array
    lon_deg: Array
    alt_m: Array
    velocity_ned_m_s: Array
    sigma_m: Array
    sigma_m_s: Array
    age_s: float


def fixes_of(log: Log) -> Fixes:
    """The fixes of a log with an origin. ValueError where position and velocity do not come together."""
    import pymap3d

    position, velocity = log.streams[Sensor.GPS_POSITION], log.streams[Sensor.GPS_VELOCITY]
    if log.origin_deg_m is None or not np.array_equal(position.t_s, velocity.t_s):
        raise ValueError("fixes with a velocity each, about a known origin, are needed")
    latitude, longitude, altitude = (np.asarray(a) for a in pymap3d.ned2geodetic(*position.value.T, *log.origin_deg_m))
    sigma, sigma_velocity = np.sqrt(position.variance), np.sqrt(velocity.variance[:, 0])
    return Fixes(
        position.t_s, latitude, longitude, altitude, velocity.value, sigma[:, [0, 2]], sigma_velocity, position.delay_s
    )


def changes(log: Log) -> tuple[Array, Array]:
    """Times at which a vehicle landed or took off, the first reading among them, and 1 on the ground, 0 in flight."""
    stream = log.streams[Sensor.LANDED]
    landed = (stream.value[:, 0] > 0.5).astype(float)
    new = np.flatnonzero(np.concatenate([[True], np.diff(landed) != 0.0]))
    return stream.t_s[new], landed[new]


def angles_of(table: Table) -> Array:
    """Roll, pitch, yaw of a table's quaternions, (n, 3) [rad]."""
    return np.asarray(_rotations(table).as_euler("ZYX")[:, ::-1])


def velocities_ned(table: Table) -> Array:
    """A table's velocities, kept in body axes, as north, east, down (n, 3) [m/s]."""
    body = np.column_stack([np.asarray(table[name], float) for name in VELOCITY_BODY])
    return np.asarray(_rotations(table).apply(body))


def _rotations(table: Table) -> Rotation:
    """Body to earth."""
    w, x, y, z = (np.asarray(table[name], float) for name in QUATERNION)
    return Rotation.from_quat(np.column_stack([x, y, z, w]))


# -- the plainer logs ---------------------------------------------------------------------------------------------
def write_csv_folder(log: Log, folder: Path) -> None:
    """Write a file for each sensor of a log into a folder that is there."""
    for name, columns in tables_of(log):
        formats = ["%.9f" if key in ("lat_deg", "lon_deg") else "%.6f" if key == "t_s" else "%.9g" for key in columns]
        line = ",".join(formats)
        rows = np.column_stack(list(columns.values())).tolist()
        text = "\n".join([",".join(columns), *(line % tuple(row) for row in rows)]) + "\n"
        (folder / f"{name}.csv").write_text(text, encoding="utf-8", newline="\n")


def tables_of(log: Log) -> Iterator[tuple[str, Columns]]:
    """Name and columns of each file; the attitude is the one that the vehicle's autopilot flew on."""
    if log.autopilot is not None:
        own = log.autopilot
        angles = zip(("roll_rad", "pitch_rad", "yaw_rad"), angles_of(own).T, strict=True)
        yield "attitude", {"t_s": own["t_s"], **dict(angles)}
    for name, sensor in (("imu", Sensor.IMU), ("flow", Sensor.FLOW_RATE), ("baro", Sensor.BARO)):
        if sensor in log.streams:
            stream = log.streams[sensor]
            columns = {"t_s": stream.t_s, **dict(zip(COLUMNS[sensor], stream.value.T, strict=True))}
            yield name, columns | ({"quality": stream.quality} if sensor == Sensor.FLOW_RATE else {})
    if Sensor.GPS_POSITION in log.streams:
        yield "gps", _gps(fixes_of(log))
    if Sensor.RANGE in log.streams:
        ranges = log.streams[Sensor.RANGE]
        yield "range", {"t_s": ranges.t_s, "range_m": ranges.value[:, 0], "valid": (ranges.quality > 0.0).astype(float)}
    if Sensor.MAG in log.streams:
        field = log.streams[Sensor.MAG]
        names = (f"mag_{axis}_mgauss" for axis in "xyz")
        yield "mag", {"t_s": field.t_s, **dict(zip(names, MILLIGAUSS_PER_GAUSS * field.value.T, strict=True))}
    if Sensor.LANDED in log.streams:
        t_s, landed = changes(log)
        yield "landed", {"t_s": t_s, "landed": landed}
    if log.truth is not None:
        place = {f"{axis}_m": log.truth[name] for axis, name in zip("xyz", POSITION_NED, strict=True)}
        yield "truth", {"t_s": log.truth["t_s"], **place}
        yield "heading_truth", {"t_s": log.truth["t_s"], "yaw_rad": angles_of(log.truth)[:, 2]}


def _gps(fixes: Fixes) -> Columns:
    velocity = dict(zip((f"vel_{axis}_m_s" for axis in "ned"), fixes.velocity_ned_m_s.T, strict=True))
    place = {"lat_deg": fixes.lat_deg, "lon_deg": fixes.lon_deg, "alt_m": fixes.alt_m}
    return {"t_s": fixes.t_s, "fix_type": np.full(len(fixes.t_s), FIX_3D), **place, **velocity}


def write_tlog(log: Log, path: Path) -> None:
    """Write a log as a .tlog. InputError where pymavlink is not installed."""
    from flownav.live.simulated import SimulatedVehicle

    vehicle, parts = SimulatedVehicle(log), []
    for t_s in np.arange(0.0, vehicle.end_s + STEP_S, STEP_S).tolist():
        stamp = struct.pack(">Q", START_US + round((t_s + LINK_S) * 1e6))
        parts += [stamp + frame for frame in vehicle.due(t_s, 0.0)]
    path.write_bytes(b"".join(parts))
