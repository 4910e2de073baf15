"""The autopilot's gains from a vehicle's control powers.

The shape of a helicopter's loops is the outcome of a search (`tools/shape_gains.py`): of all gains whose loops keep
their margins at every corner of the shipped vehicle's uncertainty box, those with the least error of position in
turbulence. Here it stands in units that the control powers take out, so that another vehicle gets loops of the same
bandwidth; whether they hold on it is printed by `flownav vehicle FILE --margins`.

A multirotor's horizontal axes are where that search (its measure and margins) ended on the roll axis of the shipped 450
mm quad with the inflow held, too; the velocity's integral was then lowered by hand until the loops of both shipped
multirotors keep 45 degrees; both axes have the same. A share of the rotors' thrust gives the body an angular
acceleration, where a cyclic gives it a rate.
"""

import math

from flownav.control.gains import AutopilotGains
from flownav.control.learnt_model import NominalModel
from flownav.control.loops import OUTER_S
from flownav.vehicle import rotor
from flownav.vehicle.feasibility import hover_induced_velocity, hover_pitch
from flownav.vehicle.kinds import AnyTrim, AnyVehicle, disc_of
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters, full_thrust
from flownav.vehicle.trim import MultirotorTrim, Trim

# attitude: a steady cyclic turns the body at 1/τ_f of it per second, τ_f the flapping's time constant
PITCH_RAD_S, PITCH_INTEGRAL_1_S, PITCH_LEAD_S = 5.69, 0.668, 0.1535
ROLL_RAD_S, ROLL_INTEGRAL_1_S, ROLL_LEAD_S = 6.42, 0.647, 0.0700
# heave: acceleration per collective; yaw: angular acceleration per pedal, both with the inflow frozen; heave was
# searched with its own loop alone, yaw chosen by hand, as its search found nothing that keeps the box (control.md)
HEAVE_RAD_S, HEAVE_INTEGRAL_1_S, HEIGHT_1_S = 9.3, 1.57, 1.7
YAW_RATE_RAD_S, YAW_RATE_INTEGRAL_1_S, HEADING_1_S = 12.0, 1.6, 1.5
SINK_SHARE = 0.5  # of the induced velocity: a vortex ring begins there (simulation/ground.py)
INTO_WIND_RAD_S = math.radians(10.0)  # chosen: slow beside the yaw loop, half way round in 18 s
# position and velocity, with gusts felt by the accelerometer and without
FELT = {
    "position_gain": 0.36, "forward_gain": 0.94, "forward_integral": 0.18, "right_gain": 1.40, "right_integral": 0.36,
    "gust_share": 1.0,
}  # fmt: skip
UNFELT = {
    "position_gain": 0.50, "forward_gain": 0.64, "forward_integral": 0.05, "right_gain": 1.03, "right_integral": 0.14,
    "gust_share": 0.0,
}  # fmt: skip
GUST_FORWARD_S, GUST_RIGHT_S = 0.275, 0.19  # the disturbance observer's low-pass: it halves the drift to the right


def gains_for(
    vehicle: AnyVehicle, hover: AnyTrim, idle_collective_rad: float, *, feels_gusts: bool = True
) -> AutopilotGains:
    """The gains for a vehicle of either kind and its trim.

    idle_collective_rad: of a helicopter; a multirotor's file states its own idle. feels_gusts: an accelerometer
    measures gusts (see `unexplained_acceleration`).
    """
    if isinstance(vehicle, MultirotorParameters) and isinstance(hover, MultirotorTrim):
        return multirotor_gains(vehicle, hover, feels_gusts=feels_gusts)
    if isinstance(vehicle, VehicleParameters) and isinstance(hover, Trim):
        return helicopter_gains(vehicle, hover, idle_collective_rad, feels_gusts=feels_gusts)
    raise TypeError("the trim is of another kind of vehicle")


