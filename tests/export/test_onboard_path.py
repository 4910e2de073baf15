"""The live path behind the library's interface: waiting, feeding and the state of now, compared with Python's."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.compile import ONE_LANE
from flownav.core.frames import heading_from_quaternion, rotation_from_quaternion
from flownav.core.measurement import EventQueue, Sensor
from flownav.estimation.law import Signature
from flownav.estimation.motion import add_motion_noise, errors_in_motion
from flownav.estimation.states import ATTITUDE, GYRO_BIAS, PLACES, POSITION, ROWS_BY_NAME, STATE, STATES, VELOCITY
from flownav.export.onboard.board import NOTHING, Board
from flownav.navigation import onboard, progress
from flownav.navigation.inertial import last_motion, motion_between
from flownav.navigation.kernel_settings import Equipment
from flownav.navigation.loop import run, start_navigator
from flownav.navigation.memory import CLOCK, OWN_FILTER, PROTECTION, load_aid, load_imu
from flownav.navigation.now import NowState, moved_on, state_of
from flownav.navigation.rings import Given, Rings, given_of, numbers_of
from flownav.navigation.rows import EventRow, InnovationRow
from flownav.navigation.tape import new_tape
from navigation_streams import circle, fly
from onboard_readings import RATES, arriving, as_prepared, flight_of, settings_of, spoilt
from packed_covariance import pack, unpack

FLOWN = fly(circle, 12.0, 0.2)
FLIGHT = flight_of(FLOWN)
SETTINGS, _ = settings_of(FLIGHT)
GYRO, LEVEL = (0.0, 0.0, 0.0), (0.0, 0.0, -9.8)


def board(settings: np.ndarray = SETTINGS) -> Board:
    return Board(settings, RATES.sizes)


def fed(readings: list[Given], on: Board | None = None) -> Board:
    on = on or board()
    for given in readings:
        on.take(given)
    on.finish()
    return on


def imu(t_s: float, gyro: tuple[float, ...] = GYRO, accel: tuple[float, ...] = LEVEL) -> Given:
    return Given(t_s, int(Sensor.IMU), numbers_of((*gyro, *accel)))


def same(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a == b) | (np.isnan(a) & np.isnan(b))


# -- what is fed ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("seed", [1, 2])
def test_readings_that_come_in_any_order_are_fed_in_that_of_their_instants_with_their_turning(seed):
    readings = arriving(FLOWN, seed)
    late, sorted_ = fed(readings), fed(as_prepared(readings))
    differ = np.flatnonzero(~same(late.work[:OWN_FILTER], sorted_.work[:OWN_FILTER]))
    assert not len(differ), differ[:10]
    assert late.digest() == sorted_.digest()
    assert late.now(12.0).status == progress.STATE_GIVEN


def test_it_is_what_replay_makes_of_the_same_readings():
    queue = FLIGHT.segment.queue
    settings, _ = settings_of(FLIGHT, horizon_s=0.0, leap_s=np.inf, anew_s=np.inf, start_wait_s=np.nan)
    on = start_navigator(Equipment(**FLIGHT.segment.equipment), FLIGHT.settings, new_tape(queue), FLIGHT.flow_noise)
    there = board(settings)
    innovation, event = [], []
    for k, given in enumerate(given_of(queue)):
        run(EventQueue._make(column[k : k + 1] for column in queue), on)
        for outcome in (there.take(given), *(there.take(NOTHING) for _ in range(3))):
            innovation.append(outcome.innovation)
            event.append(outcome.event)
        assert there.take(NOTHING).head.parts == 0.0
        if k % 100 == 0 or k == len(queue.t_s) - 1:
            assert same(there.work[:OWN_FILTER], on.work[:OWN_FILTER]).all(), k
    assert same(np.concatenate(innovation), on.tape.offers()).all()
    assert same(np.concatenate(event), on.tape.events()).all()
    assert len(InnovationRow.of(on.tape.offers()).t_s) > 1000
    assert len(EventRow.of(on.tape.events()).t_s)


def test_work_that_is_spread_over_more_calls_ends_in_the_same_bits():
    readings = arriving(FLOWN)[:900]
    patient = board()
    for given in readings:
        patient.take(given)
        patient.take(NOTHING)
        patient.take(NOTHING)
    patient.finish()
    assert patient.digest() == fed(readings).digest()


def test_the_way_through_a_gap_is_shared_among_calls():
    on = fed(arriving(FLOWN)[:600])
    newest = max(given.t_s for given in arriving(FLOWN)[:600])
    for k in range(3):  # a time that leaps is believed when three agree
        on.take(imu(newest + 8.0 + 0.01 * k))
    assert on.take(imu(newest + 8.5)).head.waiting > 1.0
    assert on.now(newest + 8.5).status in (progress.BEHIND, progress.STALE)
    calls = 0
    while on.take(NOTHING).head.parts > 0.0:
        calls += 1
    assert 20 <= calls <= 80  # 80 steps of 0.1 s, four in a call, after what waits before the gap
    assert on.now(newest + 8.5).status == progress.STATE_GIVEN


# -- the state of now -------------------------------------------------------------------------------------------
@pytest.mark.parametrize("ahead_s", [0.0, 0.1, 0.263, 0.4])
def test_the_state_of_now_is_what_python_carries_on(ahead_s):
    readings = [given for given in arriving(FLOWN) if given.t_s < 9.0]
    on = fed(readings)
    t_s = float(on.work[CLOCK]) + ahead_s
    rows = np.array([[g.t_s, *g.numbers[:6]] for g in readings if g.sensor == Sensor.IMU])
    rows = rows[rows[:, 0] > on.work[CLOCK]]
    told = on.now(t_s)
    state, rate = carried_on(on.work, rows, t_s)
    np.testing.assert_array_equal(told.pos_ned_m, state[:3])
    np.testing.assert_array_equal(told.vel_ned_m_s, state[3:6])
    np.testing.assert_array_equal(told.quaternion, state[6:10])
    np.testing.assert_array_equal(told.rate_frd_rad_s, rate)
    rotation = np.array(rotation_from_quaternion(*told.quaternion)).reshape(3, 3)
    np.testing.assert_allclose(told.vel_frd_m_s, rotation.T @ told.vel_ned_m_s, atol=1e-12)
    assert told.ahead_s == t_s - on.work[CLOCK]
    assert told.aid_age_s == t_s - load_aid(on.work, ONE_LANE, 0).aided_s
    np.testing.assert_array_equal(told.protection_m, on.work[PROTECTION : PROTECTION + 2])
    covariance_is_as_python_has_it(on, told, t_s)


def carried_on(work: np.ndarray, imu: np.ndarray, t_s: float) -> tuple[NowState, np.ndarray]:
    """The state of work at an instant by the laws as plain Python, and the rate; imu: what came after its clock."""
    state, at_s, before = state_of(work, ONE_LANE, 0), work[CLOCK], last_motion(load_imu(work, ONE_LANE, 0))
    for row in imu[imu[:, 0] < t_s]:
        state = moved_on(state, motion_between(before, tuple(row[1:]), FLIGHT.settings.imu_integrates), row[0] - at_s)
        at_s, before = row[0], tuple(row[1:])
    after = imu[imu[:, 0] >= t_s]
    newest = after[-1, 1:4] if len(after) else np.array(before[:3])
    if len(after):
        before = motion_between(before, tuple(after[0, 1:]), FLIGHT.settings.imu_integrates)
    if t_s > at_s:
        state = moved_on(state, before, t_s - at_s)
    return state, newest - state[10:13]


def covariance_at(work: np.ndarray, t_s: float, position_walk_m_rt_s: float) -> np.ndarray:
    """The covariance of all states at an instant, by NumPy: F P F' and noise, one step from the clock of work."""
    law = Signature.of(errors_in_motion.law)
    held = {name: work[ROWS_BY_NAME[name]] for name in law.names if name not in PLACES}
    dt_s = max(t_s - work[CLOCK], 0.0)
    covariance = unpack(work, ONE_LANE, 0, STATES)
    for _ in range(2):  # F P, and then F (F P)'
        errors = held | {name: covariance[PLACES[name]] for name in law.names if name in PLACES}
        records = [parameter.record(*(errors[name] for name in parameter.names)) for parameter in law.reads]
        for name, row in errors_in_motion.law(*records, dt_s=dt_s)._asdict().items():
            covariance[PLACES[name]] = row
        covariance = covariance.T
    rows = work.copy()
    pack(rows, ONE_LANE, 0, STATES, covariance)
    add_motion_noise(rows, ONE_LANE, dt_s, position_walk_m_rt_s)
    return unpack(rows, ONE_LANE, 0, STATES)


