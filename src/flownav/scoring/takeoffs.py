"""Take-offs of a block of flights: how far they pass the height that they are told, how long they see no flow there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.scoring.percentiles import spread

Array = NDArray[np.float64]
TAKEOFF_COLUMNS = ("over_commanded_m", "without_flow_s")
UP_SHARE = 0.5  # of the largest commanded height: above it a vehicle is up, and its flow is to be seen


def takeoffs(height_m: Array, commanded_m: Array, sees_flow: Array, period_s: float) -> Array:
    """One row a flight, (lanes, len(TAKEOFF_COLUMNS)), of histories (epochs, lanes); heights are of the skids.

    over_commanded_m: the largest height less the largest commanded one; without_flow_s: how long the flow sensor said
    nothing (sees_flow 0) while the vehicle was above UP_SHARE of the largest commanded height.
    """
    top_m = commanded_m.max(axis=0)
    blind = (height_m > UP_SHARE * top_m) & (sees_flow <= 0.0)
    return np.column_stack([height_m.max(axis=0) - top_m, period_s * blind.sum(axis=0)])


def takeoff_of_flight(row: Array) -> dict[str, float]:
    """One flight's row as the JSON of `flownav fly`."""
    return dict(zip(TAKEOFF_COLUMNS, map(float, row), strict=True))


def takeoff_of_flights(rows: Array) -> dict[str, Any]:
    """Many flights' rows: each number's median, 5th and 95th percentile and the worst; and how many lost the flow."""
    figures: dict[str, Any] = {
        name: {**(spread(rows[:, i]) or {}), "worst": float(rows[:, i].max())} for i, name in enumerate(TAKEOFF_COLUMNS)
    }
    return figures | {"lost_flow": int((rows[:, TAKEOFF_COLUMNS.index("without_flow_s")] > 0.0).sum())}
