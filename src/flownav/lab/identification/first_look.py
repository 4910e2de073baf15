"""Do flow and reference agree at all, and are the sensor's axes the vehicle's? No model, no noise.

The quick part of an identification, for `flownav info`.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array, Sensor
from flownav.lab.identification import reference_motion
from flownav.lab.identification.flight import IMU_NAME, LEAST_FLOW, Flight, flight
from flownav.lab.identification.own_gyro import ALIKE_WITHIN
from flownav.lab.identification.reference_truth import in_one_piece, without_leaps_and_stands
from flownav.logs.log import Log, mean_over

CLEAR_RATIO = 2.0  # the best assignment must explain this much more than the next

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
        """Whether nothing is swapped or inverted."""
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
    clear = scores[order[0]] > CLEAR_RATIO * max(scores[order[1]], 0.0) or scores[order[0]] - scores[order[1]] > 0.5
    rest = best.T @ unit
    turned = float(np.degrees(np.arctan2(rest[1, 0] - rest[0, 1], rest[0, 0] + rest[1, 1])))
    return Axes(best, sentence(best) if clear else f"unclear; nearest: {sentence(best)}", clear, turned)


def sentence(assignment: Array) -> str:
    """Verdict on axes that lie so, in words."""
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


# -- a flight judged ---------------------------------------------------------------------------------------------
class Judged(NamedTuple):
    """The flight, its motion by the reference, the flow's response to it (2, 2), and the axes by that response."""

    flown: Flight
    moved: reference_motion.Motion
    response: Array
    axes: Axes


def judged(log: Log, reference: str = "auto") -> Judged:
    """The verdict on a log. InputError names what it lacks.

    An attitude that the navigator found with flow of the wrong sign is wrong itself, and so is the rotation that was
    taken out of such a flow: both are done again with the flow put right.
    """
    found = _judged(flight(log, reference))
    if found.axes.right or not found.axes.clear or not found.flown.attitude_is_own:
        return found
    again = _judged(flight(log, reference, found.axes.assignment))
    return again if again.axes.clear else found


def _judged(flown: Flight) -> Judged:
    flown, leaps = without_leaps_and_stands(flown)
    moved = reference_motion.motion(flown)
    piece, turns = in_one_piece(flown, moved)
    if turns and np.count_nonzero(piece.good) >= LEAST_FLOW:
        flown, moved = piece, reference_motion.motion(piece)
    flown = replace(flown, notes=(*flown.notes, *(f"the reference: {line}" for line in (*leaps, *turns))))
    tie = moved.flow_tie
    age_s = tie.delay_s.value if tie is not None and tie.holds else flown.age_s
    response = reference_motion.velocity_response(flown, moved, age_s)
    return Judged(flown, moved, response, judge(response, moved.yaw_known))


# -- a first look ------------------------------------------------------------------------------------------------
OFF, APART_S, LATEST_S = (
    0.05,
    0.03,
    0.3,
)  # of scale and time, to be named; GPS may be so late
AGREE, IN_PART = 0.9, 0.4  # correlation from which two velocities agree, or do so in part


class Look(NamedTuple):
    """Comparison of flow and reference once the axes are put right.

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

    def differences(self) -> str:
        """Differences that remain between the two although they are alike, in words; "" where they are small."""
        more, ahead = self.scale - 1.0, self.lag_s
        found = [f"the flow reads {100 * abs(more):.0f} % too {'much' if more > 0 else 'little'}"] * self._off_in_size
        who = "it" if found else "the flow"
        found += [f"{who} lies {abs(ahead):.2f} s {'ahead of' if ahead > 0 else 'behind'} {self.against}"] * self._late
        return " and ".join(found)

    @property
    def _off_in_size(self) -> bool:
        return abs(self.scale - 1.0) > OFF

    @property
    def _late(self) -> bool:
        return self.lag_s < -APART_S or self.lag_s > LATEST_S

    def _where(self) -> str:
        """In what the two differ: size, time, or both."""
        return " and ".join(["size"] * self._off_in_size + ["time"] * self._late)

    @property
    def agrees(self) -> bool:
        """Whether they describe one motion: alike, and of one size."""
        low, high = ALIKE_WITHIN
        return self.correlation >= AGREE and low <= self.scale <= high

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
        if differ := self.differences():
            agree, figures = f"{agree} in shape, not in {self._where()}", f"{differ} ({figures})"
            if not ALIKE_WITHIN[0] <= self.scale <= ALIKE_WITHIN[1]:
                alike = f"alike in shape (correlation {self.correlation:.2f})"
                agree, figures = "do not agree in size", f"{alike}, {figures}"
        if self.right or not self.clear:
            return f"flow and {self.against} {agree}: {figures}"
        return f"flow and {self.against} disagree: {self.axes}; put right they {agree}: {figures}"


def first_look(log: Log) -> Look:
    """A log's flow against its best reference. InputError where the log lacks what that takes."""
    if log.truth is None and Sensor.GPS_POSITION not in log.streams and Sensor.IMU in log.streams:
        return _against_imu(log)
    flown, moved, _, axes = judged(log)
    put_right = flown.velocity_m_s @ axes.assignment
    alike = reference_motion.flow_likeness(flown, moved.t_s, moved.velocity_m_s, put_right)
    t_s, seen = flown.t_s[flown.good], flown.t_s[flown.good] - flown.age_s
    body = reference_motion.on_grid(moved.t_s, moved.in_body(flown, moved.t_s)[:, :2], seen + alike.lag_s)
    flow, reference = (
        mean_over(t_s, values, t_s - reference_motion.ALIKE_S, t_s + reference_motion.ALIKE_S)
        for values in (put_right[flown.good], body)
    )
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
        tie = reference_motion.with_flow(moved, flown, flown.velocity_m_s @ axes).flow_tie
        assert tie is not None
        scores.append((tie.likeness * float(np.cos(tie.turn_rad)), tie.alike, tie.delay_s.value))
    order = np.argsort([score for score, _, _ in scores])[::-1]
    best, (score, alike, lag_s) = ALL_AXES[order[0]], scores[order[0]]
    clear = alike and (order[0] == 0 or score > CLEAR_RATIO * max(scores[0][0], 0.0))  # than axes as they should be
    fast = reference_motion.fast_flow(flown, moved.t_s, flown.velocity_m_s @ best)
    inertial = reference_motion.on_grid(moved.t_s, moved.velocity_m_s[:, :2], flown.t_s[flown.good] - lag_s)
    scale = float(np.sum(fast * inertial) / max(float(np.sum(inertial**2)), 1e-12))
    right = bool(np.array_equal(best, np.eye(2)))
    return Look(
        flown.reference_name, score, lag_s, scale, sentence(best), right, clear, flown.range_jumping,
        flown.attitude_is_own,
    )  # fmt: skip
