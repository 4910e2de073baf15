"""The vehicle file of either kind: which keys it has, in which units, and what they may be.

Angles stand in degrees in the file and become radians in `parameters.VehicleParameters`. Ranges are wide:
they catch a wrong unit or a slipped decimal, not a bold design.
"""

from typing import Literal

from pydantic import Field, field_validator

from flownav.core.parameter_files import Number, ParameterModel


class Environment(ParameterModel):
    """Where the vehicle flies."""

    gravity_m_s2: Number = Field(gt=9.7, lt=9.9)  # of the place
    air_density_kg_m3: Number = Field(gt=0.5, lt=1.6)  # of the air that it flies in


class Body(ParameterModel):
    """The rigid body; the inertia axes are the body axes, as in paper equations 2-4."""

    mass_kg: Number = Field(gt=0.2, lt=500.0)  # of all that flies, battery and load included
    inertia_xx_kg_m2: Number = Field(gt=1e-4, lt=1e3)  # in roll, about the centre of gravity
    inertia_yy_kg_m2: Number = Field(gt=1e-4, lt=1e3)  # in pitch, about the centre of gravity
    inertia_zz_kg_m2: Number = Field(gt=1e-4, lt=1e3)  # in yaw, about the centre of gravity


class MainRotor(ParameterModel):
    """The main rotor, turning clockwise seen from above, its hub on the body z axis."""

    radius_m: Number = Field(gt=0.2, lt=6.0)  # of the blade's tip from the hub's axis
    blade_count: Number = Field(ge=2, le=8)  # of the rotor
    chord_m: Number = Field(gt=0.005, lt=0.5)  # of a blade, the same from hub to tip
    speed_rad_s: Number = Field(gt=10.0, lt=600.0)  # that the governor keeps
    lift_slope_per_rad: Number = Field(gt=2.0, lt=7.0)  # of a blade: lift coefficient per angle of attack
    profile_drag_coefficient: Number = Field(ge=0.0, lt=0.1)  # of a blade, without lift
    stall_blade_loading: Number = Field(gt=0.05, lt=0.3)  # most thrust: thrust coefficient over solidity
    wake_efficiency: Number = Field(ge=0.5, le=1.0)  # 1: ideal momentum theory; less: more induced velocity
    blade_flap_inertia_kg_m2: Number = Field(gt=1e-5, lt=100.0)  # of one blade about its flapping hinge
    hub_stiffness_n_m_rad: Number = Field(ge=0.0, lt=1e5)  # moment on the body by tilt of the disc; 0: none
    hub_above_cg_m: Number = Field(gt=0.0, lt=3.0)  # on the body's z axis
    flap_response: Number = Field(ge=0.0, le=1.5)  # flapping by airspeed over an ideal rotor's; 0: none
    inflow_mass_factor: Number = Field(0.849, ge=0.2, le=2.0)  # mass of the air that the inflow moves, over rho*pi*R^3


class TailRotor(ParameterModel):
    """The tail rotor, geared to the main rotor, its thrust to the left."""

    radius_m: Number = Field(gt=0.03, lt=1.5)  # of the blade's tip from the hub's axis
    blade_count: Number = Field(ge=2, le=8)  # of the rotor
    chord_m: Number = Field(gt=0.003, lt=0.2)  # of a blade, the same from hub to tip
    gear_ratio: Number = Field(gt=1.0, lt=15.0)  # its speed over the main rotor's
    lift_slope_per_rad: Number = Field(gt=2.0, lt=7.0)  # of a blade: lift coefficient per angle of attack
    profile_drag_coefficient: Number = Field(ge=0.0, lt=0.1)  # of a blade, without lift
    stall_blade_loading: Number = Field(gt=0.05, lt=0.4)  # most thrust: thrust coefficient over solidity
    wake_efficiency: Number = Field(ge=0.5, le=1.0)  # 1: ideal momentum theory; less: more induced velocity
    behind_cg_m: Number = Field(gt=0.1, lt=10.0)  # its hub; the vertical fin is there, too
    above_cg_m: Number = Field(gt=-1.0, lt=2.0)  # its hub; negative: below
    fin_blockage: Number = Field(gt=0.4, le=1.0)  # share of the thrust that the fin leaves; 1: all of it


