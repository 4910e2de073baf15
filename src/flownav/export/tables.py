"""A record's own tables as a folder of Parquet or CSV files beside its manifest.json, and whole numbers of time."""

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.guard import folder_written_whole
from flownav.core.record import SCHEMA_VERSION, Column, Record, Table

Stamps = NDArray[np.int64]


def write_parquet(record: Record, folder: Path) -> tuple[list[Path], list[str]]:
    """Write a folder of NAME.parquet and manifest.json, all or none; the files, and no notes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    def write(table: Table, file: Path) -> None:
        columns = {
            name: pa.array(texts(column), pa.string()) if is_text(column) else pa.array(column)
            for name, column in table.items()
        }
        pq.write_table(pa.table(columns), file, compression="zstd")

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
