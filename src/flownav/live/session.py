"""A live session as a state machine: bytes and the time in, frames out. It has no clock and no socket of its own.

Bytes become messages of one vehicle (reception), these become measurements on the vehicle's clock (hearing), which wait
on rings until all of their instant must be here, and are then fed to the navigator (filtering). Its state,
carried on to now, is sent where no limit is exceeded (answers).
"""

from collections import Counter, deque

from flownav.core.measurement import Sensor
from flownav.live.anchor import PLACES
from flownav.live.answers import WITHHELD, Answers
from flownav.live.backlog import Backlog
from flownav.live.filtering import BATCH_READINGS, Filtering, Keeper
from flownav.live.horizon import Refused
from flownav.live.intake import Intake
from flownav.live.offering import Offering
from flownav.live.options import Options
from flownav.live.rates import Rates
from flownav.live.reception import Reception, Vehicle
from flownav.live.requests import TRUTHS, Requests, Simulator
from flownav.live.vehicle_clock import MOST_BACK_S, VehicleClock
from flownav.logs.mavlink.converted import Pose
from flownav.logs.mavlink.framing import Message
from flownav.logs.mavlink.messages import CONVERTERS, STATES, LocalState, TrueState
from flownav.logs.mavlink.outgoing import ARMED, ODOMETRY_COMPONENT, Estimate, companion_heartbeat
from flownav.navigation.feed import SLOWEST_IMU_HZ
from flownav.navigation.rows import InnovationRow

LOCAL_POSITION = "LOCAL_POSITION_NED"
SECOND_S = 1.0
SEND_EVERY_S = 0.03  # without flow, above EKF2's 30 Hz; with it, an estimate for each of its readings
NAN = float("nan")


