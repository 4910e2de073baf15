"""A log's GPS readings as a receiver states them: place in degrees, velocity, accuracies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array, Sensor
from flownav.logs.log import Log


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
