"""Faults that nobody noticed: their effects beside the covariance, what innovations tell, levels, suspicions."""

from __future__ import annotations

import numpy as np
import pytest
from test_hard_flights import added_to, noisy

from flownav.core.compile import ONE_LANE
from flownav.core.measurement import Sensor, merge
from flownav.estimation.gating import Reason
from flownav.estimation.hypotheses import (
    COUNT,
    FLOW_REVERSED,
    FLOW_SCALE,
    FLOW_SWAPPED,
    FORCE,
    GPS_DRIFT,
    HEADING_OFF,
    NAMES,
    RANGE_OFFSET,
    TURNING,
    begin_lane_anew,
    effect_of,
    larger_axis,
    size_of,
)
from flownav.estimation.states import (
    ATTITUDE,
    GROUND,
    HYPOTHESES,
    INFORMATION,
    MOST_HYPOTHESES,
    POSITION,
    SCORE,
    STATE,
    STATES,
    VELOCITY,
)
from flownav.navigation.fault_sizes import least_size, prior_sigma
from flownav.navigation.flags import Flag, flagged, flags_of
from flownav.navigation.loop import run, start_navigator
from flownav.navigation.protection import levels
from flownav.navigation.rows import EstimateRow, InnovationRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.smoother import part_of
from flownav.navigation.suspicion import EXCLUDED_SIGMAS, HELD_S
from flownav.navigation.tape import (
    AIDED_AGAIN,
    DEAD_RECKONING,
    FAULT_CLEARED,
    FAULT_SUSPECTED,
    new_tape,
)
from navigation_streams import Flown, Navigated, circle, equipment, fly, navigate

FLOWN = fly(circle, 30.0)
UNPROTECTED = [name for name in EstimateRow._fields if name != "protection_m"]
OWN = (Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE)


def scaled(flown: Flown, matrix, t0_s: float) -> Flown:
    """The flow through a 2 x 2 matrix from an instant on."""
    stream = flown.streams[Sensor.FLOW_RATE]
    value = stream.value.copy()
    late = stream.t_s >= t0_s
    value[late, :2] = value[late, :2] @ np.array(matrix, float).T
    return flown.changed(Sensor.FLOW_RATE, value=value)


def drifting(flown: Flown, rate_m_s, t0_s: float) -> Flown:
    """GPS position that drifts off north."""
    stream = flown.streams[Sensor.GPS_POSITION]
    value = stream.value.copy()
    value[:, 0] += rate_m_s * np.maximum(stream.t_s - t0_s, 0.0)
    return flown.changed(Sensor.GPS_POSITION, value=value)


def blind(flown: Flown) -> Flown:
    """Flow that sees nothing."""
    return flown.changed(Sensor.FLOW_RATE, quality=0.0 * flown.streams[Sensor.FLOW_RATE].quality)


# -- effects ---------------------------------------------------------------------------------------------------
TINY = 1e-6
QUIET = (Sensor.FLOW_RATE, Sensor.RANGE, Sensor.BARO, Sensor.ATTITUDE)


def begun_anew(flown: Flown, at_s: float, faults: range) -> Navigated:
    """A run whose faults are sought from an instant on."""
    queue = merge(flown.streams.values())
    on = start_navigator(equipment(flown, queue), NavigatorSettingsFile(), new_tape(queue))
    first = int(np.searchsorted(queue.t_s, at_s))
    run(part_of(queue, 0, first), on)
    for fault in faults:
        begin_lane_anew(on.work, ONE_LANE, STATES, fault, 0)
    run(part_of(queue, first, len(queue.t_s)), on)
    return Navigated(on, flown)


@pytest.mark.parametrize(
    ("fault", "sensor", "offset", "states", "without"),
    [
        (RANGE_OFFSET, Sensor.RANGE, [TINY], [POSITION + 2, GROUND], ()),
        (FORCE, Sensor.IMU, [0.0, 0.0, 0.0, TINY], [VELOCITY, VELOCITY + 1], QUIET),
        (FORCE + 1, Sensor.IMU, [0.0, 0.0, 0.0, 0.0, TINY], [VELOCITY, VELOCITY + 1], QUIET),
        (FORCE + 2, Sensor.IMU, [0.0, 0.0, 0.0, 0.0, 0.0, TINY], [VELOCITY + 2, POSITION + 2], QUIET),
        (TURNING, Sensor.IMU, [TINY], [VELOCITY, VELOCITY + 1], QUIET),
        (TURNING + 1, Sensor.IMU, [0.0, TINY], [VELOCITY, VELOCITY + 1], QUIET),
    ],
)
def test_an_effect_is_what_a_small_fault_does_to_the_estimate(fault, sensor, offset, states, without):
    """x^ moves by minus the error's mean: x - x^ = s b. What the fault does to the filter's own trust is left over."""
    flown = fly(circle, 16.0).without(*without)
    right = begun_anew(flown, 12.0, range(COUNT))
    wrong = begun_anew(added_to(flown, sensor, offset, 12.0), 12.0, range(COUNT))
    moved = (wrong.on.work[STATE : STATE + STATES] - right.on.work[STATE : STATE + STATES])[states] / TINY
    expected = np.array([-effect_of(right.on.work, ONE_LANE, STATES, fault, state, 0) for state in states])
    largest = np.abs(expected).max()
    assert largest > 1e-3
    learnt = 0.2 if FORCE <= fault < TURNING else 0.1  # what the filter learns of the bias in 4 s is left out
    np.testing.assert_allclose(moved, expected, atol=learnt * largest)


