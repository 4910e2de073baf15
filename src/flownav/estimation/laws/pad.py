"""A pad-relative fix: two tangents and a distance from a camera that looks down, of a pad whose place is a state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.compile import equation
from flownav.estimation.law import law
from flownav.estimation.laws.geometry import cross
from flownav.frames import Vector, rotation_from_quaternion, to_body, to_earth


@equation
def sight(forward: float, right: float, component: int) -> Vector:
    """A triad about a line of sight (forward, right, 1): across it forward (0) and sideways (1), and along it (2)."""
    length = np.sqrt(forward * forward + right * right + 1.0)
    ahead, side, down = forward / length, right / length, 1.0 / length
    level = np.sqrt(ahead * ahead + down * down)
    across = (down / level, 0.0, -ahead / level)
    return (
        across[0] if component == 0 else (side * across[2] if component == 1 else ahead),
        0.0 if component == 0 else (down * across[0] - ahead * across[2] if component == 1 else side),
        across[2] if component == 0 else (-side * across[0] if component == 1 else down),
    )


class OnPad(NamedTuple):
    """The Jacobian of a pad fix."""

    pos_n: float
    pos_e: float
    pos_d: float
    pad_n: float
    pad_e: float
    pad_d: float
    tilt_n: float
    tilt_e: float
    heading: float


@law
def pad_fix(
    axis: int, pos_n: float, pos_e: float, pos_d: float, pad_n: float, pad_e: float, pad_d: float,
    qw: float, qx: float, qy: float, qz: float, measured_0: float, measured_1: float, measured_2: float,
    *, below_m: float, forward_m: float = 0.0, right_m: float = 0.0,
) -> tuple[float, OnPad]:  # fmt: skip
    """The pad's place across (axis 0, 1) and along (2) the measured line of sight [m].

    Measured are the tangents forward and right and the distance. e . m for the triad e of the measured sight and
    m = R_BE (pad - p) less the lens (forward, right, below): 0 across, the distance along. Linear in pad - p; the
    lever of the attitude error is the measured m, which is better than the predicted one when a fix is the first for
    long.
    """
    rotation = rotation_from_quaternion(qw, qx, qy, qz)
    direction, along = sight(measured_0, measured_1, axis), sight(measured_0, measured_1, 2)
    ahead, side, down = to_body(rotation, pad_n - pos_n, pad_e - pos_e, pad_d - pos_d)
    predicted = direction[0] * (ahead - forward_m) + direction[1] * (side - right_m) + direction[2] * (down - below_m)
    seen = measured_2 if axis == 2 else 0.0
    e = to_earth(rotation, direction[0], direction[1], direction[2])
    to_pad = to_earth(
        rotation,
        measured_2 * along[0] + forward_m, measured_2 * along[1] + right_m, measured_2 * along[2] + below_m,
    )  # fmt: skip
    turn = cross(e, to_pad)
    return seen - predicted, OnPad(
        pos_n=-e[0], pos_e=-e[1], pos_d=-e[2], pad_n=e[0], pad_e=e[1], pad_d=e[2],
        tilt_n=turn[0], tilt_e=turn[1], heading=turn[2],
    )  # fmt: skip
