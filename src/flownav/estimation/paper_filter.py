"""The paper's estimator: equations 24-30 with the printed A_red, B_red, R and Q, at 50 Hz.

State [x y z u v w]: earth position [m], body velocity [m/s]; input [lon lat col ped], perturbations from
trim [rad]; C = I6. The measurement is processed component by component: R is diagonal, so this is
equations 26-30 without the 6x6 inverse (a test holds it against the joint form of FilterPy). Components
that did not arrive (flow not engaged) are left out. There is no innovation test in the paper: the gate is
open.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import Lanes, Work, equation
from flownav.estimation.kalman import (
    KalmanRows,
    correct_covariance_short,
    correct_state,
    propagate_covariance,
    test_component,
)

STATES = 6
INPUTS = 4
OPEN_GATE_SIGMA = 1e6  # the paper's filter has no gate


class PaperModel(NamedTuple):
    """Discrete model and noises: transition (6, 6), input_matrix (6, 4), and diagonals (6,)."""

    transition: NDArray[np.float64]
    input_matrix: NDArray[np.float64]
    process_noise: NDArray[np.float64]
    measurement_noise: NDArray[np.float64]


@equation
def predict(work: Work, lanes: Lanes, rows: KalmanRows, inputs: int, model: PaperModel) -> None:
    """Equations 24 and 25; `inputs` is the first of the four rows of U [rad, from trim]."""
    for i in range(STATES):
        for lane in range(len(lanes)):
            total = 0.0
            for k in range(STATES):
                total += model.transition[i, k] * work[(rows.state + k) * len(lanes) + lane]
            for k in range(INPUTS):
                total += model.input_matrix[i, k] * work[(inputs + k) * len(lanes) + lane]
            work[(rows.scratch + i) * len(lanes) + lane] = total
    for i in range(STATES):
        for lane in range(len(lanes)):
            work[(rows.state + i) * len(lanes) + lane] = work[(rows.scratch + i) * len(lanes) + lane]
    propagate_covariance(work, lanes, rows, STATES, model.transition, model.process_noise)


@equation
def update(
    work: Work, lanes: Lanes, rows: KalmanRows, measured: int, arrived: int, seen: int, model: PaperModel
) -> None:
    """Equations 26-30, a component at a time; z from row `measured`, and 1.0 from row `arrived` where it came.

    Leaves each component's innovation in the rows from `seen` on and its variance S in the six rows after.
    """
    for component in range(STATES):
        for lane in range(len(lanes)):
            state = work[(rows.state + component) * len(lanes) + lane]
            work[rows.innovation * len(lanes) + lane] = work[(measured + component) * len(lanes) + lane] - state
            work[rows.noise * len(lanes) + lane] = model.measurement_noise[component]
            work[rows.offered * len(lanes) + lane] = work[(arrived + component) * len(lanes) + lane]
        test_component(work, lanes, rows, STATES, component, OPEN_GATE_SIGMA)
        for lane in range(len(lanes)):
            work[(seen + component) * len(lanes) + lane] = work[rows.innovation * len(lanes) + lane]
            variance = work[rows.innovation_variance * len(lanes) + lane]
            work[(seen + STATES + component) * len(lanes) + lane] = variance
        correct_state(work, lanes, rows, STATES)
        correct_covariance_short(work, lanes, rows, STATES)
