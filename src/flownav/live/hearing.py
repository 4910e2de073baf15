"""From a vehicle's messages to readings that wait at the horizon: their time, their source, their age, their news.

And where the local frames begin: the navigator's, which never moves, and the autopilot's, which it may set late.
"""

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

from flownav.core.frames import Vector
from flownav.core.measurement import Measurement, Sensor
from flownav.live.filtering import FLOW
from flownav.live.horizon import LATE, Horizon, Lags, Serving, Source, Sources, Waiting
from flownav.live.options import Options
from flownav.live.reception import Vehicle, VehicleClock, sender_of
from flownav.logs.mavlink.converted import Context, Dropped, Pose
from flownav.logs.mavlink.framing import ARDUPILOT, Message
from flownav.logs.mavlink.messages import instance_of, measurements
from flownav.logs.mavlink.position_messages import LEAST_FIX, fix_deg_m, local_position_m

Geodetic = tuple[float, float, float]  # latitude, longitude [deg], altitude [m]
FARTHEST_M = 50_000.0  # from the vehicle, of an origin that can be (ArduPilot's own limit for home and origin)
HIGHEST_M = 5_000.0  # up or down: chosen
LEAST_MOVE_M = 0.01  # the tick of a latitude of 1e-7 deg
LONGEST_EXPOSURE_S = 0.2  # chosen: two periods of a PX4FLOW at 9.5 Hz; a longer step is a gap
GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
REPEATED = "repeated"
MEASURED_MARGIN_S = 0.02  # beyond a measured lag; batches of 0.2 s lose nothing (test_live_recordings)
NAN = float("nan")


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


class Hearing:
    """Messages in, waiting readings out (`horizon`).

    counts: by sensor and reason, readings that were dropped. readings, heard_s (our clock) and latest: by sensor, what
    was taken. newest_s: the vehicle's time of the newest reading; since_s: of the first since the start or the restart.
    """

    def __init__(self, options: Options) -> None:
        self._options = options
        self.sources, self.horizon, self.lags = Sources(), Horizon(), Lags(options.most_horizon_s)
        self.serving, self.origin = Serving(), Origin()
        self.counts: Counter[str] = Counter()
        self.readings: Counter[Sensor] = Counter()
        self.heard_s: dict[Sensor, float] = {}
        self.latest: dict[Sensor, Measurement] = {}
        self.newest_s = self.since_s = NAN
        self.gps_heard = self.flow_came = False
        self.flow_waited = 0  # flow readings that shared their estimate with a later one
        self._flow_s = NAN  # the vehicle's time of the last flow reading
        self._fixes: dict[Source, tuple[int, ...]] = {}

    def begin_anew(self) -> None:
        """The vehicle may be elsewhere now."""
        self.horizon.clear()
        self.lags.clear()
        self.serving.clear()
        self.newest_s = self.since_s = NAN
        self.gps_heard = False

    @property
    def horizon_s(self) -> float:
        """How far behind the newest reading an instant is when it is fused."""
        options = self._options
        return self.lags.horizon_s(options.least_horizon_s, MEASURED_MARGIN_S, options.most_horizon_s)

    @property
    def dropped(self) -> Counter[str]:
        """What was dropped, by sensor and reason."""
        other = {f"{sensor.name.lower()}: other source": n for sensor, n in self.sources.dropped.items()}
        return self.counts + self.horizon.dropped + Counter(other)

    def take(
        self,
        message: Message,
        clock: VehicleClock,
        vehicle: Vehicle,
        pose: Pose | None,
        now_s: float,
        heard: Callable[[Waiting], None],
        here_ned_m: Vector | None = None,
    ) -> str:
        """What a message measures; `heard` is told of each reading. here_ned_m: where a running navigator is, if any.
        Returns `clock_jump` where the autopilot began anew."""
        sender = sender_of(message)
        by_autopilot = sender == vehicle[:2]
        source = Source(message.msgname, instance_of(message), by_autopilot)
        aligned = clock.stamped(message, *sender, now_s)
        if aligned.event == "clock_jump" and by_autopilot:
            return "clock_jump"
        if message.msgname == "GPS_RAW_INT" and self._is_old(message, source, here_ned_m):
            return ""
        context = Context(vehicle.make == ARDUPILOT, by_autopilot, self.origin.navigator_deg_m, pose)
        for outcome in measurements(message, aligned.t_s, context):
            if isinstance(outcome, Dropped) or aligned.reason:
                reason = outcome.reason if isinstance(outcome, Dropped) else aligned.reason
                self.counts[f"{outcome.sensor.name.lower()}: {reason}"] += 1
            elif self.sources.takes(outcome.sensor, source, aligned.t_s):
                self._reading(outcome, now_s, heard)
        return ""

    def _is_old(self, message: Message, source: Source, here_ned_m: Vector | None) -> bool:
        """Whether a GPS message repeats a fix; the first of each is where the vehicle is."""
        self.gps_heard = True
        fix = message.time_usec, message.lat, message.lon, message.alt, message.vel, message.cog, message.fix_type
        if message.time_usec and self._fixes.get(source) == fix:
            self.counts[f"gps_position: {REPEATED}"] += 1
            return True
        self._fixes[source] = fix
        place = fix_deg_m(message)
        if message.fix_type >= LEAST_FIX and place is not None and self.origin.fixed(place, here_ned_m):
            self.counts["origin: refused"] += 1
        return False

    def _reading(self, reading: Measurement, now_s: float, heard: Callable[[Waiting], None]) -> None:
        exposure_s = 0.0
        if reading.sensor in GPS:
            reading = reading._replace(delay_s=self._options.gps_delay_s)
        elif reading.sensor in FLOW:
            reading, exposure_s = self._exposed(reading)
        instant_s = reading.t_s - reading.delay_s
        if reading.sensor != Sensor.LANDED:
            self.lags.heard(reading.sensor, instant_s)
        if not self.horizon.take(reading, exposure_s):
            self.serving.refused(reading.sensor, reading.t_s, LATE)
            return
        heard(Waiting(instant_s, 0, reading))
        self.readings[reading.sensor] += 1
        self.heard_s[reading.sensor], self.latest[reading.sensor] = now_s, reading
        self.newest_s = reading.t_s if self.newest_s != self.newest_s else max(self.newest_s, reading.t_s)
        self.flow_waited += self.flow_came and reading.sensor in FLOW
        self.flow_came = self.flow_came or reading.sensor in FLOW
        if reading.sensor == Sensor.LANDED:
            self.serving.landed(bool(reading.value[0]))
        if self.since_s != self.since_s:
            self.since_s = reading.t_s

    def _exposed(self, reading: Measurement) -> tuple[Measurement, float]:
        """A flow reading with its age and exposure: stated, or the time since the last, of which it is the middle."""
        exposure_s = 2.0 * reading.delay_s
        if not exposure_s:
            since_s = reading.t_s - self._flow_s
            exposure_s = since_s if 0.0 < since_s <= LONGEST_EXPOSURE_S else 0.1
        self._flow_s = reading.t_s
        known = self._options.identified
        return reading._replace(delay_s=known.latency_s if known else 0.5 * exposure_s), exposure_s
