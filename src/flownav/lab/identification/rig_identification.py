"""Identification from rig logs: one joint model for each height, a second-order one for each run, noise by height."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.lab.identification.descent import DELAY_RANGE_S, Structure
from flownav.lab.identification.findings import Findings, Noise, Response, RunModel
from flownav.lab.identification.height_law import (
    NoisePoint,
    compare_schedules,
    fit_power_law,
    noise_by_height,
    spread,
    tail,
    variance_by_quality,
)
from flownav.lab.identification.orders import choose, cross_validation
from flownav.lab.identification.output_error import fit
from flownav.lab.identification.quantities import gain, latency
from flownav.lab.identification.rig_log import Run
from flownav.lab.identification.sentinel import one_axis

SAME_HEIGHT = 0.02  # runs within 2 % of a height belong together
UNKNOWN_HEIGHT = "its height is unknown: give --heights, height_m in rig.toml, or a ground_distance_m column"


def identify_rig(runs: Sequence[Run], candidates: Sequence[Structure], validate: bool = True) -> Findings:
    """Findings of rig runs at one or several heights. InputError where a run cannot be used."""
    for run in runs:
        if not np.isfinite(run.experiment.height_m):
            raise InputError(f"{run.files[0]}: {UNKNOWN_HEIGHT}")
    groups = _by_height(runs)
    responses, models = [], []
    errors: list[tuple[Run, Array]] = []
    for height_m, members in groups.items():
        experiments = [run.experiment for run in members]
        choice = choose(experiments, candidates)
        held_out = cross_validation(experiments, choice.best) if validate else ()
        best = choice.best
        responses.append(Response("x", height_m, gain(best), latency(best), choice, len(members), held_out))
        errors.extend(zip(members, best.residuals, strict=True))
        models.extend(_run_models(height_m, members))
    axes = one_axis(responses[0].gain.value)
    speeds = np.concatenate([np.abs(run.experiment.y) / run.experiment.height_m for run in runs])
    return Findings(
        "rig",
        "encoder" if any(run.reference == "encoder" for run in runs) else "rig velocity",
        tuple(responses),
        axes,
        _noise(errors),
        tuple(models),
        (min(groups), max(groups)),
        float(np.quantile(speeds, 0.999)),
        max(1, int(min(run.quality.min() for run in runs))),
        tuple(dict.fromkeys(file for run in runs for file in run.files)),
        tuple(
            f"{run.files[0]}: {count} rows left out ({reason.replace('_', ' ')})"
            for run in runs for reason, count in run.rejected.items() if reason != "no_data"
        ),
    )  # fmt: skip


def _by_height(runs: Sequence[Run]) -> dict[float, list[Run]]:
    groups: dict[float, list[Run]] = {}
    for run in sorted(runs, key=lambda run: run.experiment.height_m):
        height = run.experiment.height_m
        near = next((known for known in groups if abs(height - known) <= SAME_HEIGHT * known), height)
        groups.setdefault(near, []).append(run)
    return groups


def _run_models(height_m: float, members: Sequence[Run]) -> list[RunModel]:
    """Table 1's row for each run."""
    return [
        RunModel(height_m, number, str(run.files[0]), fit([run.experiment], Structure(2)))
        for number, run in enumerate(members, start=1)
    ]


def _noise(errors: Sequence[tuple[Run, Array]]) -> Noise:
    """Errors are the residuals of the joint models; their readings are those inside the delays considered."""
    height, quality, error, signal, name = [], [], [], [], []
    for run, residual in errors:
        t_y, t_u = run.experiment.t_y, run.experiment.t_u
        used = (t_y - DELAY_RANGE_S[1] >= t_u[0]) & (t_y - DELAY_RANGE_S[0] <= t_u[-1])
        height.append(np.full(len(residual), run.experiment.height_m))
        quality.append(run.quality[used])
        error.append(residual)
        signal.append(run.experiment.y[used])
        name.append(run.experiment.height_m)
    by_height = [
        _point(height_m, np.concatenate([e for e, h in zip(error, name, strict=True) if h == height_m]))
        for height_m in sorted(set(name))
    ]
    errors_all, heights_all = np.concatenate(error), np.concatenate(height)
    quality_all, signal_sigma = np.concatenate(quality), float(np.concatenate(signal).std())
    points = by_height if len(by_height) > 1 else noise_by_height(errors_all, heights_all)
    law = fit_power_law(points)
    return Noise(
        tuple(points),
        law,
        tuple(variance_by_quality(errors_all, quality_all)),
        tuple(compare_schedules(errors_all, heights_all, quality_all, signal_sigma)),
        signal_sigma,
        tail(errors_all, law.at(heights_all)),
    )


def _point(height_m: float, error: Array) -> NoisePoint:
    """A noise point from all errors at one height."""
    return NoisePoint(height_m, spread(error), len(error))
