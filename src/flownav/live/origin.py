"""Where the local frames begin: the navigator's, which never moves, and the autopilot's, which it may set late."""

import math
from typing import Any

from flownav.core.frames import Vector
from flownav.logs.mavlink.position_messages import local_position_m

Geodetic = tuple[float, float, float]  # latitude, longitude [deg], altitude [m]
FAR_M = 1000.0  # of an origin from the first fix that is believed without asking where the vehicle is in it: chosen
STEP_M = 10.0  # of an origin, once an estimate was sent, likewise: chosen, what GPS and an autopilot may differ by
AGREEMENTS, FITS = 3, 0.5  # so often in a row, and by so much better than the other: chosen
FARTHEST_M = 50_000.0  # from the vehicle, of an origin that can be (ArduPilot's own limit for home and origin)
HIGHEST_M = 5_000.0  # up or down: chosen
LEAST_MOVE_M = 0.01  # the tick of a latitude of 1e-7 deg


class Origin:
    """The origin of the navigator's frame, and where that lies in the autopilot's.

    The navigator's is the origin that the autopilot sent before the first fix, else the first fix; positions that it
    was fed are about it, so it stays. An autopilot that sets its own later, or another, moves what is sent by the
    difference, which is a jump of the estimate (`moves` counts them). One that no vehicle of this place can have is
    refused (`refused`).

    One message is one witness: an origin far from the first fix, or another one once an estimate was sent, is doubted
    (`doubted`). The autopilot's own position (LOCAL_POSITION_NED) is about its origin, so that with it and the fixes
    one of the two fits: the doubted one, or the one that was.
    """

    def __init__(self) -> None:
        self.navigator_deg_m: Geodetic | None = None
        self.offset_ned_m: Vector = (0.0, 0.0, 0.0)  # of the navigator's origin in the autopilot's frame
        self.moves = self.refused = 0
        self.doubted: Geodetic | None = None
        self._agreed = 0  # positions in a row that fit the doubted one, less than 0 those that fit the other
        self._received: Geodetic | None = None
        self._fix: Geodetic | None = None

    @property
    def about_deg_m(self) -> Geodetic | None:
        """The geodetic place of the navigator's origin, else the one that the autopilot sent; None without either."""
        return self.navigator_deg_m or self._received

    def received(self, place: Geodetic, *, settled: bool = False) -> str:
        """GPS_GLOBAL_ORIGIN: "" where nothing changes, `moved`, `refused`, `doubted`. settled: an estimate was sent."""
        if not can_be(place, self._fix):
            self.refused += 1
            return "refused"
        if self._is_doubtful(place, settled=settled):
            self._agreed = 0 if place != self.doubted else self._agreed
            self.doubted = place
            return "doubted"
        self._received, self.doubted = place, None
        if self.navigator_deg_m is None:
            return ""
        return self._laid(place)

    def fixed(self, place: Geodetic, here_ned_m: Vector | None = None) -> str:
        """A GPS fix: "", `moved`, `doubted` or `refused`. The first one checks the origin that was received before it,
        and is the origin where none that is possible was received.

        here_ned_m: where a navigator that began without GPS is by now; the fix is there, and the origin behind it.
        """
        self._fix = place
        if self.navigator_deg_m is not None:
            return ""
        known = self._received is not None and can_be(self._received, place)
        far = self._received is not None and math.dist(local_position_m(self._received, place), (0.0, 0.0, 0.0)) > FAR_M
        if known and here_ned_m is None and not far:
            self.navigator_deg_m = self._received
            return ""
        self.navigator_deg_m = place if here_ned_m is None else _behind(place, here_ned_m)
        if self._received is None:
            return ""
        if known and not far:
            return self._laid(self._received)
        self.doubted, self._received = self._received if known else None, None
        self.refused += not known
        return "doubted" if known else "refused"

    def _is_doubtful(self, place: Geodetic, *, settled: bool) -> bool:
        """Whether another witness has to confirm the origin before it is used."""
        used = self._received or self.navigator_deg_m
        if self.navigator_deg_m is None or used is None:
            return False
        return math.dist(local_position_m(place, used), (0.0, 0.0, 0.0)) > (STEP_M if settled else FAR_M)

    def stands(self, pos_ned_m: Vector) -> str:
        """Where the autopilot is about its own origin, by itself: "" where it decides nothing, `moved` or `refused`."""
        used, fix = self._received or self.navigator_deg_m, self._fix
        if self.doubted is None or used is None or fix is None:
            return ""
        new_m, old_m = (math.dist(local_position_m(fix, origin), pos_ned_m) for origin in (self.doubted, used))
        fits = int(new_m < FITS * old_m) - int(old_m < FITS * new_m)
        self._agreed = self._agreed + fits if fits * self._agreed >= 0 and fits else fits
        if abs(self._agreed) < AGREEMENTS:
            return ""
        place, believed = self.doubted, self._agreed > 0
        self.doubted, self._agreed = None, 0
        if not believed:
            self.refused += 1
            return "refused"
        self._received = place
        return self._laid(place)

    def as_facts(self) -> dict[str, Any]:
        """The origin as a JSON object."""
        facts = {"offset_ned_m": list(self.offset_ned_m), "moves": self.moves, "refused": self.refused}
        return facts | {"doubted": list(self.doubted) if self.doubted else None}

    def _laid(self, stated: Geodetic) -> str:
        """North and east of the earth's shape, down the difference of altitudes, as autopilots reckon."""
        assert self.navigator_deg_m is not None
        north_m, east_m, _ = local_position_m(self.navigator_deg_m, stated)
        offset_ned_m = north_m, east_m, stated[2] - self.navigator_deg_m[2]
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
