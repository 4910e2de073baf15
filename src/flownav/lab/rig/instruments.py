"""Instruments of the rig: the encoder at the pivot, and the readings of the PX4FLOW besides its pictures, as it sends
them.

A Baumer encoder of 10 000 lines, four counts a line (paper section III.C), is sampled by the dSPACE board at 1 kHz.
Its rate is the slope of a local cubic through 25 ms on either side, fitted afterwards, so that the reference has
no delay of its own; a difference of neighbouring counts would carry 0.16 rad/s of quantisation.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, savgol_filter

from flownav.core.measurement import Array
from flownav.lab.optics.firmware import Firmware
from flownav.lab.optics.flow import compensated, velocities
from flownav.sensors.range_sensor import RangefinderState, smooth_range

GYRO_SAMPLE_S = 1.0 / 760.0
GYRO_BANDWIDTH_HZ = 30.0
GYRO_NOISE_RAD_S = 0.005
GYRO_OFFSET_WEIGHT = 1e-4  # of each frame in the firmware's running mean of the rate, which it subtracts

SONAR_PERIOD_S = 0.1
SONAR_ECHO_S = 0.05  # from the trigger to the reading
SONAR_NOISE_M = 0.002
SONAR_FLOOR_M, SONAR_CEILING_M = 0.30, 5.0
SONAR_RESOLUTION_M = 1e-3


class Messages(NamedTuple):
    """Messages of the sensor: when each arrived in the log [s] and its fields (n rows)."""

    arrival_s: Array
    velocity_m_s: Array  # (n, 2)
    flow_dpx: NDArray[np.int64]  # (n, 2), sums in tenths of a pixel
    quality: NDArray[np.int64]
    ground_distance_m: Array


def _low_passed(values: Array, weight: float, start: Array | float) -> Array:
    """A running mean (n, ...) that takes in this share of each value, from `start` on."""
    kept = (1.0 - weight) * np.broadcast_to(start, values[:1].shape)
    return np.asarray(lfilter([weight], [1.0, weight - 1.0], values, axis=0, zi=kept)[0])


def gyro_at(times_s: Array, motion_s: Array, rate_rad_s: Array, rng: np.random.Generator, late_s: float = 0.0) -> Array:
    """The gyro's rate at the frames' times [rad/s]: 30 Hz low-pass at 760 Hz, noise, running mean taken out.

    late_s: how much older than those times it is; below 0 the flow is the older one. What the rod turns between the
    two instants leaks into the velocity.
    """
    samples_s = np.arange(motion_s[0], motion_s[-1], GYRO_SAMPLE_S)
    weight = 1.0 - np.exp(-2.0 * np.pi * GYRO_BANDWIDTH_HZ * GYRO_SAMPLE_S)
    rate = np.interp(samples_s, motion_s, rate_rad_s)
    smooth = _low_passed(rate, weight, rate[0])
    latest = np.clip(np.searchsorted(samples_s, times_s - late_s, "right") - 1, 0, None)
    read = smooth[latest] + GYRO_NOISE_RAD_S * rng.standard_normal(len(times_s))
    return read - _low_passed(read, GYRO_OFFSET_WEIGHT, 0.0)


def sonar_at(
    times_s: Array, motion_s: Array, height_m: Array, firmware: Firmware, rng: np.random.Generator,
    late_s: float = SONAR_ECHO_S,
) -> tuple[Array, Array]:  # fmt: skip
    """The sonar's range as the firmware holds it at the frames' times [m]: raw, and through its filter (4.3).

    A wide beam returns the nearest echo, so the range is the height, whatever the tilt of the rod. late_s: from the
    trigger to the reading, the scale of every velocity meanwhile being that of an earlier height.
    """
    triggers_s = np.arange(motion_s[0], motion_s[-1], SONAR_PERIOD_S)
    echo_m = np.interp(triggers_s, motion_s, height_m) + SONAR_NOISE_M * rng.standard_normal(len(triggers_s))
    raw_m = np.clip(np.round(echo_m / SONAR_RESOLUTION_M) * SONAR_RESOLUTION_M, SONAR_FLOOR_M, SONAR_CEILING_M)
    used_m = _median_of_three(raw_m) if firmware.sonar_median else raw_m
    state = RangefinderState(float(used_m[0]), 0.0)
    smooth_m = np.empty_like(used_m)
    for k, range_m in enumerate(used_m):
        state = smooth_range(state, float(range_m)) if k else state
        smooth_m[k] = state.range_m
    latest = np.clip(np.searchsorted(triggers_s + late_s, times_s, "right") - 1, 0, None)
    return raw_m[latest], smooth_m[latest]


def _median_of_three(values: Array) -> Array:
    padded = np.concatenate([values[:1], values[:1], values])
    return np.asarray(np.median(np.stack([padded[:-2], padded[1:-1], padded[2:]]), axis=0))


def firmware_clock(times_s: Array, firmware: Firmware) -> Array:
    """Times as the firmware's clock counts them, whole milliseconds until 2014-08 [s]."""
    return np.floor(times_s / firmware.clock_s + 0.5) * firmware.clock_s


