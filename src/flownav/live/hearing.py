"""From a vehicle's messages to readings that wait at the horizon: their time, their source, their age, their news."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from flownav.core.frames import Vector
from flownav.core.measurement import Measurement, Sensor
from flownav.live.filtering import FLOW
from flownav.live.horizon import Horizon, Waiting
from flownav.live.lags import Lags
from flownav.live.options import Options
from flownav.live.origin import Origin
from flownav.live.reception import Vehicle, sender_of
from flownav.live.serving import LATE, Serving
from flownav.live.sources import Source, Sources
from flownav.live.timing import VehicleClock
from flownav.mavlink.converted import Context, Dropped, Pose
from flownav.mavlink.dialect import ARDUPILOT, Message
from flownav.mavlink.messages import instance_of, measurements
from flownav.mavlink.position_messages import LEAST_FIX, fix_deg_m

LONGEST_EXPOSURE_S = 0.2
GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
REPEATED = "repeated"
MEASURED_MARGIN_S = 0.02  # beyond a lag that was measured: a period of a fast IMU, and jitter
NAN = float("nan")


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
                self._dropped(outcome.sensor, outcome.reason if isinstance(outcome, Dropped) else aligned.reason)
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

    def _dropped(self, sensor: Sensor, reason: str) -> None:
        self.counts[f"{sensor.name.lower()}: {reason}"] += 1

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
