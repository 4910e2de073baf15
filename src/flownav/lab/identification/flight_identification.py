"""Identification from a flight log: axes and scale from the track, latency and dynamics from motion, noise, quality.

Scale. Against GPS, whose noise is the greater, the flow's track is matched to the reference's (`displacement`);
against a truth, which is much cleaner than the flow, the flow's velocity is regressed on the reference's. Either way
the noisy side stands on the left; the bias that the other side's noise leaves is computed and is in the interval.

Latency. The age of a reading when it arrives, on the vehicle's clock: from the flow against the IMU, or against the
reference, whose own delay the IMU gives; the better-known of the two.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array, Sensor
from flownav.lab.identification.descent import Structure
from flownav.lab.identification.experiment import Experiment, experiment
from flownav.lab.identification.findings import Findings, Noise, Response, noise_of
from flownav.lab.identification.first_look import Axes, judged
from flownav.lab.identification.flight import Flight
from flownav.lab.identification.offset import Offset, flow_offset, without
from flownav.lab.identification.output_error import Z_95, fit
from flownav.lab.identification.own_gyro import own_gyro
from flownav.lab.identification.quantities import Interval, choose, cross_validation, latency
from flownav.lab.identification.reference_motion import (
    Motion,
    difference,
    fast_experiments,
    fast_flow,
    flow_likeness,
    with_flow,
)
from flownav.lab.identification.reference_truth import drift_like
from flownav.lab.identification.scale import Match, against_speed, match
from flownav.logs.log import Log
from flownav.logs.open_log import open_flight

CLUSTER_S = 3.0
FLIGHT_ORDERS = (Structure(0), Structure(1), Structure(2))
WORST_BIAS = 0.02
LEAST_LIKENESS = 0.4  # of flow and reference: less is the luck of a short flight
CLEAR_LIKENESS = 0.8  # likeness to the IMU from which it, and not the reference, shows the dynamics


class Scale(NamedTuple):
    """The sensor's response (2, 2) to body velocity, with its axes put right: gains on the diagonal.

    bias: share by which noise in the regressor pulls each gain, at most; method names that side.
    """

    response: Array
    gains: tuple[Interval, Interval]
    bias: tuple[float, float]
    method: str


class Measured(NamedTuple):
    """A flight held against its reference: the flow's raw axes, and those put right; its velocity with axes and offset
    put right (n, 2) [m/s]; its response, the track that it was matched on (None of a velocity), and its offset.
    """

    flown: Flight
    moved: Motion
    raw: Array
    axes: Axes
    put_right: Array
    scale: Scale
    track: Match | None
    offset: Offset | None

    @property
    def gains(self) -> tuple[Interval, Interval]:
        """Gains of forward velocity and of velocity to the right, with 95 % intervals that no length of log narrows."""
        x, y = (_doubted(self.scale, self.flown, axis) for axis in (0, 1))
        return x, y


def identify_flight(
    path: Path, candidates: Sequence[Structure], reference: str = "auto", flow_instance: int | None = None
) -> Findings:
    """Findings of one flight log. InputError names what is missing."""
    log = open_flight(path, flow_instance=flow_instance)
    flown, moved, raw, axes, put_right, scale, track, offset = measured(log, reference)
    runs = [_axis_run(flown, moved, put_right, axis) for axis in (0, 1)]
    structures = candidates if len(candidates) == 1 else FLIGHT_ORDERS
    responses = []
    for axis, members in enumerate(_dynamic_runs(flown, moved, put_right, runs)):
        choice = choose(members, structures)
        lag = _latency(flown, moved, latency(choice.best))
        held_out = cross_validation(members, choice.best)
        responses.append(Response("xy"[axis], runs[0].height_m, _doubted(scale, flown, axis), lag, choice, 1, held_out))
    delay_s = float(np.mean([response.latency_s.value for response in responses]))
    law = against_speed(flown, moved, put_right, delay_s)
    of_scale = (
        [f"scale: {law.verdict}; the gains are of all speeds together"] if law is not None and law.matters else []
    )
    ranges = flown.range_m[flown.good]
    return Findings(
        "flight",
        flown.reference_name,
        tuple(responses),
        axes,
        _noise(flown, put_right, [fit([run], Structure(0)).residuals[0] for run in runs]),
        (),
        (float(np.quantile(ranges, 0.01)), float(np.quantile(ranges, 0.99))),
        flown.flow_limit_rad_s,
        int(flown.quality[flown.good].min()),
        tuple((path if path.is_dir() else path.parent) / name for name in log.inputs),
        (*flown.notes, *_notes(flown, moved, scale, axes), *of_scale),
        _details(flown, moved, scale, axes, raw, track),
        law,
        offset,
        own_gyro(log),
        log.parameters,
    )


def measured(log: Log, reference: str = "auto") -> Measured:
    """The flow's axes, response and offset against a reference: "auto", "truth", "gps". InputError: none, or unlike."""
    flown, moved, raw, axes = judged(log, reference)
    _check_alike(flown, moved)
    age_s = _age(flown, moved)
    put_right = flown.velocity_m_s @ axes.assignment  # assignment is orthogonal: its transpose undoes it
    if not axes.right:
        moved = with_flow(moved, flown, put_right)
        age_s = _age(flown, moved)
    scale, track = _scale(flown, moved, age_s, put_right)
    offset = flow_offset(flown, moved, put_right, scale.response, age_s)
    drift_m_s = drift_like(offset, flown, moved, log.streams.get(Sensor.LANDED))
    if drift_m_s is not None:
        drifting = f"the reference: {flown.reference_name} drifts by {drift_m_s:.2f} m/s all the time"
        note = f"{drifting}; no offset of the flow is identified"
        flown, offset = replace(flown, notes=(*flown.notes, note)), None
    if offset is not None and offset.matters:
        put_right = without(put_right, flown.range_m, offset)
        scale, track = _scale(flown, moved, age_s, put_right)
    return Measured(flown, moved, raw, axes, put_right, scale, track, offset)


