"""Between metric velocity and the angular flow of PX4's optical-flow messages.

`r` is the distance along the boresight (body z), rates are body rates. PX4's sensor convention:

    flow_x = w_x - v_y/r,   flow_y = w_y + v_x/r
"""

from __future__ import annotations

from flownav.compile import equation


@equation
def angular_flow(
    vel_u_m_s: float, vel_v_m_s: float, rate_p_rad_s: float, rate_q_rad_s: float, range_m: float
) -> tuple[float, float]:
    """(flow_x, flow_y) [rad/s] of a lens that looks along body z; velocities body FRD [m/s]."""
    return rate_p_rad_s - vel_v_m_s / range_m, rate_q_rad_s + vel_u_m_s / range_m


@equation
def metric_flow(
    flow_x_rad_s: float, flow_y_rad_s: float, rate_p_rad_s: float, rate_q_rad_s: float, range_m: float
) -> tuple[float, float]:
    """(vel_u, vel_v) [m/s], body FRD, from angular flow and body rates: the inverse of `angular_flow`."""
    return (flow_y_rad_s - rate_q_rad_s) * range_m, (rate_p_rad_s - flow_x_rad_s) * range_m
