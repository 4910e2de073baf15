"""The landing filter's linear algebra on lanes: sparse transforms of the covariance, and scalar corrections.

The transition is a product of sparse transforms, each one law ("velocity turns with the attitude error"); an
observation is a few coefficients on a few states. Full covariances stay exactly symmetric.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import equation
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.landing.states import ATTITUDE, STATES, LandingRows

LARGEST_VARIANCE = 1e30


@equation
def transform(work: Work, lanes: Lanes, rows: LandingRows, targets: tuple[int, ...], sources: tuple[int, ...]) -> None:
    """P <- T P T' for a T that gives the states `targets` new values A x[sources] and leaves the others.

    A (targets, sources) lies in rows.coefficient, row by row; a target that keeps its old value stands among the
    sources itself.
    """
    for i in range(len(targets)):
        fresh = rows.scratch + i * STATES
        for j in range(STATES):
            for lane in range(len(lanes)):
                work[(fresh + j) * len(lanes) + lane] = 0.0
        for s in range(len(sources)):
            row = rows.covariance + sources[s] * STATES
            a = rows.coefficient + i * len(sources) + s
            for j in range(STATES):
                for lane in range(len(lanes)):
                    product = work[a * len(lanes) + lane] * work[(row + j) * len(lanes) + lane]
                    work[(fresh + j) * len(lanes) + lane] += product
    for i in range(len(targets)):
        for j in range(STATES):
            row, column = rows.covariance + targets[i] * STATES + j, rows.covariance + j * STATES + targets[i]
            for lane in range(len(lanes)):
                value = work[(rows.scratch + i * STATES + j) * len(lanes) + lane]
                work[row * len(lanes) + lane] = value
                work[column * len(lanes) + lane] = value
    for i in range(len(targets)):
        for k in range(i, len(targets)):
            row = rows.covariance + targets[i] * STATES + targets[k]
            column = rows.covariance + targets[k] * STATES + targets[i]
            for lane in range(len(lanes)):
                work[row * len(lanes) + lane] = 0.0
            for s in range(len(sources)):
                a = rows.coefficient + k * len(sources) + s
                fresh = rows.scratch + i * STATES + sources[s]
                for lane in range(len(lanes)):
                    work[row * len(lanes) + lane] += work[a * len(lanes) + lane] * work[fresh * len(lanes) + lane]
            for lane in range(len(lanes)):
                work[column * len(lanes) + lane] = work[row * len(lanes) + lane]


@equation
def set_coefficient(work: Work, lanes: Lanes, rows: LandingRows, place: int, value: float) -> None:
    """One coefficient, the same in every lane."""
    for lane in range(len(lanes)):
        work[(rows.coefficient + place) * len(lanes) + lane] = value


@equation
def decay(work: Work, lanes: Lanes, rows: LandingRows, state: int, count: int, factor: float) -> None:
    """x <- factor x for `count` states from `state` on: the transition of Gauss-Markov errors."""
    for i in range(state, state + count):
        for lane in range(len(lanes)):
            work[(rows.state + i) * len(lanes) + lane] *= factor
        for j in range(STATES):
            for lane in range(len(lanes)):
                work[(rows.covariance + i * STATES + j) * len(lanes) + lane] *= factor
        for j in range(STATES):
            for lane in range(len(lanes)):
                work[(rows.covariance + j * STATES + i) * len(lanes) + lane] *= factor


@equation
def add_noise(work: Work, lanes: Lanes, rows: LandingRows, state: int, variance: float) -> None:
    """P_ii <- P_ii + variance."""
    diagonal = rows.covariance + state * (STATES + 1)
    for lane in range(len(lanes)):
        work[diagonal * len(lanes) + lane] += variance


@equation
def forget(work: Work, lanes: Lanes, rows: LandingRows, state: int, variance: float, where: int) -> None:
    """Where row `where` is above 0: the state loses its correlations and gets this variance (a reset)."""
    for j in range(STATES):
        row, column = rows.covariance + state * STATES + j, rows.covariance + j * STATES + state
        fresh = variance if j == state else 0.0
        for lane in range(len(lanes)):
            kept = work[where * len(lanes) + lane] <= 0.0
            value = work[row * len(lanes) + lane] if kept else fresh
            work[row * len(lanes) + lane] = value
            work[column * len(lanes) + lane] = value


@equation
def fuse(work: Work, lanes: Lanes, rows: LandingRows, index: tuple[int, ...], gate_sigma: float) -> None:
    """Test and fuse one scalar observation: h has the coefficients of rows.coefficient on the states `index`.

    Reads rows.innovation, noise and offered; writes innovation_variance, test_ratio and accepted. What is absent,
    beyond the gate or not finite corrects nothing.
    """
    expect(work, lanes, rows, index)
    settle(work, lanes, rows, gate_sigma)


@equation
def expect(work: Work, lanes: Lanes, rows: LandingRows, index: tuple[int, ...]) -> None:
    """P h', the innovation's variance h P h' + R, and in rows.accepted whether the reading may be tested at all."""
    observe_cross(work, lanes, rows, index)
    for lane in range(len(lanes)):
        noise = work[rows.noise * len(lanes) + lane]
        sound = noise >= 0.0 and noise < LARGEST_VARIANCE
        work[rows.innovation_variance * len(lanes) + lane] = noise if sound else 1.0
        work[rows.accepted * len(lanes) + lane] = work[rows.offered * len(lanes) + lane] if sound else 0.0
    for t in range(len(index)):
        for lane in range(len(lanes)):
            work[rows.innovation_variance * len(lanes) + lane] += (
                work[(rows.coefficient + t) * len(lanes) + lane] * work[(rows.cross + index[t]) * len(lanes) + lane]
            )


