"""The ground of a scenario, and what comes back from it of a rotor's own wake.

The ground is level or sloping, with a step or a deck's edge, smooth or rough; the pad's centre is at 0.

Near the ground a rotor's wake comes back and is drawn in again. In a wind the ground vortex is drawn in and costs
lift, most where the wind is about 0.7 of the induced velocity v_i (Curtiss, Sun, Putman and Hanker 1984: recirculation
below about 0.5 v_i, a ground vortex under the disc up to about 1.2 v_i; Ganesh and Komerath 2006: both unsteady). Here
that is air which moves: down by `loss`·v_i at most, and unsteady by `unsteady`·v_i down and, over the disc's radius,
from side to side. Both fade with the square of the hub's height, to nothing at one rotor diameter. The sizes are
assumed: 1 % of lift, and 1 % at random, on the Maxi Joker's skids; nobody measured them on a vehicle of its size.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from pydantic import Field, model_validator

from flownav.core.compile import clamp, equation, larger, smaller
from flownav.core.parameter_files import Number, ParameterModel
from flownav.sensors.geometry import Ground
from flownav.sensors.processes import gauss_markov, gauss_markov_coefficients
from flownav.simulation.wind import PERIOD_S, WindVelocity

WAVE_RMS = math.sqrt(8.0 / 15.0)  # of one wave of `beam.roughness`
AREA_1, AREA_3 = 2.0 / math.pi, 0.5 - 2.0 / math.pi  # of a disc beyond a line: ± this·x ± this·x³, right within 0.01


class GroundSettings(ParameterModel):
    """A scenario's ground. Directions are clockwise from north.

    slope_deg rises towards `uphill_deg`. Beyond the edge, a straight line through (edge_north_m, edge_east_m), on its
    side towards `edge_toward_deg`, the ground is step_m higher; -1 beyond a deck's edge that is a metre high. The pad
    lies before the edge. rough_rms_m: of the surface about its plane, in waves of about rough_length_m; rough_place_m
    moves them, so that two flights need not find the same stone.
    """

    slope_deg: Number = Field(0.0, ge=0.0, le=20.0)  # of the whole ground; 0: level
    uphill_deg: Number = Field(0.0, ge=-360.0, le=360.0)  # where the slope rises to, clockwise from north
    step_m: Number = Field(0.0, ge=-100.0, le=100.0)  # rise of the ground beyond the edge; negative: it drops
    edge_north_m: Number = Field(1.0, ge=-1000.0, le=1000.0)  # of the pad's centre, a point on the edge
    edge_east_m: Number = Field(0.0, ge=-1000.0, le=1000.0)  # of the pad's centre, the same point
    edge_toward_deg: Number = Field(0.0, ge=-360.0, le=360.0)  # across the edge towards the step, clockwise from north
    rough_rms_m: Number = Field(0.0, ge=0.0, le=0.2)  # height of the rough surface about its plane; 0: smooth
    rough_length_m: Number = Field(0.3, ge=0.02, le=100.0)  # about the length of its waves
    rough_place_m: Number = Field(0.0, ge=-1e4, le=1e4)  # shifts the waves, so that flights find other stones

    @model_validator(mode="after")
    def _pad_lies_before_the_edge(self) -> GroundSettings:
        toward = math.radians(self.edge_toward_deg)
        if self.step_m and self.edge_north_m * math.cos(toward) + self.edge_east_m * math.sin(toward) < 0.0:
            raise ValueError("the pad lies beyond the edge; turn edge_toward_deg by 180 and change the sign of step_m")
        return self

    def parameters(self) -> Ground:
        """The ground in numbers."""
        rise, uphill = math.tan(math.radians(self.slope_deg)), math.radians(self.uphill_deg)
        toward = math.radians(self.edge_toward_deg)
        return Ground(
            slope_n=rise * math.cos(uphill),
            slope_e=rise * math.sin(uphill),
            step_m=self.step_m,
            edge_n_m=self.edge_north_m,
            edge_e_m=self.edge_east_m,
            direction_n=math.cos(toward),
            direction_e=math.sin(toward),
            rough_m=self.rough_rms_m / (WAVE_RMS * math.sqrt(3.0)),
            waves_1_m=1.0 / self.rough_length_m,
            wave_place_m=self.rough_place_m,
        )


@equation
def share_beyond(north_m: float, east_m: float, radius_m: float, ground: Ground) -> float:
    """Which share of a disc about a place lies beyond the step's edge."""
    g = ground
    beyond = (north_m - g.edge_n_m) * g.direction_n + (east_m - g.edge_e_m) * g.direction_e
    x = clamp(beyond / radius_m, -1.0, 1.0)
    return 0.5 + x * (AREA_1 + AREA_3 * x * x)


@equation
def under_rotor(north_m: float, east_m: float, over_plane_m: float, radius_m: float, ground: Ground) -> float:
    """The ground over its plane as the ground effect of a rotor's disc finds it [m].

    Each part of the disc has the image of the ground below it: the image's strength, 1/z², is the mean over the disc,
    and the rotor as high as that of ground that is level. over_plane_m: height of the hub over the plane.
    """
    share = share_beyond(north_m, east_m, radius_m, ground)
    near, far = larger(over_plane_m, 0.5 * radius_m), larger(over_plane_m - ground.step_m, 0.5 * radius_m)
    strength = (1.0 - share) / (near * near) + share / (far * far)
    return over_plane_m - 1.0 / np.sqrt(strength) if ground.step_m * ground.step_m > 0.0 else 0.0


