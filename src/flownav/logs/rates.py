"""Mean body rates over given intervals, from a gyro or from how the attitude turned."""

from __future__ import annotations

import numpy as np

from flownav.core.measurement import Array, Stream


def mean_over(t_s: Array, value: Array, start_s: Array, end_s: Array) -> Array:
    """Mean of sampled columns over intervals, linear between the samples; value (n, k) -> (m, k).

    Intervals have a length above 0; outside the samples the nearest one holds.
    """
    step_s, lasts_s = np.diff(t_s), end_s - start_s
    outside = [(np.minimum(at - t_s[0], 0.0), np.maximum(at - t_s[-1], 0.0)) for at in (start_s, end_s)]
    means = np.empty((len(start_s), value.shape[1]))
    for k in range(value.shape[1]):
        column = np.ascontiguousarray(value[:, k])
        integral = np.zeros(len(t_s))
        np.cumsum(0.5 * (column[1:] + column[:-1]) * step_s, out=integral[1:])
        begun, ended = (
            np.interp(at, t_s, integral) + before * column[0] + after * column[-1]
            for at, (before, after) in zip((start_s, end_s), outside, strict=True)
        )
        means[:, k] = (ended - begun) / lasts_s
    return means


def attitude_at(attitude: Stream, instants_s: Array) -> Array:
    """Unit quaternions (m, 4) at given instants, linear between the logged ones, held outside them."""
    agree = np.where(np.sum(attitude.value[1:] * attitude.value[:-1], axis=1) < 0, -1.0, 1.0)
    continuous = attitude.value * np.concatenate([[1.0], np.cumprod(agree)])[:, None]
    blended = np.column_stack([np.interp(instants_s, attitude.t_s, column) for column in continuous.T])
    return np.asarray(blended / np.linalg.norm(blended, axis=1)[:, None])


def attitude_rates(attitude: Stream, start_s: Array, end_s: Array) -> Array:
    """Mean body rates (m, 3) [rad/s] that turn the attitude at start into that at end: free of gyro bias.

    The rotation from start to end is conj(q0) q1; its vector part is half the turn for the small turns between.
    """
    w0, x0, y0, z0 = attitude_at(attitude, start_s).T
    w1, x1, y1, z1 = attitude_at(attitude, end_s).T
    scalar = w0 * w1 + x0 * x1 + y0 * y1 + z0 * z1
    vector = np.column_stack([
        w0 * x1 - x0 * w1 - y0 * z1 + z0 * y1,
        w0 * y1 + x0 * z1 - y0 * w1 - z0 * x1,
        w0 * z1 - x0 * y1 + y0 * x1 - z0 * w1,
    ])  # fmt: skip
    sine = np.linalg.norm(vector, axis=1)
    half_angle = np.arctan2(sine, np.abs(scalar))
    stretch = np.where(sine > 1e-12, half_angle / np.maximum(sine, 1e-12), 1.0) * np.where(scalar < 0, -1.0, 1.0)
    return np.asarray(2.0 * vector * stretch[:, None] / (end_s - start_s)[:, None])
