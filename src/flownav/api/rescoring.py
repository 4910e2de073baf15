"""Another estimate in the place of a record's own, scored by the functions that score ours."""

from __future__ import annotations

import numpy as np

from flownav.api.given import columns_of_estimate
from flownav.errors import InputError
from flownav.measurement import Array
from flownav.record import POSITION_NED, Record, Table
from flownav.scoring.autopilot import columns_of
from flownav.scoring.path import path_of, truth_alignment
from flownav.scoring.recorded import at_instants, scores_of_other

# tables that our filter wrote, or that lie in the frame of its estimate
OURS = (
    "states",
    "innovation",
    "consistency",
    "smoothed",
    "flown",
    "fed",
    "autopilot",
    "estimate",
)  # tables that our filter wrote
KINDS = ("fly", "replay")


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
    other = Record(manifest | {"filter": name, "findings": [], "notes": []}, {"estimate": columns, **tables})
    other.manifest["scores"] = scores_of_other(record, columns)
    return other


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
    """The estimate less its error in place at the last instant before the flight was handed over to the filter."""
    facts, truth = record.manifest.get("judging") or {}, record.tables.get("truth")
    if "handover_s" not in facts or truth is None:
        raise InputError("from_handover: only a simulated flight is handed over; leave it out")
    before = np.flatnonzero(np.asarray(truth["t_s"], float) < facts["handover_s"])
    row = before[-1:] if len(before) else np.zeros(1, int)
    t_s = np.asarray(truth["t_s"], float)[row]
    error = at_instants(columns, POSITION_NED, t_s)[0] - columns_of(truth, POSITION_NED)[row[0]]
    if not np.isfinite(error).all():
        raise InputError(f"from_handover: the estimate says nothing at {t_s[0]:g} s, when the flight is handed over")
    return {**columns, **{name: columns[name] - error[i] for i, name in enumerate(POSITION_NED)}}
