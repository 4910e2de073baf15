"""A pad-relative fix: two tangents and a distance from a camera that looks down, of a pad whose place is a state."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import equation
from flownav.core.frames import Vector, to_body, to_earth
from flownav.estimation.law import law
from flownav.estimation.laws import cross
from flownav.estimation.named import Attitude, Beam, PadNed, PositionNed, ReadSight, rotation_by


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
    axis: int, pos: PositionNed, pad: PadNed, q: Attitude, read: ReadSight, *, lens: Beam
) -> tuple[float, OnPad]:
    """The pad's place across (axis 0, 1) and along (2) the measured line of sight [m].

    Measured are the tangents forward and right and the distance. e . m for the triad e of the measured sight and
    m = R_BE (pad - p) less the lens (forward, right, below): 0 across, the distance along. Linear in pad - p; the
    lever of the attitude error is the measured m, which is better than the predicted one when a fix is the first for
    long.
    """
    rotation, distance_m = rotation_by(q), read.measured_2
    direction, along = sight(read.measured_0, read.measured_1, axis), sight(read.measured_0, read.measured_1, 2)
    ahead, side, down = to_body(rotation, pad.pad_n - pos.pos_n, pad.pad_e - pos.pos_e, pad.pad_d - pos.pos_d)
    forward, right, below = ahead - lens.forward_m, side - lens.right_m, down - lens.below_m
    predicted = direction[0] * forward + direction[1] * right + direction[2] * below
    seen = distance_m if axis == 2 else 0.0
    e = to_earth(rotation, direction[0], direction[1], direction[2])
    to_pad = to_earth(
        rotation,
        distance_m * along[0] + lens.forward_m,
        distance_m * along[1] + lens.right_m,
        distance_m * along[2] + lens.below_m,
    )
    turn = cross(e, to_pad)
    return seen - predicted, OnPad(
        pos_n=-e[0], pos_e=-e[1], pos_d=-e[2], pad_n=e[0], pad_e=e[1], pad_d=e[2],
        tilt_n=turn[0], tilt_e=turn[1], heading=turn[2],
    )  # fmt: skip
