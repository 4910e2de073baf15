"""Where the local frames begin: the navigator's, which never moves, and the autopilot's, which it may set late."""

from __future__ import annotations

import math
from typing import Any

from flownav.core.frames import Vector
from flownav.mavlink.position_messages import local_position_m

Geodetic = tuple[float, float, float]  # latitude, longitude [deg], altitude [m]
FARTHEST_M = 50_000.0  # from the vehicle, of an origin that can be (ArduPilot's own limit for home and origin)
HIGHEST_M = 5_000.0
LEAST_MOVE_M = 0.01


class Origin:
    """The origin of the navigator's frame, and where that lies in the autopilot's.

    The navigator's is what the autopilot told before the first fix, else the first fix; positions that it was fed are
    about it, so it stays. An autopilot that sets its own later, or another, moves what is sent by the difference, which
    is a jump of the estimate (`moves` counts them). One that no vehicle of this place can have is refused (`refused`).
    """

    def __init__(self) -> None:
        self.navigator_deg_m: Geodetic | None = None
        self.offset_ned_m: Vector = (0.0, 0.0, 0.0)  # of the navigator's origin in the autopilot's frame
        self.moves = self.refused = 0
        self._told: Geodetic | None = None
        self._fix: Geodetic | None = None

    def told(self, place: Geodetic) -> str:
        """GPS_GLOBAL_ORIGIN: "" where nothing changes, `moved`, or `refused`."""
        if not can_be(place, self._fix):
            self.refused += 1
            return "refused"
        self._told = place
        if self.navigator_deg_m is None:
            return ""
        return self._laid(place)

    def fixed(self, place: Geodetic, here_ned_m: Vector | None = None) -> str:
        """A GPS fix. The first one judges what was told before it, and is the origin where nothing that can be was.

        here_ned_m: where a navigator that began without GPS is by now; the fix is there, and the origin behind it.
        """
        self._fix = place
        if self.navigator_deg_m is not None:
            return ""
        if self._told is not None and can_be(self._told, place):
            self.navigator_deg_m = self._told
            return ""
        self.navigator_deg_m = place if here_ned_m is None else _behind(place, here_ned_m)
        if self._told is None:
            return ""
        self.refused += 1
        return "refused"

    def as_facts(self) -> dict[str, Any]:
        """What is told of it as JSON."""
        return {"offset_ned_m": list(self.offset_ned_m), "moves": self.moves, "refused": self.refused}

    def _laid(self, told: Geodetic) -> str:
        """North and east of the earth's shape, down the difference of altitudes, as autopilots reckon."""
        assert self.navigator_deg_m is not None
        north_m, east_m, _ = local_position_m(self.navigator_deg_m, told)
        offset_ned_m = north_m, east_m, told[2] - self.navigator_deg_m[2]
        if math.dist(offset_ned_m, self.offset_ned_m) < LEAST_MOVE_M:
            return ""
        self.offset_ned_m = offset_ned_m
        self.moves += 1
        return "moved"


def _behind(place: Geodetic, here_ned_m: Vector) -> Geodetic:
    """The origin of which a place lies at a position of the local frame."""
    import pymap3d

    north_m, east_m, down_m = here_ned_m
    latitude, longitude, altitude_m = pymap3d.ned2geodetic(-north_m, -east_m, -down_m, *place)
    return float(latitude), float(longitude), float(altitude_m)


def can_be(place: Geodetic, fix: Geodetic | None) -> bool:
    """Whether a place is on the earth, is not the 0, 0 of nothing known, and lies in reach of a fix, if any."""
    latitude, longitude, altitude_m = place
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and (latitude or longitude)):
        return False
    if fix is None:
        return True
    north_m, east_m, _ = local_position_m(place, fix)
    return math.hypot(north_m, east_m) <= FARTHEST_M and abs(altitude_m - fix[2]) <= HIGHEST_M
