"""GPS fixes as positions in the log's local frame. Rows have columns lat_deg, lon_deg, alt_m."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.logs.rows import Rows
from flownav.measurement import Array

FARTHEST_FIX_DEG = 0.5


def near_the_rest(fixes: Rows) -> NDArray[np.bool_]:
    """Fixes within half a degree of the middle one: a receiver's first are at times 0, 0 or where it was last used."""
    latitude, longitude = fixes.columns["lat_deg"], fixes.columns["lon_deg"]
    north = latitude - np.sort(latitude)[len(latitude) // 2]
    east = (longitude - np.sort(longitude)[len(longitude) // 2] + 180.0) % 360.0 - 180.0
    return np.asarray(np.hypot(north, east) < FARTHEST_FIX_DEG)


def origin_of(fixes: Rows) -> tuple[float, float, float]:
    """Latitude, longitude [deg] and altitude [m] of the first fix."""
    first = fixes.matrix("lat_deg", "lon_deg", "alt_m")[0]
    return float(first[0]), float(first[1]), float(first[2])


def local_position(fixes: Rows) -> Array:
    """North, east, down [m] about the first fix (n, 3)."""
    import pymap3d

    latitude, longitude, altitude = fixes.matrix("lat_deg", "lon_deg", "alt_m").T
    north, east, down = pymap3d.geodetic2ned(latitude, longitude, altitude, *origin_of(fixes))
    return np.column_stack([north, east, down])
