"""Rig logs: what a pendulum, a slide or a turntable recorded of a flow sensor and of its own motion.

A folder holds `rig.csv`, and `rig.toml` beside it where the geometry is to be known; several runs lie in folders
`run-001/`, `run-002/` .. below one. A CSV file alone is a run too. Columns, times in seconds:

- `t_s`; the sensor's velocity `flow_velocity_m_s`; `quality` 0..255 (0 = no data) and `ground_distance_m` if any;
- the reference: `reference_velocity_m_s`, or an encoder: `encoder_counts` with `encoder_counts_per_revolution` of
  rig.toml, or `encoder_angle_rad`; either with `rod_length_m` there. The sensor moves at l dtheta/dt along its own
  x axis (the paper's equation 14 is the horizontal part, l cos(theta) dtheta/dt, less by 0.5 % at 6 degrees).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from pydantic import ConfigDict

from flownav.core.errors import InputError, arg
from flownav.core.files import natural_order
from flownav.core.guard import an_input
from flownav.core.measurement import Array
from flownav.core.parameter_files import Number, ParameterModel, load
from flownav.lab.identification.experiment import Experiment, experiment
from flownav.logs.csv_table import Column, CsvTable, read_csv_table

SPEED = "metres per second (centimetres? millimetres?)"
COLUMNS = (
    Column("flow_velocity_m_s", -20.0, 20.0, SPEED),
    Column("reference_velocity_m_s", -20.0, 20.0, SPEED, required=False, may_be_empty=True),
    Column("encoder_counts", -1e9, 1e9, "counts", required=False, may_be_empty=True),
    Column("encoder_angle_rad", -1e4, 1e4, "radians", required=False, may_be_empty=True),
    Column("ground_distance_m", -1.0, 200.0, "metres are needed (millimetres?)", required=False, may_be_empty=True),
    Column("quality", 0.0, 255.0, "quality runs from 0 (no data) to 255", required=False, may_be_empty=True),
)
REFERENCES = ("velocity", "encoder")
HALF_WINDOW = 6  # samples each side of the cubic that an encoder's rate is read from
LEAST_SPAN_S = 0.05


class Rig(ParameterModel):
    """rig.toml, as far as identification needs it; its other entries are left alone."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)

    height_m: Number | None = None
    rod_length_m: Number | None = None
    pivot_height_m: Number | None = None
    encoder_counts_per_revolution: Number | None = None


@dataclass(frozen=True)
class Run:
    """One run: the experiment, quality and range at its sensor readings, and the files it came from."""

    experiment: Experiment
    quality: Array
    range_m: Array
    files: tuple[Path, ...]
    reference: str
    rejected: dict[str, int]


def is_rig(path: Path) -> bool:
    """Whether a path is a rig log: a CSV file, or a folder with rig.csv in it or in its run folders."""
    if path.is_file():
        return path.suffix.lower() == ".csv"
    return (path / "rig.csv").exists() or bool(_run_folders(path))


def read_runs(path: Path, height_m: float | None = None, reference: str = "auto") -> list[Run]:
    """Every run of a rig log. height_m replaces rig.toml's. InputError names what is missing and where."""
    if not an_input(path).exists():
        raise InputError(f"{path}: no such file or folder; identify takes rig logs, rig CSV files and flight folders")
    if reference not in ("auto", *REFERENCES):
        raise InputError(f"{arg('reference')} {reference}: auto, velocity or encoder are possible for a rig log")
    if path.is_file():
        return [_read(path, path.with_name("rig.toml"), height_m, reference)]
    folders = [path] if (path / "rig.csv").exists() else _run_folders(path)
    if not folders:
        raise InputError(f"{path}: neither rig.csv nor run folders (run-001/rig.csv ..) nor attitude.csv in it")
    return [_read(f / "rig.csv", _nearest(f, path), height_m, reference) for f in folders]


def _run_folders(path: Path) -> list[Path]:
    return sorted((f.parent for f in path.glob("*/rig.csv")), key=natural_order) if path.is_dir() else []


def _nearest(folder: Path, above: Path) -> Path:
    mine = folder / "rig.toml"
    return mine if mine.exists() else above / "rig.toml"


