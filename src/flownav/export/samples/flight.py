"""The flight that the sample logs are of, its log, and what writers need of one: fixes, angles, velocities, changes."""

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from flownav.campaigns.faults.table import log_of
from flownav.campaigns.local import fly_recorded
from flownav.core.measurement import Array, Sensor
from flownav.core.parameter_files import shipped
from flownav.core.record import QUATERNION, VELOCITY_BODY, Record, Table
from flownav.logs.log import Log
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario, with_vehicle

ORIGIN_DEG_M = (25.31, 55.49, 20.0)  # Sharjah, where the shipped magnetometer's field is from
SCENARIO, SENSOR = "samples/flight.toml", "samples/flow_sensor.toml"
RECORD_SCENARIO, VEHICLE = "pad_return", "quad-450"  # of the sample record; flown by the same kernel


@lru_cache(maxsize=2)
def sample_log(seed: int) -> Log:
    """What the vehicle of the sample flight logged: streams at their arrival, the truth, the estimate it flew on."""
    setup = assemble(load_scenario(str(shipped(SCENARIO))))
    return replace(log_of(fly_recorded(setup, seed), setup), origin_deg_m=ORIGIN_DEG_M)


def sample_record(seed: int) -> Record:
    """A flight of `pad_return` by the same vehicle; it does not say when, so that a seed gives the same bytes."""
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
