"""A live session as a state machine: bytes and the time in, frames out. It has no clock and no socket of its own.

Bytes become messages of one vehicle (reception), these become measurements on the vehicle's clock (hearing), which wait
at the horizon until all of their instant must be here, and are then fed to the navigator (filtering). Its state,
carried on to now, is sent where nothing speaks against it (answers).
"""

from collections import Counter, deque

from flownav.core.measurement import Sensor
from flownav.live.answers import UNFUSED, WITHHELD, Answers, estimate_of, fault_of, why_withheld
from flownav.live.filtering import BATCH_READINGS, Filtering, Keeper
from flownav.live.hearing import Hearing
from flownav.live.horizon import Refused
from flownav.live.options import Options
from flownav.live.rates import Rates
from flownav.live.reception import Reception, Vehicle, VehicleClock
from flownav.live.requests import TRUTHS, Requests, Simulator
from flownav.logs.mavlink.converted import Pose
from flownav.logs.mavlink.framing import Message
from flownav.logs.mavlink.messages import CONVERTERS, STATES, TrueState
from flownav.logs.mavlink.outgoing import ODOMETRY_COMPONENT, Estimate, companion_heartbeat
from flownav.navigation.feed import SLOWEST_IMU_HZ
from flownav.navigation.reasons import HORIZONTAL
from flownav.navigation.rows import InnovationRow

SECOND_S = 1.0
SEND_EVERY_S = 0.02  # without flow, above EKF2's 30 Hz; with it, an estimate for each of its readings
OUTRANKED = ("", "position_invalid", "dead_reckoning", "unprotected")  # what a sensor that does not serve may cause
NAN = float("nan")


