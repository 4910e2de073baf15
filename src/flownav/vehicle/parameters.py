"""The parameters of a helicopter and of a multirotor: the flat bundle that kernels take, made of a file's numbers."""

import math
from typing import NamedTuple

from flownav.core.parameter_files import in_si, record_of
from flownav.vehicle.schema import MainRotor, MultirotorFile, TailRotor, VehicleFile

ROTOR_INERTIA = 1.15  # of all that turns with the main rotor, over that of its blades, where a file states none


class VehicleParameters(NamedTuple):
    """A helicopter, SI units and radians; what is derived from the file says how.

    Of each rotor, with blade area b·c·R, solidity σ = b·c/(πR) and lift slope a:
    `inflow_speed` = a·σ·ΩR/(8·η_w), the only constant of the inflow balance; `thrust_slope` = ρ·a·b·c·R·ΩR/4,
    thrust per inflow that the blades see; `thrust_limit` = ρ·πR²·(ΩR)²·σ·(C_T/σ)_stall; `profile_torque` =
    ρ·b·c·R²·(ΩR)²·C_D0/8, the blades' drag torque without lift.
    """

    gravity_m_s2: float
    air_density_kg_m3: float
    mass_kg: float
    inertia_xx_kg_m2: float
    inertia_yy_kg_m2: float
    inertia_zz_kg_m2: float
    # main rotor
    main_radius_m: float
    main_speed_rad_s: float
    main_tip_speed_m_s: float
    main_inflow_speed_m_s: float
    main_thrust_slope_n_s_m: float
    main_thrust_limit_n: float
    main_profile_torque_n_m: float
    main_inplane_drag_n_s_m: float  # H-force per in-plane airspeed, ρ·b·c·R·ΩR·C_D0/4
    main_lift_solidity: float  # a·σ
    main_disc_kg_m: float  # 2ρA·η_w
    per_main_speed_s_rad: float  # 1/Ω; of what a kernel would divide by at every stage, the reciprocal
    per_inflow_mass_1_kg: float  # of the air that the rotor drags along, factor·ρπR³
    hub_stiffness_n_m_rad: float
    hub_above_cg_m: float
    flap_rate_1_s: float  # 1/τ_f = γ·Ω/16, Lock number γ = ρ·a·c·R⁴/I_β
    flap_response: float  # K_μ, flapping per in-plane airspeed against the ideal rotor
    # tail rotor
    tail_speed_rad_s: float
    tail_gear_ratio: float  # its speed over the main rotor's
    tail_tip_speed_m_s: float
    tail_inflow_speed_m_s: float
    tail_thrust_slope_n_s_m: float
    tail_thrust_limit_n: float
    tail_profile_torque_n_m: float
    tail_fin_blockage: float  # share of the tail thrust that the fin leaves
    tail_behind_cg_m: float
    tail_above_cg_m: float
    # airframe
    fuselage_area_x_m2: float
    fuselage_area_y_m2: float
    fuselage_area_z_m2: float
    vertical_fin_area_m2: float
    vertical_fin_lift_slope_per_rad: float
    vertical_fin_tail_inflow_fraction: float
    horizontal_fin_area_m2: float
    horizontal_fin_lift_slope_per_rad: float
    horizontal_fin_behind_cg_m: float
    horizontal_fin_main_inflow_fraction: float
    # skids
    cg_above_skid_m: float
    skid_half_length_m: float
    skid_half_track_m: float
    skid_stiffness_n_m: float
    skid_damping_n_s_m: float
    skid_friction_coefficient: float
    # actuators, at the blade
    cyclic_frequency_rad_s: float
    cyclic_damping_ratio: float
    cyclic_rate_limit_rad_s: float
    cyclic_minimum_rad: float
    cyclic_maximum_rad: float
    cyclic_dead_band_rad: float
    collective_frequency_rad_s: float
    collective_damping_ratio: float
    collective_rate_limit_rad_s: float
    collective_minimum_rad: float
    collective_maximum_rad: float
    collective_dead_band_rad: float
    pedal_frequency_rad_s: float
    pedal_damping_ratio: float
    pedal_rate_limit_rad_s: float
    pedal_minimum_rad: float
    pedal_maximum_rad: float
    pedal_dead_band_rad: float
    # drive
    shaft_power_limit_w: float
    rotor_inertia_kg_m2: float
    per_rotor_inertia_1_kg_m2: float
    governor_w_s_rad: float
    governor_integral_w_rad: float


class TouchdownLimits(NamedTuple):
    """Limits of a touchdown that the vehicle withstands, as the file has them.

    pad_radius_m: of the pad that a scenario's camera is to find; farther out the vehicle has not landed on it.
    """

    max_sink_rate_m_s: float
    max_lateral_speed_m_s: float
    max_tilt_deg: float
    max_yaw_rate_deg_s: float
    max_slide_m: float
    pad_radius_m: float


