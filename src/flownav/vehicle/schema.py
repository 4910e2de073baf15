"""The vehicle file of either kind: which keys it has, in which units, and what they may be.

Angles stand in degrees in the file and become radians in `parameters.VehicleParameters`. Ranges are wide:
they catch a wrong unit or a slipped decimal, not a bold design.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator

from flownav.core.parameter_files import Number, ParameterModel


class Environment(ParameterModel):
    """Where the vehicle flies."""

    gravity_m_s2: Number = Field(gt=9.7, lt=9.9)
    air_density_kg_m3: Number = Field(gt=0.5, lt=1.6)


class Body(ParameterModel):
    """The rigid body; the inertia axes are the body axes, as in paper equations 2-4."""

    mass_kg: Number = Field(gt=0.2, lt=500.0)
    inertia_xx_kg_m2: Number = Field(gt=1e-4, lt=1e3)
    inertia_yy_kg_m2: Number = Field(gt=1e-4, lt=1e3)
    inertia_zz_kg_m2: Number = Field(gt=1e-4, lt=1e3)


class MainRotor(ParameterModel):
    """The main rotor, turning clockwise seen from above, its hub on the body z axis."""

    radius_m: Number = Field(gt=0.2, lt=6.0)
    blade_count: Number = Field(ge=2, le=8)
    chord_m: Number = Field(gt=0.005, lt=0.5)
    speed_rad_s: Number = Field(gt=10.0, lt=600.0)
    lift_slope_per_rad: Number = Field(gt=2.0, lt=7.0)
    profile_drag_coefficient: Number = Field(ge=0.0, lt=0.1)
    stall_blade_loading: Number = Field(gt=0.05, lt=0.3)
    wake_efficiency: Number = Field(ge=0.5, le=1.0)
    blade_flap_inertia_kg_m2: Number = Field(gt=1e-5, lt=100.0)
    hub_stiffness_n_m_rad: Number = Field(ge=0.0, lt=1e5)
    hub_above_cg_m: Number = Field(gt=0.0, lt=3.0)
    flap_response: Number = Field(ge=0.0, le=1.5)
    inflow_mass_factor: Number = Field(0.849, ge=0.2, le=2.0)


class TailRotor(ParameterModel):
    """The tail rotor, geared to the main rotor, its thrust to the left."""

    radius_m: Number = Field(gt=0.03, lt=1.5)
    blade_count: Number = Field(ge=2, le=8)
    chord_m: Number = Field(gt=0.003, lt=0.2)
    gear_ratio: Number = Field(gt=1.0, lt=15.0)
    lift_slope_per_rad: Number = Field(gt=2.0, lt=7.0)
    profile_drag_coefficient: Number = Field(ge=0.0, lt=0.1)
    stall_blade_loading: Number = Field(gt=0.05, lt=0.4)
    wake_efficiency: Number = Field(ge=0.5, le=1.0)
    behind_cg_m: Number = Field(gt=0.1, lt=10.0)
    above_cg_m: Number = Field(gt=-1.0, lt=2.0)
    fin_blockage: Number = Field(gt=0.4, le=1.0)


class Fuselage(ParameterModel):
    """Equivalent flat-plate drag areas along the body axes."""

    area_x_m2: Number = Field(ge=0.0, lt=20.0)
    area_y_m2: Number = Field(ge=0.0, lt=20.0)
    area_z_m2: Number = Field(ge=0.0, lt=20.0)


class VerticalFin(ParameterModel):
    """The fin beside the tail rotor, at the tail rotor's place."""

    area_m2: Number = Field(ge=0.0, lt=2.0)
    lift_slope_per_rad: Number = Field(ge=0.0, lt=7.0)
    tail_inflow_fraction: Number = Field(ge=0.0, le=1.0)


class HorizontalFin(ParameterModel):
    """The tail plane."""

    area_m2: Number = Field(ge=0.0, lt=2.0)
    lift_slope_per_rad: Number = Field(ge=0.0, lt=7.0)
    behind_cg_m: Number = Field(ge=0.0, lt=10.0)
    main_inflow_fraction: Number = Field(ge=0.0, le=2.0)


class Skids(ParameterModel):
    """Four sprung feet, at the corners of a rectangle under the centre of gravity."""

    cg_above_skid_m: Number = Field(gt=0.0, lt=3.0)
    half_length_m: Number = Field(gt=0.02, lt=3.0)
    half_track_m: Number = Field(gt=0.02, lt=3.0)
    stiffness_n_m: Number = Field(gt=10.0, lt=1e6)
    damping_n_s_m: Number = Field(ge=0.0, lt=1e5)
    friction_coefficient: Number = Field(ge=0.0, le=1.5)


