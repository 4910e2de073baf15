"""How a vehicle shakes its IMU, by frequency: amplitude spectral densities of accelerometer and gyro."""

from typing import Any

import numpy as np

from flownav.core.measurement import Array

SEGMENT = 512  # readings of a periodogram: lines are resolved that lie two bins of rate / SEGMENT from each other
EVEN = 0.02  # so near the mean interval is the median one of readings without gaps
LEAST_HZ = 20.0  # slower inertial readings show no vibration


def spectrum_of(t_s: Array, value: Array) -> dict[str, Any] | None:
    """Frequencies [Hz] and, at each, the density of the accelerometer [m/s²/√Hz] and of the gyro [°/s/√Hz].

    The three axes' powers are summed. t_s (n,), value (n, 6): rates [rad/s] and specific force [m/s²]. Welch's mean of
    Hann-windowed periodograms that overlap by half (IEEE Trans. Audio Electroacoustics 15, 1967); readings are laid on
    a clock of their own interval first. None of fewer readings than SEGMENT, or slower ones than LEAST_HZ.
    """
    known = np.isfinite(value).all(axis=1) & np.isfinite(t_s)
    t_s, value = t_s[known], value[known]
    step_s = float(np.median(np.diff(t_s))) if len(t_s) > SEGMENT else 0.0
    if not step_s > 0.0 or 1.0 / step_s < LEAST_HZ:
        return None
    mean_s = float(t_s[-1] - t_s[0]) / (len(t_s) - 1)
    # a clock in step with the readings blurs nothing
    step_s = mean_s if abs(mean_s - step_s) < EVEN * step_s else step_s
    clock = np.arange(t_s[0], t_s[-1], step_s)
    if not SEGMENT <= len(clock) <= 4 * len(t_s):  # a gap of hours is no reading
        return None
    even = np.column_stack([np.interp(clock, t_s, column) for column in value.T])
    window = np.hanning(SEGMENT + 1)[:-1]
    starts = range(0, len(even) - SEGMENT + 1, SEGMENT // 2)
    power = np.zeros((SEGMENT // 2 + 1, value.shape[1]))
    for start in starts:
        part = even[start : start + SEGMENT]
        power += np.abs(np.fft.rfft((part - part.mean(axis=0)) * window[:, None], axis=0)) ** 2
    density = 2.0 * step_s * power / (len(starts) * np.sum(window**2))
    turning, shaking = (np.sqrt(density[1:, columns].sum(axis=1)) for columns in (slice(0, 3), slice(3, 6)))
    return {
        "frequency_hz": np.fft.rfftfreq(SEGMENT, step_s)[1:].tolist(),
        "accel_m_s2_rt_hz": shaking.tolist(),
        "gyro_deg_s_rt_hz": np.degrees(turning).tolist(),
    }