def messages(
    times_s: Array,
    flow_px: Array,
    quality: NDArray[np.int64],
    rates_rad_s: Array,
    ranges_m: tuple[Array, Array],
    focal_px: float,
    firmware: Firmware,
    chain_delay_s: float,
) -> Messages:
    """From matched frames to messages in the log.

    `times_s` (n+1) are the frames' times, the other rows belong to the n newer frames of each pair. The mean of
    the valid frames' velocities since the last message is sent, or the low-passed velocity where that is on.
    """
    clock = firmware_clock(times_s, firmware)
    dt_s = np.maximum(np.diff(clock), firmware.clock_s)
    raw_m, smooth_m = ranges_m
    flow = np.where((quality > 0)[:, None], compensated(flow_px, rates_rad_s, dt_s, focal_px, firmware), 0.0)
    velocity = velocities(flow, dt_s, focal_px, smooth_m)
    every = firmware.frames_per_message
    count = len(quality) // every
    rows = slice(0, count * every)
    valid = (quality[rows] > 0).reshape(count, every, 1)
    sums = (velocity[rows].reshape(count, every, 2) * valid).sum(axis=1)
    sent = sums / np.maximum(valid.sum(axis=1), 1)
    last = np.arange(count) * every + every - 1
    if firmware.low_pass:
        sent = _low_passed(velocity * (quality > 0)[:, None], firmware.low_pass_weight, 0.0)[last]
    return Messages(
        times_s[1:][last] + firmware.transmit_latency_s + chain_delay_s,
        sent,
        (10.0 * flow[rows].reshape(count, every, 2).sum(axis=1)).astype(np.int64),
        quality[last],
        raw_m[last],
    )


# -- encoder -----------------------------------------------------------------------------------------------------
LINES_PER_REVOLUTION = 10_000
COUNTS_PER_REVOLUTION = 4 * LINES_PER_REVOLUTION
SAMPLE_S = 1e-3
HALF_WINDOW = 25


def counts_of(angle_rad: Array) -> NDArray[np.int64]:
    """Encoder counts of an angle, 0 at the zero of the angle; a count is passed at its edge."""
    return np.floor(angle_rad / (2.0 * np.pi) * COUNTS_PER_REVOLUTION).astype(np.int64)


def angle_and_rate(counts: NDArray[np.int64]) -> tuple[Array, Array]:
    """Angle [rad] and rate [rad/s] from counts sampled every SAMPLE_S: value and slope of a local cubic.

    The ends are fitted with the windows nearest to them, which assumes a rod at rest there or a longer record.
    """
    angle = (counts + 0.5) * (2.0 * np.pi / COUNTS_PER_REVOLUTION)
    window = 2 * HALF_WINDOW + 1
    value, slope = (savgol_filter(angle, window, 3, deriv=k, delta=SAMPLE_S, mode="nearest") for k in (0, 1))
    return value, slope
