"""The job: logs in, findings out; rig logs together, one joint model for each height, or one flight."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flownav.core.errors import InputError, arg
from flownav.core.guard import inputs_there
from flownav.core.measurement import Array
from flownav.lab.identification.descent import DELAY_RANGE_S, Structure
from flownav.lab.identification.findings import Findings, Noise, Response, RunModel, noise_of
from flownav.lab.identification.first_look import one_axis
from flownav.lab.identification.flight_identification import identify_flight
from flownav.lab.identification.height_law import NoisePoint, spread
from flownav.lab.identification.output_error import fit
from flownav.lab.identification.quantities import CANDIDATES, choose, cross_validation, gain, latency
from flownav.lab.identification.rig_log import Run, assign_heights, is_rig, read_runs
from flownav.logs.open_log import log_kind
from flownav.logs.topic_files import is_topic_folder

SAME_HEIGHT = 0.02  # runs within 2 % of a height belong together
UNKNOWN_HEIGHT = f"its height is unknown: give {arg('heights_m')}, height_m in rig.toml, or a ground_distance_m column"


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
    parts = []
    for run, residual in errors:
        t_y, t_u = run.experiment.t_y, run.experiment.t_u
        used = (t_y - DELAY_RANGE_S[1] >= t_u[0]) & (t_y - DELAY_RANGE_S[0] <= t_u[-1])
        height_m = np.full(len(residual), run.experiment.height_m)
        parts.append((residual, height_m, run.quality[used], run.experiment.y[used]))
    error, height, quality, signal = (np.concatenate(column) for column in zip(*parts, strict=True))
    one_each = [(float(height_m), error[height == height_m]) for height_m in np.unique(height)]
    points = [NoisePoint(height_m, spread(own), len(own)) for height_m, own in one_each] if len(one_each) > 1 else []
    return noise_of(error, height, quality, float(signal.std()), points)


# -- rig logs or a flight ----------------------------------------------------------------------------------------
TAKEN = "identify takes rig logs and flight logs"


def identify(
    logs: Sequence[Path],
    structures: Sequence[Structure] = CANDIDATES,
    heights_m: Sequence[float] = (),
    reference: str = "auto",
    flow_instance: int | None = None,
) -> Findings:
    """Findings of rig logs (all together, by height) or of one flight log.

    structures: models to choose from. flow_instance: which of a flight's several flow sensors.
    InputError, one line, where a log is missing, mixed or cannot serve.
    """
    if not logs:
        raise InputError("no log given; identify takes rig folders, rig CSV files or one flight log")
    inputs_there(logs, TAKEN)
    flights = [path for path in logs if is_flight(path)]
    if flights and len(logs) > 1:
        raise InputError(f"{flights[0]}: a flight is identified alone; give rig logs together, flights one by one")
    if flights:
        if heights_m:
            raise InputError(
                f"{arg('heights_m')}: a flight's heights come from its range readings; leave the option out"
            )
        return identify_flight(flights[0], structures, reference, flow_instance)
    if flow_instance is not None:
        raise InputError(f"{arg('flow_instance')}: a rig log holds one flow sensor; leave the option out")
    for path in logs:
        if not is_rig(path):
            raise InputError(
                f"{path}: neither a rig log (rig.csv, run-001/rig.csv, a CSV file) nor a flight log (a folder with "
                "attitude.csv or imu.csv, .ulg, .bin, .tlog)"
            )
    runs = [
        run
        for path, height_m in zip(logs, assign_heights(logs, heights_m), strict=True)
        for run in read_runs(path, height_m, reference)
    ]
    return identify_rig(runs, structures)


def is_flight(path: Path) -> bool:
    """Whether a path holds a flight: a log file, or a folder of CSV files with an attitude or an IMU."""
    own = any((path / name).exists() for name in ("attitude.csv", "imu.csv"))
    return own or bool(log_kind(path)) or (path.is_dir() and is_topic_folder(path))


def name_of(logs: Sequence[Path]) -> str:
    """A name for what comes of the logs: the first one's."""
    first = logs[0].resolve()
    return first.stem if first.is_file() else first.name
