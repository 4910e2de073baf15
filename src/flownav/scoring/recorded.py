"""The scores of a record, from its tables alone, of its own estimate or another one put in its place; and by phase."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.measurement import COLUMNS, Array, Sensor
from flownav.core.record import POSITION_NED, PROTECTION_LEVELS, QUATERNION, VELOCITY_BODY, Column, Record
from flownav.scoring.consistency import aloft, consistency_by_sensor
from flownav.scoring.errors import (
    MAX_POSITION_ERROR,
    STATISTICS,
    attitude_block,
    attitude_scores,
    score_block,
    scores_of_flight,
)
from flownav.scoring.landings import takeoff_of_flight, takeoffs, with_reason
from flownav.scoring.path import References, columns_of, end_drift_of, motion_of, path_scores, truth_motion
from flownav.scoring.phases import Phase, phase_at
from flownav.scoring.reference import drift_of, protection_of
from flownav.scoring.touchdown import Limits, touchdowns
from flownav.scoring.touchdown import motion_of as truth_in_motion

TESTED = ("fused", "innovation_gate")
OF_THE_LOG = ("coverage", "autopilot")  # scores of a replay that no estimate changes
OF_THE_FILTER = ("rejected", "readings", "warnings")

Estimate = Mapping[str, Column]


def scored_table(record: Record) -> str:
    """The table that is scored: the estimate used by the autopilot, where that differs from the filter's."""
    return "flown" if "flown" in record.tables and record.manifest.get("kind") == "fly" else "estimate"


def scores_of_record(record: Record) -> dict[str, Any]:
    """The scores of a record's own estimate, computed anew. InputError where the record cannot be scored."""
    kind = record.manifest.get("kind")
    if kind == "fly":
        return flight_scores(record, record.tables[scored_table(record)])
    if kind != "replay":
        raise InputError(f"a record of kind {kind!r} holds nothing to score it against; replay it with flownav.replay")
    known, own = references_in(record), record.manifest.get("scores", {})
    scores = {**replay_scores(record, record.tables["estimate"]), "consistency": consistency_in(record)}
    explicit = len(known.outages_s)
    if "outage_median_rms_m" in own:  # of replays of their own, one a window
        scores["outages"] += own["outages"][explicit:]
        scores |= {name: own[name] for name in ("outage_median_rms_m", "outage_worst_rms_m")}
    scores |= {name: own[name] for name in (*OF_THE_LOG, *OF_THE_FILTER) if name in own}
    if "smoothed" in record.tables:
        scores["smoothed"] = path_scores(record.tables["smoothed"], known)
    return {name: scores[name] for name in own if name in scores} | scores


def scores_of_other(record: Record, estimate: Estimate) -> dict[str, Any]:
    """Scores of another estimate (columns as record.TABLES["estimate"], t_s and the position at least).

    What an estimate lacks is null. Of a replay what describes the log stays; what our filter made of it goes.
    """
    if record.manifest.get("kind") == "fly":
        return flight_scores(record, estimate)
    own = record.manifest.get("scores", {})
    empty: dict[str, Any] = {"consistency": {}, "rejected": {}, "readings": {}, "warnings": []}
    return replay_scores(record, estimate) | empty | {name: own[name] for name in OF_THE_LOG if name in own}


