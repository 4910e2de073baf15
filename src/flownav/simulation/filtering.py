"""The paper's filter's turn in each epoch, on the readings of the lane buffer; or none flies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.compile import Lanes, Work, equation
from flownav.estimation import paper_filter
from flownav.estimation.kalman import start
from flownav.estimation.paper_filter import STATES, PaperModel
from flownav.simulation import layout


@equation
def start_filter(work: Work, lanes: Lanes, variance: NDArray[np.float64], start_known: bool) -> None:
    """x: the known start, or the first GPS position; velocity zero. P = diag(variance)."""
    start(work, lanes, layout.FILTER, STATES, variance)
    for component in range(3):
        for lane in range(len(lanes)):
            known = work[(layout.HELICOPTER + component) * len(lanes) + lane]
            measured = work[(layout.MEASURED + component) * len(lanes) + lane]
            position = known if start_known else measured
            work[(layout.FILTER.state + component) * len(lanes) + lane] = position


@equation
def run_filter(work: Work, lanes: Lanes, epoch: int, paper: PaperModel | None) -> None:
    """Predict over the last epoch, correct with this one's readings, and say what is estimated.

    The compiler drops the branch where the filter is None.
    """
    if paper is not None:
        run_paper_filter(work, lanes, epoch, paper)
    say_ins_attitude(work, lanes)


@equation
def say_ins_attitude(work: Work, lanes: Lanes) -> None:
    """A filter without an attitude of its own says the INS's."""
    for i in range(4):
        for lane in range(len(lanes)):
            work[(layout.ESTIMATED_ATTITUDE + i) * len(lanes) + lane] = work[(layout.GPS + 6 + i) * len(lanes) + lane]


@equation
def run_paper_filter(work: Work, lanes: Lanes, epoch: int, model: PaperModel) -> None:
    """Equations 24-30; the estimate is the state."""
    if epoch > 0:
        paper_filter.predict(work, lanes, layout.FILTER, layout.INPUT, model)
    paper_filter.update(work, lanes, layout.FILTER, layout.MEASURED, layout.ARRIVED, layout.INNOVATION, model)
    for i in range(STATES):
        diagonal = layout.FILTER.covariance + i * (STATES + 1)
        for lane in range(len(lanes)):
            work[(layout.ESTIMATED + i) * len(lanes) + lane] = work[(layout.FILTER.state + i) * len(lanes) + lane]
            work[(layout.VARIANCE + i) * len(lanes) + lane] = work[diagonal * len(lanes) + lane]
