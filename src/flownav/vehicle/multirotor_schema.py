"""The multirotor's file: which keys it has, in which units, and what they may be (the helicopter's: `schema`)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator

from flownav.core.parameter_files import Number, ParameterModel
from flownav.vehicle.schema import Body, Environment, Fuselage, Skids, Touchdown

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
