"""Optical flow readings: angular rates less the vehicle's turning, or the sensor's own metric velocity."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, larger, procedure, replacing, smaller
from flownav.estimation.covariance import add_noise_lane, consider, covariance_of, variance_of
from flownav.estimation.laws.flow import body_velocity, flow_rate, lens_range_of
from flownav.estimation.motion import rotation_of
from flownav.estimation.states import (
    ATTITUDE,
    COMPASS,
    GROUND,
    GYRO_BIAS,
    GYRO_SHARE,
    HELD_BACK,
    INNOVATION,
    INNOVATION_VARIANCE,
    INS_ERROR,
    MEASURED,
    NOISE,
    POSITION,
    STATE,
    VELOCITY,
)
from flownav.measurement import Sensor
from flownav.navigation.flow_judge import View, judge_flow, turning_of
from flownav.navigation.flow_noise import (
    DOUBTED_RATIO,
    LONGEST_STEP_S,
    alike,
    blind_variance,
    blindness,
    flow_variance,
    followed_agreement,
    followed_excess,
    followed_likeness,
    followed_quality,
    lasting_doubt,
    lasting_walk,
    wrong_since,
)
from flownav.navigation.height import MANY_STRAYS
from flownav.navigation.lagged_flow import observe_lagged
from flownav.navigation.memory import (
    BLIND,
    INNOVATION_BEFORE,
    LENS_RANGE,
    REASON,
    SOUGHT,
    TESTED,
    TURNING,
    held_by_gps,
    load_echo,
    load_flow,
    load_ground,
    load_range,
    load_reading,
    load_start,
    set_lane,
    store_flow,
)
from flownav.navigation.offers import conclude, note_aid, put
from flownav.navigation.packed import load_flow_settings
from flownav.navigation.protection import sign_flow
from flownav.navigation.reasons import (
    FUSED,
    INNOVATION_GATE,
    NO_HEADING,
    SILENT,
)
from flownav.navigation.records import FlowMemory
from flownav.navigation.still import watch_flow
from flownav.navigation.tape import FLOW_DOUBTED, FLOW_TRUSTED, Output, write_event
from flownav.navigation.told import FlowSettings
from flownav.navigation.trust import watch_whiteness

LARGEST_SPREAD = 0.5  # of the height over the ground, of which flow makes no speed
UNKNOWN_RANGE_M = 2.0

with_agreement = replacing(FlowMemory, "excess", "ratio", "likeness")
with_verdict = replacing(FlowMemory, "taken_s", "doubted", "wrong_s", "usual")


# -- on lanes -----------------------------------------------------------------------------------------------
@procedure
def take_flow(
    work: Work, lanes: Lanes, lag: bool | None, t_s: float, sensor: int, gyro_is_imu: bool, p: Work, o: Output
) -> None:
    """Two components of flow [rad/s], or two or three of body velocity [m/s], with noise scheduled on the height.

    lag: `covariance.lagged`, whether the sensor's dynamics are states.
    """
    s = load_flow_settings(p)
    angular = sensor == Sensor.FLOW_RATE
    look(work, lanes, t_s, angular, gyro_is_imu, s)
    consider_others(work, lanes)
    watch_flow(work, lanes, angular)
    for component in range(2 if angular or lag is not None else 3):
        offer_component(work, lanes, t_s, component, angular, s)
        if lag is not None:
            observe_lagged(work, lanes, component, angular, s)
        elif angular:
            flow_rate(work, lanes, component, s.flow_forward_m, s.flow_right_m, s.flow_below_m, s.flow_below_m)
        else:
            body_velocity(work, lanes, component, s.flow_forward_m, s.flow_right_m, s.flow_below_m)
        sign_flow(work, lanes, t_s, component, angular)
        conclude(work, lanes, t_s, sensor, component, s.gate_sigma, o)
        watch_whiteness(work, lanes, t_s, 1 - component if angular else component)
        learn(work, lanes, t_s, angular, component, s)
        note_aid(work, lanes, t_s, o)
    walk_alone(work, lanes, t_s, s)
    judge_agreement(work, lanes, t_s, o)


@procedure
def look(work: Work, lanes: Lanes, t_s: float, angular: bool, gyro_is_imu: bool, s: FlowSettings) -> None:
    """TURNING, LENS_RANGE and, in TESTED, the verdict on the whole reading."""
    for lane in range(len(lanes)):
        reading, started = load_reading(work, lanes, lane), load_start(work, lanes, lane).started
        m = load_flow(work, lanes, lane)
        range_m = lens_range_of(work, lanes, lane, s.flow_below_m)
        ranged, strays = load_range(work, lanes, lane), load_echo(work, lanes, lane).stray > MANY_STRAYS
        told = t_s - ranged.taken_s <= s.height_hold_s and not np.isfinite(ranged.refused_s) and not strays
        set_lane(work, lanes, BLIND, lane, 0.0 if told else 1.0)
        spread_m = np.sqrt(larger(height_variance(work, lanes, lane), 0.0))
        known = load_ground(work, lanes, lane).known > 0.0 and spread_m <= LARGEST_SPREAD * range_m
        range_m = range_m if known else UNKNOWN_RANGE_M
        view = View(range_m, known, rotation_of(work, lanes, lane)[8])
        bias_x = work[(STATE + GYRO_BIAS) * len(lanes) + lane]
        bias_y = work[(STATE + GYRO_BIAS + 1) * len(lanes) + lane]
        x, y, after = turning_of(reading, t_s, bias_x, bias_y, gyro_is_imu, m, s)
        if angular and started > 0.0 and reading.arrived > 0.0:
            store_flow(work, lanes, lane, after)
        told = np.isfinite(reading.value_4 + reading.value_5)  # the IMU, by itself or as what the sensor's gyro follows
        work[GYRO_SHARE * len(lanes) + lane] = 1.0 if told else 0.0
        work[TURNING * len(lanes) + lane] = x
        work[(TURNING + 1) * len(lanes) + lane] = y
        work[LENS_RANGE * len(lanes) + lane] = range_m
        verdict = judge_flow(reading, angular, x, y, started, view, s)
        headed = verdict != FUSED or work[SOUGHT * len(lanes) + lane] == 0.0
        work[TESTED * len(lanes) + lane] = verdict if headed else NO_HEADING
        held = held_by_gps(work, lanes, lane, t_s)
        work[HELD_BACK * len(lanes) + lane] = 1.0 if held and np.isfinite(m.wrong_s) else 0.0


@equation
def consider_others(work: Work, lanes: Lanes) -> None:
    """What flow depends on and is no judge of: over a step of the ground it would move the height, and by accelerations
    that err it would turn the heading. Where GPS tells the velocity too, that is what corrects them.
    """
    consider(work, lanes, POSITION + 2, BLIND)
    consider(work, lanes, GROUND, BLIND)
    consider(work, lanes, ATTITUDE + 2)
    consider(work, lanes, GYRO_BIAS + 2)
    consider(work, lanes, INS_ERROR + 2)
    consider(work, lanes, COMPASS)
    consider(work, lanes, COMPASS + 1)


@equation
def height_variance(work: Work, lanes: Lanes, lane: int) -> float:
    """Of the height over the ground below [m2]."""
    both = variance_of(work, lanes, POSITION + 2, lane) + variance_of(work, lanes, GROUND, lane)
    return both - 2.0 * covariance_of(work, lanes, POSITION + 2, GROUND, lane)


@procedure
def offer_component(work: Work, lanes: Lanes, t_s: float, component: int, angular: bool, s: FlowSettings) -> None:
    """One component without turning and gain error, with its variance. A down velocity that no sensor has is NaN."""
    for lane in range(len(lanes)):
        reading, m = load_reading(work, lanes, lane), load_flow(work, lanes, lane)
        raw = reading.value_0 if component == 0 else (reading.value_1 if component == 1 else reading.value_2)
        turning = work[(TURNING + (0 if component == 0 else 1)) * len(lanes) + lane]
        along_x = component == (1 if angular else 0)  # flow_y shows the speed forward
        gain = s.flow_gain_x if along_x else (1.0 if component == 2 else s.flow_gain_y)
        observation = ((raw - turning) if angular else raw) / gain
        range_m = work[LENS_RANGE * len(lanes) + lane]
        speed = observation * range_m if angular else observation
        per_speed = 1.0 / (range_m * range_m) if angular else 1.0
        listed = reading.variance_0 if component == 0 else (
            reading.variance_1 if component == 1 else reading.variance_2
        )  # fmt: skip
        stated = np.nan if angular else listed
        noise = m.excess * flow_variance(range_m, speed, reading.quality, angular, s)
        model = per_speed * (noise + blind_variance(range_m, reading.quality, m.usual, t_s - m.taken_s, s))
        reason = int(work[TESTED * len(lanes) + lane])
        absent = component == 2 and not np.isfinite(raw)
        put(work, lanes, lane, observation, stated if np.isfinite(stated) else model, SILENT if absent else reason)
        if angular:  # the law has the gyro's bias, which TURNING does not
            bias = work[(STATE + GYRO_BIAS + component) * len(lanes) + lane]
            work[MEASURED * len(lanes) + lane] -= work[GYRO_SHARE * len(lanes) + lane] * bias


@procedure
def learn(work: Work, lanes: Lanes, t_s: float, angular: bool, component: int, s: FlowSettings) -> None:
    """Agreement and excess noise from the component that was just tested."""
    for lane in range(len(lanes)):
        reason = work[REASON * len(lanes) + lane]
        refused = reason == INNOVATION_GATE
        if reason == FUSED or refused:
            m, reading = load_flow(work, lanes, lane), load_reading(work, lanes, lane)
            innovation, total = work[INNOVATION * len(lanes) + lane], work[INNOVATION_VARIANCE * len(lanes) + lane]
            square = smaller(innovation * innovation, s.gate_sigma * s.gate_sigma * total) / total
            ratio = followed_agreement(square, t_s, m)
            unheld = not held_by_gps(work, lanes, lane, t_s)
            last = INNOVATION_BEFORE + component
            before = work[last * len(lanes) + lane]
            work[last * len(lanes) + lane] = innovation
            if refused and ratio > DOUBTED_RATIO and unheld and innovation * before > 0.0:  # spikes are not alike
                free_velocity(work, lanes, lane, smaller(abs(innovation), abs(before)), angular)
            listed = reading.variance_0 if component == 0 else (
                reading.variance_1 if component == 1 else reading.variance_2
            )  # fmt: skip
            excess = m.excess
            blind = blindness(reading.quality, m.usual) > 0.0
            if not blind and (angular or not np.isfinite(listed)):
                noise = work[NOISE * len(lanes) + lane]
                excess = followed_excess(innovation, before, noise, t_s, m, s)
            likeness = followed_likeness(alike(innovation, before, total), t_s, m)
            store_flow(work, lanes, lane, with_agreement(m, excess=excess, ratio=ratio, likeness=likeness))


@equation
def free_velocity(work: Work, lanes: Lanes, lane: int, innovation: float, angular: bool) -> None:
    """Flow that is refused again and again, and nothing else tells the velocity: then that is what is wrong."""
    freed = innovation * (work[LENS_RANGE * len(lanes) + lane] if angular else 1.0)
    add_noise_lane(work, lanes, VELOCITY, lane, freed * freed)
    add_noise_lane(work, lanes, VELOCITY + 1, lane, freed * freed)


@procedure
def walk_alone(work: Work, lanes: Lanes, t_s: float, s: FlowSettings) -> None:
    """Where no GPS holds the position, it is less sure by what lasts of the flow's error since the reading before."""
    for lane in range(len(lanes)):
        unheld = not held_by_gps(work, lanes, lane, t_s)
        step_s = smaller(t_s - load_flow(work, lanes, lane).taken_s, LONGEST_STEP_S)
        north, east = work[(STATE + VELOCITY) * len(lanes) + lane], work[(STATE + VELOCITY + 1) * len(lanes) + lane]
        walk = lasting_walk(work[LENS_RANGE * len(lanes) + lane], np.sqrt(north * north + east * east), s)
        if unheld and work[TESTED * len(lanes) + lane] == FUSED:
            add_noise_lane(work, lanes, POSITION, lane, walk * step_s)
            add_noise_lane(work, lanes, POSITION + 1, lane, walk * step_s)


@procedure
def judge_agreement(work: Work, lanes: Lanes, t_s: float, o: Output) -> None:
    """Say that flow is doubted, and that it is trusted again; note when it was tested last. No other is held back."""
    for lane in range(len(lanes)):
        work[HELD_BACK * len(lanes) + lane] = 0.0
        if work[TESTED * len(lanes) + lane] == FUSED:
            m = load_flow(work, lanes, lane)
            doubted = lasting_doubt(m.doubted, m.ratio)
            if doubted != m.doubted:
                write_event(lanes, lane, t_s, FLOW_DOUBTED if doubted > 0.0 else FLOW_TRUSTED, m.ratio, o)
            wrong_s = wrong_since(t_s, m.likeness, m.wrong_s)
            usual = followed_quality(load_reading(work, lanes, lane).quality, t_s - m.taken_s, m.usual)
            after = with_verdict(m, taken_s=t_s, doubted=doubted, wrong_s=wrong_s, usual=usual)
            store_flow(work, lanes, lane, after)