class Fuselage(ParameterModel):
    """Equivalent flat-plate drag areas along the body axes."""

    area_x_m2: Number = Field(ge=0.0, lt=20.0)  # against flow along the body, nose to tail
    area_y_m2: Number = Field(ge=0.0, lt=20.0)  # against flow from the side
    area_z_m2: Number = Field(ge=0.0, lt=20.0)  # against flow from above or below, downwash included


class VerticalFin(ParameterModel):
    """The fin beside the tail rotor, at the tail rotor's place."""

    area_m2: Number = Field(ge=0.0, lt=2.0)  # seen from the side
    lift_slope_per_rad: Number = Field(ge=0.0, lt=7.0)  # side force coefficient per angle of sideslip
    tail_inflow_fraction: Number = Field(ge=0.0, le=1.0)  # of the tail rotor's induced velocity, felt there; 0: none


class HorizontalFin(ParameterModel):
    """The tail plane."""

    area_m2: Number = Field(ge=0.0, lt=2.0)  # seen from above
    lift_slope_per_rad: Number = Field(ge=0.0, lt=7.0)  # lift coefficient per angle of attack
    behind_cg_m: Number = Field(ge=0.0, lt=10.0)  # where its force acts
    main_inflow_fraction: Number = Field(ge=0.0, le=2.0)  # of the main rotor's induced velocity, felt there; 0: none


class Skids(ParameterModel):
    """Four sprung feet, at the corners of a rectangle under the centre of gravity."""

    cg_above_skid_m: Number = Field(gt=0.0, lt=3.0)  # of the centre of gravity over the feet, unloaded
    half_length_m: Number = Field(gt=0.02, lt=3.0)  # of the feet ahead of and behind the centre of gravity
    half_track_m: Number = Field(gt=0.02, lt=3.0)  # of the feet to either side of the centre of gravity
    stiffness_n_m: Number = Field(gt=10.0, lt=1e6)  # of each of the four feet
    damping_n_s_m: Number = Field(ge=0.0, lt=1e5)  # of each of the four feet
    friction_coefficient: Number = Field(ge=0.0, le=1.5)  # dry friction over the load on the feet; 0: slides freely


class Actuator(ParameterModel):
    """A servo as seen at the blade: second order, with travel and rate limits, and a dead band."""

    frequency_rad_s: Number = Field(gt=2.0, lt=400.0)  # natural frequency
    damping_ratio: Number = Field(gt=0.2, lt=2.0)  # 1: critical
    rate_limit_deg_s: Number = Field(gt=5.0, lt=5000.0)  # fastest change of the blade angle
    minimum_deg: Number = Field(gt=-45.0, le=0.0)  # lower stop; cyclic: forward, left; pedal: nose to the left
    maximum_deg: Number = Field(gt=1.0, lt=45.0)  # upper stop; cyclic: back, right; pedal: nose to the right
    dead_band_deg: Number = Field(0.0, ge=0.0, lt=2.0)  # error that is not answered, either way; 0: none


class Drive(ParameterModel):
    """The motor's power for both rotors, the inertia that turns with them, and the governor that keeps their speed.

    Gains are shares of the power limit, per rad/s that the main rotor is slow and per rad that it has fallen behind;
    where a file states none they are Gavrilets' X-Cell's. rotor_inertia 0: from the blades'.
    """

    shaft_power_limit_w: Number = Field(gt=10.0, lt=1e6)  # most that the motor gives to both rotors together
    rotor_inertia_kg_m2: Number = Field(0.0, ge=0.0, lt=1e4)  # of all that turns, at the main rotor; 0: from the blades
    governor_gain_s_rad: Number = Field(0.01, gt=0.0, lt=10.0)  # share of the power limit by speed missing
    governor_integral_1_rad: Number = Field(0.02, ge=0.0, lt=10.0)  # share of the power limit by angle lost; 0: none


class Touchdown(ParameterModel):
    """Limits that the vehicle withstands when it touches the ground; beyond any of these it counts as crashed.

    Where a file states none, the limits are those of a helicopter of the Maxi Joker's size (its file derives them).
    """

    max_sink_rate_m_s: Number = Field(2.0, gt=0.0, lt=20.0)  # at first contact
    max_lateral_speed_m_s: Number = Field(0.6, gt=0.0, lt=20.0)  # over the ground at first contact
    max_tilt_deg: Number = Field(15.0, gt=0.0, le=30.0)  # from level at first contact
    max_yaw_rate_deg_s: Number = Field(45.0, gt=0.0, lt=720.0)  # either way at first contact
    max_slide_m: Number = Field(0.3, gt=0.0, lt=20.0)  # from first contact to rest


