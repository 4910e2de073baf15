"""The vehicle's time now: its stamps laid on our monotonic clock, and TIMESYNC where it answers."""

from collections import Counter, deque
from typing import NamedTuple

from flownav.logs.mavlink import clock as stamps
from flownav.logs.mavlink.framing import Message

NAN = float("nan")
# Chosen, and held by recorded links (test_live_recordings): after a freeze of 1 s the sending goes on within 3, a
# TIMESYNC that lies by 0.9 s does not stop it; made ones (test_live_safety) have stamps of the future and clocks that
# jump.
LONGEST_ROUND_TRIP_S = 0.5
MOST_UNSEEN_S = 0.1  # of age when it is sent that a stamped message may have, beyond the wait on the link
COARSE_S = 0.02  # of stamps in milliseconds, and of crystals that drift for FRESH_S
LEAP_S = 0.3  # a stamp that is earlier by this than any before on the link: the clock leapt, or the stamp is wrong
STEP_S = 1.0  # TIMESYNC offsets that differ by more are of a vehicle that began anew
EXCHANGES_KEPT = 16
FRESH_S = 20.0
WINDOW_S = 0.5
# of the time that passes, by which what was ahead is made up: EKF3 takes no stamp older than its last; chosen
SLEW = 0.5
MOST_SLEWED_S = 0.25  # more is of a vehicle's clock that stood still, during which nothing was sent: chosen
MOST_BACK_S = 1.0  # by which the time may have gone back while nothing is sent, until it has come on: chosen


class Exchange(NamedTuple):
    """One TIMESYNC: when it ended on our clock, their boot clock less ours, and the round trip [s]."""

    now_s: float
    offset_s: float
    round_trip_s: float