# -- simulated flights -----------------------------------------------------------------------------------------------
def flight_scores(record: Record, estimate: Estimate) -> dict[str, Any]:
    """Errors of an estimate against the truth of a simulated flight, its touchdown and its take-off.

    InputError where the record does not hold what they need.
    """
    judged, facts = record.tables.get("judging"), record.manifest.get("judging")
    if judged is None or not facts or "truth" not in record.tables:
        raise InputError("this record does not hold what its scores need; fly it again with this flownav")
    truth = record.tables["truth"]
    t_s, states = np.asarray(truth["t_s"], float), (*POSITION_NED, *VELOCITY_BODY)
    estimated, true = at_instants(estimate, states, t_s), columns_of(truth, states)
    counted = np.asarray(judged["counted"], float) * np.isfinite(estimated[:, :3]).all(axis=1)
    motion = truth_in_motion(
        true[:, :3, None], true[:, 3:, None], columns_of(truth, QUATERNION)[:, :, None],
        np.asarray(truth["rate_r_rad_s"], float)[:, None], np.asarray(truth["on_ground"], float)[:, None],
        float(facts["cg_above_skid_m"]),
    )  # fmt: skip
    over_ground = motion._replace(cg_height_m=motion.cg_height_m - np.asarray(judged["ground_m"], float)[:, None])
    error = np.zeros((len(t_s), 2, 1)) if facts["flown_on_truth"] else (estimated - true)[:, :2, None]
    touched = touchdowns(
        t_s, over_ground, error, _column(judged, "pad_seen"), _column(judged, "away"), Limits(**facts["limits"]),
        float(facts["may_land_after_s"]),
    )  # fmt: skip
    row = score_block(estimated[:, :, None], true[:, :, None], touched, counted[:, None])[0]
    end_m = float(over_ground.cg_height_m[-1, 0]) - float(facts["cg_above_skid_m"])
    scores = with_reason(scores_of_flight(_known(row)), end_m, facts)
    return scores | {"takeoff": _takeoff(record, facts), "attitude_deg": attitude_of(record, estimate)}


def attitude_of(record: Record, estimate: Estimate) -> dict[str, Any] | None:
    """Errors of an estimate's attitude against the truth of a simulated flight, as `attitude_scores` has them."""
    truth, counted = record.tables["truth"], np.asarray(record.tables["judging"]["counted"], float)
    estimated = at_instants(estimate, QUATERNION, np.asarray(truth["t_s"], float))
    true = columns_of(truth, QUATERNION)
    return attitude_scores(attitude_block(estimated[:, :, None], true[:, :, None], counted[:, None]))


def _known(row: Array) -> Array:
    """A row of scores in which a state of no number has no largest error either."""
    found = row.copy()
    if np.isnan(found[: 3 * len(STATISTICS)]).any():
        found[MAX_POSITION_ERROR] = np.nan
    return found


def _takeoff(record: Record, facts: Mapping[str, Any]) -> dict[str, float] | None:
    """How a flight took off that starts on the ground; the estimate has no part in it."""
    if not facts["starts_on_ground"]:
        return None
    above, truth, command = float(facts["cg_above_skid_m"]), record.tables["truth"], record.tables["command"]
    height_m, commanded_m = -_column(truth, "pos_d_m") - above, -_column(command, "pos_d_ref_m") - above
    period_s = float(truth["t_s"][1] - truth["t_s"][0])
    sees = _column(record.tables["judging"], "sees_flow")
    return takeoff_of_flight(takeoffs(height_m, commanded_m, sees, period_s)[0])


def at_instants(estimate: Estimate, names: tuple[str, ...], t_s: Array) -> Array:
    """Columns of an estimate (n, len(names)) at instants (n,), linear between its rows; NaN outside and without one."""
    own = np.asarray(estimate["t_s"], float)
    columns = [np.asarray(estimate[name], float) if name in estimate else np.full(len(own), np.nan) for name in names]
    if len(own) == len(t_s) and bool((own == t_s).all()):
        return np.column_stack(columns)
    return np.column_stack([np.interp(t_s, own, column, left=np.nan, right=np.nan) for column in columns])


def _column(table: Mapping[str, Column], name: str) -> Array:
    return np.asarray(table[name], float)[:, None]


# -- replays ---------------------------------------------------------------------------------------------------------
def replay_scores(record: Record, estimate: Estimate) -> dict[str, Any]:
    """Errors of an estimate against what the record of a replay kept of its log."""
    known, judged = references_in(record), record.tables["judging"]
    warned, t_s = np.asarray(judged["flagged"], float), np.asarray(judged["t_s"], float)
    row = np.searchsorted(t_s, np.asarray(estimate["t_s"], float), side="right") - 1
    standing = warned[np.clip(row, 0, len(warned) - 1)] > 0.0  # warnings are our own filter's
    return estimate_scores(estimate, known, record.manifest["duration_s"], standing)


