"""A rotor's own wake about it, near the ground: it comes back from the ground and is drawn in again.

In a wind the ground vortex is drawn in and costs lift, most where the wind is about 0.7 of the induced velocity v_i
(Curtiss, Sun, Putman and Hanker 1984: recirculation below about 0.5 v_i, a ground vortex under the disc up to about
1.2 v_i; Ganesh and Komerath 2006: both unsteady). Here that is air which moves: down by `loss`·v_i at most, and
unsteady by `unsteady`·v_i down and, over the disc's radius, from side to side. Both fade with the square of the hub's
height, to nothing at one rotor diameter. The sizes are assumed: 1 % of lift, and 1 % at random, on the Maxi Joker's
skids; nobody measured them on a vehicle of its size.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from pydantic import Field

from flownav.core.compile import clamp, equation, larger
from flownav.core.parameter_files import Number, ParameterModel
from flownav.sensors.processes import gauss_markov, gauss_markov_coefficients
from flownav.simulation.wind import PERIOD_S, WindVelocity

WORST_WIND = 0.7  # of the induced velocity
STILL_M_S = 0.3


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

    loss: Number = Field(0.06, ge=0.0, le=0.5)
    unsteady: Number = Field(0.05, ge=0.0, le=0.5)

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
