"""Do flow and reference agree at all? Their correlation, the lag between them, the scale, the axes: no model, no noise.

The quick part of an identification, for `flownav info`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Sensor
from flownav.lab.identification.flight import IMU_NAME
from flownav.lab.identification.judged import judged
from flownav.lab.identification.reference_motion import ALIKE_S, fast_flow, flow_likeness, on_grid, with_flow
from flownav.lab.identification.sentinel import ALL_AXES, CLEAR, sentence
from flownav.logs.frames import mean_over
from flownav.logs.log import Log

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
        alone = "the quick changes of flow and IMU are"
        figures = f"lag {self.lag_s:.2f} s, scale {self.scale:.2f}"
        if self.against == IMU_NAME and not (self.clear and self.correlation >= IN_PART):
            return f"no reference, and {alone} too little alike to tell (correlation {self.correlation:.2f})"
        if self.correlation < IN_PART:
            return f"flow and {self.against} do not agree: their velocities' correlation is {self.correlation:.2f}"
        agree = "agree" if self.correlation >= AGREE else f"agree in part (correlation {self.correlation:.2f})"
        if self.right or not self.clear:
            return f"flow and {self.against} {agree}: {figures}"
        return f"flow and {self.against} disagree: {self.axes}; put right they {agree}: {figures}"


def first_look(log: Log) -> Look:
    """A log's flow against its best reference. InputError where the log lacks what that takes."""
    if log.truth is None and Sensor.GPS_POSITION not in log.streams and Sensor.IMU in log.streams:
        return _against_imu(log)
    flown, moved, _, axes = judged(log)
    put_right = flown.velocity_m_s @ axes.assignment
    alike = flow_likeness(flown, moved.t_s, moved.velocity_m_s, put_right)
    t_s, seen = flown.t_s[flown.good], flown.t_s[flown.good] - flown.age_s
    body = on_grid(moved.t_s, moved.in_body(flown, moved.t_s)[:, :2], seen + alike.lag_s)
    flow, reference = (mean_over(t_s, values, t_s - ALIKE_S, t_s + ALIKE_S) for values in (put_right[flown.good], body))
    scale = float(np.sum(flow * reference) / max(float(np.sum(reference**2)), 1e-12))
    return Look(
        flown.reference_name, alike.likeness, alike.lag_s + moved.reference_delay_s, scale, axes.verdict, axes.right,
        axes.clear, flown.range_jumping, flown.attitude_is_own,
    )  # fmt: skip


def _against_imu(log: Log) -> Look:
    """For want of a reference: quick changes of the flow's velocity against the IMU's, read in all eight ways."""
    flown, moved, _, _ = judged(log, "imu")
    scores = []
    for axes in ALL_AXES:
        tie = with_flow(moved, flown, flown.velocity_m_s @ axes).flow_tie
        assert tie is not None
        scores.append((tie.likeness * float(np.cos(tie.turn_rad)), tie.alike, tie.delay_s.value))
    order = np.argsort([score for score, _, _ in scores])[::-1]
    best, (score, alike, lag_s) = ALL_AXES[order[0]], scores[order[0]]
    clear = alike and (order[0] == 0 or score > CLEAR * max(scores[0][0], 0.0))  # than with the axes as they should be
    fast = fast_flow(flown, moved.t_s, flown.velocity_m_s @ best)
    inertial = on_grid(moved.t_s, moved.velocity_m_s[:, :2], flown.t_s[flown.good] - lag_s)
    scale = float(np.sum(fast * inertial) / max(float(np.sum(inertial**2)), 1e-12))
    right = bool(np.array_equal(best, np.eye(2)))
    return Look(
        flown.reference_name, score, lag_s, scale, sentence(best), right, clear, flown.range_jumping,
        flown.attitude_is_own,
    )  # fmt: skip
