"""A live session as a state machine: bytes and the time in, frames out. It has no clock and no socket of its own.

Bytes become messages of one vehicle (reception), these become measurements on the vehicle's clock (timing, sources),
which wait at the horizon until all of their instant must be here, and are then fed to the navigator (filtering). Its
state, carried on to now, is sent where nothing speaks against it (estimating).
"""

from __future__ import annotations

from collections import Counter, deque
from typing import Protocol

from flownav.live.answers import Answers
from flownav.live.estimating import WITHHELD, estimate_of, fault_of, why_withheld
from flownav.live.filtering import BATCH, FLOW, Filtering, Keeper
from flownav.live.horizon import Horizon, Waiting
from flownav.live.options import Options
from flownav.live.reception import Reception
from flownav.live.requests import ARDUPILOT, Requests
from flownav.live.sources import Source, Sources
from flownav.live.timing import VehicleClock
from flownav.mavlink.converted import Context, Dropped, Pose
from flownav.mavlink.dialect import Message
from flownav.mavlink.messages import CONVERTERS, instance_of, measurements
from flownav.mavlink.outgoing import Estimate
from flownav.mavlink.position_messages import LEAST_FIX, fix_deg_m
from flownav.mavlink.state_messages import TrueState, hil_state_quaternion, sim_state
from flownav.measurement import Measurement, Sensor

SECOND = 1.0
SEND_EVERY_S = 0.02  # without flow; with it, an estimate for each of its readings
LONGEST_EXPOSURE_S = 0.2
GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
TRUTHS = {"SIM_STATE": sim_state, "HIL_STATE_QUATERNION": hil_state_quaternion}
NAN = float("nan")


class Chronicle(Keeper, Protocol):
    """Who keeps a session's story beside what the navigator is fed."""

    def note(self, t_s: float, source: str, kind: str, detail: str, value: float = NAN) -> None:
        """A happening."""

    def origin(self, t_s: float, origin_deg_m: tuple[float, float, float]) -> None:
        """The local frame has another origin from now on."""

    def truth(self, t_s: float, state: TrueState) -> None:
        """What a simulator says is so."""


