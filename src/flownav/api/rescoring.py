"""Another estimate in the place of a record's own, checked, and scored by the functions that score ours."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.core.record import (
    POSITION_NED,
    PROTECTION_LEVELS,
    QUATERNION,
    TABLES,
    VELOCITY_BODY,
    VELOCITY_NED,
    Record,
    Table,
)
from flownav.scoring.path import columns_of, path_of, truth_alignment
from flownav.scoring.recorded import at_instants, scores_of_other

KNOWN = ("t_s", *TABLES["estimate"], *VELOCITY_NED)
NEEDED = ("t_s", *POSITION_NED)
COLUMN_GROUPS = (VELOCITY_BODY, QUATERNION, VELOCITY_NED, PROTECTION_LEVELS)  # columns that have no meaning one by one
MOST_FLIGHT_LENGTHS = 100.0  # times the flight: such an estimate counts other seconds
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
    for names in COLUMN_GROUPS:
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
    except (TypeError, ValueError, OverflowError):
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
    if t_s[-1] - t_s[0] > MOST_FLIGHT_LENGTHS * (last - first):
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


# tables that our filter wrote, or that lie in the frame of its estimate
OURS = ("states", "innovation", "consistency", "smoothed", "flown", "fed", "autopilot", "estimate")
KINDS = ("fly", "replay")
WHOLE_SHARE = 0.99  # of the instants that are scored: an estimate that covers less is reported


def rescored(record: Record, estimate: object, name: str, *, from_handover: bool) -> Record:
    """The record with that estimate and its scores. InputError for what cannot be scored."""
    kind = record.manifest.get("kind")
    if kind not in KINDS:
        raise InputError(f"a record of kind {kind!r} holds nothing to score against; replay it with flownav.replay")
    columns: dict[str, Array] = columns_of_estimate(estimate, _span(record))
    if from_handover:
        columns = _from_handover(record, columns)
    tables = {key: table for key, table in record.tables.items() if key not in OURS}
    manifest = {key: value for key, value in record.manifest.items() if key not in ("findings", "notes")}
    if "reference" in tables:
        tables["truth"] = _placed(columns, tables["reference"])
    covered = _covered(record, columns)
    thin = f"the estimate covers {100.0 * covered:.0f} % of what is scored" if covered < WHOLE_SHARE else ""
    findings = [{"text": thin, "bad": True}] if thin else []
    facts = {"filter": name, "findings": findings, "notes": [], "covered_fraction": covered}
    other = Record(manifest | facts, {"estimate": columns, **tables})
    other.manifest["scores"] = scores_of_other(record, columns)
    return other


def _covered(record: Record, columns: Table) -> float:
    """The share of the instants that are scored (of a replay, of our estimate's) at which the other has a position.

    InputError where it has none at any of them.
    """
    judged = record.tables.get("judging") if record.manifest["kind"] == "fly" else None
    t_s = np.asarray(record.tables["truth" if judged is not None else "estimate"]["t_s"], float)
    counts = np.ones(len(t_s), bool) if judged is None else np.asarray(judged["counted"], float) > 0.0
    spoken = np.isfinite(at_instants(columns, POSITION_NED, t_s[counts])).all(axis=1)
    if not spoken.any():
        raise InputError("estimate: it says no finite position at any instant that is scored; give another")
    return float(spoken.mean())


def _placed(columns: dict[str, Array], reference: Table) -> Table:
    """A log's truth, turned and shifted onto the estimate; as it stands where the two share no time."""
    placed, position = truth_alignment(path_of(columns), reference), columns_of(reference, POSITION_NED)
    moved = position if placed is None else placed.moved(position)
    return {"t_s": reference["t_s"], **dict(zip(POSITION_NED, moved.T, strict=True))}


def _span(record: Record) -> tuple[float, float]:
    """From when to when the record goes [s]."""
    t_s = record.tables["truth" if record.manifest["kind"] == "fly" else "estimate"]["t_s"]
    return float(t_s[0]), float(t_s[-1])


def _from_handover(record: Record, columns: dict[str, Array]) -> dict[str, Array]:
    """The estimate less its error in place at the last instant before the flight's handover to the filter."""
    facts, truth = record.manifest.get("judging") or {}, record.tables.get("truth")
    if "handover_s" not in facts or truth is None:
        raise InputError("from_handover: only a simulated flight has a handover; leave it out")
    before = np.flatnonzero(np.asarray(truth["t_s"], float) < facts["handover_s"])
    row = before[-1:] if len(before) else np.zeros(1, int)
    t_s = np.asarray(truth["t_s"], float)[row]
    error = at_instants(columns, POSITION_NED, t_s)[0] - columns_of(truth, POSITION_NED)[row[0]]
    if not np.isfinite(error).all():
        raise InputError(f"from_handover: the estimate has no values at {t_s[0]:g} s, the instant of the handover")
    return {**columns, **{name: columns[name] - error[i] for i, name in enumerate(POSITION_NED)}}
