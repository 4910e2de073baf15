"""What a replay says of itself besides its errors: innovations, coverage of the sensors, where the path ended."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, Sensor, Stream
from flownav.estimation.gating import Reason
from flownav.logs.log import Log
from flownav.navigation.flags import flagged, flags_of
from flownav.navigation.rows import EstimateRow, InnovationRow
from flownav.navigation.tables import Written, estimate_table
from flownav.replays.airborne import airborne_of
from flownav.scoring.consistency import consistency_of
from flownav.scoring.coverage import coverage_of
from flownav.scoring.path import motion_of, truth_motion
from flownav.scoring.reference import drift_of, protection_of

NO_REJECTION = (Reason.FUSED, Reason.DATUM)
TESTED = (Reason.FUSED, Reason.INNOVATION_GATE)
# components that a sensor may leave out: a NaN here is nothing told, not a reading that is broken
MAY_BE_LEFT_OUT = ((Sensor.GPS_VELOCITY, 2), (Sensor.FLOW_VELOCITY, 2), (Sensor.PAD, 2))


def consistency_scores(innovation: Array) -> dict[str, dict[str, Any]]:
    """By sensor, of the components that were held against their prediction; innovation: rows of a tape's."""
    offered = InnovationRow.of(innovation)
    tested = np.isin(offered.reason, TESTED)
    found = {}
    for sensor in Sensor:
        rows = InnovationRow.of(innovation[tested & (offered.sensor == sensor)])
        judged = consistency_of(rows.component, rows.innovation, rows.innovation_variance)
        if judged is not None:
            found[sensor.name.lower()] = judged._asdict()
    return found


def told(innovation: Array) -> Array:
    """The offered components without those that their sensor left out (MAVLink's GPS has no vertical velocity).

    A component is left out where it is NaN and another of the same reading is not.
    """
    offered = InnovationRow.of(innovation)
    silent = np.isnan(offered.observation)
    kept = np.ones(len(innovation), bool)
    for sensor, component in MAY_BE_LEFT_OUT:
        of_sensor = offered.sensor == sensor
        beside = np.isin(offered.t_s, offered.t_s[of_sensor & np.isfinite(offered.observation)])
        left_out = (offered.component == component) & silent & (offered.reason == Reason.NOT_FINITE)
        kept &= ~(of_sensor & beside & left_out)
    return np.asarray(innovation[kept])


def reading_scores(innovation: Array, streams: Mapping[Sensor, Stream]) -> dict[str, dict[str, Any]]:
    """By sensor, what became of whole readings, where `rejected` counts components; innovation: rows of a tape's.

    offered to the filter; fused: with every component, or with some of them (in_part); rejected: readings that lost
    one component or more, by reason, with the rows that the reader threw away.
    """
    found = {}
    innovation = told(innovation)
    for sensor, stream in streams.items():
        offers = InnovationRow.of(innovation[InnovationRow.of(innovation).sensor == sensor])
        reading, reason = _readings(offers), offers.reason.astype(int)
        count = int(reading[-1]) + 1 if len(reading) else 0
        components = np.bincount(reading, minlength=count)
        fused = np.bincount(reading, weights=reason == Reason.FUSED, minlength=count)
        lost = {r.label: len(np.unique(reading[reason == r])) for r in Reason if r not in NO_REJECTION}
        rejected = dict(Counter(stream.rejected) + Counter(lost))
        if count or rejected:
            found[sensor.name.lower()] = {
                "offered": count,
                "fused": int(np.count_nonzero((fused == components) & (fused > 0))),
                "in_part": int(np.count_nonzero((fused < components) & (fused > 0))),
                "rejected": rejected,
            }
    return found


def _readings(offers: InnovationRow[Array]) -> NDArray[np.int_]:
    """The number of the reading that each component of one sensor belongs to: components of one count up."""
    if not len(offers.t_s):
        return np.zeros(0, int)
    begins = (np.diff(offers.t_s) != 0.0) | (np.diff(offers.component) <= 0.0)
    return np.concatenate([[0], np.cumsum(begins)]).astype(int)


def coverage_scores(log: Log) -> dict[str, dict[str, float]]:
    """By stream, its first and last reading [s]."""
    return {name: {"t0": first, "t1": last} for name, (first, last) in coverage_of(log.streams).items()}


def protection_scores(log: Log, written: Written) -> dict[str, Any] | None:
    """The levels of a replay, and how often they were exceeded unsaid."""
    rows = written.estimate
    drift = (
        None
        if log.truth is None
        else drift_of(motion_of(estimate_table(rows)), truth_motion(log.truth, log.heading_truth), airborne_of(log))
    )
    said = EstimateRow.of(rows)
    return protection_of(said.t_s, said.protection_m, flagged(said.t_s, flags_of(written.event)), drift)
