"""The paper's filter's turn in each epoch, on the readings of the lane buffer; or none flies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import Lanes, Work, equation, replacing
from flownav.estimation import paper_filter
from flownav.estimation.kalman import start
from flownav.estimation.paper_filter import STATES, PaperModel
from flownav.sensors.gps_ins import NavSolution
from flownav.simulation import layout
from flownav.simulation.layout import PLANT
from flownav.simulation.records import Estimated, Measured, PaperState, PaperVariance, Spread
from flownav.vehicle.state import HelicopterState

at_position = replacing(PaperState, "pos_n_m", "pos_e_m", "pos_d_m")
with_motion = replacing(Estimated, *PaperState._fields)
with_attitude = replacing(Estimated, "qw", "qx", "qy", "qz")


@equation
def start_filter(work: Work, lanes: Lanes, variance: NDArray[np.float64], start_known: bool) -> None:
    """x: the known start, or the first GPS position; velocity zero. P = diag(variance)."""
    start(work, lanes, layout.FILTER, STATES, variance)
    start_position(work, lanes, start_known)


@PLANT.on_lanes
def start_position(x: PaperState, state: HelicopterState, measured: Measured, *, start_known: bool) -> PaperState:
    """The filter's state at the known start, or at the first GPS position."""
    return at_position(
        x,
        pos_n_m=state.pos_n if start_known else measured.pos_n_m,
        pos_e_m=state.pos_e if start_known else measured.pos_e_m,
        pos_d_m=state.pos_d if start_known else measured.pos_d_m,
    )


@equation
def run_filter(work: Work, lanes: Lanes, epoch: int, paper: PaperModel | None) -> None:
    """Predict over the last epoch, correct with this one's readings, and say what is estimated.

    The compiler drops the branch where the filter is None.
    """
    if paper is not None:
        run_paper_filter(work, lanes, epoch, paper)
        say_state(work, lanes)
    say_ins_attitude(work, lanes)


@equation
def run_paper_filter(work: Work, lanes: Lanes, epoch: int, model: PaperModel) -> None:
    """Equations 24-30."""
    if epoch > 0:
        paper_filter.predict(work, lanes, layout.FILTER, layout.INPUT, model)
    paper_filter.update(work, lanes, layout.FILTER, layout.MEASURED, layout.ARRIVED, layout.INNOVATION, model)


class Stated(NamedTuple):
    """What the filter says."""

    estimated: Estimated
    spread: Spread


@PLANT.on_lanes
def say_state(said: Estimated, x: PaperState, variance: PaperVariance) -> Stated:
    """The estimate is the state."""
    estimated = with_motion(
        said, pos_n_m=x.pos_n_m, pos_e_m=x.pos_e_m, pos_d_m=x.pos_d_m, vel_u_m_s=x.vel_u_m_s, vel_v_m_s=x.vel_v_m_s,
        vel_w_m_s=x.vel_w_m_s,
    )  # fmt: skip
    return Stated(estimated, Spread(*variance))


@PLANT.on_lanes
def say_ins_attitude(said: Estimated, gps: NavSolution) -> Estimated:
    """A filter without an attitude of its own says the INS's."""
    return with_attitude(said, qw=gps.qw, qx=gps.qx, qy=gps.qy, qz=gps.qz)