WORST_WIND = 0.7  # of the induced velocity: Curtiss et al. 1984, as above
STILL_M_S = 0.3  # keeps a division finite: no hovering rotor's air is so slow


class RecirculationParameters(NamedTuple):
    """Shares of the induced velocity, the rotor's diameter, mass flow 2ρA, the process's decay and drive at 50 Hz."""

    loss: float
    unsteady: float
    diameter_m: float
    per_mass_flow_m_kg: float  # 1/(2ρA)
    hub_above_cg_m: float
    decay: float
    drive: float


class RecirculationState(NamedTuple):
    """Unsteady inflow down, and its gradients about the wind's axis and across it; each of variance 1."""

    down: float
    roll: float
    pitch: float


class RecirculationSettings(ParameterModel):
    """How much of the induced velocity comes back on the ground: in the worst wind, and unsteadily; 0: nothing does."""

    loss: Number = Field(0.06, ge=0.0, le=0.5)  # downward air in the worst wind, of the induced velocity; 0: none
    unsteady: Number = Field(0.05, ge=0.0, le=0.5)  # its unsteady part, standard deviation, likewise; 0: none

    def parameters(
        self, diameter_m: float, hub_above_cg_m: float, air_density_kg_m3: float, hover_inflow_m_s: float
    ) -> RecirculationParameters:
        """For a rotor, or for the disc that several have together. An eddy is one diameter at v_i of hover."""
        decay, drive = gauss_markov_coefficients(diameter_m / hover_inflow_m_s, PERIOD_S)
        per_mass_flow = 1.0 / (0.5 * math.pi * air_density_kg_m3 * diameter_m**2)
        return RecirculationParameters(
            self.loss, self.unsteady, diameter_m, per_mass_flow, hub_above_cg_m, decay, drive
        )


@equation
def step_recirculation(
    state: RecirculationState, normals: RecirculationState, p: RecirculationParameters
) -> RecirculationState:
    """One period on (50 Hz)."""
    return RecirculationState(
        gauss_markov(state.down, p.decay, p.drive, normals.down),
        gauss_markov(state.roll, p.decay, p.drive, normals.roll),
        gauss_markov(state.pitch, p.decay, p.drive, normals.pitch),
    )


# of descent, as shares of the induced velocity
RINGS_FROM, RINGS_FULLY, RINGS_STILL, RINGS_TO = 0.45, 0.9, 1.3, 1.8
BLOWN_AWAY = 0.95  # and across
RING_INFLOW, RING_UNSTEADY = 0.25, 0.2  # of it: chosen, not measured on a vehicle of this size


@equation
def ringed(descent: float, across: float) -> float:
    """How much of a vortex ring a rotor is in, 0 to 1; its descent and speed across as shares of induced velocity.

    The region of Johnson, Model for Vortex Ring State Influence on Rotorcraft Flight Dynamics, NASA TP-2005-213477, in
    straight lines.
    """
    enters = clamp((descent - RINGS_FROM) / (RINGS_FULLY - RINGS_FROM), 0.0, 1.0)
    leaves = clamp((RINGS_TO - descent) / (RINGS_TO - RINGS_STILL), 0.0, 1.0)
    share = across / BLOWN_AWAY
    return smaller(enters, leaves) * larger(1.0 - share * share, 0.0)


@equation
def vortex_ring(
    wind: WindVelocity, state: RecirculationState, sink_m_s: float, across_m_s: float, thrust_n: float,
    p: RecirculationParameters,
) -> WindVelocity:  # fmt: skip
    """The air with the flow that a rotor pulls down through itself as it sinks into its own wake: more than momentum
    theory has.

    sink_m_s: downwards over the ground; the wind's own vertical speed counts. across_m_s: horizontally through the air.
    """
    induced: float = np.sqrt(larger(thrust_n, 0.0) * p.per_mass_flow_m_kg)
    per = 1.0 / larger(induced, STILL_M_S)
    down = ringed((sink_m_s - wind.wind_d_m_s) * per, across_m_s * per) * induced
    aside = RING_UNSTEADY * down * 2.0 / p.diameter_m
    return WindVelocity(
        wind.wind_n_m_s,
        wind.wind_e_m_s,
        wind.wind_d_m_s + down * (RING_INFLOW + RING_UNSTEADY * state.down),
        wind.turn_n_rad_s + aside * state.roll,
        wind.turn_e_rad_s + aside * state.pitch,
        wind.turn_d_rad_s,
    )


@equation
def recirculated(
    wind: WindVelocity, state: RecirculationState, hub_height_m: float, thrust_n: float, p: RecirculationParameters
) -> WindVelocity:
    """The wind, and what comes back of a rotor's wake at a height of its hub over the ground, while it gives thrust."""
    near = clamp(1.0 - hub_height_m / p.diameter_m, 0.0, 1.0)
    induced: float = np.sqrt(larger(thrust_n, 0.0) * p.per_mass_flow_m_kg)
    speed = np.sqrt(wind.wind_n_m_s * wind.wind_n_m_s + wind.wind_e_m_s * wind.wind_e_m_s)
    ratio = speed / (WORST_WIND * larger(induced, STILL_M_S))
    worst = 2.0 * ratio / (1.0 + ratio * ratio)
    back = near * near * induced
    aside = p.unsteady * back * 2.0 / p.diameter_m
    return WindVelocity(
        wind.wind_n_m_s,
        wind.wind_e_m_s,
        wind.wind_d_m_s + back * (p.loss * worst + p.unsteady * state.down),
        wind.turn_n_rad_s + aside * state.roll,
        wind.turn_e_rad_s + aside * state.pitch,
        wind.turn_d_rad_s,
    )
