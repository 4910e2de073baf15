"""A multirotor's parameters: the flat bundle of floats that kernels take, and how a file's numbers become it."""

from __future__ import annotations

import math
from typing import NamedTuple

from flownav.core.parameter_files import in_si, record_of
from flownav.vehicle.parameters import of_either_kind
from flownav.vehicle.schema import MultirotorFile


class MultirotorParameters(NamedTuple):
    """A multirotor, SI units and radians. It begins as `VehicleParameters` does: kernels read these of either kind.

    Of each propeller at a speed Ω: `thrust` k_T, T = k_T·Ω² in still air; `torque` k_Q likewise; `axial` dT/dw = this·Ω
    per velocity against the thrust; `inplane` dT/dV² for slow V, the translational lift; `hover_inflow` v_i = this·Ω.
    The last three are momentum theory and blade elements about the propeller's own hover: T = S·(Θ - v_i + w),
    v_i·√(V² + (v_i - w)²) = T/2ρA, S = ρ·a·b·c·R²·Ω/4, all of which scale with Ω.
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
    """Of one rotor at the full battery's voltage [N]."""
    return vehicle.thrust_n_s2 * vehicle.full_speed_rad_s**2


def hover_speed(vehicle: MultirotorParameters) -> float:
    """At which the rotors carry the weight in still air [rad/s]."""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    return math.sqrt(weight / (vehicle.rotor_count * vehicle.thrust_n_s2))