class VehicleClock:
    """Session time: the vehicle's time since boot, which goes on through a reboot (see mavlink/clock.py).

    Of stamps alone, the least wait on the link passes for none; a TIMESYNC exchange measures it, to within half its
    round trip. The stamps of the last second rule: an exchange that contradicts them is of a clock that has been
    stopped or set since, or a lie, and does not serve. counts: `clock_jump`, `clock_set` (another clock than the
    boot's), `wrapped`, exchanges not believed (`timesync_refused`), and steps of a second or more between exchanges
    (`timesync_step`).
    """

    def __init__(self, system: int, component: int) -> None:
        self._state = stamps.ClockState((system, component, "boot"))
        self._leads: deque[tuple[float, float]] = deque(maxlen=2)  # since when, and session time less ours [s]
        self._exchanges: deque[Exchange] = deque(maxlen=EXCHANGES_KEPT)
        self._leaping, self._leap_s = 0, NAN  # stamps in a row that are ahead of our clock, and by how much
        self._offset_stated_s = self._doubted_s = NAN  # offset by TIMESYNC, and one that differs by a step
        self._asked_s = self._ahead_s = NAN  # our clock when the time was asked for last, and session time less ours
        self.counts: Counter[str] = Counter()

    def stamped(self, message: Message, system: int, component: int, now_s: float) -> stamps.Aligned:
        """The session time of a message that arrived at `now_s` of our clock."""
        stamp = stamps.stamp_of(message, system, component, self._state.reference_s)
        state, aligned = stamps.align(self._state, now_s, stamp)
        if self._leaps(stamp, aligned, now_s):
            self.counts["ahead"] += 1
            return stamps.Aligned(NAN, "stale_time")
        self._state = state
        if aligned.event == "clock_jump" and stamp is not None and stamp.clock != state.reference:
            aligned = aligned._replace(event="clock_set")  # UNIX time, or another component's: no reboot
        if aligned.event:
            self.counts[aligned.event] += 1
        if stamp is not None and stamp.clock == self._state.reference and not aligned.reason:
            if aligned.event == "clock_jump":
                self._exchanges.clear()
                self._leads = deque(maxlen=2)
            self._note_lead(aligned.t_s - now_s, now_s)
        return aligned

    def _leaps(self, stamp: stamps.Stamp | None, aligned: stamps.Aligned, now_s: float) -> bool:
        """Whether the autopilot's clock has leapt ahead of ours in this one message: some in a row must agree on it."""
        if stamp is None or stamp.clock != self._state.reference or aligned.reason or aligned.event:
            return False
        leap_s = aligned.t_s - now_s - self._offset_s
        agrees = abs(leap_s - self._leap_s) <= LEAP_S
        self._leaping = (self._leaping + 1 if agrees else 1) if leap_s > LEAP_S else 0
        self._leap_s = leap_s
        return 0 < self._leaping < stamps.CONFIRMATIONS

    def _note_lead(self, lead_s: float, now_s: float) -> None:
        """The least wait on the link is the greatest lead; it is remembered for two windows."""
        if not self._leads or now_s - self._leads[-1][0] >= WINDOW_S:
            self._leads.append((now_s, lead_s))
        elif lead_s > self._leads[-1][1]:
            self._leads[-1] = self._leads[-1][0], lead_s

    @property
    def _offset_s(self) -> float:
        """Session time less ours, by the least wait seen; NaN before the first stamp."""
        return max((lead_s for _, lead_s in self._leads), default=NAN)

    def received_unix(self, message: Message, system: int, component: int) -> None:
        """SYSTEM_TIME."""
        if message.time_boot_ms:
            clock = (system, component, "unix")
            self._state = stamps.received_unix_time(
                self._state, clock, message.time_unix_usec * 1e-6, message.time_boot_ms * 1e-3
            )

    def exchanged(self, tc1_ns: int, ts1_ns: int, now_s: float) -> bool:
        """A TIMESYNC reply to a request that we sent at `ts1_ns` of our clock; True where it shows a new start."""
        exchange = Exchange(now_s, *stamps.timesync_offset_s(tc1_ns, ts1_ns, round(now_s * 1e9)))
        if not 0.0 <= exchange.round_trip_s <= LONGEST_ROUND_TRIP_S:
            self.counts["timesync_refused"] += 1
            return False
        stepped = self._stepped(exchange.offset_s)
        if stepped:
            self.counts["timesync_step"] += 1
        if self._serves(exchange):
            self._exchanges.append(exchange)
        else:
            self.counts["timesync_refused"] += 1
        return stepped

    def _stepped(self, offset_s: float) -> bool:
        """Whether two exchanges in a row agree on an offset that is more than STEP_S from the one in use."""
        if not abs(offset_s - self._offset_stated_s) > STEP_S:
            self._offset_stated_s, self._doubted_s = offset_s, NAN
            return False
        if not abs(offset_s - self._doubted_s) <= STEP_S:
            self._doubted_s = offset_s
            return False
        self._offset_stated_s, self._doubted_s = offset_s, NAN
        return True

    def _serves(self, exchange: Exchange) -> bool:
        """Whether an exchange agrees with the stamps: they show a later time by no more than its own uncertainty,
        and an earlier one by no more than the wait on the link and a reading's own age when it is sent.
        """
        ahead_s = exchange.offset_s + self._shift_s - self._offset_s
        return -0.5 * exchange.round_trip_s - COARSE_S <= ahead_s <= exchange.round_trip_s + MOST_UNSEEN_S

    @property
    def _shift_s(self) -> float:
        """Session time less the vehicle's time since boot: not 0 after a reboot."""
        clock = self._state.clocks.get(self._state.reference)
        return clock.offset_s if clock else 0.0

    def best(self, now_s: float) -> Exchange | None:
        """The exchange with the shortest round trip among the fresh ones that agree with the stamps."""
        fresh = [e for e in self._exchanges if now_s - e.now_s <= FRESH_S and self._serves(e)]
        return min(fresh, key=lambda exchange: exchange.round_trip_s, default=None)

    def now_s(self, now_s: float) -> float:
        """Session time at an instant of our clock; NaN before the vehicle's clock was received. Never behind a stamp.

        A loaded link makes every stamp seem later, and the time with it: it goes slower until that is made up.
        """
        best = self.best(now_s)
        ahead_s = self._offset_s if best is None else max(best.offset_s + self._shift_s, self._offset_s)
        if 0.0 < self._ahead_s - ahead_s <= MOST_SLEWED_S:
            ahead_s = max(ahead_s, self._ahead_s - SLEW * max(now_s - self._asked_s, 0.0))
        self._asked_s, self._ahead_s = now_s, ahead_s
        return now_s + ahead_s

    def boot_s(self, t_s: float) -> float:
        """The vehicle's time since boot at a session time."""
        return t_s - self._shift_s