def covariance_is_as_python_has_it(on: Board, told, t_s: float) -> None:
    whole = covariance_at(on.work, t_s, FLIGHT.settings.position_walk_m_rt_s)
    heading = heading_from_quaternion(*told.quaternion)
    turn = np.eye(6)
    turn[3:5, 3:5] = [[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]]
    places = [*range(POSITION, POSITION + 3), *range(ATTITUDE, ATTITUDE + 3)]
    pose = turn @ whole[np.ix_(places, places)] @ turn.T
    velocity = whole[VELOCITY : VELOCITY + 3, VELOCITY : VELOCITY + 3]
    rotation = np.array(rotation_from_quaternion(*told.quaternion)).reshape(3, 3)
    bias = whole[GYRO_BIAS : GYRO_BIAS + 3, GYRO_BIAS : GYRO_BIAS + 3]
    for found, expected in (
        (told.pose_covariance, pose), (told.vel_ned_covariance, velocity),
        (told.vel_frd_covariance, rotation.T @ velocity @ rotation), (told.rate_covariance, bias),
    ):  # fmt: skip
        upper = expected[np.triu_indices(len(expected))]
        np.testing.assert_allclose(found, upper, rtol=1e-9, atol=1e-15)


def test_telling_leaves_the_navigator_as_it_is():
    readings = arriving(FLOWN)
    quiet, asked = board(), board()
    for given in readings[:800]:
        quiet.take(given)
        asked.take(given)
        asked.now(given.t_s)
    assert quiet.digest() == asked.digest()


