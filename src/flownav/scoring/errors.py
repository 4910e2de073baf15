"""Errors of an estimate against the truth beside the touchdown: one flight or a block of flights alike.

Histories are `(epochs, columns, lanes)`; a single flight is a block of one lane. The sums run over time in
one order, so a flight scores the same bytes alone and in any block.
"""

import csv
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import equation, kernel, larger, magnitude, sparingly
from flownav.core.frames import heading_from_quaternion, rotation_from_quaternion
from flownav.core.measurement import Array
from flownav.core.parameter_files import shipped
from flownav.core.text import finite_or_none
from flownav.scoring.landings import crashed, succeeded, touchdown_of_flight, touchdown_of_flights
from flownav.scoring.percentiles import spread
from flownav.scoring.touchdown import TOUCHDOWN_COLUMNS

STATES = ("x", "y", "z", "u", "v", "w")
STATISTICS = ("mean_error", "std_error", "rms_error", "max_error")

# one flight's scores as a row: each state's statistics, largest error of one position axis, the touchdown
SCORE_COLUMNS = (
    *(f"{state}.{statistic}" for state in STATES for statistic in STATISTICS),
    "max_position_error_m",
    *(f"touchdown.{name}" for name in TOUCHDOWN_COLUMNS),
)
MAX_POSITION_ERROR = len(STATES) * len(STATISTICS)


class ErrorSums(NamedTuple):
    """Sums of one state's error: sum, sum of squares, largest magnitude, running mean and sum of squares about it."""

    total: float
    squares: float
    largest: float
    mean: float
    about_mean: float


@equation
def with_error(sums: ErrorSums, error: float, count: float) -> ErrorSums:
    """One more error, the `count`-th.

    B. P. Welford, "Note on a method for calculating corrected sums of squares and products", Technometrics 4 (1962).
    """
    off = error - sums.mean
    mean = sums.mean + off / count
    return ErrorSums(
        sums.total + error, sums.squares + error * error, larger(sums.largest, magnitude(error)), mean,
        sums.about_mean + off * (error - mean),
    )  # fmt: skip


@equation
def statistics_of(sums: ErrorSums, count: float) -> tuple[float, float, float, float]:
    """Mean, standard deviation about it, RMS and largest magnitude, as STATISTICS has them; NaN of no error."""
    if count == 0.0:
        return np.nan, np.nan, np.nan, np.nan
    spread, square = sums.about_mean / count, sums.squares / count
    return sums.total / count, np.sqrt(spread), np.sqrt(square), sums.largest


@equation
def _sums_of(kept: Array) -> ErrorSums:
    return ErrorSums(kept[0], kept[1], kept[2], kept[3], kept[4])


@kernel
def put_error_statistics(estimate: Array, truth: Array, counted: Array, result: Array) -> None:
    """Write the result of `error_statistics`."""
    epochs, states, lanes = estimate.shape
    sums, count = np.zeros((states, lanes, 5)), np.zeros(lanes)
    for k in range(epochs):
        for lane in range(lanes):
            if counted[k, lane] > 0.0:
                count[lane] += 1.0
                for state in range(states):
                    now = with_error(
                        _sums_of(sums[state, lane]), estimate[k, state, lane] - truth[k, state, lane], count[lane]
                    )
                    for i in range(5):
                        sums[state, lane, i] = now[i]
    for lane in range(lanes):
        for state in range(states):
            found = statistics_of(_sums_of(sums[state, lane]), count[lane])
            for i in range(4):
                result[lane, state, i] = found[i]


def error_statistics(estimate: Array, truth: Array, counted: Array) -> Array:
    """Mean, standard deviation, RMS and largest absolute error over the steps that count.

    estimate and truth (epochs, states, lanes), counted (epochs, lanes) 0/1 -> (lanes, states, 4), in the order of
    STATISTICS; NaN of a lane in which no step counts. The standard deviation is that of the error about its mean (the
    paper's "difference in standard deviation").
    """
    _, states, lanes = estimate.shape
    result = np.empty((lanes, states, 4))
    sparingly(put_error_statistics, counted.size, estimate, truth, counted, result)
    return result


def score_block(estimate: Array, truth: Array, touchdown: Array, counted: Array) -> Array:
    """Scores of a block of flights, (lanes, len(SCORE_COLUMNS)).

    estimate and truth (epochs, 6, lanes): position NED [m] and velocity body FRD [m/s]; touchdown (lanes,
    len(TOUCHDOWN_COLUMNS)); counted (epochs, lanes) 0/1: the steps whose errors count.
    """
    statistics = error_statistics(estimate, truth, counted)
    largest = statistics[:, :3, 3].max(axis=1)
    return np.column_stack([statistics.reshape(len(statistics), -1), largest, touchdown])


def touchdown_rows(rows: Array) -> Array:
    """The touchdowns of rows of scores, (flights, len(TOUCHDOWN_COLUMNS))."""
    return rows[:, MAX_POSITION_ERROR + 1 :]


def scores_of_flight(row: Array) -> dict[str, Any]:
    """One flight's row of scores as the JSON of `flownav fly`; what is NaN is null."""
    landing = touchdown_rows(row[None, :])
    stated = _nested(lambda column: finite_or_none(float(row[column])))
    return stated | {"touchdown": touchdown_of_flight(landing[0]), "crashed": bool(crashed(landing)[0])}


