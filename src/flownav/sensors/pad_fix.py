"""A pad-relative fix: where the pad's centre lies from the lens, as a downward camera and a target give it.

The reading is what MAVLink LANDING_TARGET carries: tangents of the angles towards body forward and right, and the
distance. The line of sight has white noise across it, the same both ways, and the distance a share of itself;
readings are offered while the lens is between two heights and the pad's mark, whose sides lie north and east, is whole
within a view that is so wide forward and so wide to the right.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation, larger, magnitude
from flownav.core.frames import Rotation, to_body

SMALLEST_DEPTH_M = 0.01


class PadFixParameters(NamedTuple):
    """Noise and limits; `fitted` 0: the vehicle has no such sensor."""

    fitted: float
    angle_sigma_rad: float
    distance_sigma: float  # of the distance
    min_height_m: float
    max_height_m: float
    half_view_forward_tangent: float
    half_view_right_tangent: float
    side_m: float  # of the mark that must be whole in view; 0: its centre suffices


class PadFixNormals(NamedTuple):
    """Standard normals of one reading (four: pairs are drawn)."""

    forward: float
    right: float
    distance: float
    spare: float


class PadFixReading(NamedTuple):
    """Tangents towards body forward and right, distance [m], and 1 where there is a fix."""

    tan_forward: float
    tan_right: float
    distance_m: float
    valid: float


@equation
def read_pad(
    lens_n_m: float, lens_e_m: float, lens_d_m: float, rotation: Rotation, n: PadFixNormals, p: PadFixParameters
) -> PadFixReading:
    """The fix of a lens at (n, e, d) from the pad's centre, with attitude R_EB."""
    ahead, right, below = to_body(rotation, -lens_n_m, -lens_e_m, -lens_d_m)
    depth = larger(below, SMALLEST_DEPTH_M)
    forward, sideways = ahead / depth, right / depth
    distance = np.sqrt(ahead * ahead + right * right + depth * depth)
    in_height = (-lens_d_m >= p.min_height_m) & (-lens_d_m <= p.max_height_m)
    reach = 0.5 * p.side_m * (magnitude(rotation[0]) + magnitude(rotation[3])) / depth  # of the turned square
    in_view = magnitude(forward) + reach <= p.half_view_forward_tangent
    in_view = in_view & (magnitude(sideways) + reach <= p.half_view_right_tangent)
    seen = in_height & in_view & (p.fitted > 0.5)
    # noise across the sight: unit vectors (1, 0, -forward) and sight x that, of their lengths
    length, level = np.sqrt(forward * forward + sideways * sideways + 1.0), np.sqrt(1.0 + forward * forward)
    one, two = p.angle_sigma_rad * length / level * n.forward, p.angle_sigma_rad / level * n.right
    noisy_ahead = forward + one - forward * sideways * two
    noisy_side = sideways + level * level * two
    noisy_depth = 1.0 - forward * one - sideways * two
    return PadFixReading(
        noisy_ahead / noisy_depth,
        noisy_side / noisy_depth,
        distance * (1.0 + p.distance_sigma * n.distance),
        1.0 if seen else 0.0,
    )