def _check_alike(flown: Flight, moved: Motion) -> None:
    """InputError where the flow does not follow the reference, straight or mirrored: there is nothing to identify."""
    alike = flow_likeness(flown, moved.t_s, moved.velocity_m_s)
    best = max(alike.likeness, alike.mirrored)
    if best < LEAST_LIKENESS:
        raise InputError(
            f"{flown.name}: the flow does not follow the reference ({flown.reference_name}; their velocities' "
            f"correlation is {best:.2f}, {LEAST_LIKENESS:g} is needed): no scale can be found; `flownav info` shows "
            "range, quality and clock"
        )


def _doubted(scale: Scale, flown: Flight, axis: int) -> Interval:
    """A gain's interval with what no length of log takes out: noise in the regressor, a range that jumps."""
    value, low, high = scale.gains[axis]
    doubt = np.hypot(scale.bias[axis], flown.range_doubt) * abs(value)
    return Interval(value, value - float(np.hypot(value - low, doubt)), value + float(np.hypot(high - value, doubt)))


def _age(flown: Flight, moved: Motion) -> float:
    """How old a flow reading is when it arrives, to turn it by the right attitude; the log's own value where unsure."""
    tie = moved.flow_tie
    return tie.delay_s.value if tie is not None and tie.holds else flown.age_s


def _latency(flown: Flight, moved: Motion, against_reference: Interval) -> Interval:
    """On the vehicle's clock: the better-known of the IMU's word and the reference's, whose delay is taken out.

    The IMU's word is of the log's attitude. Where that is an estimate, its errors pass for delays: then it is the
    latency against the reference as that is stamped, and the interval includes the delay that the IMU shows.
    """
    if flown.attitude_is_own:
        delay_s, (value, low, high) = moved.reference_delay_s, against_reference
        half = float(np.hypot(0.5 * (high - low), delay_s))
        return Interval(value - delay_s, value - delay_s - half, value - delay_s + half)
    words = [tie.delay_s for tie in (moved.flow_tie,) if tie is not None and tie.holds]
    if moved.reference_tie is not None and moved.reference_tie.holds:
        own = moved.reference_tie.delay_s
        words.append(difference(against_reference, Interval(0.0, own.low - own.value, own.high - own.value)))
    return min(words, key=lambda word: word.high - word.low, default=against_reference)