def scores_of_flights(rows: Array) -> dict[str, Any]:
    """Many flights' scores as the same JSON, each number its median and 5th and 95th percentile."""
    landings = touchdown_rows(rows)
    counts = {"landed": int(succeeded(landings).sum()), "crashed": int(crashed(landings).sum())}
    return _nested(lambda column: spread(rows[:, column])) | {"touchdown": touchdown_of_flights(landings)} | counts


def _nested(number: Any) -> dict[str, Any]:
    """The nested JSON layout of the errors, each leaf from its column in the score row."""
    states = {
        state: {name: number(i * len(STATISTICS) + j) for j, name in enumerate(STATISTICS)}
        for i, state in enumerate(STATES)
    }
    return {"states": states, "max_position_error_m": number(MAX_POSITION_ERROR)}


# -- attitude ----------------------------------------------------------------------------------------------------
ANGLES = ("roll", "pitch", "yaw")


def attitude_block(stated: Array, true: Array, counted: Array) -> Array:
    """STATISTICS of the errors of roll, pitch and yaw [deg] of a block of flights, (lanes, 3, 4).

    stated, true: quaternions body to earth (epochs, 4, lanes); counted (epochs, lanes) 0/1: the steps whose errors
    count.
    """
    apart = euler_deg(*np.moveaxis(stated, 1, 0)) - euler_deg(*np.moveaxis(true, 1, 0))
    within = np.ascontiguousarray(np.moveaxis(apart - 360.0 * np.rint(apart / 360.0), 0, 1))
    counts = counted * np.isfinite(within).all(axis=1)
    found = error_statistics(within, np.zeros_like(within), counts)
    return found


def euler_deg(w: Array, x: Array, y: Array, z: Array) -> Array:
    """Roll, pitch and yaw [deg] of unit quaternions, arrays of any shape: (3, ...), as `frames.euler_from_quaternion`
    has them of one.
    """
    rotation = rotation_from_quaternion(w, x, y, z)  # type: ignore[arg-type]  # of arrays, element by element
    roll, pitch = np.arctan2(rotation[7], rotation[8]), np.arcsin(np.clip(-np.asarray(rotation[6]), -1.0, 1.0))
    return np.asarray(np.degrees([roll, pitch, heading_from_quaternion(w, x, y, z)]))


def attitude_scores(blocks: Array) -> dict[str, Any] | None:
    """Errors of attitude [deg] as the JSON of `flownav fly`, blocks (flights, 3, 4): of one flight each number, of many
    its median and 5th and 95th percentile; None where no attitude was estimated.
    """
    if not np.isfinite(blocks).any():
        return None
    one = len(blocks) == 1
    return {
        angle: {
            name: finite_or_none(float(blocks[0, i, j])) if one else spread(blocks[:, i, j])
            for j, name in enumerate(STATISTICS)
        }
        for i, angle in enumerate(ANGLES)
    }


def attitude_rms(blocks: Array | None) -> dict[str, float | None]:
    """RMS error of roll, pitch and yaw [deg] over all flights, blocks (flights, 3, 4); null without an estimate."""
    if blocks is None or not np.isfinite(blocks).any():
        return dict.fromkeys(ANGLES)
    squares = np.nanmean(blocks[:, :, STATISTICS.index("rms_error")] ** 2, axis=0)
    return {angle: finite_or_none(float(np.sqrt(square))) for angle, square in zip(ANGLES, squares, strict=True)}


# -- the paper's Tables 5 and 6 beside ours ----------------------------------------------------------------------
TABLES = {5: "paper_table5_takeoff.csv", 6: "paper_table6_landing.csv"}


def published(number: int | None) -> dict[str, Any] | None:
    """The published Table 5 (take-off) or 6 (landing), or None where there is none to compare with."""
    if number is None:
        return None
    with shipped(TABLES[number]).open(encoding="utf-8") as file:
        rows = {row["state"]: row for row in csv.DictReader(file)}
    states = {
        state: {statistic: float(rows[key][statistic]) for statistic in ("mean_error", "std_error")}
        for key in rows
        for state in STATES
        if key in (f"{state}_m", f"{state}_m_s")
    }
    largest = float(rows["max_position_difference_m"]["mean_error"])
    return {"title": f"Table {number}", "states": states, "max_position_error_m": largest}


def percentile_of_paper(rows: NDArray[np.float64], table: dict[str, Any]) -> dict[str, Any]:
    """The percentage of our flights whose figure is below the paper's: |mean error|, std error and largest error.

    rows (flights, len(SCORE_COLUMNS)).
    """

    def share_below(column: str, value: float) -> float:
        ours = np.abs(rows[:, SCORE_COLUMNS.index(column)])
        return float(100.0 * np.mean(ours < abs(value)))

    states = {
        state: {statistic: share_below(f"{state}.{statistic}", value) for statistic, value in entry.items()}
        for state, entry in table["states"].items()
    }
    largest = share_below("max_position_error_m", table["max_position_error_m"])
    return {"states": states, "max_position_error_m": largest}