class Actuator(ParameterModel):
    """A servo as seen at the blade: second order, with travel and rate limits, and a dead band."""

    frequency_rad_s: Number = Field(gt=2.0, lt=400.0)
    damping_ratio: Number = Field(gt=0.2, lt=2.0)
    rate_limit_deg_s: Number = Field(gt=5.0, lt=5000.0)
    minimum_deg: Number = Field(gt=-45.0, le=0.0)
    maximum_deg: Number = Field(gt=1.0, lt=45.0)
    dead_band_deg: Number = Field(0.0, ge=0.0, lt=2.0)


class Drive(ParameterModel):
    """What the motor can give to both rotors, what turns with them, and the governor that keeps their speed.

    Gains are shares of the power limit, per rad/s that the main rotor is slow and per rad that it has fallen behind;
    where a file says none they are Gavrilets' X-Cell's. rotor_inertia 0: from the blades'.
    """

    shaft_power_limit_w: Number = Field(gt=10.0, lt=1e6)
    rotor_inertia_kg_m2: Number = Field(0.0, ge=0.0, lt=1e4)
    governor_gain_s_rad: Number = Field(0.01, gt=0.0, lt=10.0)
    governor_integral_1_rad: Number = Field(0.02, ge=0.0, lt=10.0)


class Touchdown(ParameterModel):
    """What the vehicle stands when it touches the ground; beyond any of these it counts as crashed.

    Where a file says nothing, the limits are those of a helicopter of the Maxi Joker's size (its file derives them).
    """

    max_sink_rate_m_s: Number = Field(2.0, gt=0.0, lt=20.0)
    max_lateral_speed_m_s: Number = Field(0.6, gt=0.0, lt=20.0)
    max_tilt_deg: Number = Field(15.0, gt=0.0, le=30.0)
    max_yaw_rate_deg_s: Number = Field(45.0, gt=0.0, lt=720.0)
    max_slide_m: Number = Field(0.3, gt=0.0, lt=20.0)


class VehicleFile(ParameterModel):
    """A vehicle file, schema 1."""

    schema_version: Literal[1]
    name: str = Field(min_length=1)
    environment: Environment
    body: Body
    main_rotor: MainRotor
    tail_rotor: TailRotor
    fuselage: Fuselage
    vertical_fin: VerticalFin
    horizontal_fin: HorizontalFin
    skids: Skids
    cyclic: Actuator
    collective: Actuator
    pedal: Actuator
    drive: Drive
    touchdown: Touchdown = Touchdown()


KIND = "multirotor"


class Frame(ParameterModel):
    """Four or six arms of one length, as an X: the first rotor is on the right of the nose, turning to the left."""

    rotor_count: Number
    arm_m: Number = Field(gt=0.03, lt=3.0)
    rotors_above_cg_m: Number = Field(gt=-0.5, lt=1.0)

    @field_validator("rotor_count")
    @classmethod
    def _four_or_six(cls, count: float) -> float:
        if count not in (4, 6):
            raise ValueError("4 or 6 rotors are known")
        return count


class Propeller(ParameterModel):
    """One of the propellers, all of a kind. Coefficients static: T = C_T·ρ·n²·D⁴, P = C_P·ρ·n³·D⁵, n in rev/s."""

    radius_m: Number = Field(gt=0.01, lt=1.5)
    blade_count: Number = Field(ge=2, le=6)
    chord_m: Number = Field(gt=0.001, lt=0.3)
    thrust_coefficient: Number = Field(gt=0.02, lt=0.3)
    power_coefficient: Number = Field(gt=0.005, lt=0.3)
    lift_slope_per_rad: Number = Field(gt=2.0, lt=7.0)
    inplane_drag_n_s2_m_rad: Number = Field(ge=0.0, lt=0.1)
    flap_response: Number = Field(ge=0.0, le=1.5)
    hub_stiffness_n_m_rad: Number = Field(ge=0.0, lt=1e3)
    inertia_kg_m2: Number = Field(gt=1e-8, lt=1.0)


class Motor(ParameterModel):
    """One of the motors with its controller, all of a kind."""

    time_constant_s: Number = Field(gt=0.005, lt=0.5)
    full_speed_rad_s: Number = Field(gt=50.0, lt=5000.0)
    idle_share: Number = Field(gt=0.0, lt=0.3)
    efficiency: Number = Field(gt=0.3, le=1.0)


class Battery(ParameterModel):
    """The battery: its voltage at rest falls in a straight line from full to empty."""

    full_v: Number = Field(gt=2.0, lt=1000.0)
    empty_v: Number = Field(gt=1.0, lt=1000.0)
    capacity_ah: Number = Field(gt=0.05, lt=1000.0)
    resistance_ohm: Number = Field(ge=0.0, lt=5.0)


class MultirotorFile(ParameterModel):
    """A multirotor's file, schema 1."""

    schema_version: Literal[1]
    kind: Literal["multirotor"]
    name: str = Field(min_length=1)
    environment: Environment
    body: Body
    frame: Frame
    propeller: Propeller
    motor: Motor
    battery: Battery
    fuselage: Fuselage
    skids: Skids
    touchdown: Touchdown = Touchdown()