def _body_input(flown: Flight, moved: Motion, age_s: float) -> Array:
    return moved.in_body(flown, flown.t_s[flown.good] - age_s)[:, :2]


def _scale(flown: Flight, moved: Motion, age_s: float, velocity: Array) -> tuple[Scale, Match | None]:
    if flown.reference == "gps":
        track = match(flown, age_s, velocity)
        return _scale_of_track(track), track
    return _scale_of_velocity(flown, moved, velocity), None


def _scale_of_track(track: Match) -> Scale:
    """The response is the inverse of the mixing; its covariance by the inverse's derivative, dB = -B dM B."""
    response = np.linalg.inv(track.mixing)
    covariance = track.covariance[:4, :4]  # of m11, m21, m12, m22
    gains = []
    for axis in (0, 1):
        slope = np.array([-response[axis, i] * response[j, axis] for i, j in ((0, 0), (1, 0), (0, 1), (1, 1))])
        gains.append(Interval.of(float(response[axis, axis]), float(np.sqrt(slope @ covariance @ slope))))
    return Scale(np.asarray(response), (gains[0], gains[1]), track.attenuation, "displacement")


def _scale_of_velocity(flown: Flight, moved: Motion, velocity: Array) -> Scale:
    """Flow on reference velocity at the delay that fits best, with intervals by clusters of CLUSTER_S."""
    t_s, y = flown.t_s[flown.good], velocity[flown.good]
    fits = []
    for delay in np.arange(0.0, 0.3, 0.01):
        design = np.column_stack([_body_input(flown, moved, float(delay)), np.ones(len(t_s))])
        solution = np.linalg.lstsq(design, y, rcond=None)[0]
        fits.append((float(np.sum((y - design @ solution) ** 2)), design, solution))
    _, design, solution = min(fits, key=lambda entry: entry[0])
    inverse = np.linalg.inv(design.T @ design)
    labels = np.floor(t_s / CLUSTER_S).astype(int)
    gains = []
    for axis in (0, 1):
        residual = y[:, axis] - design @ solution[:, axis]
        scores = np.array([design[labels == k].T @ residual[labels == k] for k in np.unique(labels)])
        few = len(scores) / max(1, len(scores) - 3)
        covariance = few * inverse @ (scores.T @ scores) @ inverse
        gains.append(Interval.of(float(solution[axis, axis]), float(np.sqrt(covariance[axis, axis]))))
    return Scale(np.asarray(solution[:2].T), (gains[0], gains[1]), _reference_noise_share(flown, design), "velocity")


def _reference_noise_share(flown: Flight, design: Array) -> tuple[float, float]:
    """Share of the reference velocity's power that is its own noise, from second differences of its positions."""
    position = flown.reference_m[:, :2]
    second = position[2:] - 2.0 * position[1:-1] + position[:-2]
    sigma_m = float(np.sqrt(np.median(second**2) / 0.455 / 6.0))  # 0.455: median of a squared normal
    step = float(np.median(np.diff(flown.reference_t_s)))
    noise = 2.0 * sigma_m**2 / (2.0 * max(0.1, step)) ** 2
    return noise / float(design[:, 0].var()), noise / float(design[:, 1].var())


def _axis_run(flown: Flight, moved: Motion, velocity: Array, axis: int) -> Experiment:
    """One body axis as an experiment: the reference's velocity on the vehicle's clock in, the flow's at arrival out."""
    body = moved.in_body(flown, moved.t_s)[:, axis]
    t_s, y = flown.t_s[flown.good], velocity[flown.good, axis]
    return experiment(
        f"{flown.name} {'xy'[axis]}", moved.t_s, body, t_s, y, float(np.median(flown.range_m[flown.good]))
    )


