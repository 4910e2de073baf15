"""Which fault is suspected, and the memory of those that are sought anew.

Faults that are there or are not are sought until innovations exclude them; those that last, in windows.
"""

import numpy as np

from flownav.core.compile import Lanes, Work, equation, exp, larger, procedure, replacing
from flownav.estimation.covariance import states_of
from flownav.estimation.hypotheses import (
    COUNT,
    FLOW_SWAPPED,
    FORCE,
    GPS_DRIFT,
    HEADING_OFF,
    begin_lane_anew,
    fade,
    followed,
    leave,
    leave_lane,
)
from flownav.estimation.states import GPS_SLOW
from flownav.navigation.fault_sizes import (
    SIZE_SIGMAS,
    evidence_of,
    largest_size,
    level_effect,
    size_in,
)
from flownav.navigation.memory import (
    DRIFT_SINCE,
    held_by_gps,
    load_flow,
    load_sign,
    load_suspicion,
    share,
    shared,
    store_suspicion,
)
from flownav.navigation.records import SuspicionMemory
from flownav.navigation.tape import FAULT_CLEARED, FAULT_SUSPECTED, Output, write_event

MEMORY_S = 20.0  # over which the innovations' evidence of faults fades
EXCLUDED_SIGMAS = 8.0  # from a fault that is there or is not; never excluded, its effect has no bound (test_protection)
PUZZLING_EVIDENCE = 9.0  # 3 sigma, for a fault that is there or is not, after which it may be there for long
WINDOW_S = 20.0  # a fault that lasts is sought from the start of such a window
# evidence that raises a suspicion (4.9 sigma), and that ends it (2.2); at 0 none is cleared (test_protection_by_hand)
SUSPECT_EVIDENCE, CLEAR_EVIDENCE = 24.0, 5.0
HELD_S = 10.0  # so long a suspicion lasts at least: what the fault did is still there; chosen, not measured
with_left_over = replacing(SuspicionMemory, "left_over_m")


@equation
def leave_over(work: Work, lanes: Lanes, lane: int, moved_m: float) -> None:
    """Keep the largest effect that a fault may have had on the position, before it is sought anew; faults come one at a
    time.
    """
    m = load_suspicion(work, lanes, lane)
    store_suspicion(work, lanes, lane, with_left_over(m, left_over_m=larger(m.left_over_m, moved_m)))


@equation
def seek_anew(work: Work, lanes: Lanes, fault: int, lane: int, drifted_s: float) -> None:
    """A fault that lasts is sought from now on; its effect until now, by its size, stays.

    Of a drift of GPS, its reading stays off by what it drifted since the search began.
    """
    found = size_in(work, lanes, fault, lane)
    leave_lane(work, lanes, states_of(lanes), fault, lane, found.size)
    if fault < HEADING_OFF:
        slow = GPS_SLOW + fault - GPS_DRIFT
        leave(work, lanes, slow, lane, found.size * drifted_s)
    leave_over(work, lanes, lane, level_effect(work, lanes, fault, lane) * SIZE_SIGMAS * found.sigma)
    begin_lane_anew(work, lanes, states_of(lanes), fault, lane)


@procedure
def seek_windows_anew(work: Work, lanes: Lanes, t_s: float) -> None:
    """Faults that last are sought in windows: drifts of GPS, and errors of the IMU."""
    since_s = shared(work, lanes, DRIFT_SINCE)
    if t_s - since_s > WINDOW_S:
        share(work, lanes, DRIFT_SINCE, t_s)
        for fault in range(GPS_DRIFT, FLOW_SWAPPED):
            for lane in range(len(lanes)):
                evident = fault >= FORCE and size_in(work, lanes, fault, lane).evidence > PUZZLING_EVIDENCE
                if fault != HEADING_OFF and not evident:
                    seek_anew(work, lanes, fault, lane, t_s - since_s if np.isfinite(since_s) else 0.0)


@equation
def exclude(work: Work, lanes: Lanes, lane: int, fault: int) -> None:
    """A fault that is there or is not, and that innovations exclude since the instant from which it was sought: it is
    sought from now on. What it may have done until it was excluded, had it begun in between, is remembered.
    """
    found = size_in(work, lanes, fault, lane)
    if 1.0 - found.size > EXCLUDED_SIGMAS * found.sigma:
        leave_over(work, lanes, lane, level_effect(work, lanes, fault, lane) * largest_size(fault, found))
        begin_lane_anew(work, lanes, states_of(lanes), fault, lane)


@equation
def judge_suspicion(
    m: SuspicionMemory, worst: float, which: int, puzzled: bool, travel_m: float, kept: float, t_s: float
) -> SuspicionMemory:
    """Memory of suspicion after the evidence of the worst fault; what was left over fades, and grows while flow
    puzzles.
    """
    suspects = m.suspected == 0.0 and worst > SUSPECT_EVIDENCE
    clears = m.suspected > 0.0 and worst < CLEAR_EVIDENCE and t_s - m.suspected_s > HELD_S
    puzzled_s = t_s if puzzled else m.puzzled_s
    left_over_m = m.left_over_m * kept
    return SuspicionMemory(
        which + 1.0 if suspects else (0.0 if clears else m.suspected),
        t_s if suspects else m.suspected_s,
        puzzled_s,
        left_over_m + travel_m if t_s - puzzled_s < HELD_S else left_over_m,
    )


@procedure
def mind_faults(work: Work, lanes: Lanes, t_s: float, dt_s: float, o: Output) -> None:
    """Write which fault is suspected, and when none is any more; the evidence of faults fades."""
    if followed(work, lanes) == 0:
        return
    kept = exp(-dt_s / MEMORY_S)
    fade(work, lanes, kept)
    seek_windows_anew(work, lanes, t_s)
    for lane in range(len(lanes)):
        worst, which, worst_flow = 0.0, 0, 0.0
        for k in range(COUNT):
            found = size_in(work, lanes, k, lane)
            evidence = evidence_of(work, lanes, k, lane)
            which = k if evidence > worst else which
            worst = larger(worst, evidence)
            worst_flow = larger(worst_flow, found.evidence if k >= FLOW_SWAPPED else 0.0)
        before = load_suspicion(work, lanes, lane)
        unheld = not held_by_gps(work, lanes, lane, t_s)
        puzzled = worst_flow > PUZZLING_EVIDENCE or (unheld and load_flow(work, lanes, lane).doubted > 0.0)
        speed_m_s = load_sign(work, lanes, lane).speed_m_s
        after = judge_suspicion(before, worst, which, puzzled, 2.0 * dt_s * speed_m_s, kept, t_s)
        store_suspicion(work, lanes, lane, after)
        if before.suspected == 0.0 and after.suspected > 0.0:
            write_event(lanes, lane, t_s, FAULT_SUSPECTED, which, o)
        elif before.suspected > 0.0 and after.suspected == 0.0:
            write_event(lanes, lane, t_s, FAULT_CLEARED, before.suspected - 1.0, o)
        for k in range(FLOW_SWAPPED, COUNT):
            exclude(work, lanes, lane, k)