def test_following_faults_changes_no_bit_of_the_estimate():
    flown = noisy(FLOWN)
    followed = navigate(flown)
    queue = merge(flown.streams.values())
    on = start_navigator(equipment(flown, queue), NavigatorSettingsFile(), new_tape(queue))
    on.work[HYPOTHESES] = 0.0
    run(queue, on)
    alone = EstimateRow.of(on.tape.estimates())
    assert all(
        getattr(alone, name).tobytes() == getattr(followed.estimate_rows, name).tobytes() for name in UNPROTECTED
    )
    assert on.tape.offers().tobytes() == followed.offers.tobytes()
    assert followed.on.work[HYPOTHESES] == MOST_HYPOTHESES


# -- sizes ------------------------------------------------------------------------------------------------------
def test_a_size_is_the_innovations_mean_and_the_priors():
    found = size_of(75.0, 150.0, 0.2)  # the prior's information is 25
    assert found.size == pytest.approx(1.5)
    assert found.sigma == pytest.approx(0.1)
    assert found.evidence == pytest.approx(225.0)
    nothing = size_of(0.0, 0.0, 0.3)
    assert (nothing.size, nothing.sigma, nothing.evidence) == (0.0, pytest.approx(0.3), 0.0)


def told(run_of: Navigated, fault: int):
    return size_of(run_of.on.work[INFORMATION + fault], run_of.on.work[SCORE + fault], prior_sigma(fault))


@pytest.mark.parametrize(
    ("fault", "faulty", "size"),
    [
        (GPS_DRIFT, lambda f: drifting(blind(f), 1.5, 20.2), 1.5),
        (HEADING_OFF, lambda f: f, 0.0),
        (FLOW_SCALE, lambda f: f, 0.0),
    ],
)
def test_innovations_tell_the_size(fault, faulty, size):
    """GPS drift is sought anew at 20.2 s; beside a flow one as fast is refused before it is evidence (`fix_walk`)."""
    found = told(navigate(faulty(noisy(fly(circle, 30.0)))), fault)
    assert abs(found.size - size) < 0.5 * size + 3.0 * found.sigma
    assert (found.evidence > 20.0) == (size > 0.0)


def test_every_fault_has_a_name_and_sizes():
    assert len(NAMES) == COUNT == len(set(NAMES))
    assert all(prior_sigma(k) > 0.0 and least_size(k) > 0.0 for k in range(COUNT))


