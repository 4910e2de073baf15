"""Inertial readings that no vehicle can follow do not arrive; those that the next confirms do."""

from __future__ import annotations

import numpy as np

from flownav.measurement import Sensor
from flownav.navigation.records import ImuMemory, Reading, SpikeMemory
from flownav.navigation.spikes import judge_spike
from flownav.navigation.tape import IMU_SPIKE
from navigation_streams import fly, navigate, still

KEPT = ImuMemory(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8, 0.0, 0.0, 0.0)
CALM = SpikeMemory(0.0, 0.02, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8)
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
    assert not judge_spike(jump, 0.2, KEPT, CALM)[0]  # after a gap anything may be


def test_what_the_next_reading_says_again_is_believed_and_three_in_a_row_are_the_most():
    jump = reading((5.0, 0.0, 0.0))
    spike, after = judge_spike(jump, STEP_S, KEPT, CALM)
    assert spike
    assert after.refused == 1.0
    assert not judge_spike(jump, 2 * STEP_S, KEPT, after)[0]
    memory, verdicts = CALM, []
    for k, sign in enumerate((1.0, -1.0, 1.0, -1.0)):
        spike, memory = judge_spike(reading((sign * 25.0, 0.0, 0.0)), (k + 1) * STEP_S, KEPT, memory)
        verdicts.append(spike)
    assert verdicts == [True, True, True, False]


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
