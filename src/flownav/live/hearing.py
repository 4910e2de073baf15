"""From a vehicle's messages to readings that wait at the horizon: their time, their source, their age, their news.

And where the local frames begin: the navigator's, which never moves, and the autopilot's, which it may set late.
"""

import math
from collections import Counter, deque
from typing import Any

from flownav.core.frames import Vector
from flownav.core.measurement import Measurement, Sensor
from flownav.live.filtering import FLOW, handed_over
from flownav.live.horizon import LATE, Lags, Serving, Source, Sources
from flownav.live.inertial import Inertial
from flownav.live.options import Options
from flownav.live.reception import Vehicle, sender_of
from flownav.live.repeats import CONTENT, Repeats
from flownav.live.vehicle_clock import VehicleClock
from flownav.logs.mavlink.converted import Context, Dropped, Pose
from flownav.logs.mavlink.framing import ARDUPILOT, PX4, Message
from flownav.logs.mavlink.messages import instance_of, measurements
from flownav.logs.mavlink.position_messages import LEAST_FIX, fix_deg_m, local_position_m
from flownav.navigation import waiting
from flownav.navigation.feed import SLOWEST_IMU_HZ
from flownav.navigation.rings import Rings

Geodetic = tuple[float, float, float]  # latitude, longitude [deg], altitude [m]
FAR_M = 1000.0  # of an origin from the first fix that is believed without asking where the vehicle is in it: chosen
STEP_M = 10.0  # of an origin, once an estimate was sent, likewise: chosen, what GPS and an autopilot may differ by
AGREEMENTS, FITS = 3, 0.5  # so often in a row, and by so much better than the other: chosen
FARTHEST_M = 50_000.0  # from the vehicle, of an origin that can be (ArduPilot's own limit for home and origin)
HIGHEST_M = 5_000.0  # up or down: chosen
LEAST_MOVE_M = 0.01  # the tick of a latitude of 1e-7 deg
LONGEST_EXPOSURE_S = 0.2  # chosen: two periods of a PX4FLOW at 9.5 Hz; a longer step is a gap
GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
REPEATED = "repeated"
NOTHING = "no_data"  # six zeros: no vehicle neither turns nor feels anything, not even in free fall
CROWDED = "crowded"  # closer together than any autopilot measures
UNBIASED = "SCALED_IMU"
LEAST_UNBIASED = 25  # readings by which its rate is known: chosen
MEASURED_MARGIN_S = 0.02  # beyond a measured lag; batches of 0.2 s lose nothing (test_live_recordings)
NAN = float("nan")


