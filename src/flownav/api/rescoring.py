"""Another estimate in the place of a record's own, scored by the functions that score ours."""

from __future__ import annotations

import numpy as np

from flownav.api.given import columns_of_estimate
from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, Record, Table
from flownav.scoring.path import columns_of, path_of, truth_alignment
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
WHOLE = 0.99  # of the instants that are scored: an estimate that covers less is said to


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
    thin = f"the estimate covers {100.0 * covered:.0f} % of what is scored" if covered < WHOLE else ""
    findings = [{"text": thin, "bad": True}] if thin else []
    facts = {"filter": name, "findings": findings, "notes": [], "covered_fraction": covered}
    other = Record(manifest | facts, {"estimate": columns, **tables})
    other.manifest["scores"] = scores_of_other(record, columns)
    return other


def _covered(record: Record, columns: Table) -> float:
    """The share of the instants that are scored (of a replay, of our estimate's) at which the other says a position.

    InputError where it says none at any of them.
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
