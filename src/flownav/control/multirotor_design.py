"""A multirotor's gains from its control powers: the shape of each loop in units that the control powers take out.

The shape of the horizontal axes is where a local search for the least drift (`control.shaping`'s measure and margins)
ended on the shipped 450 mm quad, its gains then lowered by hand until the loops of both shipped multirotors keep 45
degrees with the inflow held, too; both axes have the same. A share of the rotors' thrust gives the body an angular
acceleration, where a cyclic gives it a rate.
"""

from __future__ import annotations

import math

from flownav.control.gains import AutopilotGains
from flownav.control.loops import OUTER_S
from flownav.vehicle.multirotor_parameters import MultirotorParameters, full_thrust
from flownav.vehicle.multirotor_trim import MultirotorTrim

ATTITUDE_1_S2, ATTITUDE_INTEGRAL_1_S, LEAD_S = 46.0, 0.45, 0.234
POSITION_1_S, VELOCITY_1_S, VELOCITY_INTEGRAL_1_S2 = 0.50, 1.20, 0.11
# heave and yaw: chosen by hand inside the margins; yaw could be faster
HEAVE_RAD_S, HEAVE_INTEGRAL_1_S, HEIGHT_1_S = 4.5, 0.9, 1.2
YAW_RATE_RAD_S, YAW_RATE_INTEGRAL_1_S, HEADING_1_S = 6.0, 1.2, 1.5
GUST_S = 0.109  # the disturbance observer's low-pass
CLIMB_LIMIT_SHARE = 0.25  # of the full thrust, about trim
TILT_LIMIT_SHARE = 0.3
YAW_LIMIT_SHARE = 0.15
SPOOL_S = 1.0  # from hover to idle after touchdown


def multirotor_gains(
    vehicle: MultirotorParameters, hover: MultirotorTrim, *, feels_gusts: bool = True
) -> AutopilotGains:
    """The gains for a multirotor and its trim; its controls are shares (`motors`), where a blade's are angles."""
    roll, pitch, yaw, heave = control_powers(vehicle, hover)
    by_roll, by_pitch = ATTITUDE_1_S2 / roll, ATTITUDE_1_S2 / pitch
    by_yaw, by_heave = YAW_RATE_RAD_S / yaw, HEAVE_RAD_S / heave
    decay = math.exp(-OUTER_S / GUST_S)
    return AutopilotGains(
        position_gain=POSITION_1_S,
        forward_gain=VELOCITY_1_S,
        right_gain=VELOCITY_1_S,
        forward_integral=VELOCITY_INTEGRAL_1_S2,
        right_integral=VELOCITY_INTEGRAL_1_S2,
        gust_share=1.0 if feels_gusts else 0.0,
        gust_decay_forward=decay,
        gust_decay_right=decay,
        height_gain=HEIGHT_1_S,
        collective_gain=by_heave,
        collective_integral=HEAVE_INTEGRAL_1_S * by_heave,
        collective_limit_rad=CLIMB_LIMIT_SHARE,
        pitch_gain=by_pitch,
        pitch_integral=ATTITUDE_INTEGRAL_1_S * by_pitch,
        pitch_damping=LEAD_S * by_pitch,
        roll_gain=by_roll,
        roll_integral=ATTITUDE_INTEGRAL_1_S * by_roll,
        roll_damping=LEAD_S * by_roll,
        cyclic_limit_rad=TILT_LIMIT_SHARE,
        heading_gain=HEADING_1_S,
        yaw_rate_gain=by_yaw,
        yaw_rate_integral=YAW_RATE_INTEGRAL_1_S * by_yaw,
        pedal_limit_rad=YAW_LIMIT_SHARE,
        collective_trim_rad=hover.controls.col,
        pedal_trim_rad=hover.controls.ped,
        lon_trim_rad=hover.controls.lon,
        lat_trim_rad=hover.controls.lat,
        pitch_trim_sine=math.sin(hover.pitch_rad),
        roll_trim_sine=math.sin(hover.roll_rad) * math.cos(hover.pitch_rad),
        idle_collective_rad=vehicle.idle_share,
        spool_rate_rad_s=hover.controls.col / SPOOL_S,
        pad_pos_d_m=-vehicle.cg_above_skid_m,
        skids_below_cg_m=vehicle.cg_above_skid_m,
    )


def control_powers(vehicle: MultirotorParameters, hover: MultirotorTrim) -> tuple[float, float, float, float]:
    """Angular accelerations by lat, lon, ped [rad/s2] and the acceleration by col [m/s2], of one share, in hover."""
    force = full_thrust(vehicle) * (hover.voltage_v / vehicle.full_v) ** 2
    count, arm = vehicle.rotor_count, 1.0 / vehicle.per_arm_1_m
    moment = force * 0.5 * count * arm  # Σx² = Σy² = count·arm²/2, and a rotor's share is lat·y/arm
    torque = force * count * vehicle.torque_n_m_s2 / vehicle.thrust_n_s2
    return (
        moment / vehicle.inertia_xx_kg_m2,
        moment / vehicle.inertia_yy_kg_m2,
        torque / vehicle.inertia_zz_kg_m2,
        force * count / vehicle.mass_kg,
    )
