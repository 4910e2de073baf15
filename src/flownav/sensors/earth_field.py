"""Where magnetic north lies: the declination of the World Magnetic Model (NOAA, by pygeomag)."""

from __future__ import annotations

import math
from functools import cache

MODEL_YEAR = 2026.0  # declination changes by less than 0.3 deg a year; logs seldom say which year they are of
COARSE_DEG = 0.1


def declination_rad(origin_deg_m: tuple[float, float, float] | None) -> float:
    """Heading of magnetic north at latitude, longitude [deg], altitude [m], clockwise from true north [rad].

    0 where there is no origin, or the needle does not know (at the poles).
    """
    if origin_deg_m is None or not all(math.isfinite(value) for value in origin_deg_m):
        return 0.0
    latitude, longitude, _ = origin_deg_m
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        return 0.0
    return _declination_rad(round(latitude / COARSE_DEG), round(longitude / COARSE_DEG))


@cache
def _declination_rad(latitude_steps: int, longitude_steps: int) -> float:
    from pygeomag import GeoMag

    field = GeoMag().calculate(
        glat=latitude_steps * COARSE_DEG, glon=longitude_steps * COARSE_DEG, alt=0.0, time=MODEL_YEAR
    )
    declination = math.radians(float(field.d))
    return declination if math.isfinite(declination) else 0.0
