"""From a vehicle's messages to readings that wait at the horizon: their time, their source, their age, their news."""

from collections import Counter, deque

from flownav.core.frames import Vector
from flownav.core.measurement import Measurement, Sensor
from flownav.live.field import Field
from flownav.live.filtering import FLOW, given_of
from flownav.live.horizon import LATE, Lags, Serving, Source, Sources
from flownav.live.inertial import Inertial
from flownav.live.options import Options
from flownav.live.origin import Origin
from flownav.live.reception import Vehicle, sender_of
from flownav.live.repeats import CONTENT, Repeats
from flownav.live.vehicle_clock import VehicleClock
from flownav.logs.mavlink.converted import Context, Dropped, Pose
from flownav.logs.mavlink.framing import ARDUPILOT, PX4, Message
from flownav.logs.mavlink.messages import instance_of, measurements
from flownav.logs.mavlink.position_messages import LEAST_FIX, fix_deg_m
from flownav.navigation import waiting
from flownav.navigation.feed import SLOWEST_IMU_HZ
from flownav.navigation.rings import Rings

LONGEST_EXPOSURE_S = 0.2  # chosen: two periods of a PX4FLOW at 9.5 Hz; a longer step is a gap
GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
REPEATED = "repeated"
NOTHING = "no_data"  # six zeros: no vehicle neither turns nor feels anything, not even in free fall
CROWDED = "crowded"  # closer together than any autopilot measures
UNBIASED = "SCALED_IMU"
LEAST_UNBIASED = 25  # readings by which its rate is known: chosen
MEASURED_MARGIN_S = 0.02  # beyond a measured lag; batches of 0.2 s lose nothing (test_live_recordings)
NAN = float("nan")


class Intake:
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
        self.received_s: dict[Sensor, float] = {}
        self.latest: dict[Sensor, Measurement] = {}
        self.newest_s = self.since_s = NAN
        self.gps_received = self.flow_arrived = False
        self.flow_waited = 0  # flow readings that shared their estimate with a later one
        self._flow_s = NAN  # the vehicle's time of the last flow reading
        self.repeats, self.inertial, self.field = Repeats(), Inertial(), Field()
        self._unbiased_s: deque[float] = deque(maxlen=LEAST_UNBIASED)
        self.swaps: deque[tuple[float, Source, str]] = deque()  # inertial sources that were found wrong, since when

    def begin_anew(self) -> None:
        """The vehicle may be elsewhere now."""
        self.rings.clear()
        self.lags.clear()
        self.serving.clear()
        self.inertial.clear()
        self.field.clear()
        self.sources.barred.clear()
        self._unbiased_s.clear()
        self.newest_s = self.since_s = NAN
        self.gps_received = False

    def forget_vehicle(self) -> None:
        """Another autopilot is the vehicle now, which may be another vehicle: nothing of the one before is known of it,
        neither where its frame begins nor what it read last.
        """
        self.begin_anew()
        dropped, self.sources = self.sources.dropped, Sources()
        self.sources.dropped = dropped
        self.origin, self.repeats = Origin(), Repeats()
        self.latest.clear()
        self.swaps.clear()
        self._flow_s = NAN

    @property
    def horizon_s(self) -> float:
        """How far behind the newest reading an instant is when it is fused."""
        options = self._options
        return self.lags.horizon_s(options.least_horizon_s, MEASURED_MARGIN_S, options.most_horizon_s)

    @property
    def dropped(self) -> Counter[str]:
        """Number of dropped readings by sensor and reason."""
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
        """Put a message's measurements onto the rings. here_ned_m: where a running navigator is, if any.
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
        if vehicle.make == PX4 and by_autopilot and message.msgname == UNBIASED:
            self.field.sensed(message, aligned.t_s)
        for outcome in measurements(message, aligned.t_s, context):
            if isinstance(outcome, Dropped) or aligned.reason:
                reason = outcome.reason if isinstance(outcome, Dropped) else aligned.reason
                self.counts[f"{outcome.sensor.name.lower()}: {reason}"] += 1
            elif (
                outcome.sensor != Sensor.IMU or self._compared(source, vehicle, outcome, now_s)
            ) and self.sources.takes(outcome.sensor, source, aligned.t_s):
                self._reading(self._restored(outcome), now_s)
        return ""

    def _restored(self, reading: Measurement) -> Measurement:
        """A magnetometer's reading without what PX4's EKF2 has learnt of it; all others as they are."""
        if reading.sensor != Sensor.MAG:
            return reading
        x, y, z = reading.value[:3]
        return reading._replace(value=self.field.restored((x, y, z), reading.t_s))

    def _compared(self, source: Source, vehicle: Vehicle, reading: Measurement, now_s: float) -> bool:
        """Whether an inertial reading may be used: new, and compared with the other sources'."""
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
        """Compare an inertial reading with the other sources'. Readings of a faulty source are taken back and another
        source's are put in their place.
        """
        barred = self.sources.barred.get(Sensor.IMU, set())
        swap = self.inertial.received(source, reading, self.sources.chosen(Sensor.IMU), barred)
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
        """A receiver is one that has had a fix (ArduPilot reports one that it does not have); the first of all fixes
        is where the vehicle is."""
        place = fix_deg_m(message)
        if message.fix_type < LEAST_FIX or place is None:
            return
        self.gps_received = True
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
            self.lags.received(reading.sensor, instant_s)
        status = self.rings.take(given_of(reading, exposure_s, self._options.identified))
        if status != waiting.TAKEN:
            why = LATE if status == waiting.LATE else "overflow"
            self.counts[f"{reading.sensor.name.lower()}: {why}"] += 1
            self.serving.refused(reading.sensor, reading.t_s, LATE)
            return
        self.readings[reading.sensor] += 1
        self.received_s[reading.sensor], self.latest[reading.sensor] = now_s, reading
        self.newest_s = reading.t_s if self.newest_s != self.newest_s else max(self.newest_s, reading.t_s)
        self.flow_waited += self.flow_arrived and reading.sensor in FLOW
        self.flow_arrived = self.flow_arrived or reading.sensor in FLOW
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