def helicopter_gains(
    vehicle: VehicleParameters, hover: Trim, idle_collective_rad: float, *, feels_gusts: bool = True
) -> AutopilotGains:
    """The gains for a helicopter and its trim."""
    heave_per_collective = vehicle.main_thrust_slope_n_s_m * vehicle.main_tip_speed_m_s * (2.0 / 3.0) / vehicle.mass_kg
    side_per_pedal = vehicle.tail_thrust_slope_n_s_m * vehicle.tail_tip_speed_m_s * (2.0 / 3.0)
    yaw_per_pedal = side_per_pedal * vehicle.tail_behind_cg_m / vehicle.inertia_zz_kg_m2
    collective, yaw = HEAVE_RAD_S / heave_per_collective, YAW_RATE_RAD_S / yaw_per_pedal
    pitch, roll = PITCH_RAD_S / vehicle.flap_rate_1_s, ROLL_RAD_S / vehicle.flap_rate_1_s
    return AutopilotGains(
        **(FELT if feels_gusts else UNFELT),
        gust_decay_forward=math.exp(-OUTER_S / GUST_FORWARD_S),
        gust_decay_right=math.exp(-OUTER_S / GUST_RIGHT_S),
        height_gain=HEIGHT_1_S,
        **_loop("collective", collective, HEAVE_INTEGRAL_1_S),
        **_loop("pitch", pitch, PITCH_INTEGRAL_1_S, PITCH_LEAD_S),
        **_loop("roll", roll, ROLL_INTEGRAL_1_S, ROLL_LEAD_S),
        **_loop("yaw_rate", yaw, YAW_RATE_INTEGRAL_1_S),
        heading_gain=HEADING_1_S,
        into_wind_rad_s=INTO_WIND_RAD_S if feels_gusts else 0.0,
        sink_limit_m_s=SINK_SHARE * hover.induced_velocity_m_s,
        **_at_rest(vehicle, hover),
        idle_collective_rad=idle_collective_rad,
        pedal_per_collective=_pedal_per_collective(vehicle, hover),
    )


SLOP_UNSURE = 0.3  # standard deviation of the dead band, a share: half of the shipped sheet's value


def nominal_model(vehicle: VehicleParameters, hover: Trim, begins: int) -> NominalModel:
    """Beliefs about a helicopter before it is learnt in hover; begins: the epoch of the stir, below 0: never."""
    spring = vehicle.hub_stiffness_n_m_rad + vehicle.hub_above_cg_m * hover.thrust_n
    inflow, tip = hover.induced_velocity_m_s, vehicle.main_tip_speed_m_s
    back = vehicle.flap_response * rotor.blowback(
        hover.collective_rad, 0.0, 0.0, inflow, vehicle.main_lift_solidity, tip
    )  # fmt: skip
    return NominalModel(
        spring / vehicle.inertia_yy_kg_m2, spring / vehicle.inertia_xx_kg_m2, vehicle.flap_rate_1_s,
        vehicle.cyclic_frequency_rad_s, vehicle.cyclic_damping_ratio, vehicle.cyclic_dead_band_rad,
        SLOP_UNSURE * vehicle.cyclic_dead_band_rad, vehicle.per_main_speed_s_rad, float(back / tip), begins,
    )  # fmt: skip


def _at_rest(vehicle: AnyVehicle, hover: AnyTrim) -> dict[str, float]:
    """The controls with which a vehicle hangs in hover, how it hangs, and how high it stands."""
    trims = (f"{name}_trim_rad" for name in ("lon", "lat", "collective", "pedal"))
    pitch_sine, roll_sine = math.sin(hover.pitch_rad), math.sin(hover.roll_rad) * math.cos(hover.pitch_rad)
    standing = {"pad_pos_d_m": -vehicle.cg_above_skid_m, "skids_below_cg_m": vehicle.cg_above_skid_m}
    hanging = dict(zip(trims, hover.controls, strict=True))
    return {**hanging, "pitch_trim_sine": pitch_sine, "roll_trim_sine": roll_sine, **standing}


def _loop(name: str, gain: float, integral_1_s: float, lead_s: float | None = None) -> dict[str, float]:
    """The gains of a loop; its integral and its damping are shares of its gain."""
    damping = {} if lead_s is None else {f"{name}_damping": lead_s * gain}
    return {f"{name}_gain": gain, f"{name}_integral": integral_1_s * gain, **damping}