class StatedWind(ParameterModel):
    """The wind up to which the vehicle is stated to land; `flownav fly` notes where a scenario's is stronger."""

    max_speed_20ft_m_s: Number = Field(0.0, ge=0.0, le=30.0)  # steady speed at 20 ft, gusts about it; 0: not stated


class VehicleFile(ParameterModel):
    """A vehicle file, schema 1."""

    schema_version: Literal[1]  # of this kind of file; 1
    name: str = Field(min_length=1)  # of the vehicle, as reports have it
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
    wind: StatedWind = StatedWind()


KIND = "multirotor"


class Frame(ParameterModel):
    """Four or six arms of one length, as an X: the first rotor is on the right of the nose, turning to the left."""

    rotor_count: Number  # 4 or 6
    arm_m: Number = Field(gt=0.03, lt=3.0)  # from the middle to a rotor's hub
    rotors_above_cg_m: Number = Field(gt=-0.5, lt=1.0)  # of the hubs; negative: below

    @field_validator("rotor_count")
    @classmethod
    def _four_or_six(cls, count: float) -> float:
        if count not in (4, 6):
            raise ValueError("4 or 6 rotors are known")
        return count


class Propeller(ParameterModel):
    """One of the propellers, all of a kind. Coefficients static: T = C_T·ρ·n²·D⁴, P = C_P·ρ·n³·D⁵, n in rev/s."""

    radius_m: Number = Field(gt=0.01, lt=1.5)  # of the blade's tip from the hub's axis
    blade_count: Number = Field(ge=2, le=6)  # of one propeller
    chord_m: Number = Field(gt=0.001, lt=0.3)  # of a blade, at 3/4 of the radius
    thrust_coefficient: Number = Field(gt=0.02, lt=0.3)  # C_T, in still air
    power_coefficient: Number = Field(gt=0.005, lt=0.3)  # C_P of the shaft's power, in still air
    lift_slope_per_rad: Number = Field(gt=2.0, lt=7.0)  # of a blade: lift coefficient per angle of attack
    inplane_drag_n_s2_m_rad: Number = Field(ge=0.0, lt=0.1)  # drag by airspeed in the disc's plane and rotor speed
    flap_response: Number = Field(ge=0.0, le=1.5)  # flapping by airspeed over a hinged rotor's; 0: none
    hub_stiffness_n_m_rad: Number = Field(ge=0.0, lt=1e3)  # moment on the arm by tilt of the disc; 0: none
    inertia_kg_m2: Number = Field(gt=1e-8, lt=1.0)  # of propeller and motor bell about the shaft


class Motor(ParameterModel):
    """One of the motors with its controller, all of a kind."""

    time_constant_s: Number = Field(gt=0.005, lt=0.5)  # first-order lag of the rotor's speed
    full_speed_rad_s: Number = Field(gt=50.0, lt=5000.0)  # of the rotor at full command and full battery
    idle_share: Number = Field(gt=0.0, lt=0.3)  # least thrust of a rotor, of its full thrust
    efficiency: Number = Field(gt=0.3, le=1.0)  # shaft's power over the battery's


class Battery(ParameterModel):
    """The battery: its voltage at rest falls in a straight line from full to empty."""

    full_v: Number = Field(gt=2.0, lt=1000.0)  # at rest, when full
    empty_v: Number = Field(gt=1.0, lt=1000.0)  # at rest, when capacity_ah is used
    capacity_ah: Number = Field(gt=0.05, lt=1000.0)  # from full to empty
    resistance_ohm: Number = Field(ge=0.0, lt=5.0)  # of cells, leads and plugs; 0: no sag


class MultirotorFile(ParameterModel):
    """A multirotor's file, schema 1."""

    schema_version: Literal[1]  # of this kind of file; 1
    kind: Literal["multirotor"]  # tells it from a helicopter's file
    name: str = Field(min_length=1)  # of the vehicle, as reports have it
    environment: Environment
    body: Body
    frame: Frame
    propeller: Propeller
    motor: Motor
    battery: Battery
    fuselage: Fuselage
    skids: Skids
    touchdown: Touchdown = Touchdown()
    wind: StatedWind = StatedWind()