def test_in_flight_the_state_of_now_is_told_after_every_reading():
    on, said = board(), []
    for given in arriving(FLOWN):
        on.take(given)
        said.append(on.now(given.t_s).status)
    started = said.index(progress.STATE_GIVEN)
    assert started < 300
    assert set(said[started:]) == {progress.STATE_GIVEN}


def test_before_the_start_and_long_after_the_last_reading_nothing_is_told():
    on = board()
    assert on.now(0.0).status == progress.NOT_STARTED
    on = fed(arriving(FLOWN)[:900])
    assert on.now(float(on.work[CLOCK]) + 2.1).status == progress.STALE
    assert on.now(float(on.work[CLOCK]) - 0.1).status == progress.STALE
    assert on.now(float(on.work[CLOCK]) + 1.9).status == progress.STATE_GIVEN
    assert np.isfinite(on.work[STATE : STATE + 3]).all()


# -- what becomes of a reading ----------------------------------------------------------------------------------
def status(on: Board, given: Given) -> float:
    return on.take(given).head.status


def test_a_reading_of_an_instant_that_is_past_is_late():
    on = fed([imu(0.01 * k) for k in range(100)])
    assert status(on, Given(0.5, int(Sensor.BARO), numbers_of((100.0,)))) == progress.LATE
    assert status(on, Given(0.9, int(Sensor.BARO), numbers_of((100.0,)))) == progress.TAKEN
    assert status(on, Given(0.9, int(Sensor.BARO), numbers_of((100.0,), delay_s=0.5))) == progress.LATE


