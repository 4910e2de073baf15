"""The landing filter's law of a pad-relative fix."""

from __future__ import annotations

import numpy as np

from flownav.compile import equation
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.landing.lag import body_velocity_jacobian
from flownav.estimation.landing.observe import rotation_of
from flownav.estimation.landing.states import ATTITUDE, POSITION, LandingRows
from flownav.frames import Rotation, Vector, to_earth

PAD_STATES = (POSITION, POSITION + 1, POSITION + 2, ATTITUDE, ATTITUDE + 1, ATTITUDE + 2)


@equation
def pad_from_lens(rotation: Rotation, pos_n: float, pos_e: float, pos_d: float, lens_below_m: float) -> Vector:
    """The pad's centre (the origin) from the lens, body FRD [m]: -R_BE p less the lens's place."""
    return (
        -(rotation[0] * pos_n + rotation[3] * pos_e + rotation[6] * pos_d),
        -(rotation[1] * pos_n + rotation[4] * pos_e + rotation[7] * pos_d),
        -(rotation[2] * pos_n + rotation[5] * pos_e + rotation[8] * pos_d) - lens_below_m,
    )


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


@equation
def observe_pad(
    work: Work, lanes: Lanes, rows: LandingRows, component: int, measured: int, lens_below_m: float
) -> None:
    """A pad-relative fix (tangents forward and right, distance) as the pad's place along and across its line of sight.

    e . m for the triad e of the measured sight and m = -R_BE p less the lens: 0 across, the distance along. Linear in
    p; the lever of the attitude error is the measured m, which is better than the predicted one when a fix is the
    first for long.
    """
    for lane in range(len(lanes)):
        rotation = rotation_of(work, lanes, rows, lane)
        forward, right = work[measured * len(lanes) + lane], work[(measured + 1) * len(lanes) + lane]
        distance = work[(measured + 2) * len(lanes) + lane]
        axis, along = sight(forward, right, component), sight(forward, right, 2)
        ahead, side, down = pad_from_lens(
            rotation,
            work[(rows.state + POSITION) * len(lanes) + lane],
            work[(rows.state + POSITION + 1) * len(lanes) + lane],
            work[(rows.state + POSITION + 2) * len(lanes) + lane],
            lens_below_m,
        )
        seen = distance if component == 2 else 0.0
        predicted = axis[0] * ahead + axis[1] * side + axis[2] * down
        work[rows.innovation * len(lanes) + lane] = seen - predicted
        axis_ned = to_earth(rotation, axis[0], axis[1], axis[2])
        to_pad = to_earth(rotation, distance * along[0], distance * along[1], distance * along[2] + lens_below_m)
        turn = body_velocity_jacobian(axis_ned, to_pad[0], to_pad[1], to_pad[2])
        work[rows.coefficient * len(lanes) + lane] = -axis_ned[0]
        work[(rows.coefficient + 1) * len(lanes) + lane] = -axis_ned[1]
        work[(rows.coefficient + 2) * len(lanes) + lane] = -axis_ned[2]
        work[(rows.coefficient + 3) * len(lanes) + lane] = turn[0]
        work[(rows.coefficient + 4) * len(lanes) + lane] = turn[1]
        work[(rows.coefficient + 5) * len(lanes) + lane] = turn[2]