def _dynamic_runs(
    flown: Flight, moved: Motion, velocity: Array, runs: Sequence[Experiment]
) -> Sequence[Sequence[Experiment]]:
    """Experiments for the dynamics of x and of y: above 1/SPLIT_S of the IMU where it serves, else of the reference."""
    if moved.fast_m_s is None or moved.flow_tie is None or moved.flow_tie.likeness < CLEAR_LIKENESS:
        return [[run] for run in runs]
    other = fast_flow(flown, moved.t_s, velocity)
    both = fast_experiments(flown.name, moved.t_s, moved.fast_m_s, flown.t_s[flown.good], other)
    return [both, both]


def _noise(flown: Flight, velocity: Array, residuals: Sequence[Array]) -> Noise:
    """Errors of both axes together, against gain and delay."""
    ranges, quality = flown.range_m[flown.good], flown.quality[flown.good]
    error = np.concatenate([_complete(residual, len(ranges)) for residual in residuals])
    height, grade = np.concatenate([ranges, ranges]), np.concatenate([quality, quality])
    return noise_of(error, height, grade, float(velocity[flown.good].std()))


def _complete(residual: Array, count: int) -> Array:
    """The reference reaches 2 s beyond the flow on either side, so every reading has a residual."""
    if len(residual) != count:
        raise InputError(f"{count - len(residual)} flow readings lie outside the reference's time; trim the log")
    return residual


def _notes(flown: Flight, moved: Motion, scale: Scale, axes: Axes) -> list[str]:
    notes = []
    if not axes.right:
        notes.append(f"axes: {axes.verdict}; gains are of the axes put right")
    if max(scale.bias) > WORST_BIAS:
        notes.append(
            f"scale: noise in the regressor may pull the gains by up to {max(scale.bias):.0%}, which is in their "
            "intervals; a longer or livelier flight is needed"
        )
    if flown.range_doubt > WORST_BIAS:
        notes.append(
            f"range: it jumps in {flown.range_jumping:.0%} of its steps in flight, an error of {flown.range_doubt:.0%} "
            "of every gain, which is in their intervals"
        )
    if flown.reference == "gps":
        notes.append("error: what is left of the GPS and attitude errors counts as the flow's; it is an upper bound")
    if moved.flow_tie is None:
        notes.append("latency is against the reference and holds the reference's own delay: the log has no IMU")
    elif not moved.flow_tie.holds and (moved.reference_tie is None or not moved.reference_tie.holds):
        notes.append("latency is against the reference and holds its delay: the IMU agrees with neither of them")
    if not moved.yaw_known:
        notes.append(
            "the reference's heading is the one that fits the flow, for want of an IMU that agrees: a sensor turned "
            "about its boresight does not show"
        )
    return notes


def _details(
    flown: Flight, moved: Motion, scale: Scale, axes: Axes, raw: Array, track: Match | None
) -> dict[str, object]:
    details: dict[str, object] = {
        "scale_method": scale.method,
        "scale_bias": {"x": scale.bias[0], "y": scale.bias[1]},
        "cross_coupling": {"x_from_y": float(scale.response[0, 1]), "y_from_x": float(scale.response[1, 0])},
        "velocity_response": raw.tolist(),
        "turned_deg": axes.turned_deg,
        "reference_yaw_deg": float(np.degrees(moved.yaw_rad)),
        "reference_delay_s": moved.reference_delay_s,
        "usable_share": float(flown.good.mean()),
        "range_jumping_share": flown.range_jumping,
        "range_doubt": flown.range_doubt,
    }
    if track is not None:
        sigma = float(np.sqrt(track.covariance[4, 4]))
        details["reference_behind_flow_s"] = {
            "value": track.lag_s, "low": track.lag_s - Z_95 * sigma, "high": track.lag_s + Z_95 * sigma
        }  # fmt: skip
        details["track_innovation_m"] = track.innovation_m
    for name, tie in (("flow", moved.flow_tie), ("reference", moved.reference_tie)):
        if tie is not None:
            details[f"{name}_against_imu"] = {
                "delay_s": tie.delay_s._asdict(), "turn_deg": float(np.degrees(tie.turn_rad)), "likeness": tie.likeness
            }  # fmt: skip
    return details
