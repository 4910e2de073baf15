"""Errors of an estimate against the truth, and the touchdown: one flight or a block of flights alike.

Histories are `(epochs, columns, lanes)`; a single flight is a block of one lane. The sums run over time in
one order, so a flight scores the same bytes alone and in any block.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.compile import kernel

STATES = ("x", "y", "z", "u", "v", "w")
STATISTICS = ("mean_error", "std_error", "rms_error", "max_error")
TOUCHDOWN = ("t_s", "horizontal_error_m", "sink_rate_m_s")
CRASH_SINK_RATE_M_S = 2.0
AIRBORNE_EPOCHS = 25  # half a second without contact: skids flutter at lift-off

# one flight's scores as a row: each state's statistics, largest error of one position axis, touchdown, crashed 0/1
SCORE_COLUMNS = (
    *(f"{state}.{statistic}" for state in STATES for statistic in STATISTICS),
    "max_position_error_m",
    *(f"touchdown.{name}" for name in TOUCHDOWN),
    "crashed",
)
MAX_POSITION_ERROR = len(STATES) * len(STATISTICS)
CRASHED = len(SCORE_COLUMNS) - 1

Array = NDArray[np.float64]


@kernel
def error_statistics(estimate: Array, truth: Array, counted: Array) -> Array:
    """Mean, standard deviation, RMS and largest absolute error over the steps that count.

    estimate and truth (epochs, states, lanes), counted (epochs, lanes) 0/1 -> (lanes, states, 4), in the order of
    STATISTICS; NaN of a lane in which no step counts. The standard deviation is that of the error about its mean (the
    paper's "difference in standard deviation").
    """
    epochs, states, lanes = estimate.shape
    total, squares, largest = np.zeros((states, lanes)), np.zeros((states, lanes)), np.zeros((states, lanes))
    count = np.zeros(lanes)
    for k in range(epochs):
        for lane in range(lanes):
            if counted[k, lane] > 0.0:
                count[lane] += 1.0
                for state in range(states):
                    error = estimate[k, state, lane] - truth[k, state, lane]
                    total[state, lane] += error
                    squares[state, lane] += error * error
                    largest[state, lane] = max(largest[state, lane], abs(error))
    spread = np.zeros((states, lanes))
    for k in range(epochs):
        for lane in range(lanes):
            if counted[k, lane] > 0.0:
                for state in range(states):
                    error = estimate[k, state, lane] - truth[k, state, lane]
                    spread[state, lane] += (error - total[state, lane] / count[lane]) ** 2
    result = np.empty((lanes, states, 4))
    for lane in range(lanes):
        for state in range(states):
            result[lane, state, 0] = total[state, lane] / count[lane]
            result[lane, state, 1] = np.sqrt(spread[state, lane] / count[lane])
            result[lane, state, 2] = np.sqrt(squares[state, lane] / count[lane])
            result[lane, state, 3] = largest[state, lane] if count[lane] > 0.0 else np.nan
    return result


@kernel
def first_contact(t_s: Array, position: Array, sink_rate: Array, on_ground: Array) -> Array:
    """Time, distance from the pad's centre and sink rate of the first ground contact after being airborne.

    t_s (epochs,), position (epochs, 3, lanes) NED [m], sink_rate (epochs, lanes) downward [m/s], on_ground
    (epochs, lanes) 0/1 -> (lanes, 3); NaN where a flight never touches. The sink rate is that of the last
    epoch before contact.
    """
    epochs, lanes = on_ground.shape
    result = np.full((lanes, 3), np.nan)
    for lane in range(lanes):
        without_contact = 0
        for k in range(epochs):
            touching = on_ground[k, lane] > 0.0
            if touching and without_contact >= AIRBORNE_EPOCHS:
                result[lane, 0] = t_s[k]
                result[lane, 1] = np.sqrt(position[k, 0, lane] ** 2 + position[k, 1, lane] ** 2)
                result[lane, 2] = sink_rate[k - 1, lane]
                break
            without_contact = 0 if touching else without_contact + 1
    return result


def score_block(
    t_s: Array, estimate: Array, truth: Array, sink_rate: Array, on_ground: Array, *, may_land_after_s: float,
    counted: Array | None = None,
) -> Array:  # fmt: skip
    """Scores of a block of flights, (lanes, len(SCORE_COLUMNS)).

    estimate and truth (epochs, 6, lanes): position NED [m] and velocity body FRD [m/s]; counted (epochs, lanes) 0/1:
    the steps whose errors count, all where it is None. A first contact before `may_land_after_s`, or harder than
    CRASH_SINK_RATE_M_S, is a crash; an earlier one is no touchdown.
    """
    statistics = error_statistics(estimate, truth, np.ones_like(on_ground) if counted is None else counted)
    lanes = statistics.shape[0]
    contact = first_contact(t_s, truth[:, :3], sink_rate, on_ground)
    too_early = contact[:, 0] < may_land_after_s
    crashed = too_early | (contact[:, 2] > CRASH_SINK_RATE_M_S)
    landing = np.where(too_early[:, None], np.nan, contact)
    largest = statistics[:, :3, 3].max(axis=1)
    return np.column_stack([statistics.reshape(lanes, -1), largest, landing, crashed])


def scores_of_flight(row: Array) -> dict[str, Any]:
    """One flight's row of scores as the JSON of `flownav fly`; what is NaN is null."""
    return _nested(lambda column: _finite(float(row[column]))) | {"crashed": bool(row[CRASHED])}


def scores_of_flights(rows: Array) -> dict[str, Any]:
    """Many flights' scores as the same JSON, each number its median and 5th and 95th percentile."""

    def spread(column: int) -> dict[str, float] | None:
        values = rows[~np.isnan(rows[:, column]), column]
        if not len(values):
            return None
        low, median, high = np.percentile(values, [5, 50, 95])
        return {"median": float(median), "p05": float(low), "p95": float(high)}

    landed = np.isfinite(rows[:, MAX_POSITION_ERROR + 1]) & (rows[:, CRASHED] == 0.0)
    return _nested(spread) | {"landed": int(landed.sum()), "crashed": int(rows[:, CRASHED].sum())}


def _nested(number: Any) -> dict[str, Any]:
    """The nested JSON layout, each leaf from its column in the score row."""
    states = {
        state: {name: number(i * len(STATISTICS) + j) for j, name in enumerate(STATISTICS)}
        for i, state in enumerate(STATES)
    }
    landing = {name: number(MAX_POSITION_ERROR + 1 + j) for j, name in enumerate(TOUCHDOWN)}
    return {
        "states": states,
        "max_position_error_m": number(MAX_POSITION_ERROR),
        "touchdown": None if landing["t_s"] is None else landing,
    }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
