"""A record's contents as writers take them: paths as poses, the estimate's error, whole numbers of time, tables as a
folder.

Poses stand in NED/FRD or in ENU/FLU; the error, where the record holds a truth. Tables are Parquet or CSV files beside
the manifest.json.
"""

import csv
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.arrow_columns import table_of
from flownav.core.errors import InputError
from flownav.core.frames import quaternion_product, rotation_from_quaternion, to_earth
from flownav.core.guard import folder_written_whole
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, QUATERNION, SCHEMA_VERSION, VELOCITY_BODY, Column, Record, Table

PATHS = ("estimate", "smoothed", "truth", "autopilot")
FRAMES = ("ned", "enu")
ENU_FROM_NED = (0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0)  # swaps north and east, turns down up
FRD_FROM_FLU = (0.0, 1.0, 0.0, 0.0)  # half a turn about forward
SIGMAS = 3.0
ERROR = ("error_n_m", "error_e_m", "error_d_m")
BOUND = ("three_sigma_n_m", "three_sigma_e_m", "three_sigma_d_m")


class Trajectory(NamedTuple):
    """A path, rows in order of time.

    name: of PATHS. t_s (n,); position_m (n, 3) in the earth frame; quaternion (n, 4) w, x, y, z, body to earth;
    velocity_m_s (n, 3) in the earth frame, None where the record has none; oriented: False where no attitude was
    recorded and `quaternion` is level, facing north; row (n,): which row of the record's table each is; left_out: how
    many rows had no finite time, position or attitude.
    """

    name: str
    t_s: Array
    position_m: Array
    quaternion: Array
    velocity_m_s: Array | None
    oriented: bool
    row: NDArray[np.int64]
    left_out: int

    @property
    def notes(self) -> Iterator[str]:
        """Notes on this path for the user, one line each."""
        if self.left_out:
            yield f"{self.name}: {self.left_out} of {self.left_out + len(self.t_s)} rows left out, not finite"
        if not self.oriented:
            yield f"{self.name}: no attitude recorded, level and facing north written; compare positions only"


def trajectories(record: Record, frame: str = "ned") -> list[Trajectory]:
    """Every path that the record holds, in NED/FRD or (`frame` "enu") in ENU/FLU. InputError without any."""
    found = [path for name in PATHS if (path := _trajectory(record, name)) is not None]
    if not found:
        raise InputError(f"the record holds no path (no finite position in {', '.join(PATHS)})")
    return found if frame == "ned" else [in_enu(path) for path in found]


def in_enu(path: Trajectory) -> Trajectory:
    """A path of NED/FRD in ENU/FLU: the earth's axes and the body's are both exchanged."""

    def turned(vector: Array) -> Array:
        return vector[:, [1, 0, 2]] * (1.0, 1.0, -1.0)

    from_frd = quaternion_product(ENU_FROM_NED, tuple(path.quaternion.T))
    return path._replace(
        position_m=turned(path.position_m),
        quaternion=np.column_stack(quaternion_product(from_frd, FRD_FROM_FLU)),
        velocity_m_s=None if path.velocity_m_s is None else turned(path.velocity_m_s),
    )


def _trajectory(record: Record, name: str) -> Trajectory | None:
    table = record.tables.get(name, {})
    if not {"t_s", *POSITION_NED} <= table.keys():
        return None
    t_s = np.asarray(table["t_s"], float)
    position = record.matrix(name, POSITION_NED)
    usable = np.isfinite(t_s) & np.isfinite(position).all(axis=1)
    quaternion = record.matrix(name, QUATERNION) if set(QUATERNION) <= table.keys() else np.full((len(t_s), 4), np.nan)
    attitude = np.isfinite(quaternion).all(axis=1) & (np.abs(quaternion).max(axis=1, initial=0.0) > 0.0)
    oriented = bool((usable & attitude).any())
    if oriented:
        usable &= attitude
    else:
        quaternion = np.tile((1.0, 0.0, 0.0, 0.0), (len(t_s), 1))
    row = np.flatnonzero(usable)
    row = row[np.argsort(t_s[row], kind="stable")]
    if not len(row):
        return None
    unit = quaternion[row] / np.linalg.norm(quaternion[row], axis=1, keepdims=True)
    velocity = None
    if oriented and set(VELOCITY_BODY) <= table.keys():
        body = record.matrix(name, VELOCITY_BODY)[row]
        velocity = np.column_stack(to_earth(rotation_from_quaternion(*unit.T), *body.T))
    return Trajectory(name, t_s[row], position[row], unit, velocity, oriented, row, int(len(t_s) - len(row)))