class Origin:
    """The origin of the navigator's frame, and where that lies in the autopilot's.

    The navigator's is what the autopilot told before the first fix, else the first fix; positions that it was fed are
    about it, so it stays. An autopilot that sets its own later, or another, moves what is sent by the difference, which
    is a jump of the estimate (`moves` counts them). One that no vehicle of this place can have is refused (`refused`).

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
        self._told: Geodetic | None = None
        self._fix: Geodetic | None = None

    @property
    def about_deg_m(self) -> Geodetic | None:
        """Where on earth the vehicle is, as far as anybody said."""
        return self.navigator_deg_m or self._told

    def told(self, place: Geodetic, *, settled: bool = False) -> str:
        """GPS_GLOBAL_ORIGIN: "" where nothing changes, `moved`, `refused`, `doubted`. settled: an estimate was sent."""
        if not can_be(place, self._fix):
            self.refused += 1
            return "refused"
        if self._is_doubtful(place, settled=settled):
            self._agreed = 0 if place != self.doubted else self._agreed
            self.doubted = place
            return "doubted"
        self._told, self.doubted = place, None
        if self.navigator_deg_m is None:
            return ""
        return self._laid(place)

    def fixed(self, place: Geodetic, here_ned_m: Vector | None = None) -> str:
        """A GPS fix: "", `moved`, `doubted` or `refused`. The first one judges what was told before it, and is the
        origin where nothing that can be was.

        here_ned_m: where a navigator that began without GPS is by now; the fix is there, and the origin behind it.
        """
        self._fix = place
        if self.navigator_deg_m is not None:
            return ""
        known = self._told is not None and can_be(self._told, place)
        far = self._told is not None and math.dist(local_position_m(self._told, place), (0.0, 0.0, 0.0)) > FAR_M
        if known and here_ned_m is None and not far:
            self.navigator_deg_m = self._told
            return ""
        self.navigator_deg_m = place if here_ned_m is None else _behind(place, here_ned_m)
        if self._told is None:
            return ""
        if known and not far:
            return self._laid(self._told)
        self.doubted, self._told = self._told if known else None, None
        self.refused += not known
        return "doubted" if known else "refused"

    def _is_doubtful(self, place: Geodetic, *, settled: bool) -> bool:
        """Whether somebody else has to say the same before it is believed."""
        used = self._told or self.navigator_deg_m
        if self.navigator_deg_m is None or used is None:
            return False
        return math.dist(local_position_m(place, used), (0.0, 0.0, 0.0)) > (STEP_M if settled else FAR_M)

    def stands(self, pos_ned_m: Vector) -> str:
        """Where the autopilot is about its own origin, by itself: "" where it decides nothing, `moved` or `refused`."""
        used, fix = self._told or self.navigator_deg_m, self._fix
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
        self._told = place
        return self._laid(place)

    def as_facts(self) -> dict[str, Any]:
        """What is told of it as JSON."""
        facts = {"offset_ned_m": list(self.offset_ned_m), "moves": self.moves, "refused": self.refused}
        return facts | {"doubted": list(self.doubted) if self.doubted else None}

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
    """Messages in, readings that wait out (`rings`).

    counts: by sensor and reason, readings that were dropped. readings, heard_s (our clock) and latest: by sensor, what
    was taken. newest_s: the vehicle's time of the newest reading; since_s: of the first since the start or the restart.
    """

    def __init__(self, options: Options, rings: Rings) -> None:
        self._options = options
        self.sources, self.rings, self.lags = Sources(), rings, Lags(options.most_horizon_s)
        self.serving, self.origin = Serving(), Origin()
        self.counts: Counter[str] = Counter()
        self.readings: Counter[Sensor] = Counter()
        self.heard_s: dict[Sensor, float] = {}
        self.latest: dict[Sensor, Measurement] = {}
        self.newest_s = self.since_s = NAN
        self.gps_heard = self.flow_came = False
        self.flow_waited = 0  # flow readings that shared their estimate with a later one
        self._flow_s = NAN  # the vehicle's time of the last flow reading
        self.repeats, self.inertial = Repeats(), Inertial()
        self._unbiased_s: deque[float] = deque(maxlen=LEAST_UNBIASED)
        self.swaps: deque[tuple[float, Source, str]] = deque()  # inertial sources that were found wrong, since when

    def begin_anew(self) -> None:
        """The vehicle may be elsewhere now."""
        self.rings.clear()
        self.lags.clear()
        self.serving.clear()
        self.inertial.clear()
        self.sources.barred.clear()
        self._unbiased_s.clear()
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
        return self.counts + Counter(other)

    def take(
        self,
        message: Message,
        clock: VehicleClock,
        vehicle: Vehicle,
        pose: Pose | None,
        now_s: float,
        here_ned_m: Vector | None = None,
    ) -> str:
        """What a message measures, onto the rings. here_ned_m: where a running navigator is, if any.
        Returns `clock_jump` where the autopilot began anew."""
        sender = sender_of(message)
        by_autopilot = sender == vehicle[:2]
        source = Source(message.msgname, instance_of(message), by_autopilot)
        aligned = clock.stamped(message, *sender, now_s)
        if aligned.event == "clock_jump" and by_autopilot:
            return "clock_jump"
        if self.repeats.is_old(message, source, aligned.t_s):
            self.counts[f"{CONTENT[message.msgname][0].name.lower()}: {REPEATED}"] += 1
            return ""
        if message.msgname == "GPS_RAW_INT":
            self._fix(message, here_ned_m)
        context = Context(vehicle.make == ARDUPILOT, by_autopilot, self.origin.navigator_deg_m, pose)
        for outcome in measurements(message, aligned.t_s, context):
            if isinstance(outcome, Dropped) or aligned.reason:
                reason = outcome.reason if isinstance(outcome, Dropped) else aligned.reason
                self.counts[f"{outcome.sensor.name.lower()}: {reason}"] += 1
            elif (
                outcome.sensor != Sensor.IMU or self._compared(source, vehicle, outcome, now_s)
            ) and self.sources.takes(outcome.sensor, source, aligned.t_s):
                self._reading(outcome, now_s)
        return ""

    def _compared(self, source: Source, vehicle: Vehicle, reading: Measurement, now_s: float) -> bool:
        """An inertial reading, held against the others' where it is news; whether it says anything."""
        if self.repeats.is_crowded(source, reading.t_s):
            self.counts[f"imu: {CROWDED}"] += 1
            return False
        self._prefer(source, vehicle, reading.t_s)
        self._compare(source, reading, now_s)
        if not any(reading.value):
            self.counts[f"imu: {NOTHING}"] += 1
            return False
        return True

    def _prefer(self, source: Source, vehicle: Vehicle, t_s: float) -> None:
        """PX4's HIGHRES_IMU has EKF2's own biases taken off, and what EKF2 learns wrong by our heading would come back
        as a gyro that agrees; SCALED_IMU has not. It goes before where it comes as often as is needed.
        """
        if vehicle.make != PX4 or source.message != UNBIASED or not source.by_autopilot:
            return
        self._unbiased_s.append(t_s)
        if (
            t_s - self._unbiased_s[0] <= len(self._unbiased_s) / SLOWEST_IMU_HZ
            and len(self._unbiased_s) == LEAST_UNBIASED
        ):
            self.sources.first[Sensor.IMU] = UNBIASED
        elif len(self._unbiased_s) == LEAST_UNBIASED:
            self.sources.first.pop(Sensor.IMU, None)

    def _compare(self, source: Source, reading: Measurement, now_s: float) -> None:
        """An inertial reading beside the others'. What a wrong one said is taken back, another's put in its place."""
        barred = self.sources.barred.get(Sensor.IMU, set())
        swap = self.inertial.heard(source, reading, self.sources.chosen(Sensor.IMU), barred)
        alone = not self.sources.alive(Sensor.IMU, reading.t_s)
        if source in barred and self.inertial.recovered(source, reading.t_s, alone=alone):
            barred.discard(source)
        if swap is None:
            return
        self.sources.bar(Sensor.IMU, swap.barred)
        self.counts[f"imu: {swap.why}"] += self.rings.take_back(swap.since_s)
        self.swaps.append((swap.since_s, swap.barred, swap.why))
        for sample in swap.others:
            self._reading(sample.reading, now_s)

    def _fix(self, message: Message, here_ned_m: Vector | None) -> None:
        """A receiver is one that has had a fix (ArduPilot tells of one that it does not have); the first of all fixes
        is where the vehicle is."""
        place = fix_deg_m(message)
        if message.fix_type < LEAST_FIX or place is None:
            return
        self.gps_heard = True
        if self.origin.fixed(place, here_ned_m) == "refused":
            self.counts["origin: refused"] += 1

    def _reading(self, reading: Measurement, now_s: float) -> None:
        exposure_s = 0.0
        if reading.sensor in GPS:
            reading = reading._replace(delay_s=self._options.gps_delay_s)
        elif reading.sensor in FLOW:
            reading, exposure_s = self._exposed(reading)
        instant_s = reading.t_s - reading.delay_s
        if reading.sensor != Sensor.LANDED:
            self.lags.heard(reading.sensor, instant_s)
        said = self.rings.take(handed_over(reading, exposure_s, self._options.identified))
        if said != waiting.TAKEN:
            why = LATE if said == waiting.LATE else "overflow"
            self.counts[f"{reading.sensor.name.lower()}: {why}"] += 1
            self.serving.refused(reading.sensor, reading.t_s, LATE)
            return
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
