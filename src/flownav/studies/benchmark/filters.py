"""Steps of the filters and their parts, each in a bare loop, for timing."""

import numpy as np

from flownav.core.compile import Lanes, Work, kernel, pointer
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import Array
from flownav.estimation import paper_filter, states
from flownav.estimation.covariance import at, correct, expect, settle
from flownav.estimation.error_models import FilterSettings, propagate_walks
from flownav.estimation.kalman import kalman_row_count, kalman_rows
from flownav.estimation.motion import predict
from flownav.estimation.paper_filter import PaperModel

SETTINGS = FilterSettings(
    accel_noise_m_s2_rt_hz=0.05, gyro_noise_rad_s_rt_hz=0.004, accel_walk_m_s2_rt_s=0.003, gyro_walk_rad_s_rt_s=1e-4,
    position_walk_m_rt_s=0.01,
    gps_slow_sigma_m=1.5, gps_slow_sigma_down_m=2.5, gps_slow_tau_s=300.0,
    gps_fast_sigma_m=0.5, gps_fast_sigma_down_m=1.0, gps_fast_tau_s=20.0,
    gps_velocity_sigma_m_s=0.1, gps_velocity_sigma_down_m_s=0.1, gps_velocity_tau_s=5.0,
    ins_tilt_sigma_rad=0.01, ins_tilt_tau_s=30.0, ins_heading_sigma_rad=0.15, ins_heading_tau_s=3e4,
    ground_walk_m_rt_s=0.05, baro_walk_m_rt_s=0.1, pad_walk_m_rt_s=0.0, flow_scale_sigma=0.03,
    gate_sigma=5.0, accel_bias_limit_m_s2=0.6, gyro_bias_limit_rad_s=0.15,
)  # fmt: skip


def standing(lanes: Lanes, n: int = states.STATES) -> Array:
    """A buffer of filters that hover 5 m above the ground."""
    rows = np.zeros((states.FILTER_ROWS, len(lanes)))
    rows[states.QUATERNION] = rows[states.OFFERED] = rows[states.INNOVATION_VARIANCE] = 1.0
    rows[states.IMU + 5] = -GRAVITY_M_S2
    rows[states.STATE + states.POSITION + 2] = -5.0
    rows[states.ACCEL_NOISE : states.ACCEL_NOISE + 2] = SETTINGS.accel_noise_m_s2_rt_hz**2
    rows[states.GYRO_NOISE] = SETTINGS.gyro_noise_rad_s_rt_hz**2
    for i in range(n):
        rows[at(i, i)] = 0.01
    rows[states.OBSERVED : states.OBSERVED + 11] = np.array([10, 3, 4, 5, 6, 7, 8, 29, 2, 27, 9])[
        :, None
    ]  # as a flow rate
    rows[states.COEFFICIENT : states.COEFFICIENT + 9], rows[states.CROSS : states.CROSS + n], rows[states.NOISE] = (
        0.1,
        1e-8,
        1.0,
    )
    return rows.reshape(-1)


@kernel
def correct_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """State and covariance corrected."""
    work = pointer(buffer)
    for _ in range(steps):
        for lane in range(len(lanes)):
            work[states.ACCEPTED * len(lanes) + lane] = 1.0
        correct(work, lanes, states.STATES)


@kernel
def offer_nothing(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """A reading that no lane offers."""
    work = pointer(buffer)
    for lane in range(len(lanes)):
        work[states.OFFERED * len(lanes) + lane] = 0.0
    for _ in range(steps):
        expect(work, lanes, states.STATES, False)
        settle(work, lanes, states.STATES, 5.0)


@kernel
def predict_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """A prediction with its random walks."""
    work = pointer(buffer)
    for _ in range(steps):
        predict(work, lanes, states.STATES, 1e-4, settings)
        propagate_walks(work, lanes, 1e-4, settings)


# -- the paper's filter ------------------------------------------------------------------------------------------
FILTER = kalman_rows(0, paper_filter.STATES)
INPUT = kalman_row_count(paper_filter.STATES)
MEASURED = INPUT + paper_filter.INPUTS
ARRIVED = MEASURED + paper_filter.STATES
SEEN = ARRIVED + paper_filter.STATES
PAPER_ROWS = SEEN + 2 * paper_filter.STATES


@kernel
def run_paper_filter(work: Work, lanes: Lanes, steps: int, model: PaperModel) -> None:
    """Predict and update `steps` times with every component present; work (PAPER_ROWS * len(lanes),)."""
    for lane in range(len(lanes)):
        for component in range(paper_filter.STATES):
            work[(ARRIVED + component) * len(lanes) + lane] = 1.0
    for _ in range(steps):
        paper_filter.predict(work, lanes, FILTER, INPUT, model)
        paper_filter.update(work, lanes, FILTER, MEASURED, ARRIVED, SEEN, model)
