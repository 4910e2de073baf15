"""Optical flow readings: angular rates less the vehicle's turning, or the sensor's own metric velocity."""

from __future__ import annotations

import numpy as np

from flownav.compile import ONE_LANE, procedure
from flownav.estimation.landing.observe import (
    BODY_VELOCITY_STATES,
    FLOW_RATE_STATES,
    height_range,
    observe_body_velocity,
    observe_flow_rate,
    rotation_of,
)
from flownav.estimation.landing.states import GYRO_BIAS
from flownav.measurement import Sensor
from flownav.navigation.height import range_variance
from flownav.navigation.offers import (
    FUSED,
    INNOVATION_GATE,
    NEAR_GROUND,
    NO_HEIGHT,
    OUT_OF_RANGE,
    TILTED,
    conclude,
    note_aid,
    put,
    usable,
)
from flownav.navigation.state import (
    FLOW_BIAS_COUNT,
    FLOW_BIAS_X,
    FLOW_CLOCK,
    FLOW_DOUBT,
    FLOW_DOUBTED,
    FLOW_EXCESS,
    FLOW_GYRO_IS_IMU,
    FLOW_RATIO,
    FLOW_TRUSTED,
    LATEST_IMU,
    LEVER,
    RANGE_CLOCK,
    RANGE_SINCE,
    ROWS,
    STARTED,
    USE_IMU,
    VALUE,
    Reading,
    Running,
    write_event,
)

LARGEST_EXCESS = 400.0
AGREEMENT_S = 1.0
DOUBTED_RATIO, TRUSTED_RATIO = 4.0, 2.0  # on average 1
LONGEST_STEP_S = 1.0
UNKNOWN_RANGE_M = 2.0


@procedure
def take_flow(reading: Reading, on: Running) -> None:
    """Two components of flow [rad/s], or two or three of body velocity [m/s], with noise scheduled on the height."""
    memory, settings, value = on.memory, on.settings, reading.value
    if memory[STARTED] == 0.0:
        return
    angular = reading.sensor == Sensor.FLOW_RATE
    upright = rotation_of(on.work, ONE_LANE, ROWS, 0)[8]
    known = reading.t_s - memory[RANGE_CLOCK] <= settings.height_hold_s
    range_m = height_range(on.work, ONE_LANE, ROWS, 0, settings.flow_below_m) if known else UNKNOWN_RANGE_M
    turning_x, turning_y = rotation_rate(reading, on) if angular else (0.0, 0.0)
    reason = usable(reading.quality, value[0] + value[1] + turning_x + turning_y, 0.0, on)
    disputed = np.isfinite(memory[RANGE_SINCE])  # over a step of the ground the flow would move the height
    if reason == FUSED and angular and (disputed or not known):
        reason = NO_HEIGHT
    if reason == FUSED and angular and max(abs(value[0]), abs(value[1])) > settings.flow_limit_rad_s:
        reason = OUT_OF_RANGE
    if reason == FUSED and upright < np.cos(settings.tilt_limit_rad):
        reason = TILTED
    if reason == FUSED and known and range_m * upright < settings.flow_min_height_m:
        reason = NEAR_GROUND
    components = 3 if not angular and np.isfinite(value[2]) else 2
    tested = False
    for channel in range(components):
        if angular:
            observation = value[channel] - (turning_x if channel == 0 else turning_y)
            speed = observation * range_m
            scale_of_noise = 1.0 / (range_m * range_m)
        else:
            observation = speed = value[channel]
            scale_of_noise = 1.0
        stated = np.nan if angular else reading.variance[channel]
        model = scale_of_noise * velocity_variance(range_m, speed, reading.quality, angular, on)
        noise = memory[FLOW_EXCESS] * model if np.isnan(stated) else stated
        outcome = offer_flow(reading, channel, observation, noise, reason, on)
        if outcome == FUSED or outcome == INNOVATION_GATE:  # noqa: SIM109
            follow_agreement(reading.t_s, on)
            if np.isnan(stated):
                learn_flow_noise(reading.t_s, on)
            tested = True
        if outcome == FUSED:
            note_aid(reading.t_s, on)
    if tested:
        memory[FLOW_CLOCK] = reading.t_s
        judge_agreement(reading.t_s, on)


@procedure
def offer_flow(reading: Reading, channel: int, observation: float, noise: float, reason: int, on: Running) -> int:
    """Offer one component; what became of it."""
    work = on.work
    work[VALUE] = observation
    if reading.sensor == Sensor.FLOW_RATE:
        set_lever(1 if channel == 0 else 0, on)
        observe_flow_rate(work, ONE_LANE, ROWS, channel, VALUE, LEVER, on.settings.flow_below_m)
        put(noise, reason, FLOW_RATE_STATES, on.work)
        return conclude(reading, channel, observation, reason, on)
    set_lever(channel, on)
    observe_body_velocity(work, ONE_LANE, ROWS, channel, VALUE, LEVER)
    put(noise, reason, BODY_VELOCITY_STATES, on.work)
    return conclude(reading, channel, observation, reason, on)


