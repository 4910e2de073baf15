"""The paper's Tables 5 and 6 beside our scores, and where its single flight lies among ours."""

from __future__ import annotations

import csv
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.parameter_files import shipped
from flownav.scoring.errors import SCORE_COLUMNS, STATES

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
