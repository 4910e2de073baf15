"""Do flow and reference agree at all? Their correlation, the lag between them, the scale, the axes: no model, no noise.

The quick part of an identification, for `flownav info`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.identification.flight import flight
from flownav.identification.reference_motion import ALIKE_S, flow_likeness, motion, on_grid, velocity_response
from flownav.identification.sentinel import judge
from flownav.logs.log import Log
from flownav.logs.rates import mean_over

AGREE, IN_PART = 0.9, 0.4  # correlation from which two velocities agree, or do so in part


class Look(NamedTuple):
    """What flow and reference say of each other once the axes are put right.

    against: the reference's name; correlation of the two velocities; lag_s: how much later the reference arrives than
    what the flow describes; scale: flow over reference; axes: the verdict on the sensor's axes, clear: beyond doubt.
    """

    against: str
    correlation: float
    lag_s: float
    scale: float
    axes: str
    right: bool
    clear: bool
    range_jumping: float
    own_attitude: bool

    @property
    def verdict(self) -> str:
        """In words."""
        figures = f"lag {self.lag_s:.2f} s, scale {self.scale:.2f}"
        if self.correlation < IN_PART:
            return f"flow and {self.against} do not agree: their velocities' correlation is {self.correlation:.2f}"
        agree = "agree" if self.correlation >= AGREE else f"agree in part (correlation {self.correlation:.2f})"
        if self.right or not self.clear:
            return f"flow and {self.against} {agree}: {figures}"
        return f"flow and {self.against} disagree: {self.axes}; put right they {agree}: {figures}"


def first_look(log: Log) -> Look:
    """A log's flow against its best reference. InputError where the log lacks what that takes."""
    flown = flight(log)
    moved = motion(flown)
    axes = judge(velocity_response(flown, moved, flown.age_s), moved.yaw_known)
    put_right = flown.velocity_m_s @ axes.assignment
    alike = flow_likeness(flown, moved.t_s, moved.velocity_m_s, put_right)
    t_s, seen = flown.t_s[flown.good], flown.t_s[flown.good] - flown.age_s
    body = on_grid(moved.t_s, moved.in_body(flown, moved.t_s)[:, :2], seen + alike.lag_s)
    flow, reference = (
        mean_over(t_s, values, t_s - ALIKE_S, t_s + ALIKE_S) for values in (put_right[flown.good], body)
    )
    scale = float(np.sum(flow * reference) / max(float(np.sum(reference**2)), 1e-12))
    return Look(
        flown.reference_name, alike.likeness, alike.lag_s + moved.reference_delay_s, scale, axes.verdict, axes.right,
        axes.clear, flown.range_jumping, flown.attitude_is_own,
    )  # fmt: skip
