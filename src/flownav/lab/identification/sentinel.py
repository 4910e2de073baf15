"""The axis sentinel: are the sensor's axes the vehicle's, or swapped, or of the wrong sign?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array

CLEAR = 2.0  # the best assignment must explain this much more than the next

# how a sensor's axes may lie, as sensor = axes @ vehicle
ALL_AXES = tuple(
    np.array([[x, 0.0], [0.0, y]]) if straight else np.array([[0.0, x], [y, 0.0]])
    for straight in (True, False)
    for x in (1.0, -1.0)
    for y in (1.0, -1.0)
)


class Axes(NamedTuple):
    """The verdict. assignment (2, 2) of -1, 0, 1: sensor = assignment @ vehicle, as near as can be."""

    assignment: Array
    verdict: str
    clear: bool
    turned_deg: float  # what remains: the sensor turned about its boresight

    @property
    def right(self) -> bool:
        """Nothing is swapped or inverted."""
        return bool(np.array_equal(self.assignment, np.eye(2)))


def judge(response: Array, yaw_known: bool = True) -> Axes:
    """The verdict on a sensor whose velocity is response @ the vehicle's (2 by 2, body x and y).

    Where the reference's heading is not known, any turn may be the reference's: only a mirrored sensor shows, and
    the assignment keeps the sensor's own x.
    """
    scale = np.linalg.norm(response, axis=1, keepdims=True)
    unit = response / np.maximum(scale, 1e-12)
    if not yaw_known:
        mirrored = bool(np.linalg.det(unit) < 0.0)
        verdict = "mirrored: the axes are swapped, or the sign of one is inverted" if mirrored else "not mirrored"
        return Axes(np.diag([1.0, -1.0 if mirrored else 1.0]), f"{verdict} (heading unknown)", True, 0.0)
    scores = [float(np.sum(candidate * unit)) for candidate in ALL_AXES]
    order = np.argsort(scores)[::-1]
    best = ALL_AXES[order[0]]
    clear = scores[order[0]] > CLEAR * max(scores[order[1]], 0.0) or scores[order[0]] - scores[order[1]] > 0.5
    rest = best.T @ unit
    turned = float(np.degrees(np.arctan2(rest[1, 0] - rest[0, 1], rest[0, 0] + rest[1, 1])))
    return Axes(best, sentence(best) if clear else f"unclear; nearest: {sentence(best)}", clear, turned)


def sentence(assignment: Array) -> str:
    """What is wrong with axes that lie so, in words."""
    swapped = assignment[0, 0] == 0.0
    inverted = [axis for axis, row in zip("xy", assignment, strict=True) if row.sum() < 0.0]
    parts = ["axes are swapped"] if swapped else []
    if len(inverted) == 2:
        parts.append(
            "signs of x and y are inverted (sensor turned by 180 deg)" if not swapped else "both signs inverted"
        )
    elif inverted:
        parts.append(f"sign of {inverted[0]} is inverted")
    return ", ".join(parts) if parts else "axes and signs are right"


def one_axis(gain: float) -> Axes:
    """The verdict of a rig, which moves along one axis."""
    sign = -1.0 if gain < 0.0 else 1.0
    verdict = "sign is inverted" if gain < 0.0 else "sign is right (one axis)"
    return Axes(np.diag([sign, 1.0]), verdict, True, 0.0)