@procedure
def set_lever(component: int, on: Running) -> None:
    """Velocity of the lens from rotation, w x l, along one body axis."""
    work, settings = on.work, on.settings
    p = work[LATEST_IMU] - work[ROWS.state + GYRO_BIAS]
    q = work[LATEST_IMU + 1] - work[ROWS.state + GYRO_BIAS + 1]
    r = work[LATEST_IMU + 2] - work[ROWS.state + GYRO_BIAS + 2]
    forward = q * settings.flow_below_m - r * settings.flow_right_m
    right = r * settings.flow_forward_m - p * settings.flow_below_m
    down = p * settings.flow_right_m - q * settings.flow_forward_m
    lever = forward if component == 0 else (right if component == 1 else down)
    work[LEVER] = lever if on.memory[USE_IMU] > 0.0 else 0.0


@procedure
def rotation_rate(reading: Reading, on: Running) -> tuple[float, float]:
    """The turning that the flow saw [rad/s]: the chosen gyro of columns 2 and 3 less its bias.

    The vehicle's IMU (columns 4 and 5, its mean over the exposure) has the filter's bias; a sensor's own gyro is
    followed against it, but not where it has no data: it may say zero then for its gyro too.
    """
    value, memory, work = reading.value, on.memory, on.work
    imu_x, imu_y = value[4] - work[ROWS.state + GYRO_BIAS], value[5] - work[ROWS.state + GYRO_BIAS + 1]
    imu_here = np.isfinite(imu_x + imu_y)
    if memory[FLOW_GYRO_IS_IMU] > 0.0 and imu_here:
        return imu_x, imu_y
    own_x, own_y = value[2], value[3]
    if imu_here and np.isfinite(own_x + own_y) and reading.quality != 0.0:
        memory[FLOW_BIAS_COUNT] += 1.0
        step_s = min(max(reading.t_s - memory[FLOW_CLOCK], 0.0), LONGEST_STEP_S)
        share = max(1.0 - np.exp(-step_s / on.settings.flow_gyro_time_s), 1.0 / memory[FLOW_BIAS_COUNT])
        memory[FLOW_BIAS_X] += share * (own_x - imu_x - memory[FLOW_BIAS_X])
        memory[FLOW_BIAS_X + 1] += share * (own_y - imu_y - memory[FLOW_BIAS_X + 1])
    return own_x - memory[FLOW_BIAS_X], own_y - memory[FLOW_BIAS_X + 1]


@procedure
def velocity_variance(range_m: float, speed_m_s: float, quality: float, angular: bool, on: Running) -> float:
    """Variance of a flow velocity [m2/s2]: (sigma_flow r)^2 + floor^2, sigma_flow by quality (as PX4's EKF2).

    A metric sensor multiplied by a range of its own, whose error scales its velocity.
    """
    settings = on.settings
    low, good = settings.flow_low_quality_sigma_rad_s, settings.flow_sigma_rad_s
    sigma = (low + (good - low) * quality / 255.0) * range_m
    scaled = 0.0 if angular else speed_m_s * speed_m_s * range_variance(range_m, on) / (range_m * range_m)
    return sigma * sigma + settings.flow_floor_m_s * settings.flow_floor_m_s + scaled


@procedure
def follow_agreement(t_s: float, on: Running) -> None:
    """Follow how well flow agrees with what the filter expects of it: nu^2 over its variance, 1 on average.

    A wrong sign, swapped axes or garbage stay within the gate reading by reading, but not on average.
    """
    memory, work = on.memory, on.work
    gate, total = on.settings.filter.gate_sigma, work[ROWS.innovation_variance]
    square = min(work[ROWS.innovation] ** 2, gate * gate * total) / total
    share = min(max(t_s - memory[FLOW_CLOCK], 0.0) / AGREEMENT_S, 1.0)
    memory[FLOW_RATIO] += 0.5 * share * (square - memory[FLOW_RATIO])


@procedure
def judge_agreement(t_s: float, on: Running) -> None:
    """Say that flow is doubted, and that it is trusted again."""
    memory = on.memory
    if memory[FLOW_DOUBT] == 0.0 and memory[FLOW_RATIO] > DOUBTED_RATIO:
        memory[FLOW_DOUBT] = 1.0
        write_event(t_s, FLOW_DOUBTED, memory[FLOW_RATIO], on.tape)
    elif memory[FLOW_DOUBT] > 0.0 and memory[FLOW_RATIO] < TRUSTED_RATIO:
        memory[FLOW_DOUBT] = 0.0
        write_event(t_s, FLOW_TRUSTED, memory[FLOW_RATIO], on.tape)


@procedure
def learn_flow_noise(t_s: float, on: Running) -> None:
    """Follow how many times noisier than its model the flow is: the mean of (nu^2 - h P h')/R, at least 1.

    A poor lens or floor shows in the innovations; the model alone would take its noise for motion and gate the
    rest away. Flow smoother than modelled is not trusted more: what is left of its error lasts.
    """
    memory, work = on.memory, on.work
    noise, total = work[ROWS.noise], work[ROWS.innovation_variance]
    gate = on.settings.filter.gate_sigma
    square = min(work[ROWS.innovation] ** 2, gate * gate * total)
    found = (square - (total - noise)) * memory[FLOW_EXCESS] / noise
    share = min(max(t_s - memory[FLOW_CLOCK], 0.0), LONGEST_STEP_S) / on.settings.flow_noise_time_s
    followed = memory[FLOW_EXCESS] + 0.5 * share * (found - memory[FLOW_EXCESS])
    memory[FLOW_EXCESS] = min(max(followed, 1.0), LARGEST_EXCESS)
