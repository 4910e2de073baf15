"""Geodetic positions: which fixes belong together, and where they lie in the log's local frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.logs.rows import Rows

FARTHEST_FIX_DEG = 0.5

Origin = tuple[float, float, float]  # latitude, longitude [deg], altitude [m]


def near_the_rest(latitude_deg: Array, longitude_deg: Array) -> NDArray[np.bool_]:
    """Fixes within half a degree of the middle one: a receiver's first are at times 0, 0 or where it was last used."""
    north = latitude_deg - np.sort(latitude_deg)[len(latitude_deg) // 2]
    east = (longitude_deg - np.sort(longitude_deg)[len(longitude_deg) // 2] + 180.0) % 360.0 - 180.0
    return np.asarray(np.hypot(north, east) < FARTHEST_FIX_DEG)


def origin_of(fixes: Rows) -> Origin:
    """The first fix. Rows have columns lat_deg, lon_deg, alt_m."""
    first = fixes.matrix("lat_deg", "lon_deg", "alt_m")[0]
    return float(first[0]), float(first[1]), float(first[2])


def local_position(fixes: Rows) -> Array:
    """North, east, down [m] about the first fix (n, 3). Rows have columns lat_deg, lon_deg, alt_m."""
    return local_ned(fixes.matrix("lat_deg", "lon_deg", "alt_m"), origin_of(fixes))


def local_ned(geodetic_deg_m: Array, origin: Origin) -> Array:
    """North, east, down [m] about an origin; latitude, longitude [deg] and altitude [m] in, shape (n, 3) both."""
    import pymap3d

    return np.column_stack(pymap3d.geodetic2ned(*geodetic_deg_m.T, *origin))