def touchdown_limits(file: VehicleFile | MultirotorFile, pad_radius_m: float = math.inf) -> TouchdownLimits:
    """The limits of a checked file."""
    return TouchdownLimits(**file.touchdown.model_dump(), pad_radius_m=pad_radius_m)


def of_either_kind(file: VehicleFile | MultirotorFile) -> dict[str, float]:
    """The file's numbers in SI, those that the bundles of both kinds of vehicle have by their names there."""
    return (
        in_si(file) | in_si(file.environment) | in_si(file.body) | in_si(file.skids) | in_si(file.skids, "skid_")
    )  # fmt: skip


def flatten(file: VehicleFile) -> VehicleParameters:
    """The checked file as the flat bundle, angles in radians, rotor constants derived."""
    main, tail, rho = file.main_rotor, file.tail_rotor, file.environment.air_density_kg_m3
    tail_speed = tail.gear_ratio * main.speed_rad_s
    main_area = _blade_area_m2(main)
    main_tip = main.speed_rad_s * main.radius_m
    lock_number = rho * main.lift_slope_per_rad * main.chord_m * main.radius_m**4 / main.blade_flap_inertia_kg_m2
    inertia = file.drive.rotor_inertia_kg_m2 or ROTOR_INERTIA * main.blade_count * main.blade_flap_inertia_kg_m2
    rotors = in_si(main) | in_si(main, "main_") | in_si(tail, "tail_")
    return record_of(
        VehicleParameters,
        of_either_kind(file) | rotors | in_si(file.drive),
        **_rotor("main", main, main.speed_rad_s, rho),
        **_rotor("tail", tail, tail_speed, rho),
        main_inplane_drag_n_s_m=rho * main_area * main_tip * main.profile_drag_coefficient / 4.0,
        main_lift_solidity=main.lift_slope_per_rad * _solidity(main),
        main_disc_kg_m=2.0 * rho * math.pi * main.radius_m**2 * main.wake_efficiency,
        per_main_speed_s_rad=1.0 / main.speed_rad_s,
        per_inflow_mass_1_kg=1.0 / (main.inflow_mass_factor * rho * math.pi * main.radius_m**3),
        flap_rate_1_s=lock_number * main.speed_rad_s / 16.0,
        tail_speed_rad_s=tail_speed,
        rotor_inertia_kg_m2=inertia,
        per_rotor_inertia_1_kg_m2=1.0 / inertia,
        governor_w_s_rad=file.drive.governor_gain_s_rad * file.drive.shaft_power_limit_w,
        governor_integral_w_rad=file.drive.governor_integral_1_rad * file.drive.shaft_power_limit_w,
    )


def without_slop(vehicle: VehicleParameters) -> VehicleParameters:
    """The vehicle whose servos answer every error: linear about a trim, and the paper's."""
    return vehicle._replace(cyclic_dead_band_rad=0.0, collective_dead_band_rad=0.0, pedal_dead_band_rad=0.0)


def _blade_area_m2(rotor: MainRotor | TailRotor) -> float:
    return rotor.blade_count * rotor.chord_m * rotor.radius_m


def _solidity(rotor: MainRotor | TailRotor) -> float:
    return _blade_area_m2(rotor) / (math.pi * rotor.radius_m**2)


def _rotor(name: str, rotor: MainRotor | TailRotor, speed_rad_s: float, rho: float) -> dict[str, float]:
    """Parameters derived of both rotors alike, as `VehicleParameters` has them."""
    area, slope, tip = _blade_area_m2(rotor), rotor.lift_slope_per_rad, speed_rad_s * rotor.radius_m
    return {
        f"{name}_tip_speed_m_s": tip,
        f"{name}_inflow_speed_m_s": slope * _solidity(rotor) * tip / (8.0 * rotor.wake_efficiency),
        f"{name}_thrust_slope_n_s_m": rho * slope * area * tip / 4.0,
        f"{name}_thrust_limit_n": rho * area * tip**2 * rotor.stall_blade_loading,
        f"{name}_profile_torque_n_m": rho * area * rotor.radius_m * tip**2 * rotor.profile_drag_coefficient / 8.0,
    }