def error_table(record: Record, paths: list[Trajectory]) -> Table | None:
    """Estimate less truth [m] at the estimate's instants inside the truth's time, and three standard deviations.

    Columns t_s, ERROR, and BOUND where the record states them. None without an estimate, a truth, or an instant that
    both have.
    """
    named = {path.name: path for path in paths}
    if not {"estimate", "truth"} <= named.keys():
        return None
    estimate, truth = named["estimate"], named["truth"]
    inside = (estimate.t_s >= truth.t_s[0]) & (estimate.t_s <= truth.t_s[-1])
    if not inside.any():
        return None
    t_s = estimate.t_s[inside]
    table: Table = {"t_s": t_s}
    for k, name in enumerate(ERROR):
        table[name] = estimate.position_m[inside, k] - np.interp(t_s, truth.t_s, truth.position_m[:, k])
    columns = tuple(f"std_{name}" for name in POSITION_NED)
    if set(columns) <= record.tables["estimate"].keys():
        spread = record.matrix("estimate", columns)[estimate.row][inside]
        table |= {name: SIGMAS * spread[:, k] for k, name in enumerate(BOUND)}
    return table


Stamps = NDArray[np.int64]


def write_parquet(record: Record, folder: Path) -> tuple[list[Path], list[str]]:
    """Write a folder of NAME.parquet and manifest.json, all or none; the files, and no notes."""
    import pyarrow.parquet as pq

    def write(table: Table, file: Path) -> None:
        columns = {name: np.array(texts(one), object) if is_text(one) else one for name, one in table.items()}
        pq.write_table(table_of(columns), file, compression="zstd")

    return _write(record, folder, ".parquet", write)


def write_csv(record: Record, folder: Path) -> tuple[list[Path], list[str]]:
    """Write a folder of NAME.csv and manifest.json, all or none; the files, and no notes.

    The headers are the record's column names, which carry frames and units. Numbers are written so that they
    read back to the same value; NaN is an empty cell.
    """

    def write(table: Table, file: Path) -> None:
        with file.open("w", newline="", encoding="utf-8", errors="backslashreplace") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(table)
            writer.writerows(zip(*(map(_cell, column.tolist()) for column in table.values()), strict=True))

    return _write(record, folder, ".csv", write)


def is_text(column: Column) -> bool:
    """Whether a column holds strings."""
    return column.dtype.kind in "OUS"


def texts(column: Column) -> list[str | None]:
    """A column of strings as such; None where a row has none."""
    return [None if value is None else str(value) for value in column]


def manifest_json(record: Record) -> str:
    """The record's manifest as its own file has it."""
    return json.dumps({"schema": SCHEMA_VERSION, **record.manifest}, indent=1, default=str)


def _write(record: Record, folder: Path, suffix: str, write: Any) -> tuple[list[Path], list[str]]:
    with folder_written_whole(folder) as temporary:
        (temporary / "manifest.json").write_text(manifest_json(record), encoding="utf-8")
        for name, table in record.tables.items():
            write({key: np.asarray(column) for key, column in table.items()}, temporary / f"{name}{suffix}")
    return [folder / "manifest.json", *(folder / f"{name}{suffix}" for name in record.tables)], []


def _cell(value: Any) -> Any:
    """NaN as an empty cell, truth values as 1 and 0, the rest as it is."""
    if isinstance(value, float) and math.isnan(value):
        return ""
    return int(value) if isinstance(value, bool) else value


def stamps(t_s: NDArray[np.float64], per_second: float, shift_s: float = 0.0) -> Stamps:
    """Finite times [s], `shift_s` later, in units of 1/per_second, rounded to the nearest."""
    return np.rint((t_s + shift_s) * per_second).astype(np.int64)


def finite_rows(t_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """The rows with a finite time, in order of time; ties keep their order."""
    rows = np.flatnonzero(np.isfinite(t_s))
    return rows[np.argsort(t_s[rows], kind="stable")]


def shift_needed_s(record: Record) -> float:
    """Whole seconds to add so that no time is negative; 0 where none is.

    A record's innovations stand at the instant that a delayed reading describes, which may lie before time 0.
    """
    times = [np.asarray(table["t_s"], float) for table in record.tables.values()]
    earliest = min((float(t[np.isfinite(t)].min()) for t in times if np.isfinite(t).any()), default=0.0)
    return float(np.ceil(max(-earliest, 0.0)))
