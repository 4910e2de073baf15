"""Inertial readings that no vehicle can follow do not arrive, alone or in bursts; what lasts does."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.navigation.motion_records import ImuMemory, SpikeMemory
from flownav.navigation.records import Reading
from flownav.navigation.spikes import (
    BURST_S,
    LONE_SHARE,
    MOST_DOUBT_M_S,
    MOST_DOUBT_RAD,
    Witness,
    doubt_of,
    judge_spike,
    turning_doubt_of,
)
from flownav.navigation.tape import IMU_SPIKE
from flownav.navigation.vibration import with_reading
from navigation_streams import fly, navigate, still

KEPT = ImuMemory(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8, 0.0, 0.0, 0.0)
CALM = SpikeMemory(0.0, 0.02, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8, 0.0)
STEP_S = 0.004


def reading(gyro=(0.0, 0.0, 0.0), accel=(0.0, 0.0, -9.8)) -> Reading:
    return Reading(*gyro, *accel, np.nan, np.nan, np.nan, 255.0, 1.0, 0.0)


def test_what_a_vehicle_can_do_is_no_spike_and_what_it_cannot_is():
    assert not judge_spike(reading((0.9, 0.0, 0.0)), STEP_S, KEPT, CALM)[0]
    assert judge_spike(reading((0.0, 3.0, 0.0)), STEP_S, KEPT, CALM)[0]
    assert not judge_spike(reading(accel=(15.0, 0.0, -9.8)), STEP_S, KEPT, CALM)[0]
    assert judge_spike(reading(accel=(0.0, 60.0, -9.8)), STEP_S, KEPT, CALM)[0]


def test_a_longer_step_and_a_shaken_vehicle_may_jump_further():
    jump = reading((3.0, 0.0, 0.0))
    assert not judge_spike(jump, 0.02, KEPT, CALM)[0]
    assert not judge_spike(jump, STEP_S, KEPT, CALM._replace(gyro_rad_s=0.5))[0]
    assert not judge_spike(jump, 0.2, KEPT, CALM)[0]  # after a gap as much as at 50 Hz
    assert judge_spike(reading((6.0, 0.0, 0.0)), 0.2, KEPT, CALM)[0]


def test_after_a_gap_what_stays_is_believed_at_the_fourth_reading():
    verdicts, _ = judged([reading(accel=(0.0, 150.0, -9.8))] * 6, 0.4)
    assert verdicts == [True, True, True, False, False, False]


def judged(readings, period_s=STEP_S, memory=CALM):
    """Verdicts on readings that follow the kept one at a period; one that is believed is kept instead."""
    verdicts, kept, step_s = [], KEPT, period_s
    for said in readings:
        spike, memory = judge_spike(said, step_s, kept, memory)
        kept, step_s = (kept, step_s + period_s) if spike else (with_reading(said, 0.0, kept), period_s)
        verdicts.append(spike)
    return verdicts, memory


@pytest.mark.parametrize("period_s", [0.004, 0.01])
def test_a_burst_is_refused_for_three_tenths_of_a_second_and_what_lasts_is_believed(period_s):
    count = round(0.4 / period_s)
    for said in (reading((5.0, 0.0, 0.0)), reading(accel=(40.0, 0.0, -9.8))):
        verdicts, _ = judged([said] * count, period_s)
        assert sum(verdicts) == pytest.approx(BURST_S / period_s, abs=1)
        assert all(verdicts[: sum(verdicts)])


def test_a_burst_of_noise_does_not_make_itself_usual_and_motors_that_start_do():
    chance = np.random.default_rng(2)

    def shaken(sigma_m_s2, count):
        return [
            reading(accel=tuple(np.array([0.0, 0.0, -9.8]) + chance.normal(0.0, sigma_m_s2, 3))) for _ in range(count)
        ]

    assert np.mean(judged(shaken(60.0, 20), 0.01)[0]) > 0.9
    memory, refused = CALM, 0
    kept, kept_s = KEPT, 0.0
    for k, said in enumerate(shaken(8.0, 300)):
        spike, memory = judge_spike(said, 0.01 * (k + 1) - kept_s, kept, memory)
        refused += spike
        if not spike:
            kept, kept_s = (
                KEPT._replace(accel_x=said.value_3, accel_y=said.value_4, accel_z=said.value_5),
                0.01 * (k + 1),
            )
    assert refused < 30
    assert memory.accel_m_s2 > 5.0


def test_in_a_vehicle_that_shakes_what_the_next_reading_says_again_is_believed():
    """Its bursts cannot be distinguished from its motion; three spikes in a row are the most."""
    shaken = CALM._replace(gyro_rad_s=0.5, accel_m_s2=4.0)
    assert judged([reading(accel=(90.0, 0.0, -9.8))] * 2, 0.01, shaken)[0] == [True, False]
    to_and_fro = [reading(accel=(sign * 120.0, 0.0, -9.8)) for sign in (1.0, -1.0, 1.0, -1.0, 1.0)]
    assert judged(to_and_fro[:4], 0.01, shaken)[0] == [True, True, True, False]


def test_nothing_but_zeros_is_a_failed_imu_however_long():
    zeros = reading((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert all(judged([zeros] * 500)[0])
    assert not judge_spike(reading((0.0, 0.0, 0.0), (0.0, 0.0, -1e-3)), STEP_S, KEPT, CALM)[0]  # free fall


def test_a_burst_leaves_a_doubt_of_what_it_would_have_done_and_a_lone_spike_some_of_it():
    said = reading((5.0, 0.0, 0.0), (40.0, 0.0, -9.8))
    memory, velocity, attitude = CALM, [], []
    for k in range(10):
        step_s = 0.01 * (k + 1)
        _, memory = judge_spike(said, step_s, KEPT, memory)
        velocity.append(doubt_of(said, step_s, KEPT, memory))
        attitude.append(turning_doubt_of(said, step_s, KEPT, memory))
    assert velocity[0] == pytest.approx((LONE_SHARE * 40.0 * 0.01) ** 2)
    assert sum(velocity[:2]) == pytest.approx((40.0 * 0.02) ** 2)
    assert sum(velocity) == pytest.approx(MOST_DOUBT_M_S**2)
    assert sum(attitude[:2]) == pytest.approx((5.0 * 0.02) ** 2)
    assert sum(attitude) == pytest.approx(MOST_DOUBT_RAD**2)
    assert min(*velocity, *attitude) >= 0.0


@pytest.mark.parametrize(("period_s", "turning_rad_s2"), [(0.02, 200.0), (0.01, 250.0), (0.004, 400.0)])
def test_a_hard_turn_is_followed(period_s, turning_rad_s2):
    """A flick of a small aerobatic vehicle: up to 5 rad/s, a quarter of a second, down again."""
    t_s = np.arange(0.0, 0.6, period_s)
    rate = np.clip(np.minimum(t_s - 0.1, 0.4 - t_s) * turning_rad_s2, 0.0, 5.0)
    imu = np.column_stack([t_s, rate, np.zeros((len(t_s), 4)), np.full(len(t_s), -9.8)])
    assert Witness().keeps(imu).all()


def test_the_witness_keeps_what_the_filter_keeps():
    flown = fly(still, 4.0)
    imu = np.column_stack([flown.streams[Sensor.IMU].t_s, flown.streams[Sensor.IMU].value])
    imu[100, 1] += 25.0
    imu[200:210, 4] += 60.0
    whole, piecewise = Witness(), Witness()
    kept = whole.keeps(imu)
    assert np.flatnonzero(~kept).tolist() == [100, *range(200, 210)]
    assert np.array_equal(kept, np.concatenate([piecewise.keeps(imu[k : k + 1]) for k in range(len(imu))]))


def test_one_spike_of_10_ms_in_a_hover_moves_nothing():
    flown = fly(still, 10.0)
    imu = flown.streams[Sensor.IMU].value.copy()
    at = len(imu) // 2
    imu[at, 1] += 25.0
    spoilt = navigate(flown.changed(Sensor.IMU, value=imu))
    clean = navigate(flown)
    assert len([e for e in spoilt.events("imu", "spike")]) == 1
    assert np.abs(spoilt.velocity_error - clean.velocity_error).max() < 0.02
    assert int(IMU_SPIKE) == 15


@pytest.mark.parametrize("told", [{}, {"notch_rotor_hz": 24.0, "notch_blades_hz": 48.0}])
@pytest.mark.parametrize("axis", [0, 4])
@pytest.mark.parametrize("value_read", [1e200, 1000.0])
def test_one_mad_reading_after_a_gap_is_none(value_read, axis, told):
    """1000 m/s2, held for what of the gap the filter still follows, had been 250 m/s."""
    flown = fly(still, 20.0).cut(Sensor.IMU, 8.0, 8.15)
    imu = flown.streams[Sensor.IMU]
    value = imu.value.copy()
    value[np.searchsorted(imu.t_s, 8.15), axis] = value_read
    struck, calm = navigate(flown.changed(Sensor.IMU, value=value), **told), navigate(flown, **told)
    late = struck.t_s > 10.0
    assert np.sqrt(np.mean(struck.velocity_error[late] ** 2)) < 0.01 + np.sqrt(np.mean(calm.velocity_error[late] ** 2))