class MultirotorParameters(NamedTuple):
    """A multirotor, SI units and radians. It begins as `VehicleParameters` does: kernels read these of either kind.

    Of each propeller at a speed Ω: `thrust` k_T, T = k_T·Ω² in still air; `torque` k_Q likewise; `axial` dT/dw = this·Ω
    per velocity against the thrust; `inplane` dT/dV² for slow V, the translational lift; `hover_inflow` v_i = this·Ω.
    The last three are momentum theory and blade elements about the propeller's own hover: T = S·(Θ - v_i + w),
    v_i·√(V² + (v_i - w)²) = T/2ρA, S = ρ·a·b·c·R²·Ω/4, all of which scale with Ω. The air that passes the disc takes
    the power T·(v_i - w), so a thrust that is larger by dT takes `torque_of_thrust`·dT, to first order.
    """

    gravity_m_s2: float
    air_density_kg_m3: float
    mass_kg: float
    inertia_xx_kg_m2: float
    inertia_yy_kg_m2: float
    inertia_zz_kg_m2: float
    # places of the rotors, clockwise from the front right; they turn left, right, left, ... seen from above
    x_1_m: float
    y_1_m: float
    x_2_m: float
    y_2_m: float
    x_3_m: float
    y_3_m: float
    x_4_m: float
    y_4_m: float
    x_5_m: float
    y_5_m: float
    x_6_m: float
    y_6_m: float
    rotor_count: float
    per_arm_1_m: float
    rotors_above_cg_m: float
    # propellers
    radius_m: float
    thrust_n_s2: float
    torque_n_m_s2: float
    torque_of_thrust_m: float
    axial_n_s2_m: float
    axial_held_n_s2_m: float  # the same while v_i keeps its value
    inplane_n_s2_m2: float
    hover_inflow_m: float
    inplane_drag_n_s2_m_rad: float  # H-force per in-plane airspeed and speed
    flap_back_m: float  # tilt of the disc = this·V/(Ω·R²), against the airspeed
    hub_stiffness_n_m_rad: float
    rotor_inertia_kg_m2: float
    # motors
    motor_rate_1_s: float
    full_speed_rad_s: float
    idle_share: float
    efficiency: float
    # battery
    full_v: float
    volt_per_as: float
    resistance_ohm: float
    # airframe
    fuselage_area_x_m2: float
    fuselage_area_y_m2: float
    fuselage_area_z_m2: float
    # feet
    cg_above_skid_m: float
    skid_half_length_m: float
    skid_half_track_m: float
    skid_stiffness_n_m: float
    skid_damping_n_s_m: float
    skid_friction_coefficient: float


def rotor_angles(count: int) -> list[float]:
    """Where the arms point [rad], clockwise from the nose: 45, 135, ... of four, 30, 90, ... of six."""
    return [math.pi / count * (1 + 2 * i) for i in range(count)]


def flatten_multirotor(file: MultirotorFile) -> MultirotorParameters:
    """The checked file as the flat bundle."""
    frame, blade, rho = file.frame, file.propeller, file.environment.air_density_kg_m3
    count, radius = int(frame.rotor_count), blade.radius_m
    angles = rotor_angles(count)
    places = [(frame.arm_m * math.cos(angle), frame.arm_m * math.sin(angle)) for angle in angles]
    places += [(0.0, 0.0)] * (6 - count)
    thrust = blade.thrust_coefficient * rho * (2.0 * radius) ** 4 / (2.0 * math.pi) ** 2
    torque = blade.power_coefficient * rho * (2.0 * radius) ** 5 / (2.0 * math.pi) ** 3
    disc = rho * math.pi * radius**2
    inflow = math.sqrt(thrust / (2.0 * disc))
    slope = rho * blade.lift_slope_per_rad * blade.blade_count * blade.chord_m * radius**2 / 4.0
    pitch = 1.5 * (thrust / slope + inflow) / radius  # the blades' effective pitch
    numbers = of_either_kind(file) | in_si(frame) | in_si(blade) | in_si(blade, "rotor_")
    return record_of(
        MultirotorParameters,
        numbers | in_si(file.motor) | in_si(file.battery),
        **{f"{axis}_{i + 1}_m": place[k] for i, place in enumerate(places) for k, axis in enumerate("xy")},
        per_arm_1_m=1.0 / frame.arm_m,
        thrust_n_s2=thrust,
        torque_n_m_s2=torque,
        torque_of_thrust_m=inflow - thrust / slope,
        axial_n_s2_m=0.5 * slope / (1.0 + slope / (4.0 * disc * inflow)),
        axial_held_n_s2_m=slope,
        inplane_n_s2_m2=slope / (4.0 * inflow + slope / disc) + slope * pitch / radius,
        hover_inflow_m=inflow,
        flap_back_m=blade.flap_response * 2.0 * (4.0 / 3.0 * pitch * radius - inflow),
        motor_rate_1_s=1.0 / file.motor.time_constant_s,
        volt_per_as=(file.battery.full_v - file.battery.empty_v) / (3600.0 * file.battery.capacity_ah),
    )


def with_inflow_held(vehicle: MultirotorParameters) -> MultirotorParameters:
    """The multirotor whose induced velocities keep their values, as they do in the first tens of milliseconds."""
    return vehicle._replace(axial_n_s2_m=vehicle.axial_held_n_s2_m)


def full_thrust(vehicle: MultirotorParameters) -> float:
    """Thrust of one rotor at the full battery's voltage [N]."""
    return vehicle.thrust_n_s2 * vehicle.full_speed_rad_s**2


def hover_speed(vehicle: MultirotorParameters) -> float:
    """At which the rotors carry the weight in still air [rad/s]."""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    return math.sqrt(weight / (vehicle.rotor_count * vehicle.thrust_n_s2))
