"""The filter's turn in each epoch: the paper's or the landing filter, on the readings of the lane buffer.

Which filter flies is part of the flight's type (the other one's parameters are None), so that a kernel holds
the code of its own filter alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.compile import equation
from flownav.estimation import paper_filter
from flownav.estimation.kalman import Lanes, Work, start
from flownav.estimation.paper_filter import STATES, PaperModel
from flownav.simulation import layout
from flownav.simulation.landing_filtering import LandingSetup, run_landing_filter, start_landing_filter


@equation
def start_filter(
    work: Work, lanes: Lanes, variance: NDArray[np.float64], start_known: bool, landing: LandingSetup | None
) -> None:
    """x: the known start, or the first GPS position; velocity zero. P = diag(variance), or the landing filter's own."""
    if landing is None:
        start(work, lanes, layout.FILTER, STATES, variance)
        for component in range(3):
            for lane in range(len(lanes)):
                known = work[(layout.HELICOPTER + component) * len(lanes) + lane]
                measured = work[(layout.MEASURED + component) * len(lanes) + lane]
                position = known if start_known else measured
                work[(layout.FILTER.state + component) * len(lanes) + lane] = position
    else:
        start_landing_filter(work, lanes, landing, start_known)


@equation
def run_filter(work: Work, lanes: Lanes, epoch: int, paper: PaperModel | None, landing: LandingSetup | None) -> None:
    """Predict over the last epoch, correct with this one's readings, and say what is estimated.

    The compiler drops a branch whose filter is None, for which the tests must stand nested as they do.
    """
    if landing is None:
        if paper is not None:
            run_paper_filter(work, lanes, epoch, paper)
        say_ins_attitude(work, lanes)
    else:
        run_landing_filter(work, lanes, epoch, landing)


@equation
def say_ins_attitude(work: Work, lanes: Lanes) -> None:
    """A filter without an attitude of its own says the INS's."""
    for i in range(4):
        for lane in range(len(lanes)):
            work[(layout.ESTIMATED_ATTITUDE + i) * len(lanes) + lane] = work[(layout.GPS + 6 + i) * len(lanes) + lane]


# -- the paper's ------------------------------------------------------------------------------------------
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
