"""An estimate against a reference whose frame is turned and shifted: motion capture, another log's local frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array

VELOCITY_SPAN_S = 0.1
LEAST_SPREAD_M = 0.2  # rms about the middle, of both paths: of less, noise and drift make the angle
LEAST_LIKENESS = 0.5


class Alignment(NamedTuple):
    """What takes the reference into the estimate's frame: first turned by yaw, then shifted.

    yaw_shown: whether the two paths move enough, and alike, to show the yaw; it is the best fit all the same.
    """

    yaw_rad: float
    shift_ned_m: tuple[float, float, float]
    yaw_shown: bool = True

    def turned(self, vectors_ned: Array) -> Array:
        """Vectors (n, 3) in the estimate's axes."""
        cosine, sine = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        north, east, down = vectors_ned.T
        return np.column_stack([cosine * north - sine * east, sine * north + cosine * east, down])

    def moved(self, positions_ned_m: Array) -> Array:
        """Positions (n, 3) in the estimate's frame."""
        return np.asarray(self.turned(positions_ned_m) + np.array(self.shift_ned_m))


def align(estimate_ned_m: Array, reference_ned_m: Array) -> Alignment:
    """The yaw and the shift that bring a reference (n, 3) closest to an estimate (n, 3) at the same instants.

    Least squares over the horizontal plane (Umeyama 1991 in two dimensions, scale 1): the yaw is the angle of
    sum(conj(r) e) of the centred positions as complex numbers.
    """
    mean_estimate, mean_reference = estimate_ned_m.mean(axis=0), reference_ned_m.mean(axis=0)
    ours, theirs = estimate_ned_m - mean_estimate, reference_ned_m - mean_reference
    product = np.sum((theirs[:, 0] - 1j * theirs[:, 1]) * (ours[:, 0] + 1j * ours[:, 1]))
    turn = Alignment(float(np.angle(product)), (0.0, 0.0, 0.0))
    shift = mean_estimate - turn.turned(mean_reference[None, :])[0]
    spread = [float(np.sqrt(np.mean(np.sum(path[:, :2] ** 2, axis=1)))) for path in (ours, theirs)]
    likeness = abs(product) / max(len(ours) * spread[0] * spread[1], 1e-12)
    shown = min(spread) >= LEAST_SPREAD_M and likeness >= LEAST_LIKENESS
    return Alignment(turn.yaw_rad, (float(shift[0]), float(shift[1]), float(shift[2])), shown)


def velocity_of(t_s: Array, position_m: Array) -> Array:
    """Velocity (n, 3) of sampled positions, by differences over VELOCITY_SPAN_S about each instant."""
    late = np.minimum(t_s + 0.5 * VELOCITY_SPAN_S, t_s[-1])
    early = np.maximum(t_s - 0.5 * VELOCITY_SPAN_S, t_s[0])
    moved = [np.interp(late, t_s, column) - np.interp(early, t_s, column) for column in position_m.T]
    return np.asarray(np.column_stack(moved) / (late - early)[:, None])