class Session:
    """One link's session. `now_s` is always our monotonic clock; `unix_s` is UNIX time at `now_s` of the start.

    counts: what was dropped, by where and why; sent and withheld: estimates, the latter by reason.
    """

    def __init__(self, options: Options, keeper: Chronicle, now_s: float, unix_s: float) -> None:
        self.options, self.keeper = options, keeper
        self._unix_less_now_s = unix_s - now_s
        self.reception = Reception(options.system, options.component, options.key, unix_s)
        self.answers, self.requests = Answers(options), Requests()
        self.sources, self.horizon = Sources(), Horizon()
        self.filtering = Filtering(options, keeper)
        self.clock: VehicleClock | None = None
        self._origin_deg_m: tuple[float, float, float] | None = None
        self.counts: Counter[str] = Counter()
        self.withheld: Counter[str] = Counter()
        self.sent = 0
        self.reason = "no_vehicle"
        self.estimate: Estimate | None = None
        self.readings: Counter[Sensor] = Counter()
        self.heard_s: dict[Sensor, float] = {}  # our clock
        self.latest: dict[Sensor, Measurement] = {}
        self.outbox: deque[bytes] = deque(maxlen=1024)
        self.innovations: dict[tuple[int, int], tuple[float, float, int]] = {}  # innovation, test ratio, reason
        self._newest_s = NAN  # session time of the newest reading
        self._vehicle_s = NAN  # our clock when the vehicle last spoke
        self._listening_s = NAN  # session time of the first reading since the start or the restart
        self._gps_heard = False
        self._flow_s = NAN  # session time of the last flow reading
        self.due = False
        self._sent_s = self._second_s = float("-inf")

    @property
    def origin_deg_m(self) -> tuple[float, float, float] | None:
        """Latitude, longitude [deg] and altitude [m] of the local frame's origin."""
        return self._origin_deg_m

    @origin_deg_m.setter
    def origin_deg_m(self, origin_deg_m: tuple[float, float, float] | None) -> None:
        self._origin_deg_m = origin_deg_m
        if origin_deg_m is not None:
            self.keeper.origin(self._newest_s, origin_deg_m)

    @property
    def dropped(self) -> dict[str, int]:
        """Everything that was dropped, by where and why."""
        found = {f"link: {name}": n for name, n in self.reception.counts.items()}
        found |= {f"horizon: {name}": n for name, n in self.horizon.dropped.items()}
        found |= {f"{sensor.name.lower()}: other source": n for sensor, n in self.sources.dropped.items()}
        found |= {f"clock: {name}": n for name, n in (self.clock.counts if self.clock else Counter[str]()).items()}
        return found | dict(self.counts)

    # -- what arrives -----------------------------------------------------------------------------------------
    def take(self, piece: bytes, now_s: float, *, whole: bool) -> bool:
        """What arrived at `now_s`; True where the vehicle spoke in it. `tick` does the rest."""
        before = self.reception.received
        for message in self.reception.feed(piece, whole=whole):
            if self.clock is None:
                self._meet(now_s)
            elif now_s - self._vehicle_s > self.options.restart_s:
                self._restart(now_s, "silence", now_s - self._vehicle_s)
            self._vehicle_s = now_s
            self._take(message, now_s)
        return self.reception.received > before

    def _meet(self, now_s: float) -> None:
        vehicle = self.reception.vehicle
        assert vehicle is not None
        self.clock = VehicleClock(vehicle.system, vehicle.component)
        self.answers.of_system(vehicle)
        self.requests.begin(vehicle)
        self.reason = "listening"

    def _restart(self, now_s: float, why: str, value: float) -> None:
        """The vehicle may be elsewhere now: the navigation begins anew, and the streams are asked for again."""
        vehicle, clock = self.reception.vehicle, self.clock
        assert vehicle is not None
        assert clock is not None
        self.horizon.clear()
        self.filtering.stop()
        self.requests.begin(vehicle)
        self._listening_s, self._gps_heard, self._newest_s = NAN, False, NAN
        self.keeper.note(clock.now_s(now_s), "link", "restart", why, value)

    def _take(self, message: Message, now_s: float) -> None:
        vehicle, clock, name = self.reception.vehicle, self.clock, message.msgname
        assert vehicle is not None
        assert clock is not None
        if name == "TIMESYNC":
            self._timesync(message, clock, now_s)
        elif name == "COMMAND_ACK":
            self.requests.acknowledged(message)
        elif name == "SYSTEM_TIME":
            clock.told_unix(message, vehicle.system, vehicle.component)
        elif name == "GPS_GLOBAL_ORIGIN" and self.origin_deg_m is None:
            self._origin_told(message)
        elif name in TRUTHS:
            state, t_s = TRUTHS[name](message), clock.now_s(now_s)
            if state is not None and t_s == t_s:
                self.keeper.truth(t_s, state)
        elif name in CONVERTERS:
            self._measured(message, clock, now_s)

    def _timesync(self, message: Message, clock: VehicleClock, now_s: float) -> None:
        if message.tc1:
            clock.exchanged(message.tc1, message.ts1, now_s)
        elif clock.now_s(now_s) == clock.now_s(now_s):  # known
            boot_s = clock.boot_s(clock.now_s(now_s))
            self._send(self.answers.timesync_answer(message, boot_s), now_s)

    def _origin_told(self, message: Message) -> None:
        if (message.latitude or message.longitude) and abs(message.latitude) <= 90e7:
            self.origin_deg_m = message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3

    def _measured(self, message: Message, clock: VehicleClock, now_s: float) -> None:
        vehicle = self.reception.vehicle
        assert vehicle is not None
        if message.msgname == "GPS_RAW_INT":
            self._gps_heard = True
            if self.origin_deg_m is None and message.fix_type >= LEAST_FIX:
                self.origin_deg_m = fix_deg_m(message)
        aligned = clock.stamped(message, vehicle.system, vehicle.component, now_s)
        if aligned.event == "clock_jump":
            self._restart(now_s, "clock_jump", NAN)
        context = Context(vehicle.make == ARDUPILOT, True, self.origin_deg_m, self._pose())
        source = Source(message.msgname, instance_of(message))
        for outcome in measurements(message, aligned.t_s, context):
            if isinstance(outcome, Dropped) or aligned.reason:
                reason = outcome.reason if isinstance(outcome, Dropped) else aligned.reason
                self.counts[f"{outcome.sensor.name.lower()}: {reason}"] += 1
            elif self.sources.takes(outcome.sensor, source, aligned.t_s):
                self._reading(outcome, now_s)

    def _reading(self, reading: Measurement, now_s: float) -> None:
        exposure_s = 0.0
        if reading.sensor in GPS:
            reading = reading._replace(delay_s=self.options.gps_delay_s)
        elif reading.sensor in FLOW:
            reading, exposure_s = self._exposed(reading)
        if not self.horizon.take(reading, exposure_s):
            return
        self.filtering.heard(Waiting(reading.t_s - reading.delay_s, 0, reading))
        self.readings[reading.sensor] += 1
        self.heard_s[reading.sensor], self.latest[reading.sensor] = now_s, reading
        self._newest_s = reading.t_s if self._newest_s != self._newest_s else max(self._newest_s, reading.t_s)
        self.due = self.due or reading.sensor in FLOW
        if self._listening_s != self._listening_s:
            self._listening_s = reading.t_s

    def _exposed(self, reading: Measurement) -> tuple[Measurement, float]:
        """A flow reading with its age and exposure: stated, or the time since the last, of which it is the middle."""
        exposure_s = 2.0 * reading.delay_s
        if not exposure_s:
            since_s = reading.t_s - self._flow_s
            exposure_s = since_s if 0.0 < since_s <= LONGEST_EXPOSURE_S else 0.1
        self._flow_s = reading.t_s
        known = self.options.identified
        return reading._replace(delay_s=known.latency_s if known else 0.5 * exposure_s), exposure_s

    def _pose(self) -> Pose | None:
        found = self.estimate
        return Pose(found.pos_ned_m, found.quaternion) if found is not None and not self.reason else None

    # -- the time passes --------------------------------------------------------------------------------------
    def tick(self, now_s: float) -> None:
        """Feed what is due, and send what is due: estimates, requests, heartbeats."""
        if self.clock is None or self.reception.vehicle is None:
            return
        t_s = self.clock.now_s(now_s)
        listened = t_s - self._listening_s >= self.options.listen_s
        if self.filtering.running is None and listened and len(self.horizon):
            self.filtering.begin(self.horizon.waiting(), self._gps_heard, self.origin_deg_m)
        behind = self.filtering.running is not None and self._feed(t_s - self.options.horizon_s)
        if not behind and (self.due or now_s - self._sent_s >= SEND_EVERY_S):
            self.due, self._sent_s = False, now_s
            self._offer(t_s, now_s)
        if now_s - self._second_s >= SECOND:
            self._second_s = now_s
            self._send(self.answers.heartbeat(), now_s)
            self._send(self.answers.timesync(now_s), now_s)
        request = self.requests.due(self.answers.mav, self.reception.vehicle, now_s)
        if request is not None:
            self._send(request, now_s)

    def _feed(self, until_s: float) -> bool:
        """A batch: what was listened to for seconds must not hold up what arrives now. True where more is due."""
        released = self.horizon.release(until_s, BATCH)
        if released:
            outcome = self.filtering.feed(released)
            for row in outcome.innovation.tolist():
                self.innovations[int(row[1]), int(row[2])] = (row[5], row[7], int(row[8]))
        return len(released) == BATCH

    def _offer(self, t_s: float, now_s: float) -> None:
        """Send the estimate of now, or say why not."""
        on, vehicle, clock = self.filtering.running, self.reception.vehicle, self.clock
        assert vehicle is not None
        assert clock is not None
        reason = why_withheld(on, t_s, self._newest_s, self.options.limits)
        if not reason and on is not None:
            imu = self.filtering.imu_after(self.filtering.clock_s)
            self.estimate = estimate_of(on, imu, t_s, clock.boot_s(t_s), self.filtering.jumps)
            reason = fault_of(self.estimate, self.options.limits)
            if not reason and self.options.send == "none":
                reason = "nothing_asked"
            messages = [] if reason else self.answers.estimates(vehicle, self.estimate, on)
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
