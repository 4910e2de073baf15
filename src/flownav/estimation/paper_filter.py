"""The paper's estimator: equations 24-30 with the printed A_red, B_red, R and Q, at 50 Hz.

State [x y z u v w]: earth position [m], body velocity [m/s]; input [lon lat col ped], perturbations from
trim [rad]; C = I6. The measurement is processed component by component: R is diagonal, so this is
equations 26-30 without the 6x6 inverse (a test holds it against the joint form of FilterPy). Components
that did not arrive (flow not engaged) are left out. There is no innovation test in the paper: the gate is
open.

First the linear algebra on lanes: predict, innovation, test, update. A filter of `n` states lives in a lane buffer (see
`flownav.core.compile`): each scalar of its state and of its covariance is a row of `len(lanes)` values, at the rows
that `KalmanRows` names. `n` and the rows are constants at the call, so that LLVM unrolls the small loops and vectorises
the lane loop. One scalar component at a time is, for uncorrelated noise, algebraically the joint update and needs no
matrix inverse. A component that is not offered or fails its test leaves the lane as it was.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import Lanes, Work, equation


class KalmanRows(NamedTuple):
    """Where a filter's scalars lie in the lane buffer (row numbers)."""

    state: int  # n rows: x
    covariance: int  # n*n rows: P, row by row
    cross: int  # n rows: P h'
    gain: int  # n rows: K
    scratch: int  # n*n rows
    innovation: int  # nu = z - h x
    noise: int  # R of this component
    innovation_variance: int  # S = h P h' + R
    test_ratio: int  # nu^2 / (gate^2 S); above 1 is rejected
    offered: int  # 1.0 where this lane has such a measurement now
    accepted: int  # 1.0 where it was fused


def kalman_rows(first: int, n: int) -> KalmanRows:
    """Rows for a filter of n states, from row `first` on."""
    sizes = (n, n * n, n, n, n * n, 1, 1, 1, 1, 1, 1)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]) + first
    return KalmanRows(*(int(start) for start in starts))


def kalman_row_count(n: int) -> int:
    """How many rows `kalman_rows` takes."""
    return 2 * n * n + 3 * n + 6


@equation
def start(work: Work, lanes: Lanes, rows: KalmanRows, n: int, variance: NDArray[np.float64]) -> None:
    """x = 0 and P = diag(variance), variance (n,)."""
    for i in range(n):
        for lane in range(len(lanes)):
            work[(rows.state + i) * len(lanes) + lane] = 0.0
        for j in range(n):
            for lane in range(len(lanes)):
                work[(rows.covariance + i * n + j) * len(lanes) + lane] = variance[i] if i == j else 0.0


@equation
def propagate_covariance(
    work: Work,
    lanes: Lanes,
    rows: KalmanRows,
    n: int,
    transition: NDArray[np.float64],
    process_noise: NDArray[np.float64],
) -> None:
    """P <- F P F' + Q with one F (n, n) and diagonal Q (n,) for all lanes; exactly symmetric."""
    for i in range(n):
        for j in range(n):
            for lane in range(len(lanes)):
                total = 0.0
                for k in range(n):
                    total += transition[i, k] * work[(rows.covariance + k * n + j) * len(lanes) + lane]
                work[(rows.scratch + i * n + j) * len(lanes) + lane] = total
    for i in range(n):
        for j in range(i, n):
            noise = process_noise[i] if i == j else 0.0
            for lane in range(len(lanes)):
                total = noise
                for k in range(n):
                    total += work[(rows.scratch + i * n + k) * len(lanes) + lane] * transition[j, k]
                work[(rows.covariance + i * n + j) * len(lanes) + lane] = total
                work[(rows.covariance + j * n + i) * len(lanes) + lane] = total


@equation
def test_component(work: Work, lanes: Lanes, rows: KalmanRows, n: int, component: int, gate_sigma: float) -> None:
    """`test_innovation` for a reading of one state itself: h is a unit vector, so P h' is a column of P."""
    for i in range(n):
        for lane in range(len(lanes)):
            entry = work[(rows.covariance + i * n + component) * len(lanes) + lane]
            work[(rows.cross + i) * len(lanes) + lane] = entry
    for lane in range(len(lanes)):
        variance = work[rows.noise * len(lanes) + lane] + work[(rows.cross + component) * len(lanes) + lane]
        work[rows.innovation_variance * len(lanes) + lane] = variance
    judge(work, lanes, rows, n, gate_sigma)


@equation
def judge(work: Work, lanes: Lanes, rows: KalmanRows, n: int, gate_sigma: float) -> None:
    """The test ratio, the verdict and the gain, from P h' and S."""
    per_gate = 1.0 / (gate_sigma * gate_sigma)
    precision = rows.scratch
    for lane in range(len(lanes)):
        per_variance = 1.0 / work[rows.innovation_variance * len(lanes) + lane]
        innovation = work[rows.innovation * len(lanes) + lane]
        ratio = innovation * innovation * per_variance * per_gate
        fused = work[rows.offered * len(lanes) + lane] > 0.0 and ratio <= 1.0
        work[rows.test_ratio * len(lanes) + lane] = ratio
        work[rows.accepted * len(lanes) + lane] = 1.0 if fused else 0.0
        work[precision * len(lanes) + lane] = per_variance
    for i in range(n):
        for lane in range(len(lanes)):
            gain = work[(rows.cross + i) * len(lanes) + lane] * work[precision * len(lanes) + lane]
            fused = work[rows.accepted * len(lanes) + lane] > 0.0
            work[(rows.gain + i) * len(lanes) + lane] = gain if fused else 0.0


@equation
def correct_state(work: Work, lanes: Lanes, rows: KalmanRows, n: int) -> None:
    """x <- x + K nu in the lanes that accepted."""
    for i in range(n):
        for lane in range(len(lanes)):
            fused = work[rows.accepted * len(lanes) + lane] > 0.0
            innovation = work[rows.innovation * len(lanes) + lane] if fused else 0.0
            work[(rows.state + i) * len(lanes) + lane] += work[(rows.gain + i) * len(lanes) + lane] * innovation


@equation
def correct_covariance_short(work: Work, lanes: Lanes, rows: KalmanRows, n: int) -> None:
    """P <- P - K S K' (the paper's equation 30)."""
    for i in range(n):
        for j in range(i, n):
            for lane in range(len(lanes)):
                corrected = work[(rows.covariance + i * n + j) * len(lanes) + lane] - (
                    work[(rows.gain + i) * len(lanes) + lane]
                    * work[rows.innovation_variance * len(lanes) + lane]
                    * work[(rows.gain + j) * len(lanes) + lane]
                )
                work[(rows.covariance + i * n + j) * len(lanes) + lane] = corrected
                work[(rows.covariance + j * n + i) * len(lanes) + lane] = corrected


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
