"""The verdict on a flow reading, and the turning that it saw: laws of one reading, its memory and the settings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.compile import cos, equation, exp, larger, replacing, smaller
from flownav.navigation.flow_noise import LONGEST_STEP_S
from flownav.navigation.offers import usable_in_flight
from flownav.navigation.reasons import FUSED, NEAR_GROUND, NO_HEIGHT, OUT_OF_RANGE, TILTED
from flownav.navigation.records import FlowMemory, Reading
from flownav.navigation.told import FlowSettings

with_gyro = replacing(FlowMemory, "bias_x", "bias_y", "bias_count")

NEAR_LIMIT = 0.98  # a sensor that has reached its limit reads the limit, whatever the flow


class View(NamedTuple):
    """The ground that the lens sees: the range along the boresight by the filter, whether that is well known, R_33."""

    range_m: float
    known: bool
    upright: float


@equation
def turning_of(
    reading: Reading, t_s: float, bias_x: float, bias_y: float, gyro_is_imu: bool, m: FlowMemory, s: FlowSettings
) -> tuple[float, float, FlowMemory]:
    """The turning that the flow saw [rad/s]: its own gyro less its bias, or the vehicle's IMU over the exposure.

    bias_x, bias_y: the filter's gyro bias, which the IMU's mean has. A sensor's own gyro is followed against the IMU,
    but not where it has no data: it may say zero then for its gyro too.
    """
    imu_x, imu_y = reading.value_4 - bias_x, reading.value_5 - bias_y
    own_x, own_y = reading.value_2, reading.value_3
    imu_here = bool(np.isfinite(imu_x + imu_y))
    by_imu = gyro_is_imu and imu_here
    follows = imu_here and not by_imu and bool(np.isfinite(own_x + own_y)) and reading.quality != 0.0
    count = m.bias_count + 1.0 if follows else m.bias_count
    step_s = smaller(larger(t_s - m.taken_s, 0.0), LONGEST_STEP_S)
    share = larger(1.0 - exp(-step_s / s.flow_gyro_time_s), 1.0 / larger(count, 1.0)) if follows else 0.0
    bias_own_x = m.bias_x + share * (own_x - imu_x - m.bias_x) if follows else m.bias_x
    bias_own_y = m.bias_y + share * (own_y - imu_y - m.bias_y) if follows else m.bias_y
    after = with_gyro(m, bias_x=bias_own_x, bias_y=bias_own_y, bias_count=count)
    x = imu_x if by_imu else own_x - bias_own_x
    y = imu_y if by_imu else own_y - bias_own_y
    return x, y, after


@equation
def judge_flow(
    reading: Reading, angular: bool, turning_x: float, turning_y: float, started: float, view: View, s: FlowSettings
) -> int:
    """The verdict on a flow reading as a whole."""
    turning = turning_x + turning_y if angular else 0.0
    reason = usable_in_flight(reading, reading.value_0 + reading.value_1 + turning, 0.0, started)
    reason = NO_HEIGHT if reason == FUSED and angular and not view.known else reason
    fast = angular and larger(abs(reading.value_0), abs(reading.value_1)) >= NEAR_LIMIT * s.flow_limit_rad_s
    reason = OUT_OF_RANGE if reason == FUSED and fast else reason
    reason = TILTED if reason == FUSED and view.upright < cos(s.tilt_limit_rad) else reason
    near = view.known and view.range_m * view.upright <= s.flow_min_height_m  # `lens_range_of` is at least 0.05
    return NEAR_GROUND if reason == FUSED and near else reason