class Session:
    """One link's session. `now_s` is always our monotonic clock; `unix_s` is UNIX time at `now_s` of the start.

    dropped: what was not taken, by where and why; sent and withheld: estimates, the latter by reason; velocities: those
    withheld of which the velocity was sent; turns: how often another autopilot was taken for the vehicle.
    """

    def __init__(self, options: Options, keeper: Keeper, now_s: float, unix_s: float) -> None:
        self.options, self.keeper = options, keeper
        self._unix_less_now_s = unix_s - now_s
        self.reception = Reception(
            options.system, options.component, options.key, unix_s, options.accept, ODOMETRY_COMPONENT
        )
        self._others_counted = 0
        self.backlog = Backlog() if options.capacity_bytes_s is None else None  # a line of a known pace is kept to it
        self.rates = Rates(options.capacity_bytes_s, options.send, signed=options.key is not None)
        self.answers, self.requests, self.simulator = Answers(options), Requests(self.rates), Simulator()
        self.filtering = Filtering(options, keeper)
        self.intake = Intake(options, self.filtering.rings)
        self.offering = Offering(options.limits, keeper, self.intake, self.filtering)
        self.clock: VehicleClock | None = None
        self.withheld: Counter[str] = Counter()
        self.sent = self.velocities = self.turns = 0
        self.armed = False
        self.reason = "no_vehicle"
        self.estimate: Estimate | None = None
        self.outbox: deque[bytes] = deque(maxlen=1024)
        self.innovations: dict[tuple[int, int], tuple[float, float, int]] = {}  # innovation, test ratio, reason
        self._origin_kept: tuple[float, float, float] | None = None
        self._vehicle_s = NAN  # our clock at the vehicle's last message
        self._sent_s = self._second_s = self._stamped_s = float("-inf")

    @property
    def dropped(self) -> dict[str, int]:
        """Everything that was dropped, by where and why."""
        found = {f"link: {name}": n for name, n in self.reception.counts.items()}
        found |= {f"clock: {name}": n for name, n in (self.clock.counts if self.clock else Counter[str]()).items()}
        return found | dict(self.intake.dropped)

    @property
    def origin_deg_m(self) -> tuple[float, float, float] | None:
        """Origin of the navigator's frame."""
        return self.intake.origin.navigator_deg_m

    @property
    def alarms(self) -> dict[Sensor, Refused]:
        """Sensors that are received and not fused, since when and why."""
        return self.offering.alarms

    @property
    def resets(self) -> int:
        """Jumps of what is sent: starts, resets of the filter, and a new origin of the autopilot."""
        return self.filtering.jumps + self.intake.origin.moves + self.offering.anchor.moves

    @property
    def due(self) -> bool:
        """Whether flow has come, for which an estimate is to be sent."""
        return self.intake.flow_arrived

    # -- what arrives -----------------------------------------------------------------------------------------
    def take(self, piece: bytes, now_s: float, *, whole: bool) -> bool:
        """Take bytes that arrived at `now_s`; True where the vehicle sent one of them. `tick` does the rest."""
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
                self.requests.received(message.msgname, now_s)
                self._received(message, self.clock, vehicle, now_s)
            if message.msgname in CONVERTERS:
                self._measured(message, self.clock, vehicle, now_s)
        self._say_others(now_s)
        overfull = self.rates.received(len(piece), now_s, settled=self.requests.settled)
        if overfull and self.reception.vehicle is not None and self.clock is not None:
            self.requests.revise(self.reception.vehicle, now_s)
            t_s = self.clock.now_s(now_s)
            self.keeper.note(t_s, "link", "overfull", "streams are asked for at lower rates", self.rates.plan.bytes_s)
        return self.reception.received > before

    def _say_others(self, now_s: float) -> None:
        """Other autopilots go into the record, each once."""
        others = self.reception.others
        if len(others) > self._others_counted and self.clock is not None:
            self._others_counted = len(others)
            names = ", ".join(f"{system}.{component}" for system, component in others)
            self.keeper.note(self.clock.now_s(now_s), "link", "other_autopilot", names, NAN)

    def overhear(self, piece: bytes) -> None:
        """A datagram from elsewhere than the vehicle."""
        if not self.offering.settled:
            self.reception.overhear(piece)

    def _choose(self, now_s: float) -> None:
        """Before anything was sent, replace the autopilot that was received first by a better one."""
        better, before = self.reception.better(now_s), self.reception.vehicle
        if better is None or before is None or self.clock is None:
            return
        names = [f"{one.system}.{one.component}" for one in (better, before)]
        why_restarted = f"{names[0]} is taken for the autopilot, in place of {names[1]}"
        self._restart(self.clock.now_s(now_s), why_restarted, NAN)
        self.reception.take(better)
        self.intake.forget_vehicle()
        self._vehicle_s = NAN
        self.turns += 1
        self._meet(better, now_s)

    def _meet(self, vehicle: Vehicle, now_s: float) -> None:
        self.clock = VehicleClock(vehicle.system, vehicle.component)
        self.answers.of_system(vehicle)
        self.requests.begin(vehicle, now_s)
        self.reason = "listening"

    def _restart(self, t_s: float, why: str, value: float) -> None:
        """The vehicle may be elsewhere now: the navigation begins anew."""
        self.intake.begin_anew()
        self.filtering.stop()
        self.offering.begin_anew()
        self.keeper.note(t_s, "link", "restart", why, value)

    def _received(self, message: Message, clock: VehicleClock, vehicle: Vehicle, now_s: float) -> None:
        """Take messages of the autopilot that are no measurements."""
        name = message.msgname
        truth = self.simulator.received(message, vehicle)
        if truth is not None:
            self.requests.revise(vehicle, now_s, {truth.name: (truth.number, truth.rate_hz)})
        if name == "TIMESYNC":
            self._timesync(message, clock, vehicle, now_s)
        elif name == "HEARTBEAT":
            self.armed = bool(message.base_mode & ARMED)
        elif name == "COMMAND_ACK":
            self.requests.acknowledged(message)
        elif name == "SYSTEM_TIME":
            clock.received_unix(message, vehicle.system, vehicle.component)
        elif name == "GPS_GLOBAL_ORIGIN":
            self._origin_received(message, clock.now_s(now_s))
        elif name == LOCAL_POSITION:
            state_message = STATES[name](message)
            if isinstance(state_message, LocalState):
                self.offering.beginning.state_height(-state_message.pos_ned_m[2], clock.now_s(now_s))
                self.offering.say_origin(self.intake.origin.stands(state_message.pos_ned_m), clock.now_s(now_s))
        elif name in TRUTHS:
            state, t_s = STATES[name](message), clock.now_s(now_s)
            if isinstance(state, TrueState) and t_s == t_s:
                self.keeper.truth(t_s, state)

    def _timesync(self, message: Message, clock: VehicleClock, vehicle: Vehicle, now_s: float) -> None:
        t_s = clock.now_s(now_s)
        if message.tc1 and self.backlog is not None and self.backlog.answered(message.ts1, now_s):
            return
        if not message.tc1:
            if t_s == t_s:  # known
                self._send(self.answers.timesync_answer(message, clock.boot_s(t_s)), now_s)
        elif clock.exchanged(message.tc1, message.ts1, now_s):
            self.requests.begin(vehicle, now_s)  # a reboot: all streams are off
            self.keeper.note(t_s, "link", "timesync_step", "the vehicle began anew; its streams are asked for again")

    def _origin_received(self, message: Message, t_s: float) -> None:
        origin = self.intake.origin
        place = message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3
        nowhere = origin.about_deg_m is None
        event = origin.received(place, settled=self.offering.settled)
        if nowhere and not event and self.filtering.lacks_gps and not self.armed:
            self.filtering.stop()  # which way is north is known now; one that flies goes on as it is
            self.keeper.note(t_s, "link", "restart", "origin_came", NAN)
        self.offering.say_origin(event, t_s)

    def _measured(self, message: Message, clock: VehicleClock, vehicle: Vehicle, now_s: float) -> None:
        here_ned_m = self.filtering.here_ned_m if self.origin_deg_m is None else None
        event = self.intake.take(message, clock, vehicle, self._pose(), now_s, here_ned_m)
        while self.intake.swaps:
            since_s, source, why = self.intake.swaps.popleft()
            self.keeper.note(since_s, "imu", why, f"{source.message} is not believed any more", NAN)
        if event == "clock_jump":
            self._restart(clock.now_s(now_s), event, NAN)

    def _pose(self) -> Pose | None:
        found = self.estimate
        return Pose(found.pos_ned_m, found.quaternion) if found is not None and not self.reason else None

    # -- the time passes --------------------------------------------------------------------------------------
    def tick(self, now_s: float) -> None:
        """Feed what is due, and send what is due: estimates, requests, heartbeats."""
        intake = self.intake
        if not self.offering.settled:
            self._choose(now_s)
        if self.clock is None or self.reception.vehicle is None:
            return
        t_s = self.clock.now_s(now_s)
        if self.offering.asks_where(t_s):
            self.requests.revise(self.reception.vehicle, now_s, {LOCAL_POSITION: (32, 2.0)})
        if self.origin_deg_m is not None and self.origin_deg_m != self._origin_kept:
            self._origin_kept = self.origin_deg_m
            self.keeper.origin(t_s, self.origin_deg_m)
        listened = t_s - intake.since_s >= self.options.listen_s
        if self.filtering.running is None and listened and len(intake.rings):
            self.filtering.begin(intake.gps_received, intake.origin.about_deg_m)
        if self.filtering.lacks_imu and self.filtering.imu_rate_hz(intake.newest_s) >= SLOWEST_IMU_HZ:
            self._restart(t_s, "imu_came", NAN)  # it was decided without one, which serves now
        elif self.filtering.lacks_gps and intake.gps_received and not self.armed:
            self.filtering.stop()  # and is begun with GPS at once; one that flies goes on as it is
            self.keeper.note(t_s, "link", "restart", "gps_came", NAN)
        until_s = min(t_s, intake.lags.newest_s) - intake.horizon_s
        behind = self.filtering.running is not None and self._feed(until_s)
        since_s = now_s - self._sent_s
        behind = behind or 0.0 < self._stamped_s - t_s <= MOST_BACK_S or not self._is_read(t_s, now_s)
        if not behind and (self.due or since_s >= SEND_EVERY_S) and since_s >= self.rates.estimate_every_s:
            intake.flow_arrived, self._sent_s = False, now_s
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
        outcome = self.filtering.feed(until_s)
        if outcome.readings:
            offered = [InnovationRow(*row) for row in outcome.innovation.tolist()]
            for row in offered:
                offer = row.innovation, row.test_ratio, int(row.reason)
                self.innovations[int(row.sensor), int(row.component)] = offer
            self.intake.serving.judged(offered)
            self.offering.heights.judged(offered)
        return outcome.readings == BATCH_READINGS

    def _offer(self, t_s: float, now_s: float) -> None:
        """Send the estimate of now, or its permitted part, or note why not."""
        vehicle = self.reception.vehicle
        assert vehicle is not None
        assert self.clock is not None
        self.offering.watch(t_s)
        reason, estimate = self.offering.judged(t_s, self.clock, self.resets)
        if (
            reason in PLACES
            and self.filtering.running is not None
            and self.offering.anchor.may_move(self.filtering.running, t_s)
        ):
            self.offering.anchor.move(self.filtering.running, jumps=bool(self.reason))
            self.keeper.note(t_s, "live", "anchored", f"{reason}: what is sent is about where the vehicle is now", NAN)
            reason, estimate = self.offering.judged(t_s, self.clock, self.resets)
        messages: list[Message] = []
        if estimate is not None and not reason:
            self.estimate = estimate
            offset_ned_m = self.offering.offset_ned_m
            assert self.filtering.running is not None
            messages = self.answers.estimates(vehicle, estimate, self.filtering.running, offset_ned_m)
            reason = "" if messages else "nothing_asked" if self.options.send == "none" else "no_pad"
        elif estimate is not None and reason in PLACES:
            messages = self.answers.velocity(vehicle, estimate)
            self.velocities += bool(messages)
        for message in messages:
            self._send(message, now_s)
            self._stamped_s = t_s
        self.offering.settled |= reason in ("", "nothing_asked")
        if reason:
            self.withheld[reason] += 1
        else:
            self.sent += 1
        if reason != self.reason:
            kind = "withheld" if reason else "sending"
            self.keeper.note(t_s, "live", kind, WITHHELD.get(reason, ""), NAN)
            self.reason = reason

    def _is_read(self, t_s: float, now_s: float) -> bool:
        """Whether what was sent is read in time, so that more may follow; asks for it."""
        backlog = self.backlog
        if backlog is None:
            return True
        spells, is_open = backlog.spells, backlog.is_open(now_s)
        if backlog.spells > spells:
            self.keeper.note(t_s, "link", "slow_reader", "what is sent is not read in time; fewer estimates are", NAN)
        if backlog.due(now_s):
            question = self.answers.timesync(now_s)
            self._send(question, now_s)
            backlog.asked(question.ts1, now_s)
        return is_open

    def _send(self, message: Message, now_s: float) -> None:
        frame = self.answers.packed(message, now_s + self._unix_less_now_s)
        self.outbox.append(frame)
        if self.backlog is not None:
            self.backlog.put(len(frame))