def estimate_scores(
    estimate: Estimate, known: References, duration_s: float, warned: NDArray[np.bool_]
) -> dict[str, Any]:
    """Errors of an estimate against what is known of its log. warned: at which of its instants a warning stands."""
    scores: dict[str, Any] = {
        "duration_s": duration_s,
        **path_scores(estimate, known),
        "end_drift_m": end_drift_of(motion_of(estimate), known),
        "protection": None,
    }
    if set(PROTECTION_LEVELS) <= estimate.keys():  # else it states none
        truth = None if known.truth is None else truth_motion(known.truth, known.heading)
        drift = None if truth is None else drift_of(motion_of(estimate), truth, known.flight_s)
        t_s = np.asarray(estimate["t_s"], float)
        scores["protection"] = protection_of(t_s, columns_of(estimate, PROTECTION_LEVELS), warned, drift)
    return scores


def references_in(record: Record) -> References:
    """The references for a path's scores in the record of a replay. InputError where it lacks them."""
    parameters, facts = record.manifest.get("parameters", {}), record.manifest.get("judging")
    if facts is None or "judging" not in record.tables:
        raise InputError("this record does not hold what its scores need; replay the log again with this flownav")
    flew = facts["flight_s"]
    return References(
        fixes=_readings(record, Sensor.GPS_POSITION),
        speeds=_readings(record, Sensor.GPS_VELOCITY),
        gps_delay_s=float(parameters["gps_delay_s"]),
        outages_s=tuple((float(t0), float(t1)) for t0, t1 in parameters["gps_outages_s"]),
        truth=record.tables.get("reference"),
        truth_name=str(record.manifest.get("truth_name", "")),
        heading=record.tables.get("reference_heading"),
        flight_s=None if flew is None else (float(flew[0]), float(flew[1])),
    )


def _readings(record: Record, sensor: Sensor) -> tuple[Array, Array] | None:
    table = record.tables.get(sensor.name.lower())
    return None if table is None else (np.asarray(table["t_s"], float), columns_of(table, COLUMNS[sensor]))


def consistency_in(record: Record) -> dict[str, dict[str, Any]]:
    """By sensor, whether the innovations that were fused in flight are as large as the filter states."""
    table = record.tables.get("innovation")
    needed = {"sensor", "component", "reason", "innovation", "innovation_variance"}
    if table is None or not needed <= table.keys():  # another estimate states none
        return {}
    sensor, reason = np.asarray(table["sensor"], str), np.asarray(table["reason"], str)
    tested = np.isin(reason, TESTED) & _aloft(record, np.asarray(table["t_s"], float))
    component = np.unique(np.asarray(table["component"], str), return_inverse=True)[1]
    news, variance = (np.asarray(table[name], float) for name in ("innovation", "innovation_variance"))
    fused = reason == TESTED[0]
    return consistency_by_sensor(lambda each: tested & (sensor == each.name.lower()), fused, component, news, variance)


def _aloft(record: Record, t_s: Array) -> NDArray[np.bool_]:
    """Which instants (n,) are in flight: by the truth of a simulated one, else by its landed signal."""
    for name, column in (("truth", "on_ground"), ("landed", "landed")):
        table = record.tables.get(name, {})
        if column in table:
            return aloft(t_s, np.asarray(table["t_s"], float), np.asarray(table[column], float))
    return np.ones(len(t_s), bool)


class PhaseScores(NamedTuple):
    """A phase's errors, NaN where they are not known, and of the values offered to the filter how many were not fused.

    horizontal_rms_m, vertical_rms_m: of the estimate used by the autopilot, or else of the navigator's, against the
    truth, or else GPS. velocity_rms_m_s: of the length of the velocity's error.
    """

    phase: Phase
    horizontal_rms_m: float
    vertical_rms_m: float
    velocity_rms_m_s: float
    offered: int
    rejected: int