@pytest.mark.parametrize(
    ("said", "kept"), [(0.0, 0), (7.9, 7), (255.0, 255), (300.0, 255), (-1.0, 0), (np.nan, 0), (np.inf, 255)]
)
def test_a_quality_is_kept_as_a_whole_number_beside_the_order_of_arrival(said, kept):
    rings = Rings(RATES.sizes, 9)
    for k, quality in enumerate((said, 255.0, said, 1.0)):
        value = (0.1, 0.2, 0.3, 0.4)
        rings.take(Given(2.0, int(Sensor.FLOW_RATE), numbers_of((*value[:3], k), (), quality, 0.5, 0.1, withheld=1.0)))
    waits = rings.waiting()
    assert waits.quality.tolist() == [kept, 255, kept, 1]
    assert waits.value[:, 3].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert waits.withheld.tolist() == [1.0] * 4
    assert waits.sensor.tolist() == [Sensor.FLOW_RATE] * 4


def test_too_many_that_wait_are_dropped():
    on = fed([imu(0.01 * k) for k in range(100)])
    said = [status(on, Given(0.95 + 1e-4 * k, int(Sensor.BARO), numbers_of((100.0,)))) for k in range(60)]
    room = int(RATES.sizes.table)
    assert said == [progress.TAKEN] * room + [progress.OVERFLOW] * (60 - room)


def test_a_time_that_is_no_number_and_a_sensor_that_is_none():
    on = board()
    for t_s in (np.nan, np.inf, -np.inf):
        assert status(on, imu(t_s)) == progress.NOT_FINITE
    for sensor in (-1, 99, 10**9):
        assert status(on, Given(0.0, sensor, numbers_of((1.0,)))) == progress.NO_SENSOR


def test_a_time_that_leaps_is_believed_when_three_agree():
    on = fed([imu(0.01 * k) for k in range(100)])
    assert status(on, imu(1000.0)) == progress.NOT_BELIEVED
    assert status(on, imu(1.0)) == progress.TAKEN  # the clock goes on: it was one that lied
    assert [status(on, imu(3.0 + 0.01 * k)) for k in range(3)] == [progress.NOT_BELIEVED] * 2 + [progress.TAKEN]


@pytest.mark.parametrize("leap_s", [1000.0, -500.0])
def test_after_a_leap_too_far_it_begins_anew(leap_s):
    on = fed(arriving(FLOWN)[:900])
    assert on.now(float(on.work[CLOCK])).status == progress.STATE_GIVEN
    said = [status(on, imu(leap_s + 0.01 * k)) for k in range(3)]
    assert said == [progress.NOT_BELIEVED] * 2 + [progress.BEGUN_ANEW]
    assert on.now(leap_s).status == progress.NOT_STARTED
    fresh = board()
    for given in (imu(leap_s + 0.01 * k) for k in range(2, 100)):
        on.take(given)
        fresh.take(given)
    on.finish()
    fresh.finish()
    assert on.digest() == fresh.digest()


def test_a_sensor_that_was_due_and_did_not_come_moves_the_filter_and_is_noted():
    readings = arriving(FLOWN)[:900]
    on = fed(readings)
    silent = Given(readings[-1].t_s, int(Sensor.GPS_VELOCITY), numbers_of((), withheld=2.0))
    outcomes = [on.take(silent)]
    outcomes += [on.take(imu(readings[-1].t_s + 0.01 * k)) for k in range(1, 40)]
    offered = np.concatenate([outcome.innovation for outcome in outcomes])
    assert np.count_nonzero(InnovationRow.of(offered).sensor == Sensor.GPS_VELOCITY) == 0
    assert on.work[CLOCK] >= silent.t_s


def test_whatever_is_handed_over_the_numbers_stay_within_what_the_header_says():
    readings = arriving(FLOWN)
    for seed in range(40):
        on = board()
        for given in (*readings[:400], *spoilt(readings[400:600], seed)):
            head, innovation, event = on.take(given)
            assert head.status in {value for value, _ in progress.STATUSES.values()}
            assert 0 <= head.waiting <= RATES.sizes.ring + RATES.sizes.table + 1
            assert len(innovation) <= onboard.MOST_INNOVATIONS
            assert len(event) <= onboard.MOST_EVENTS
            assert on.now(given.t_s).status in {value for value, _ in progress.NOW_STATUSES.values()}
