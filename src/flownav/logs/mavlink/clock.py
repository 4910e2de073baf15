"""One log clock from the clocks of many senders, one message at a time.

A vehicle stamps its messages with its time since boot, in 32 bits of milliseconds (they wrap after 49.7 days) or
64 bits of microseconds; another component has its own; some stamps are UNIX time; some messages have none. The log
clock is the autopilot's time since boot: a stamp of that clock is taken as it is. Every other clock is laid upon it
by the least difference seen between a stamp and the log's time on arrival: waiting on the link only ever adds to it.
A message without a stamp was sent after the last stamped one that arrived before it.

A step that cannot be is believed when three rising stamps agree on it with none against (a reboot, a clock that was
set); the log clock then goes on by the time that passed between the arrivals. Until then, and for a stamp that
stands still (a GPS without a fix repeats its last), a reading has no time and is left out, with the reason. An
arrival clock that jumps or stands still does no harm while stamps advance.
"""

from collections.abc import Mapping
from typing import NamedTuple

from flownav.logs.mavlink.framing import Message

UNIX_FROM_US = 10**15  # September 2001: a greater count of microseconds is UNIX time
WRAP_MS_S = 2**32 * 1e-3
LATE_S = 2.0  # a stamp may be this much older than the newest
LEAP_S = 10.0  # a stamp may be this much later than expected
AGREEMENT_S = 1.0
CONFIRMATIONS = 3
LONGEST_WAIT_S = 1.0  # an unstamped message follows its stamped predecessor by no more than this
LONGEST_PAUSE_S = 86400.0  # arrivals further apart than this are a damaged arrival time
CRYSTAL_DRIFT = 200e-6  # of one crystal against another
SET_BACK_S, SET_FOR_S = 0.25, 1.0  # of another clock: all its stamps later by more, for this long, mean that it was set

ClockName = tuple[int, int, str]  # system, component, "boot" or "unix"


class Stamp(NamedTuple):
    """The time stamp of a message: whose clock, its time [s], and the time at which it wraps [s] (0: never)."""

    clock: ClockName
    stamp_s: float
    wrap_s: float = 0.0


class _Clock(NamedTuple):
    """log time = stamp + offset. stamp_s: newest, unwrapped. doubted_*: a step that is not yet believed. late_*: since
    when all stamps came later than the least wait by SET_BACK_S or more, and by how much at least.
    """

    offset_s: float
    stamp_s: float
    wraps: int = 0
    doubted_offset_s: float = 0.0
    doubted_stamp_s: float = 0.0
    doubts: int = 0
    late_since_s: float = float("nan")
    late_s: float = 0.0


class ClockState(NamedTuple):
    """The aligner's memory: `reference` is the clock that rules; nothing has a time before its first stamp."""

    reference: ClockName
    log_s: float = float("nan")
    arrival_s: float = 0.0
    clocks: Mapping[ClockName, _Clock] = {}

    def now_s(self, arrival_s: float) -> float:
        """The log's time at an arrival; NaN before the reference clock was received."""
        return self.log_s + min(max(arrival_s - self.arrival_s, 0.0), LONGEST_WAIT_S)

    @property
    def reference_s(self) -> float:
        """The newest stamp of the reference clock, unwrapped [s]; NaN before the first."""
        clock = self.clocks.get(self.reference)
        return clock.stamp_s if clock else float("nan")


class Aligned(NamedTuple):
    """A message's log time [s], or NaN and why (`no_clock`, `stale_time`); event: "", "clock_jump", "wrapped"."""

    t_s: float
    reason: str = ""
    event: str = ""


def align(state: ClockState, arrival_s: float, stamp: Stamp | None) -> tuple[ClockState, Aligned]:
    """The log time of one message and the state after it. Arrival: seconds of the receiver's clock, any zero."""
    now = state.now_s(arrival_s)
    if stamp is None:
        return state, Aligned(now, "no_clock" if now != now else "")
    rules = stamp.clock == state.reference
    clock = state.clocks.get(stamp.clock)
    if clock is None:
        if not rules and now != now:
            return state, Aligned(now, "no_clock")
        offset = 0.0 if rules else now - stamp.stamp_s
        return _received(state, stamp.clock, _Clock(offset, stamp.stamp_s), arrival_s, rules)
    turns = _turns(clock, stamp)
    reading = stamp.stamp_s + (clock.wraps + turns) * stamp.wrap_s
    wraps = clock.wraps + max(turns, 0)
    event = "wrapped" if turns > 0 else ""
    if not _believable(state, clock, reading, arrival_s, rules):
        return _doubted(state, clock, stamp, arrival_s, rules)
    laid = _Clock(clock.offset_s, max(reading, clock.stamp_s), wraps)
    if not rules:
        laid = _laid(clock, laid, now, reading)
    late = reading < clock.stamp_s
    state, aligned = _received(state, stamp.clock, laid, arrival_s, rules and not late, event)
    return state, aligned._replace(t_s=reading + laid.offset_s)