def test_the_larger_axis_is_that_of_the_covariance():
    covariance = np.array([[4.0, 1.5], [1.5, 2.0]])
    assert larger_axis(4.0, 2.0, 1.5) == pytest.approx(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


# -- levels and suspicions ----------------------------------------------------------------------------------------
FAULTS = {
    "reversed": lambda f: scaled(f, [[-1, 0], [0, -1]], 12.0),
    "swapped": lambda f: scaled(f, [[0, 1], [1, 0]], 12.0),
    "thirty percent less": lambda f: scaled(f, [[0.7, 0], [0, 0.7]], 12.0),
    "accelerometer": lambda f: added_to(f, Sensor.IMU, [0.0, 0.0, 0.0, 0.3, 0.0], 12.0),
    "range": lambda f: added_to(f, Sensor.RANGE, [0.5], 12.0),
    "GPS drift": lambda f: drifting(f, 0.5, 12.0),
    "GPS jump": lambda f: added_to(f, Sensor.GPS_POSITION, [20.0, 0.0, 0.0], 12.0),
}


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_error_stays_within_the_level_or_something_is_said(name, seed):
    flown = FAULTS[name](noisy(FLOWN, seed))
    for sensors in (OWN, (*OWN, Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.MAG, Sensor.BARO)):
        if name.startswith("GPS") and sensors == OWN:
            continue
        found = navigate(flown.only(*sensors))
        off = np.hypot(*(found.error - found.error[0])[:, :2].T)
        said = flagged(found.t_s, flags_of(found.on.tape.events()))
        beyond = (off > found.estimate_rows.protection_m[:, 0]) & ~said
        assert beyond.mean() < 0.02, (name, sensors)


@pytest.mark.parametrize("sensors", [OWN, tuple(FLOWN.streams)])
def test_a_flight_without_faults_raises_no_suspicion_and_has_levels_of_use(sensors):
    for seed in (1, 2, 3):
        found = navigate(noisy(FLOWN, seed).only(*sensors))
        assert len(found.events("filter", "suspects")) == 0
        levels_m = found.estimate_rows.protection_m
        assert np.isfinite(levels_m).all()
        sigma = found.estimate_rows.std_pos_ned_m[:, :2].max(axis=1)
        assert (levels_m[:, 0] >= 4.0 * sigma * 0.999).all()
        assert np.median(levels_m[:, 0]) < 20.0


def test_a_reversed_flow_is_suspected_by_name_and_the_suspicion_lasts():
    """By an accelerometer of 0.05 m/s2/rt(Hz); by one of twice that flow is doubted, and the levels hold."""
    turned = scaled(noisy(FLOWN), [[-1, 0], [0, -1]], 12.0).only(*OWN)
    found, plain = navigate(turned, accel_noise_m_s2_rt_hz=0.05), navigate(turned)
    assert plain.events("flow", "doubted")[0, 0] == pytest.approx(12.2, abs=0.3)
    off = np.hypot(*(plain.error - plain.error[0])[:, :2].T)
    assert (off <= plain.estimate_rows.protection_m[:, 0]).all()
    suspected = found.events("filter", "suspects")
    assert len(suspected)
    assert suspected[0, 0] == pytest.approx(12.5, abs=1.0)
    assert int(suspected[0, 1]) in (FLOW_REVERSED, FLOW_SWAPPED, FLOW_SCALE)
    cleared = found.events("filter", "cleared")
    assert all(after - before > HELD_S for before, after in zip(suspected[:, 0], cleared[:, 0], strict=False))


def test_what_is_there_or_not_is_sought_anew_once_it_is_excluded():
    """The effect of a reversal that grows without bound is cut off by the first innovations that exclude it."""
    found = navigate(noisy(FLOWN).only(*OWN))
    for fault in (FLOW_SWAPPED, FLOW_REVERSED):
        size = told(found, fault)
        assert 1.0 - size.size <= 4.0 * EXCLUDED_SIGMAS * size.sigma  # looked at once a while; for ever: 1000
        assert abs(effect_of(found.on.work, ONE_LANE, STATES, fault, POSITION, 0)) < 20.0


def test_levels_by_hand():
    found = navigate(noisy(FLOWN))
    work = found.on.work.copy()
    work[HYPOTHESES] = 0.0
    own = levels(work, ONE_LANE, 0)
    work[HYPOTHESES] = MOST_HYPOTHESES
    assert levels(work, ONE_LANE, 0).horizontal_m >= own.horizontal_m
    sigma = found.sigma(POSITION + 2)
    assert own.vertical_m == pytest.approx(2.5 * sigma)
    assert found.sigma(ATTITUDE) > 0.0


@pytest.mark.parametrize("matrix", [[[-1, 0], [0, -1]], [[0, 1], [1, 0]]])
def test_a_flow_that_turns_wrong_while_gps_holds_moves_nothing(matrix):
    """It was taken again when the vehicle's speed passed through zero, and carried the position 20 m off."""
    found = navigate(scaled(noisy(FLOWN), matrix, 12.0))
    assert np.hypot(*found.error[:, :2].T).max() < 0.2
    assert len(found.events("flow", "doubted"))


def test_a_flow_that_is_right_again_is_trusted_5_s_later():
    flown = noisy(FLOWN)
    wrong = scaled(flown, [[-1, 0], [0, -1]], 12.0)
    late = flown.streams[Sensor.FLOW_RATE].t_s >= 16.0
    value = np.where(late[:, None], flown.streams[Sensor.FLOW_RATE].value, wrong.streams[Sensor.FLOW_RATE].value)
    found = navigate(flown.changed(Sensor.FLOW_RATE, value=value))
    flow = InnovationRow.of(found.offers[found.offered.sensor == Sensor.FLOW_RATE])
    again_s = flow.t_s[(flow.t_s > 16.0) & (flow.reason == Reason.FUSED)].min()
    assert 20.5 < again_s < 23.0
    assert (flow.reason[flow.t_s > again_s] == Reason.FUSED).all()


# -- flags --------------------------------------------------------------------------------------------------------
def test_flags_stand_until_they_are_taken_down():
    rows = np.array([
        [1.0, DEAD_RECKONING, 0.0], [2.0, AIDED_AGAIN, 0.0], [3.0, FAULT_SUSPECTED, 9.0], [5.0, FAULT_CLEARED, 9.0],
        [6.0, DEAD_RECKONING, 0.0],
    ])  # fmt: skip
    flags = flags_of(rows)
    assert flags == (
        Flag(1.0, 2.0, "filter", "dead_reckoning"),
        Flag(3.0, 5.0, "filter", "suspects"),
        Flag(6.0, np.inf, "filter", "dead_reckoning"),
    )
    assert flagged(np.array([0.5, 1.0, 2.0, 4.0, 5.5, 9.0]), flags).tolist() == [False, True, False, True, False, True]
