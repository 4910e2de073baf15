"""Geodetic fixes as local positions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.measurement import Array

FARTHEST_FIX_DEG = 0.5

Origin = tuple[float, float, float]


def near_the_rest(latitude_deg: Array, longitude_deg: Array) -> NDArray[np.bool_]:
    """Fixes within half a degree of the middle one: a receiver's first are at times 0, 0 or where it was last used."""
    north = latitude_deg - np.sort(latitude_deg)[len(latitude_deg) // 2]
    east = (longitude_deg - np.sort(longitude_deg)[len(longitude_deg) // 2] + 180.0) % 360.0 - 180.0
    return np.asarray(np.hypot(north, east) < FARTHEST_FIX_DEG)


def local_ned(geodetic_deg_m: Array, origin_deg_m: Origin) -> Array:
    """North, east, down [m] about an origin; latitude, longitude [deg] and altitude [m] in, shape (n, 3) both."""
    import pymap3d

    return np.column_stack(pymap3d.geodetic2ned(*geodetic_deg_m.T, *origin_deg_m))
