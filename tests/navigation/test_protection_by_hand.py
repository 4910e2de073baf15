"""Protection levels step by step in plain Python, on buffers that are filled by hand."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.compile import ONE_LANE
from flownav.estimation.covariance import at
from flownav.estimation.hypotheses import (
    COUNT,
    FLOW_AGE,
    FLOW_REVERSED,
    FLOW_SCALE,
    FLOW_SWAPPED,
    FORCE,
    GPS_DRIFT,
    HEADING_OFF,
    LEFT,
    RANGE_OFFSET,
    TURNING,
    Size,
    effect_of,
    fade,
    hold_unlearnt,
    leave,
    weigh,
)
from flownav.estimation.states import (
    ACCEL_BIAS,
    ACCEPTED,
    CROSS,
    GPS_SLOW,
    GYRO_BIAS,
    HYPOTHESES,
    INFORMATION,
    INNOVATION,
    INNOVATION_VARIANCE,
    MOST_HYPOTHESES,
    POSITION,
    SCORE,
    SHARE,
    SIGNATURE,
    STATE,
    STATES,
    VELOCITY,
)
from flownav.navigation.fault_signs import sign_drift, sign_flow
from flownav.navigation.fault_sizes import SIZE_SIGMAS, evidence_of, largest_size, prior_sigma
from flownav.navigation.memory import DRIFT_SINCE, MEMORY, PROTECTION, SCALE_DOUBT, SUSPECTED, load_flow, new_work
from flownav.navigation.protection import (
    OWN_DOWN_SIGMAS,
    OWN_ERROR_SIGMAS,
    SIGMAS_BESIDE,
    disputed,
    levels,
    set_levels,
)
from flownav.navigation.records import (
    FlowMemory,
    FlowSignMemory,
    GpsMemory,
    Look,
    RangeMemory,
    SuspicionMemory,
)
from flownav.navigation.suspicion import (
    CLEAR_EVIDENCE,
    HELD_S,
    MEMORY_S,
    PUZZLING_EVIDENCE,
    SUSPECT_EVIDENCE,
    WINDOW_S,
    exclude,
    mind_faults,
    seek_windows_anew,
)
from flownav.navigation.tape import FAULT_CLEARED, FAULT_SUSPECTED, empty_tape, output_of, room_of

_, store_flow = MEMORY.access(FlowMemory)
_, store_look = MEMORY.access(Look)

FLOW_SPEED = MEMORY.row(FlowSignMemory, "speed_m_s")
TURNED_BEFORE = MEMORY.row(FlowSignMemory, "turning_x")
LEFT_OVER = MEMORY.row(SuspicionMemory, "left_over_m")
PUZZLED_AT = MEMORY.row(SuspicionMemory, "puzzled_s")
CONTRADICTION, BEFORE = MEMORY.row(RangeMemory, "contradiction_m"), MEMORY.row(RangeMemory, "before_m")


@pytest.fixture
def work():
    return new_work(ONE_LANE)


def put_effect(work, fault, north=0.0, east=0.0, down=0.0):
    for i, value in enumerate((north, east, down)):
        work[at(POSITION + i, STATES + fault)] = value


def put_size(work, fault, size, sigma):
    """Set the sums over innovations so that with the prior a fault has this size and standard deviation."""
    total = 1.0 / sigma**2
    work[INFORMATION + fault] = total - 1.0 / prior_sigma(fault) ** 2
    work[SCORE + fault] = total * size


# -- effects and what innovations tell ---------------------------------------------------------------------------
def test_what_the_filter_has_learnt_is_no_fault(work):
    """However much corrections have learnt of it: another one may begin at any time."""
    held = [at(ACCEL_BIAS + axis, STATES + FORCE + axis) for axis in range(3)]
    held += [at(GYRO_BIAS + axis, STATES + TURNING + axis) for axis in range(2)]
    work[held[0]] = 0.3
    hold_unlearnt(work, ONE_LANE, STATES)
    assert work[held].tolist() == [1.0] * 5
    assert work[at(0, STATES) : at(0, STATES + COUNT + 1)].sum() == 5.0
    still = new_work(ONE_LANE)
    still[HYPOTHESES] = 0.0
    hold_unlearnt(still, ONE_LANE, STATES)
    assert not still[held].any()


def test_an_innovation_tells_of_a_fault_by_its_part_of_it(work):
    work[ACCEPTED], work[INNOVATION], work[INNOVATION_VARIANCE] = 1.0, 0.3, 0.04
    work[CROSS + STATES + HEADING_OFF], work[CROSS + STATES + FORCE] = 2.0, -1.0
    work[SIGNATURE + HEADING_OFF], work[SHARE + HEADING_OFF] = 5.0, -1.0
    weigh(work, ONE_LANE, STATES, 2.0)
    assert work[INFORMATION + HEADING_OFF] == pytest.approx(4.0 / 0.08)
    assert work[SCORE + HEADING_OFF] == pytest.approx(2.0 * 0.3 / 0.08)
    assert work[SCORE + FORCE] == pytest.approx(-0.3 / 0.08)
    assert (work[SIGNATURE + HEADING_OFF], work[SHARE + HEADING_OFF]) == (0.0, 1.0)
    work[ACCEPTED] = 0.0
    weigh(work, ONE_LANE, STATES, 2.0)
    assert work[INFORMATION + HEADING_OFF] == pytest.approx(4.0 / 0.08)
    fade(work, ONE_LANE, 0.5)
    assert work[INFORMATION + HEADING_OFF] == pytest.approx(2.0 / 0.08)
    assert work[SCORE + FORCE] == pytest.approx(-0.15 / 0.08)


@pytest.mark.parametrize("angular", [True, False])
def test_what_a_unit_of_each_fault_adds_to_a_flow(work, angular):
    """2 m/s forward and 1 m/s to the right, 4 m up, turning by 0.1 rad/s about x."""
    work[STATE + VELOCITY], work[STATE + VELOCITY + 1], work[TURNED_BEFORE] = 2.0, 1.0, 0.1
    store_look(work, ONE_LANE, 0, Look(turning_x=0.2, range_m=4.0))
    read = (0.1 - 0.25, 0.5) if angular else (2.0, 1.0)
    store_flow(work, ONE_LANE, 0, load_flow(work, ONE_LANE, 0)._replace(taken_s=9.9))
    for component in range(2):
        own, other = read[component], read[1 - component]
        sign_flow(work, ONE_LANE, 10.0, component, angular)
        expected = {FLOW_SCALE: (own, 1.0), FLOW_SWAPPED: (other - own, -1.0), FLOW_REVERSED: (-2.0 * own, -1.0),
                    FLOW_AGE: (-own / 0.1, 1.0), RANGE_OFFSET: (0.0, 1.0)}  # fmt: skip
        for fault, (signature, share) in expected.items():
            assert work[SIGNATURE + fault] == pytest.approx(signature), (component, fault)
            assert work[SHARE + fault] == share
    assert work[FLOW_SPEED] == pytest.approx(np.hypot(*read) * (4.0 if angular else 1.0))
    assert work[TURNED_BEFORE] == 0.2
    sign_flow(work, ONE_LANE, 10.0, 0, angular)
    assert work[SIGNATURE + FLOW_AGE] == pytest.approx(0.0 if not angular else -0.1 / 0.1)  # of the turning alone
    sign_flow(work, ONE_LANE, 20.0, 0, angular)
    assert work[SIGNATURE + FLOW_AGE] == 0.0  # after a pause nothing is known of what was before


def test_a_drift_grows_from_the_start_of_its_window(work):
    work[DRIFT_SINCE] = 100.0
    sign_drift(work, ONE_LANE, 107.0, 1)
    assert [work[SIGNATURE + GPS_DRIFT + i] for i in range(3)] == [0.0, 7.0, 0.0]


def test_what_a_fault_did_in_a_window_stays_where_it_is(work):
    """A drift of 0.3 m/s has moved the position by -0.6 m, and its reading is off by what it drifted in the window."""
    work[DRIFT_SINCE] = 100.0
    put_effect(work, GPS_DRIFT, north=-2.0)
    put_effect(work, HEADING_OFF, north=5.0)
    put_size(work, GPS_DRIFT, 0.3, 0.1)
    seek_windows_anew(work, ONE_LANE, 99.5 + WINDOW_S + 0.4)
    assert effect_of(work, ONE_LANE, STATES, GPS_DRIFT, POSITION, 0) == -2.0
    seek_windows_anew(work, ONE_LANE, 100.5 + WINDOW_S)
    assert work[DRIFT_SINCE] == 100.5 + WINDOW_S
    assert effect_of(work, ONE_LANE, STATES, GPS_DRIFT, POSITION, 0) == 0.0
    assert work[INFORMATION + GPS_DRIFT] == work[SCORE + GPS_DRIFT] == 0.0
    assert effect_of(work, ONE_LANE, STATES, LEFT, POSITION, 0) == pytest.approx(-0.6)
    assert effect_of(work, ONE_LANE, STATES, LEFT, GPS_SLOW, 0) == pytest.approx(0.3 * (0.5 + WINDOW_S))
    assert work[LEFT_OVER] == pytest.approx(2.0 * SIZE_SIGMAS * 0.1)
    assert effect_of(work, ONE_LANE, STATES, HEADING_OFF, POSITION, 0) == 5.0  # it is sought for ever


def test_a_fault_of_the_imu_that_is_evident_is_not_sought_anew(work):
    work[DRIFT_SINCE] = 100.0
    for axis, evidence in ((0, PUZZLING_EVIDENCE + 1.0), (1, PUZZLING_EVIDENCE - 1.0)):
        put_effect(work, FORCE + axis, east=1.0)
        evident(work, FORCE + axis, 0.2, evidence)
    seek_windows_anew(work, ONE_LANE, 100.5 + WINDOW_S)
    assert [effect_of(work, ONE_LANE, STATES, FORCE + axis, POSITION + 1, 0) for axis in range(2)] == [1.0, 0.0]


# -- levels --------------------------------------------------------------------------------------------------------
def test_the_size_that_is_left_possible():
    assert largest_size(HEADING_OFF, Size(-0.1, 0.05, 4.0)) == pytest.approx(0.1 + SIZE_SIGMAS * 0.05)
    assert largest_size(FLOW_REVERSED, Size(0.1, 0.05, 4.0)) == pytest.approx(0.1 + SIZE_SIGMAS * 0.05)
    assert largest_size(FLOW_SWAPPED, Size(0.9, 0.5, 4.0)) == 1.0


def test_the_level_is_the_largest_over_all_that_may_have_happened(work):
    for i, variance in enumerate((4.0, 1.0, 9.0)):
        work[at(POSITION + i, POSITION + i)] = variance
    assert levels(work, ONE_LANE, 0) == pytest.approx((OWN_ERROR_SIGMAS * 2.0, OWN_DOWN_SIGMAS * 3.0))
    put_effect(work, HEADING_OFF, 30.0, 40.0, -20.0)
    put_size(work, HEADING_OFF, 0.02, 0.01)
    most = 0.02 + SIZE_SIGMAS * 0.01
    put_effect(work, RANGE_OFFSET, 1.0, 1.0, 1.0)
    small = levels(work, ONE_LANE, 0)
    assert small == pytest.approx(
        (OWN_ERROR_SIGMAS * 2.0, OWN_DOWN_SIGMAS * 3.0)
    )  # 2.5 m beside 2 sigma: below 4 sigma
    put_effect(work, HEADING_OFF, 300.0, -400.0, -600.0)
    assert levels(work, ONE_LANE, 0) == pytest.approx(
        (SIGMAS_BESIDE * 2.0 + 500.0 * most, SIGMAS_BESIDE * 3.0 + 600.0 * most)
    )
    work[LEFT_OVER] = 600.0  # of one fault at a time
    assert levels(work, ONE_LANE, 0).horizontal_m == pytest.approx(SIGMAS_BESIDE * 2.0 + 600.0)
    work[LEFT_OVER] = 0.0
    work[CONTRADICTION], work[BEFORE] = -900.0, -800.0
    for axis, left_m in enumerate((3.0, -4.0, 7.0)):
        leave(work, ONE_LANE, POSITION + axis, 0, left_m)
    assert levels(work, ONE_LANE, 0) == pytest.approx(
        (SIGMAS_BESIDE * 2.0 + 500.0 * most + 5.0, SIGMAS_BESIDE * 3.0 + 1000.0 + 7.0)
    )
    work[HYPOTHESES] = 0.0
    assert levels(work, ONE_LANE, 0) == pytest.approx((OWN_ERROR_SIGMAS * 2.0, OWN_DOWN_SIGMAS * 3.0))
    work[CONTRADICTION] = 0.0
    work[SCALE_DOUBT], work[STATE + POSITION], work[STATE + POSITION + 1] = 0.1, 60.0, 80.0
    set_levels(work, ONE_LANE)
    assert np.isnan(work[PROTECTION : PROTECTION + 2]).all()  # nothing is followed, nothing is stated
    work[HYPOTHESES] = MOST_HYPOTHESES
    for fault in (HEADING_OFF, RANGE_OFFSET, LEFT):
        put_effect(work, fault)
    set_levels(work, ONE_LANE)
    axes = np.linalg.eigvalsh([[4.0 + 36.0, 48.0], [48.0, 1.0 + 64.0]])
    assert work[PROTECTION] == pytest.approx(OWN_ERROR_SIGMAS * np.sqrt(axes[-1]))
    assert work[PROTECTION + 1] == pytest.approx(OWN_DOWN_SIGMAS * 3.0)


def test_one_range_alone_disputes_no_height():
    assert disputed(-0.5, -0.4, 0.1) == pytest.approx(0.6)  # and on by what it grew
    assert disputed(0.3, 2.0, 0.1) == 0.3
    assert disputed(0.05, 0.04, 0.1) == 0.04
    assert disputed(0.5, -0.4, 0.1) == disputed(0.5, 0.0, 0.1) == disputed(np.nan, 0.5, 0.1) == 0.0


def test_what_an_excluded_fault_may_have_done_is_remembered(work):
    put_effect(work, FLOW_REVERSED, 3.0, 4.0)
    work[LEFT_OVER] = 2.0
    put_size(work, FLOW_REVERSED, 0.5, 0.2)
    exclude(work, ONE_LANE, 0, FLOW_REVERSED)  # neither there nor excluded
    assert work[LEFT_OVER] == 2.0
    assert effect_of(work, ONE_LANE, STATES, FLOW_REVERSED, POSITION, 0) == 3.0
    put_size(work, FLOW_REVERSED, 0.1, 0.02)
    exclude(work, ONE_LANE, 0, FLOW_REVERSED)
    assert work[LEFT_OVER] == 2.0  # more than 5 m times 0.16
    put_effect(work, FLOW_REVERSED, 30.0, 40.0)
    put_size(work, FLOW_REVERSED, 0.1, 0.02)
    exclude(work, ONE_LANE, 0, FLOW_REVERSED)
    assert work[LEFT_OVER] == pytest.approx(50.0 * (0.1 + SIZE_SIGMAS * 0.02))
    assert effect_of(work, ONE_LANE, STATES, FLOW_REVERSED, POSITION, 0) == 0.0
    assert work[INFORMATION + FLOW_REVERSED] == work[SCORE + FLOW_REVERSED] == 0.0


# -- suspicions ------------------------------------------------------------------------------------------------------
class Minded:
    """A navigator's buffer whose faults are minded at instants of the test's own."""

    def __init__(self, work):
        self.work, self.tape = work, empty_tape(1, 1, 10)
        tape = self.tape
        self.output = output_of(
            *(table.reshape(-1) for table in (tape.estimate, tape.innovation, tape.event)),
            *(table.reshape(-1) for table in tape.journal), room_of(tape), tape.used,
        )  # fmt: skip
        work[MEMORY.row(GpsMemory, "last_fix_s")] = np.inf

    def at(self, t_s, dt_s=1e-9):
        mind_faults(self.work, ONE_LANE, t_s, dt_s, self.output)
        return self.tape.events().tolist()


def evident(work, fault, size, evidence):
    put_size(work, fault, size, abs(size) / np.sqrt(evidence))


def test_a_suspicion_needs_evidence_and_a_size_and_lasts(work):
    minded = Minded(work)
    evident(work, HEADING_OFF, 0.3, SUSPECT_EVIDENCE - 1.0)
    assert minded.at(50.0) == []
    evident(work, HEADING_OFF, 0.1, SUSPECT_EVIDENCE + 50.0)  # what is no fault yet
    assert minded.at(51.0) == []
    evident(work, HEADING_OFF, 0.3, SUSPECT_EVIDENCE + 1.0)
    raised = [52.0, float(FAULT_SUSPECTED), float(HEADING_OFF)]
    assert minded.at(52.0) == [raised]
    assert work[SUSPECTED] == HEADING_OFF + 1.0
    evident(work, HEADING_OFF, 0.3, CLEAR_EVIDENCE - 1.0)
    assert minded.at(51.9 + HELD_S) == [raised]
    evident(work, HEADING_OFF, 0.3, CLEAR_EVIDENCE + 1.0)
    assert minded.at(52.1 + HELD_S) == [raised]
    evident(work, HEADING_OFF, 0.3, CLEAR_EVIDENCE - 1.0)
    assert minded.at(52.2 + HELD_S) == [raised, [52.2 + HELD_S, float(FAULT_CLEARED), float(HEADING_OFF)]]
    assert work[SUSPECTED] == 0.0


def test_the_most_evident_fault_is_named(work):
    minded = Minded(work)
    evident(work, FLOW_SCALE, 1.0, SUSPECT_EVIDENCE + 1.0)
    evident(work, RANGE_OFFSET, 1.0, SUSPECT_EVIDENCE + 9.0)
    evident(work, HEADING_OFF, 1.0, SUSPECT_EVIDENCE + 2.0)
    assert minded.at(1.0)[0][2] == RANGE_OFFSET


def test_a_drift_north_and_east_is_one_fault(work):
    minded = Minded(work)
    work[DRIFT_SINCE] = 0.0
    evident(work, GPS_DRIFT, 0.3, 0.4 * SUSPECT_EVIDENCE)
    evident(work, GPS_DRIFT + 1, 0.4, 0.7 * SUSPECT_EVIDENCE)
    assert evidence_of(work, ONE_LANE, GPS_DRIFT, 0) == 0.0
    assert evidence_of(work, ONE_LANE, GPS_DRIFT + 1, 0) == pytest.approx(1.1 * SUSPECT_EVIDENCE)
    assert minded.at(1.0)[0][2] == GPS_DRIFT + 1


def test_of_the_imus_faults_the_most_evident_one_is_meant(work):
    """A gyro that warms up tilts the vehicle; too small to be suspected, it is no fault of the accelerometer either."""
    minded = Minded(work)
    work[DRIFT_SINCE] = 0.0
    evident(work, FORCE + 1, 0.5, SUSPECT_EVIDENCE + 1.0)
    evident(work, TURNING, 0.01, SUSPECT_EVIDENCE + 9.0)
    assert minded.at(1.0) == []
    evident(work, TURNING, 0.01, SUSPECT_EVIDENCE - 9.0)
    assert minded.at(2.0)[0][2] == FORCE + 1


def test_what_was_told_and_what_is_left_over_fade(work):
    minded = Minded(work)
    work[INFORMATION + HEADING_OFF], work[SCORE + HEADING_OFF], work[LEFT_OVER] = 10.0, 1.0, 8.0
    minded.at(1.0, MEMORY_S)
    assert work[INFORMATION + HEADING_OFF] == pytest.approx(10.0 / np.e)
    assert work[SCORE + HEADING_OFF] == pytest.approx(1.0 / np.e)
    assert work[LEFT_OVER] == pytest.approx(8.0 / np.e)


@pytest.mark.parametrize(("evidence", "doubted", "unheld"), [(10.0, False, False), (0.5, True, True)])
def test_while_a_reversed_flow_is_possible_what_is_left_over_grows_by_twice_the_way(work, evidence, doubted, unheld):
    minded = Minded(work)
    work[FLOW_SPEED] = 3.0
    work[MEMORY.row(GpsMemory, "last_fix_s")] = -np.inf if unheld else np.inf
    if doubted:
        store_flow(work, ONE_LANE, 0, load_flow(work, ONE_LANE, 0)._replace(doubted=1.0))
    evident(work, FLOW_REVERSED, 0.3, evidence)
    minded.at(5.0, 0.1)
    assert work[PUZZLED_AT] == 5.0
    assert work[LEFT_OVER] == pytest.approx(0.1 * 2.0 * 3.0)
    quiet = Minded(new_work(ONE_LANE))
    quiet.work[FLOW_SPEED] = 3.0
    quiet.at(5.0, 0.1)
    assert quiet.work[LEFT_OVER] == 0.0
