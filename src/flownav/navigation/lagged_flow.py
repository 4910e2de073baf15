"""A flow sensor whose dynamics are states of the filter (`estimation.lag`): its law, its step and its start."""

import numpy as np

from flownav.core.compile import Lanes, Work, equation
from flownav.estimation.covariance import forget_lane
from flownav.estimation.lag import FlowLag, lag_of_step
from flownav.estimation.laws.flow import lagged_flow, lagged_flow_rate
from flownav.estimation.states import FLOW_LAG, STATE, STATES_WITH_LAG
from flownav.navigation.kernel_settings import FlowSettings
from flownav.navigation.memory import set_lane


@equation
def observe_lagged(work: Work, lanes: Lanes, component: int, angular: bool, s: FlowSettings) -> None:
    """The law of a component of a sensor whose dynamics are states; there are none for a velocity down."""
    if angular:
        lagged_flow_rate(work, lanes, component, s.flow_lag_c_1_s2, s.flow_below_m)
    else:
        lagged_flow(work, lanes, component, s.flow_lag_c_1_s2)


@equation
def flow_lag(s: FlowSettings, dt_s: float) -> FlowLag:
    """The sensor's dynamics over a step of dt."""
    return lag_of_step(s.flow_lag_b_1_s, s.flow_lag_c_1_s2, dt_s, s.flow_forward_m, s.flow_right_m, s.flow_below_m)


@equation
def start_lag(work: Work, lanes: Lanes, lag: bool | None, lane: int, sigma_m_s: float, s: FlowSettings) -> None:
    """The dynamics of one lane at its start: at rest, as its velocity is, and as unsure, c x1 and sqrt(c) x2 [m/s].

    lag: `covariance.lagged`; nothing where they are no states.
    """
    if lag is not None:
        for i in range(4):
            state = FLOW_LAG + i
            sigma = sigma_m_s / (s.flow_lag_c_1_s2 if i % 2 == 0 else np.sqrt(s.flow_lag_c_1_s2))
            set_lane(work, lanes, STATE + state, lane, 0.0)
            forget_lane(work, lanes, STATES_WITH_LAG, state, lane, sigma * sigma)