def scores_by_phase(record: Record, phases: Sequence[Phase]) -> list[PhaseScores]:
    """A row for each phase. An instant on the border of two belongs to the later one."""
    place, speed = errors_of(record, POSITION_NED), errors_of(record, VELOCITY_BODY)
    table = record.tables.get("innovation", {})
    t_s = np.asarray(table.get("t_s", ()), float)
    fused = np.asarray(table.get("fused", np.ones(len(t_s))), float) > 0.5
    rows = []
    for k, phase in enumerate(phases):
        last = k + 1 == len(phases)
        horizontal, vertical, velocity = (
            _rms(place, phase, slice(0, 2), last),
            _rms(place, phase, slice(2, 3), last),
            _rms(speed, phase, slice(0, 3), last),
        )
        here = _inside(t_s, phase, last)
        rows.append(PhaseScores(phase, horizontal, vertical, velocity, int(here.sum()), int((here & ~fused).sum())))
    return rows


def rejected_mostly_in(record: Record, phases: Sequence[Phase]) -> dict[tuple[str, str], str]:
    """By sensor and reason, the name of the phase in which most of its values were not fused."""
    table = record.tables.get("innovation", {})
    if not phases or not all(name in table for name in ("t_s", "sensor", "fused", "reason")):
        return {}
    rows = np.flatnonzero(np.asarray(table["fused"], float) < 0.5)
    counted: dict[tuple[str, str], Counter[str]] = {}
    for row in rows:
        key = (str(table["sensor"][row]), str(table["reason"][row]))
        counted.setdefault(key, Counter())[phase_at(list(phases), float(table["t_s"][row]))] += 1
    return {key: names.most_common(1)[0][0] for key, names in counted.items()}


def errors_of(record: Record, columns: tuple[str, ...]) -> tuple[Array, Array] | None:
    """Instants (n,) and errors (n, 3) against the truth, of the estimate used by the autopilot or else of the
    navigator's; without a truth those of the position against GPS.
    """
    truth = record.tables.get("truth", {})
    for name in ("flown", "estimate"):
        table = record.tables.get(name, {})
        if len(table.get("t_s", ())) and len(truth.get("t_s", ())) and all(c in table and c in truth for c in columns):
            t_s, known = np.asarray(table["t_s"], float), np.asarray(truth["t_s"], float)
            there = np.column_stack(
                [np.interp(t_s, known, np.asarray(truth[c], float), np.nan, np.nan) for c in columns]
            )
            return t_s, record.matrix(name, columns) - there
    return _against_gps(record, columns) if columns == POSITION_NED else None


def _against_gps(record: Record, columns: tuple[str, ...]) -> tuple[Array, Array] | None:
    """Errors against GPS, at the instants that it describes: its arrival less its delay."""
    gps, estimate = record.tables.get("gps_position", {}), record.tables.get("estimate", {})
    if not all(len(table.get("t_s", ())) and all(c in table for c in columns) for table in (gps, estimate)):
        return None
    delays: Any = record.manifest.get("delays_s")
    delay_s = delays.get("gps_position") if isinstance(delays, Mapping) else None
    t_s = np.asarray(gps["t_s"], float) - (float(delay_s) if isinstance(delay_s, (int, float)) else 0.0)
    known = np.asarray(estimate["t_s"], float)
    ours = np.column_stack([np.interp(t_s, known, estimate[c], np.nan, np.nan) for c in columns])
    error = ours - record.matrix("gps_position", columns)
    error[np.asarray(gps.get("quality", np.full(len(t_s), 255.0)), float) <= 0.0] = np.nan
    return t_s, error


def _rms(errors: tuple[Array, Array] | None, phase: Phase, columns: slice, last: bool) -> float:
    if errors is None:
        return float("nan")
    t_s, error = errors
    squares = (error[_inside(t_s, phase, last), columns] ** 2).sum(axis=1)
    squares = squares[np.isfinite(squares)]
    return float(np.sqrt(squares.mean())) if len(squares) else float("nan")


def _inside(t_s: Array, phase: Phase, last: bool) -> NDArray[np.bool_]:
    return (t_s >= phase.t0) & ((t_s <= phase.t1) if last else (t_s < phase.t1))
