"""Another estimate as columns: from a data frame, a mapping or a table, checked in shape, in units and in time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, PROTECTION_LEVELS, QUATERNION, TABLES, VELOCITY_BODY, VELOCITY_NED

KNOWN = ("t_s", *TABLES["estimate"], *VELOCITY_NED)
NEEDED = ("t_s", *POSITION_NED)
TOGETHER = (VELOCITY_BODY, QUATERNION, VELOCITY_NED, PROTECTION_LEVELS)  # columns that say nothing one by one
LONGEST = 100.0  # times the flight: such an estimate counts other seconds
UNIT_LENGTH = (0.9, 1.1)  # of a quaternion


def columns_of_estimate(given: Any, span_s: tuple[float, float]) -> dict[str, Array]:
    """The columns of an estimate, those that scoring knows: t_s and the position at least.

    given: a mapping of columns, a Table, or a data frame of pandas (t_s a column or the index), xarray, polars or
    Arrow. span_s: from when to when the record goes [s].
    InputError, one line, for what is missing, has another unit, length or order, or shares no time with the record.
    """
    columns = {name: _numbers(name, values) for name, values in _mapping_of(given).items() if isinstance(name, str)}
    _require_names(columns)
    kept = {name: values for name, values in columns.items() if name in KNOWN}
    _require_shapes(kept)
    for names in TOGETHER:
        there = [name for name in names if name in kept]
        if there and len(there) < len(names):
            raise InputError(f"estimate: it has {there[0]}, and {_missing(names, kept)} is missing; give all or none")
    _require_time(kept["t_s"], span_s)
    if set(QUATERNION) <= kept.keys():
        _require_rotations(np.column_stack([kept[name] for name in QUATERNION]))
    return kept


def _mapping_of(given: Any) -> dict[Any, Any]:
    """Column names to values, of whatever holds them."""
    if isinstance(given, Mapping) and not hasattr(given, "data_vars"):
        return dict(given)
    if hasattr(given, "data_vars"):  # xarray
        return {name: given[name].values for name in (*given.coords, *given.data_vars)}
    if hasattr(given, "reset_index"):  # pandas
        whole = given.reset_index() if given.index.name == "t_s" else given
        return {name: whole[name].to_numpy() for name in whole.columns}
    if hasattr(given, "to_dict") and hasattr(given, "columns"):  # polars
        return {name: given[name].to_numpy() for name in given.columns}
    if hasattr(given, "column_names"):  # Arrow
        return {name: given[name].to_numpy() for name in given.column_names}
    raise InputError(
        f"estimate: {type(given).__name__} is given; a mapping of columns, or a data frame of pandas, xarray or "
        "polars, is needed"
    )


def _numbers(name: str, values: Any) -> Array:
    """A column as numbers; of text an empty one, which is nobody's."""
    found = np.asarray(values)
    if found.dtype.kind in "OUS" and name not in KNOWN:
        return np.zeros(0)
    try:
        return np.asarray(found, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"estimate: column {name} holds something that is no number; numbers are needed") from None


def _require_names(columns: Mapping[str, Array]) -> None:
    for name in NEEDED:
        if name not in columns:
            stem = name.rsplit("_", 1)[0]
            alike = [other for other in columns if other == stem or other.startswith(f"{stem}_")]
            what = f"it has {alike[0]}, which is in another unit or states none" if alike else "it is missing"
            raise InputError(f"estimate: {name} is needed, and {what}; give {', '.join(NEEDED)} (seconds, metres, NED)")
    for name in (*VELOCITY_BODY, *VELOCITY_NED):
        stem = name.removesuffix("_m_s")
        wrong = [other for other in columns if (other == stem or other.startswith(f"{stem}_")) and other != name]
        if wrong and name not in columns:
            raise InputError(f"estimate: {wrong[0]}: a velocity is {name}, in metres a second; convert and rename it")


def _require_shapes(columns: Mapping[str, Array]) -> None:
    for name, values in columns.items():
        if values.ndim != 1:
            raise InputError(f"estimate: column {name} has shape {values.shape}; one number a row is needed")
        if len(values) != len(columns["t_s"]):
            raise InputError(f"estimate: column {name} has {len(values)} rows and t_s {len(columns['t_s'])}")
    if len(columns["t_s"]) < 2:
        raise InputError(f"estimate: {len(columns['t_s'])} rows; two or more are needed")


def _require_time(t_s: Array, span_s: tuple[float, float]) -> None:
    first, last = span_s
    if not np.isfinite(t_s).all() or not (np.diff(t_s) > 0.0).all():
        raise InputError("estimate: t_s must be finite and increase from row to row; sort it, and drop what is twice")
    if t_s[-1] - t_s[0] > LONGEST * (last - first):
        raise InputError(
            f"estimate: t_s goes from {t_s[0]:g} to {t_s[-1]:g}, and the record lasts {last - first:g} s; give seconds"
        )
    if t_s[-1] <= first or t_s[0] >= last:
        raise InputError(
            f"estimate: t_s goes from {t_s[0]:g} to {t_s[-1]:g} s and the record from {first:g} to {last:g} s; they "
            "share no time: give it on the record's clock"
        )


def _require_rotations(quaternion: Array) -> None:
    length = np.sqrt(np.sum(quaternion**2, axis=1))
    known = np.isfinite(length)
    wrong = known & ~((length >= UNIT_LENGTH[0]) & (length <= UNIT_LENGTH[1]))
    if wrong.any():
        raise InputError(f"estimate: qw, qx, qy, qz of row {int(np.argmax(wrong))} has length {length[wrong][0]:g}")


def _missing(names: tuple[str, ...], columns: Mapping[str, Array]) -> str:
    return next(name for name in names if name not in columns)