@equation
def settle(work: Work, lanes: Lanes, rows: LandingRows, gate_sigma: float) -> None:
    """Test what `expect` left, and correct with what passes."""
    for lane in range(len(lanes)):
        variance = work[rows.innovation_variance * len(lanes) + lane]
        innovation = work[rows.innovation * len(lanes) + lane]
        ratio = innovation * innovation / (gate_sigma * gate_sigma * variance)
        fused = work[rows.accepted * len(lanes) + lane] > 0.0 and variance > 0.0 and ratio <= 1.0
        work[rows.test_ratio * len(lanes) + lane] = ratio
        work[rows.accepted * len(lanes) + lane] = 1.0 if fused else 0.0
    correct(work, lanes, rows)


@equation
def observe_cross(work: Work, lanes: Lanes, rows: LandingRows, index: tuple[int, ...]) -> None:
    """rows.cross <- P h'."""
    for j in range(STATES):
        for lane in range(len(lanes)):
            work[(rows.cross + j) * len(lanes) + lane] = 0.0
    for t in range(len(index)):
        row = rows.covariance + index[t] * STATES
        for j in range(STATES):
            for lane in range(len(lanes)):
                product = work[(rows.coefficient + t) * len(lanes) + lane] * work[(row + j) * len(lanes) + lane]
                work[(rows.cross + j) * len(lanes) + lane] += product


@equation
def correct(work: Work, lanes: Lanes, rows: LandingRows) -> None:
    """x <- x + K nu and Joseph's P <- (I - K h) P (I - K h)' + K R K' in the lanes that accepted.

    Written out, with c = P h' and S = h c + R: P - (K c' + c K') + S K K', whatever the gain; both terms are
    symmetric to the last bit, so P stays so.
    """
    for i in range(STATES):
        for lane in range(len(lanes)):
            fused = work[rows.accepted * len(lanes) + lane] > 0.0
            variance = work[rows.innovation_variance * len(lanes) + lane] if fused else 1.0
            cross = work[(rows.cross + i) * len(lanes) + lane] if fused else 0.0
            gain = cross / variance
            innovation = work[rows.innovation * len(lanes) + lane] if fused else 0.0
            work[(rows.cross + i) * len(lanes) + lane] = cross
            work[(rows.gain + i) * len(lanes) + lane] = gain
            work[(rows.root + i) * len(lanes) + lane] = gain * np.sqrt(variance)
            work[(rows.state + i) * len(lanes) + lane] += gain * innovation
    for i in range(STATES):
        for j in range(STATES):
            element = rows.covariance + i * STATES + j
            for lane in range(len(lanes)):
                gain_i, gain_j = work[(rows.gain + i) * len(lanes) + lane], work[(rows.gain + j) * len(lanes) + lane]
                cross_i, cross_j = (
                    work[(rows.cross + i) * len(lanes) + lane],
                    work[(rows.cross + j) * len(lanes) + lane],
                )
                root_i, root_j = work[(rows.root + i) * len(lanes) + lane], work[(rows.root + j) * len(lanes) + lane]
                taken = (gain_i * cross_j + gain_j * cross_i) - root_i * root_j
                work[element * len(lanes) + lane] -= taken
    fold_attitude(work, lanes, rows)


@equation
def fold_attitude(work: Work, lanes: Lanes, rows: LandingRows) -> None:
    """The correction of the attitude error into the quaternion: q <- (1, theta/2) q, of unit length; theta <- 0.

    Without a correction the quaternion keeps its last bit.
    """
    for lane in range(len(lanes)):
        x = 0.5 * work[(rows.state + ATTITUDE) * len(lanes) + lane]
        y = 0.5 * work[(rows.state + ATTITUDE + 1) * len(lanes) + lane]
        z = 0.5 * work[(rows.state + ATTITUDE + 2) * len(lanes) + lane]
        qw = work[rows.attitude * len(lanes) + lane]
        qx = work[(rows.attitude + 1) * len(lanes) + lane]
        qy = work[(rows.attitude + 2) * len(lanes) + lane]
        qz = work[(rows.attitude + 3) * len(lanes) + lane]
        w = qw - x * qx - y * qy - z * qz
        a = qx + x * qw + y * qz - z * qy
        b = qy - x * qz + y * qw + z * qx
        c = qz + x * qy - y * qx + z * qw
        corrected = x != 0.0 or y != 0.0 or z != 0.0
        shrink = 1.0 / np.sqrt(w * w + a * a + b * b + c * c) if corrected else 1.0
        work[rows.attitude * len(lanes) + lane] = w * shrink
        work[(rows.attitude + 1) * len(lanes) + lane] = a * shrink
        work[(rows.attitude + 2) * len(lanes) + lane] = b * shrink
        work[(rows.attitude + 3) * len(lanes) + lane] = c * shrink
        work[(rows.state + ATTITUDE) * len(lanes) + lane] = 0.0
        work[(rows.state + ATTITUDE + 1) * len(lanes) + lane] = 0.0
        work[(rows.state + ATTITUDE + 2) * len(lanes) + lane] = 0.0