def _laid(before: _Clock, clock: _Clock, now: float, reading: float) -> _Clock:
    """Another clock than ours by the least wait; anew where it was set back, so that everything waits longer."""
    drift = CRYSTAL_DRIFT * (clock.stamp_s - before.stamp_s)
    offset = min(before.offset_s + drift, now - reading)
    late = now - reading - offset
    if not late > SET_BACK_S:
        return clock._replace(offset_s=offset)
    since, least = (now, late) if before.late_since_s != before.late_since_s else (before.late_since_s, before.late_s)
    least = min(least, late)
    if now - since < SET_FOR_S:
        return clock._replace(offset_s=offset, late_since_s=since, late_s=least)
    return clock._replace(offset_s=offset + least)


def received_unix_time(state: ClockState, clock: ClockName, unix_s: float, boot_s: float) -> ClockState:
    """SYSTEM_TIME has both times of one instant: the UNIX clock's offset is then known without any wait."""
    reference = state.clocks.get(state.reference)
    if reference is None or unix_s * 1e6 < UNIX_FROM_US:
        return state
    boot_s += reference.wraps * WRAP_MS_S
    return state._replace(clocks={**state.clocks, clock: _Clock(reference.offset_s + boot_s - unix_s, unix_s)})


def stamp_of(message: Message, system: int, component: int, reference_s: float = float("nan")) -> Stamp | None:
    """The time stamp of a message; None where it has no stamp, or 0, which means the same.

    The trap: ArduPilot writes milliseconds since boot into OPTICAL_FLOW.time_usec. Of both readings the one nearer
    to the autopilot's clock (`reference_s`, seconds since boot) is right.
    """
    fields = message.fieldnames
    if "time_boot_ms" in fields:
        boot_ms = message.time_boot_ms
        return Stamp((system, component, "boot"), boot_ms * 1e-3, WRAP_MS_S) if boot_ms else None
    count = message.time_usec if "time_usec" in fields else message.usec if "usec" in fields else 0
    if not count:
        return None
    if count >= UNIX_FROM_US:
        return Stamp((system, component, "unix"), count * 1e-6)
    if message.msgname == "OPTICAL_FLOW" and abs(count * 1e-3 - reference_s) < abs(count * 1e-6 - reference_s):
        return Stamp((system, component, "boot"), count * 1e-3, WRAP_MS_S)
    return Stamp((system, component, "boot"), count * 1e-6)


def timesync_offset_s(tc1_ns: int, ts1_ns: int, now_ns: int) -> tuple[float, float]:
    """From a TIMESYNC reply: their clock less ours [s], and the round trip [s] within which that is known.

    tc1: their time when they answered; ts1: ours when we asked; now: ours as the answer arrives. Half the round
    trip is the offset's largest error.
    """
    return (tc1_ns - 0.5 * (ts1_ns + now_ns)) * 1e-9, (now_ns - ts1_ns) * 1e-9


def _received(
    state: ClockState, name: ClockName, clock: _Clock, arrival_s: float, leads: bool, event: str = ""
) -> tuple[ClockState, Aligned]:
    t_s = clock.stamp_s + clock.offset_s
    log_s, since_s = (t_s, arrival_s) if leads else (state.log_s, state.arrival_s)
    return ClockState(state.reference, log_s, since_s, {**state.clocks, name: clock}), Aligned(t_s, event=event)


def _turns(clock: _Clock, stamp: Stamp) -> int:
    """Whether the count has wrapped since the newest stamp (1), or the stamp is from before a wrap (-1)."""
    if stamp.wrap_s:
        for turns in (1, -1):
            ahead = stamp.stamp_s + (clock.wraps + turns) * stamp.wrap_s - clock.stamp_s
            if -LATE_S <= ahead <= LEAP_S:
                return turns
    return 0


def _believable(state: ClockState, clock: _Clock, reading: float, arrival_s: float, rules: bool) -> bool:
    if not rules:
        return -LATE_S <= reading + clock.offset_s - state.now_s(arrival_s) <= LATE_S
    step = reading - clock.stamp_s
    return step >= -LATE_S and (step <= LEAP_S or abs(step - (arrival_s - state.arrival_s)) <= LEAP_S)


def _doubted(
    state: ClockState, clock: _Clock, stamp: Stamp, arrival_s: float, rules: bool
) -> tuple[ClockState, Aligned]:
    """Count a step that cannot be; believe it when enough stamps agree."""
    elapsed = arrival_s - state.arrival_s
    now = state.log_s + (elapsed if 0.0 <= elapsed <= LONGEST_PAUSE_S else 0.0)
    offset = now - stamp.stamp_s
    agrees = clock.doubts > 0 and abs(offset - clock.doubted_offset_s) < AGREEMENT_S
    doubts = clock.doubts + (stamp.stamp_s > clock.doubted_stamp_s) if agrees else 1
    if doubts >= CONFIRMATIONS:
        return _received(state, stamp.clock, _Clock(offset, stamp.stamp_s), arrival_s, rules, "clock_jump")
    newest = max(stamp.stamp_s, clock.doubted_stamp_s) if agrees else stamp.stamp_s
    doubted = clock._replace(doubted_offset_s=offset, doubted_stamp_s=newest, doubts=doubts)
    state = state._replace(clocks={**state.clocks, stamp.clock: doubted})
    return state, Aligned(float("nan"), "stale_time")