class Session:
    """One link's session. `now_s` is always our monotonic clock; `unix_s` is UNIX time at `now_s` of the start.

    dropped: what was not taken, by where and why; sent and withheld: estimates, the latter by reason; alarms: sensors
    that are heard and not fused, since when and why.
    """

    def __init__(self, options: Options, keeper: Keeper, now_s: float, unix_s: float) -> None:
        self.options, self.keeper = options, keeper
        self._unix_less_now_s = unix_s - now_s
        self.reception = Reception(
            options.system, options.component, options.key, unix_s, options.accept, ODOMETRY_COMPONENT
        )
        self.rates = Rates(options.capacity_bytes_s, options.send, signed=options.key is not None)
        self.answers, self.requests, self.simulator = Answers(options), Requests(self.rates), Simulator()
        self.hearing, self.filtering = Hearing(options), Filtering(options, keeper)
        self.clock: VehicleClock | None = None
        self.withheld: Counter[str] = Counter()
        self.sent = 0
        self.reason = "no_vehicle"
        self.alarms: dict[Sensor, Refused] = {}
        self.past_alarms: dict[Sensor, Refused] = {}  # the longest of each sensor
        self.estimate: Estimate | None = None
        self.outbox: deque[bytes] = deque(maxlen=1024)
        self.innovations: dict[tuple[int, int], tuple[float, float, int]] = {}  # innovation, test ratio, reason
        self._origin_kept: tuple[float, float, float] | None = None
        self._vehicle_s = NAN  # our clock when the vehicle last spoke
        self._sent_s = self._second_s = float("-inf")

    @property
    def dropped(self) -> dict[str, int]:
        """Everything that was dropped, by where and why."""
        found = {f"link: {name}": n for name, n in self.reception.counts.items()}
        found |= {f"clock: {name}": n for name, n in (self.clock.counts if self.clock else Counter[str]()).items()}
        return found | dict(self.hearing.dropped)

    @property
    def origin_deg_m(self) -> tuple[float, float, float] | None:
        """Origin of the navigator's frame."""
        return self.hearing.origin.navigator_deg_m

    @property
    def resets(self) -> int:
        """Jumps of what is sent: starts, resets of the filter, and a new origin of the autopilot."""
        return self.filtering.jumps + self.hearing.origin.moves

    @property
    def due(self) -> bool:
        """Whether flow has come, for which an estimate is to be sent."""
        return self.hearing.flow_came

    # -- what arrives -----------------------------------------------------------------------------------------
    def take(self, piece: bytes, now_s: float, *, whole: bool) -> bool:
        """What arrived at `now_s`; True where the vehicle spoke in it. `tick` does the rest."""
        before = self.reception.received
        for message in self.reception.feed(piece, whole=whole):
            vehicle = self.reception.vehicle
            assert vehicle is not None
            if self.clock is None:
                self._meet(vehicle, now_s)
            assert self.clock is not None
            if self.reception.is_of_vehicle(message):
                if now_s - self._vehicle_s > self.options.restart_s:
                    self.requests.begin(vehicle, now_s)
                    self._restart(self.clock.now_s(now_s), "silence", now_s - self._vehicle_s)
                self._vehicle_s = now_s
                self.requests.heard(message.msgname, now_s)
                self._told(message, self.clock, vehicle, now_s)
            if message.msgname in CONVERTERS:
                self._measured(message, self.clock, vehicle, now_s)
        overfull = self.rates.heard(len(piece), now_s, settled=self.requests.settled)
        if overfull and self.reception.vehicle is not None and self.clock is not None:
            self.requests.revise(self.reception.vehicle, now_s)
            t_s = self.clock.now_s(now_s)
            self.keeper.note(t_s, "link", "overfull", "streams are asked for at lower rates", self.rates.plan.bytes_s)
        return self.reception.received > before

    def _meet(self, vehicle: Vehicle, now_s: float) -> None:
        self.clock = VehicleClock(vehicle.system, vehicle.component)
        self.answers.of_system(vehicle)
        self.requests.begin(vehicle, now_s)
        self.reason = "listening"

    def _restart(self, t_s: float, why: str, value: float) -> None:
        """The vehicle may be elsewhere now: the navigation begins anew."""
        self.hearing.begin_anew()
        self.filtering.stop()
        self.alarms = {}
        self.keeper.note(t_s, "link", "restart", why, value)

    def _told(self, message: Message, clock: VehicleClock, vehicle: Vehicle, now_s: float) -> None:
        """What the autopilot says that is no measurement."""
        name = message.msgname
        truth = self.simulator.heard(message, vehicle)
        if truth is not None:
            self.requests.revise(vehicle, now_s, {truth.name: (truth.number, truth.rate_hz)})
        if name == "TIMESYNC":
            self._timesync(message, clock, vehicle, now_s)
        elif name == "COMMAND_ACK":
            self.requests.acknowledged(message)
        elif name == "SYSTEM_TIME":
            clock.told_unix(message, vehicle.system, vehicle.component)
        elif name == "GPS_GLOBAL_ORIGIN":
            self._origin_told(message, clock.now_s(now_s))
        elif name in TRUTHS:
            state, t_s = STATES[name](message), clock.now_s(now_s)
            if isinstance(state, TrueState) and t_s == t_s:
                self.keeper.truth(t_s, state)

    def _timesync(self, message: Message, clock: VehicleClock, vehicle: Vehicle, now_s: float) -> None:
        t_s = clock.now_s(now_s)
        if not message.tc1:
            if t_s == t_s:  # known
                self._send(self.answers.timesync_answer(message, clock.boot_s(t_s)), now_s)
        elif clock.exchanged(message.tc1, message.ts1, now_s):
            self.requests.begin(vehicle, now_s)  # a reboot: all streams are off
            self.keeper.note(t_s, "link", "timesync_step", "the vehicle began anew; its streams are asked for again")

    def _origin_told(self, message: Message, t_s: float) -> None:
        origin = self.hearing.origin
        place = message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3
        event = origin.told(place)
        if event == "moved":
            offset_m = sum(value**2 for value in origin.offset_ned_m) ** 0.5
            self.keeper.note(t_s, "origin", "moved", "the autopilot set its origin; what is sent is about it", offset_m)
        elif event == "refused":
            self.hearing.counts["origin: refused"] += 1
            self.keeper.note(t_s, "origin", "refused", f"{place[0]:.5f}, {place[1]:.5f}: the vehicle is not near it")

    def _measured(self, message: Message, clock: VehicleClock, vehicle: Vehicle, now_s: float) -> None:
        here_ned_m = self.filtering.here_ned_m if self.origin_deg_m is None else None
        event = self.hearing.take(message, clock, vehicle, self._pose(), now_s, self.filtering.heard, here_ned_m)
        if event == "clock_jump":
            self._restart(clock.now_s(now_s), event, NAN)

    def _pose(self) -> Pose | None:
        found = self.estimate
        return Pose(found.pos_ned_m, found.quaternion) if found is not None and not self.reason else None

    # -- the time passes --------------------------------------------------------------------------------------
    def tick(self, now_s: float) -> None:
        """Feed what is due, and send what is due: estimates, requests, heartbeats."""
        hearing = self.hearing
        if self.clock is None or self.reception.vehicle is None:
            return
        t_s = self.clock.now_s(now_s)
        if self.origin_deg_m is not None and self.origin_deg_m != self._origin_kept:
            self._origin_kept = self.origin_deg_m
            self.keeper.origin(t_s, self.origin_deg_m)
        listened = t_s - hearing.since_s >= self.options.listen_s
        if self.filtering.running is None and listened and len(hearing.horizon):
            self.filtering.begin(hearing.horizon.waiting(), hearing.gps_heard, self.origin_deg_m)
        if self.filtering.lacks_imu and self.filtering.imu_rate_hz(hearing.newest_s) >= SLOWEST_IMU_HZ:
            self._restart(t_s, "imu_came", NAN)  # it was decided without one, which serves now
        until_s = min(t_s, hearing.lags.newest_s) - hearing.horizon_s
        behind = self.filtering.running is not None and self._feed(until_s)
        since_s = now_s - self._sent_s
        if not behind and (self.due or since_s >= SEND_EVERY_S) and since_s >= self.rates.estimate_every_s:
            hearing.flow_came, self._sent_s = False, now_s
            self._offer(t_s, now_s)
        if now_s - self._second_s >= SECOND_S:
            self._second_s = now_s
            self._send(companion_heartbeat(self.answers.mav), now_s)
            self._send(self.answers.timesync(now_s), now_s)
        request = self.requests.due(self.answers.mav, self.reception.vehicle, now_s)
        for question in (request, self.simulator.due(self.answers.mav, self.reception.vehicle, now_s)):
            if question is not None:
                self._send(question, now_s)

    def _feed(self, until_s: float) -> bool:
        """A batch: what was listened to for seconds must not hold up what arrives now. True where more is due."""
        released = self.hearing.horizon.release(until_s, BATCH_READINGS)
        if released:
            outcome = self.filtering.feed(released)
            offered = [InnovationRow(*row) for row in outcome.innovation.tolist()]
            for row in offered:
                told = row.innovation, row.test_ratio, int(row.reason)
                self.innovations[int(row.sensor), int(row.component)] = told
            self.hearing.serving.judged(offered)
        return len(released) == BATCH_READINGS

    def _watch(self, t_s: float) -> None:
        """Alarms that begin and end go into the record."""
        found = self.hearing.serving.alarms(t_s, self.options.limits.unfused_s)
        for sensor in found.keys() - self.alarms.keys():
            spell = found[sensor]
            self.keeper.note(t_s, sensor.name.lower(), "unfused", spell.why, t_s - spell.since_s)
        for sensor in self.alarms.keys() - found.keys():
            self.keeper.note(t_s, sensor.name.lower(), "fused_again", "", NAN)
        for sensor, spell in found.items():
            before = self.past_alarms.get(sensor)
            if before is None or spell.until_s - spell.since_s >= before.until_s - before.since_s:
                self.past_alarms[sensor] = spell
        self.alarms = found

    def _offer(self, t_s: float, now_s: float) -> None:
        """Send the estimate of now, or say why not."""
        on, vehicle, clock, limits = self.filtering.running, self.reception.vehicle, self.clock, self.options.limits
        assert vehicle is not None
        assert clock is not None
        self._watch(t_s)
        reason = why_withheld(on, t_s, self.hearing.newest_s, limits)
        if reason in OUTRANKED and any(sensor in HORIZONTAL for sensor in self.alarms):
            reason = UNFUSED
        if not reason and on is not None:
            imu = self.filtering.imu_after(self.filtering.clock_s)
            offset_ned_m = self.hearing.origin.offset_ned_m
            self.estimate = estimate_of(on, imu, t_s, clock.boot_s(t_s), self.resets, offset_ned_m, limits)
            reason = fault_of(self.estimate, limits)
            if not reason and self.options.send == "none":
                reason = "nothing_asked"
            messages = [] if reason else self.answers.estimates(vehicle, self.estimate, on, offset_ned_m)
            if not reason and not messages:
                reason = "no_pad"
            for message in messages:
                self._send(message, now_s)
        if reason:
            self.withheld[reason] += 1
        else:
            self.sent += 1
        if reason != self.reason:
            kind = "withheld" if reason else "sending"
            self.keeper.note(t_s, "live", kind, WITHHELD.get(reason, ""), NAN)
            self.reason = reason

    def _send(self, message: Message, now_s: float) -> None:
        self.outbox.append(self.answers.packed(message, now_s + self._unix_less_now_s))
