"""Messages of one kind as checked rows: in the unit wanted, finite, inside limits, in time order."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.logs.csv_table import Column, CsvTable, check_clock, check_finite
from flownav.logs.dataflash.columns import DataFlash

MICROSECOND_S = 1e-6


class Field(NamedTuple):
    """A field of a message: the limits of its values and the factor to their unit where the log states none."""

    label: str
    low: float
    high: float
    factor: float = 1.0
    required: bool = True
    may_be_nan: bool = False


def message_rows(log: DataFlash, name: str, fields: Sequence[Field], instance: int | None = None) -> CsvTable | None:
    """Every row of a kind of message as written, t_s seconds since the vehicle started.

    None where the kind does not occur, or lacks TimeUS or a required field as a number.
    """
    numeric = log.formats[name].numbers if log.count(name) else frozenset()
    lacking = [field.label for field in fields if field.required and field.label not in numeric]
    if "TimeUS" not in numeric or lacking:
        return None
    present = [field for field in fields if field.label in numeric]
    columns = log.table(name, ["TimeUS", *(field.label for field in present)], instance=instance)
    stated = log.formats[name].multipliers
    scaled = {field.label: _scaled(columns[field.label], stated.get(field.label, field.factor)) for field in present}
    return CsvTable(_scaled(columns["TimeUS"], MICROSECOND_S), scaled, path=Path(f"{log.path}: {name}"))


def _scaled(values: NDArray[Any], factor: float) -> Array:
    """In float64, times a factor; a damaged file's signalling NaN or huge number is no warning, the checks see it."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(values.astype(float) * factor)


def check_rows(table: CsvTable, fields: Sequence[Field]) -> None:
    """Throw away and count what is not finite, out of range or out of order. InputError where the clock restarts."""
    check_finite(table, [Column(f.label, f.low, f.high, may_be_empty=f.may_be_nan) for f in fields])
    inside = np.ones(len(table.t_s), bool)
    for field in fields:
        values = table.columns.get(field.label)
        if values is not None:
            inside &= ~((values < field.low) | (values > field.high))
    table.keep(inside, "out_of_range")
    if len(table.t_s):
        check_clock(table)


def held_at(instants_s: Array, t_s: Array, values: Array) -> Array:
    """The latest value at each instant, the first one before there is any; values (n, ...), n at least 1."""
    return np.asarray(values[np.maximum(np.searchsorted(t_s, instants_s, side="right") - 1, 0)])
