"""Refuse a vehicle that cannot be: one line that names the numbers that contradict each other.

Closed forms only (hover by momentum theory and blade elements), so that a bad file is refused at once.
"""

import math

from flownav.core.errors import InputError
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters, full_thrust, hover_speed

HOVER_MARGIN = 1.05  # the thrust and power limits must leave this much above what hover takes
LIFT_MARGIN = 1.2  # a multirotor's rotors must be able to lift this much of the weight


def require_feasible(vehicle: VehicleParameters, where: str) -> None:
    """InputError, naming file, keys and numbers, where the vehicle contradicts itself or cannot hover."""
    require_rigid_body(vehicle, where)
    _require_geometry(vehicle, where)
    _require_hover(vehicle, where)


def require_rigid_body(vehicle: VehicleParameters | MultirotorParameters, where: str) -> None:
    """InputError where no body has such moments of inertia: the largest is more than the other two together."""
    moments = sorted((vehicle.inertia_xx_kg_m2, vehicle.inertia_yy_kg_m2, vehicle.inertia_zz_kg_m2))
    if moments[2] > moments[0] + moments[1]:
        raise InputError(
            f"{where}: body: no rigid body has these inertias, {moments[2]:g} kg m2 is more than "
            f"{moments[0]:g} + {moments[1]:g}; correct inertia_xx, inertia_yy or inertia_zz"
        )


def _require_geometry(vehicle: VehicleParameters, where: str) -> None:
    clear = vehicle.tail_behind_cg_m - vehicle.main_radius_m
    tail_radius = vehicle.tail_tip_speed_m_s / vehicle.tail_speed_rad_s
    if clear < tail_radius and vehicle.tail_above_cg_m > vehicle.hub_above_cg_m - tail_radius:
        raise InputError(
            f"{where}: tail_rotor.behind_cg_m: the rotors strike each other, {vehicle.tail_behind_cg_m:g} m is less "
            f"than main radius + tail radius {vehicle.main_radius_m + tail_radius:g} m; correct radius_m or behind_cg_m"
        )
    if vehicle.cg_above_skid_m + vehicle.tail_above_cg_m < tail_radius:
        raise InputError(
            f"{where}: skids.cg_above_skid_m: the tail rotor strikes the ground when parked, its hub stands "
            f"{vehicle.cg_above_skid_m + vehicle.tail_above_cg_m:g} m high and its radius is {tail_radius:g} m"
        )


def _require_hover(vehicle: VehicleParameters, where: str) -> None:
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    if weight * HOVER_MARGIN > vehicle.main_thrust_limit_n:
        raise InputError(
            f"{where}: main_rotor: cannot hover, the blades stall at {vehicle.main_thrust_limit_n:.1f} N and hover "
            f"takes {weight:.1f} N; correct body.mass_kg, main_rotor.radius_m, chord_m or speed_rad_s"
        )
    inflow = hover_induced_velocity(weight, vehicle.main_thrust_slope_n_s_m, vehicle.main_inflow_speed_m_s)
    collective = hover_pitch(weight, inflow, vehicle.main_thrust_slope_n_s_m, vehicle.main_tip_speed_m_s)
    _require_travel(
        "collective", collective, vehicle.collective_minimum_rad, vehicle.collective_maximum_rad, where, "body.mass_kg"
    )
    torque = vehicle.main_profile_torque_n_m + weight * inflow / vehicle.main_speed_rad_s
    side_force = torque / vehicle.tail_behind_cg_m / vehicle.tail_fin_blockage
    if side_force * HOVER_MARGIN > vehicle.tail_thrust_limit_n:
        raise InputError(
            f"{where}: tail_rotor: cannot hold the heading, the blades stall at {vehicle.tail_thrust_limit_n:.2f} N "
            f"and hover takes {side_force:.2f} N; correct radius_m, chord_m or gear_ratio"
        )
    tail_inflow = hover_induced_velocity(side_force, vehicle.tail_thrust_slope_n_s_m, vehicle.tail_inflow_speed_m_s)
    pedal = hover_pitch(side_force, tail_inflow, vehicle.tail_thrust_slope_n_s_m, vehicle.tail_tip_speed_m_s)
    _require_travel("pedal", pedal, vehicle.pedal_minimum_rad, vehicle.pedal_maximum_rad, where, "tail_rotor")
    power = (
        torque * vehicle.main_speed_rad_s
        + vehicle.tail_profile_torque_n_m * vehicle.tail_speed_rad_s
        + side_force * tail_inflow
    )
    if power * HOVER_MARGIN > vehicle.shaft_power_limit_w:
        raise InputError(
            f"{where}: drive.shaft_power_limit_w: cannot hover, it takes {power:.0f} W and the drive gives "
            f"{vehicle.shaft_power_limit_w:.0f} W"
        )


def _require_travel(control: str, needed: float, low: float, high: float, where: str, blame: str) -> None:
    if not low < needed < high:
        raise InputError(
            f"{where}: {control}: cannot hover, it takes {math.degrees(needed):.2f} deg and the travel is "
            f"{math.degrees(low):g}..{math.degrees(high):g} deg; correct {control}.maximum_deg or {blame}"
        )


def hover_induced_velocity(thrust_n: float, thrust_slope_n_s_m: float, inflow_speed_m_s: float) -> float:
    """v_i [m/s] of a thrust in hover by momentum theory: T = 2ρA·η_w·v_i² = thrust_slope·v_i²/inflow_speed."""
    return math.sqrt(max(thrust_n, 0.0) * inflow_speed_m_s / thrust_slope_n_s_m)


def hover_pitch(thrust_n: float, induced_m_s: float, thrust_slope_n_s_m: float, tip_speed_m_s: float) -> float:
    """Blade pitch [rad] that gives the thrust in hover: T = thrust_slope·(2/3·ΩR·θ - v_i)."""
    return 1.5 * (thrust_n / thrust_slope_n_s_m + induced_m_s) / tip_speed_m_s


def require_multirotor(vehicle: MultirotorParameters, where: str) -> None:
    """InputError, naming file, keys and numbers, where the multirotor contradicts itself or cannot hover."""
    require_rigid_body(vehicle, where)
    apart = 2.0 / vehicle.per_arm_1_m * math.sin(math.pi / vehicle.rotor_count)
    if apart < 2.0 * vehicle.radius_m:
        raise InputError(
            f"{where}: frame.arm_m: the propellers strike each other, their hubs are {apart:.3f} m apart and they are "
            f"{2.0 * vehicle.radius_m:.3f} m wide; correct arm_m or propeller.radius_m"
        )
    if vehicle.volt_per_as <= 0.0:
        raise InputError(f"{where}: battery: empty_v must be less than full_v")
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    hover = hover_speed(vehicle)
    watt = vehicle.rotor_count * vehicle.torque_n_m_s2 * hover**3 / vehicle.efficiency
    under_root = vehicle.full_v**2 - 4.0 * vehicle.resistance_ohm * watt
    sagged = 0.5 * (1.0 + math.sqrt(max(under_root, 0.0)) / vehicle.full_v)
    lift = vehicle.rotor_count * full_thrust(vehicle) * sagged**2
    if under_root <= 0.0 or lift < LIFT_MARGIN * weight:
        raise InputError(
            f"{where}: cannot hover, the rotors lift {lift:.1f} N on the battery as it sags and it weighs {weight:.1f} "
            "N; correct body.mass_kg, motor.full_speed_rad_s, propeller.radius_m or battery.resistance_ohm"
        )