def _read(file: Path, sheet: Path, height_m: float | None, reference: str) -> Run:
    rig = load(sheet, Rig) if sheet.exists() else Rig()
    table = read_csv_table(file, COLUMNS)
    columns = {name: values for name, values in table.columns.items() if np.isfinite(values).any()}
    t_u, u, kind = _reference(file, table, columns, rig, reference)
    quality = columns.get("quality", np.full(len(table.t_s), 255.0))
    used = quality > 0
    if not used.any():
        raise InputError(f"{file}: quality is 0 (no data) in every row; the sensor saw nothing")
    distance = columns.get("ground_distance_m", np.full(len(table.t_s), np.nan))
    height = height_m if height_m is not None else rig.height_m
    if height is None:
        known = distance[np.isfinite(distance)]
        height = float(np.median(known)) if len(known) else float("nan")
    used[1:] &= np.diff(table.t_s) > 0.0
    name = str(file.parent if file.name == "rig.csv" else file)
    run = experiment(name, t_u, u, table.t_s[used], table.columns["flow_velocity_m_s"][used], height)
    range_m = np.where(np.isfinite(distance[used]), distance[used], height)
    rejected = dict(table.rejected) | ({"no_data": int(np.sum(~used))} if not used.all() else {})
    return Run(run, quality[used], range_m, (file, *([sheet] if sheet.exists() else [])), kind, rejected)


def _reference(
    file: Path, table: CsvTable, columns: dict[str, Array], rig: Rig, wanted: str
) -> tuple[Array, Array, str]:
    """The input's times and velocities and which reference they are from."""
    if wanted in ("auto", "velocity") and "reference_velocity_m_s" in columns:
        return *_clean(table.t_s, columns["reference_velocity_m_s"]), "velocity"
    angle = columns.get("encoder_angle_rad")
    if angle is None and "encoder_counts" in columns:
        if rig.encoder_counts_per_revolution is None:
            raise InputError(f"{file}: encoder_counts need encoder_counts_per_revolution in rig.toml beside it")
        angle = columns["encoder_counts"] * (2.0 * np.pi / rig.encoder_counts_per_revolution)
    if wanted == "velocity" or angle is None:
        needed = "reference_velocity_m_s" if wanted == "velocity" else (
            "encoder_counts or encoder_angle_rad" if wanted == "encoder" else
            "reference_velocity_m_s, encoder_counts or encoder_angle_rad"
        )  # fmt: skip
        raise InputError(f"{file}: no reference; a column {needed} is needed")
    if rig.rod_length_m is None:
        raise InputError(f"{file}: an encoder needs rod_length_m in rig.toml beside it")
    t_s, angle = _clean(table.t_s, angle)
    if len(t_s) < 2 * HALF_WINDOW + 1:
        raise InputError(f"{file}: {len(t_s)} encoder readings; at least {2 * HALF_WINDOW + 1} are needed")
    return t_s, rig.rod_length_m * rate_of(t_s, angle), "encoder"


def _clean(t_s: Array, value: Array) -> tuple[Array, Array]:
    keep = np.isfinite(value)
    keep[1:] &= np.diff(t_s) > 0.0
    return t_s[keep], value[keep]


def rate_of(t_s: Array, angle_rad: Array) -> Array:
    """The rate (n,) of sampled angles: slope at its middle of the cubic through each window, at its own times.

    A window holds 2 HALF_WINDOW + 1 samples or LEAST_SPAN_S, whichever is more; at the ends the nearest one serves.
    """
    step = float(np.median(np.diff(t_s)))
    half = min(max(HALF_WINDOW, int(np.ceil(0.5 * LEAST_SPAN_S / step))), (len(t_s) - 1) // 2)
    width = 2 * half + 1
    windows, values = sliding_window_view(t_s, width), sliding_window_view(angle_rad, width)
    first = np.clip(np.arange(len(t_s)) - half, 0, len(t_s) - width)
    span = half * step
    x = (windows[first] - t_s[:, None]) / span
    powers = x[:, :, None] ** np.arange(4)
    normal = np.einsum("nki,nkj->nij", powers, powers)
    right = np.einsum("nki,nk->ni", powers, values[first] - angle_rad[:, None])
    return np.asarray(np.linalg.solve(normal, right[:, :, None])[:, 1, 0] / span)


def assign_heights(logs: Sequence[Path], heights_m: Sequence[float]) -> list[float | None]:
    """A height for each log: none given, one for all, or one each. InputError otherwise."""
    if not heights_m:
        return [None] * len(logs)
    if any(not 0.01 <= height <= 1000.0 for height in heights_m):
        raise InputError(f"{arg('heights_m')}: metres from 0.01 to 1000 are needed")
    if len(heights_m) == 1:
        return [heights_m[0]] * len(logs)
    if len(heights_m) != len(logs):
        raise InputError(
            f"{arg('heights_m')}: {len(heights_m)} heights for {len(logs)} logs; give one for all or one each"
        )
    return list(heights_m)