def _pedal_per_collective(vehicle: VehicleParameters, hover: Trim) -> float:
    """Between hover and blades without lift, where the tail rotor holds the profile torque alone."""
    side = vehicle.main_profile_torque_n_m / vehicle.tail_behind_cg_m / vehicle.tail_fin_blockage
    slope = vehicle.tail_thrust_slope_n_s_m
    pitch = hover_pitch(
        side, hover_induced_velocity(side, slope, vehicle.tail_inflow_speed_m_s), slope, vehicle.tail_tip_speed_m_s
    )
    return (hover.pedal_rad - pitch) / hover.collective_rad


ATTITUDE_1_S2, ATTITUDE_INTEGRAL_1_S, LEAD_S = 46.8, 0.93, 0.251
POSITION_1_S, VELOCITY_1_S, VELOCITY_INTEGRAL_1_S2 = 0.39, 0.99, 0.26
# heave and yaw: chosen by hand inside the margins; yaw could be faster
ROTORS_HEAVE_RAD_S, ROTORS_HEAVE_INTEGRAL_1_S, ROTORS_HEIGHT_1_S = 4.5, 0.9, 1.2
ROTORS_YAW_RATE_RAD_S, ROTORS_YAW_RATE_INTEGRAL_1_S, ROTORS_HEADING_1_S = 6.0, 1.2, 1.5
ROTORS_GUST_S = 0.044  # the disturbance observer's low-pass
# shares of the full thrust: chosen, not measured
CLIMB_LIMIT_SHARE = 0.25  # about trim
TILT_LIMIT_SHARE = 0.3
YAW_LIMIT_SHARE = 0.15
SPOOL_S = 0.25  # from hover to idle, from the first touch on: chosen; on legs half light it slides (control.md)


def multirotor_gains(
    vehicle: MultirotorParameters, hover: MultirotorTrim, *, feels_gusts: bool = True
) -> AutopilotGains:
    """The gains for a multirotor and its trim; its controls are shares (`motors`), where a blade's are angles."""
    roll, pitch, yaw, heave = control_powers(vehicle, hover)
    by_roll, by_pitch = ATTITUDE_1_S2 / roll, ATTITUDE_1_S2 / pitch
    by_yaw, by_heave = ROTORS_YAW_RATE_RAD_S / yaw, ROTORS_HEAVE_RAD_S / heave
    decay = math.exp(-OUTER_S / ROTORS_GUST_S)
    return AutopilotGains(
        position_gain=POSITION_1_S,
        forward_gain=VELOCITY_1_S,
        right_gain=VELOCITY_1_S,
        forward_integral=VELOCITY_INTEGRAL_1_S2,
        right_integral=VELOCITY_INTEGRAL_1_S2,
        gust_share=1.0 if feels_gusts else 0.0,
        gust_decay_forward=decay,
        gust_decay_right=decay,
        height_gain=ROTORS_HEIGHT_1_S,
        **_loop("collective", by_heave, ROTORS_HEAVE_INTEGRAL_1_S),
        **_loop("pitch", by_pitch, ATTITUDE_INTEGRAL_1_S, LEAD_S),
        **_loop("roll", by_roll, ATTITUDE_INTEGRAL_1_S, LEAD_S),
        **_loop("yaw_rate", by_yaw, ROTORS_YAW_RATE_INTEGRAL_1_S),
        collective_limit_rad=CLIMB_LIMIT_SHARE,
        cyclic_limit_rad=TILT_LIMIT_SHARE,
        heading_gain=ROTORS_HEADING_1_S,
        sink_limit_m_s=SINK_SHARE * disc_of(vehicle).induced_m_s,
        pedal_limit_rad=YAW_LIMIT_SHARE,
        **_at_rest(vehicle, hover),
        idle_collective_rad=vehicle.idle_share,
        spool_rate_rad_s=hover.controls.col / SPOOL_S,
        presses_on=1.0,
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
