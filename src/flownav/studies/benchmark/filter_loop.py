"""A bare loop of filter steps, for timing."""

from __future__ import annotations

from flownav.core.compile import Lanes, Work, kernel
from flownav.estimation import paper_filter
from flownav.estimation.kalman import kalman_row_count, kalman_rows
from flownav.estimation.paper_filter import INPUTS, STATES, PaperModel

FILTER = kalman_rows(0, STATES)
INPUT = kalman_row_count(STATES)
MEASURED = INPUT + INPUTS
ARRIVED = MEASURED + STATES
SEEN = ARRIVED + STATES
ROWS = SEEN + 2 * STATES


@kernel
def run_paper_filter(work: Work, lanes: Lanes, steps: int, model: PaperModel) -> None:
    """Predict and update `steps` times with every component present; work (ROWS * len(lanes),)."""
    for lane in range(len(lanes)):
        for component in range(STATES):
            work[(ARRIVED + component) * len(lanes) + lane] = 1.0
    for _ in range(steps):
        paper_filter.predict(work, lanes, FILTER, INPUT, model)
        paper_filter.update(work, lanes, FILTER, MEASURED, ARRIVED, SEEN, model)
