"""Wind: a steady part and Dryden gusts (MIL-F-8785C, low altitude).

With h in feet and W20 the wind speed at 20 ft:

    steady speed  W20 ln(h/z0)/ln(20/z0),  z0 = 0.15 ft (terminal flight phases)
    L_w = h                                   sigma_w = 0.1 W20
    L_u = L_v = h/(0.177 + 0.000823 h)^1.2    sigma_u = sigma_v = sigma_w/(0.177 + 0.000823 h)^0.4

    H_u(s) = sigma_u sqrt(2 T_u/pi) / (1 + T_u s)
    H_w(s) = sigma_w sqrt(T_w/pi) (1 + sqrt(3) T_w s) / (1 + T_w s)^2,   H_v alike,   T = L/V

h is held at 0.5 m and above. The steady speed follows the vehicle's height. Two simplifications, stated: the gusts'
scales and intensities are those of one reference height (powers stay out of the flight loop; near the ground L_w
would shrink with h), and the frozen gust field is carried past the vehicle at the reference height's steady speed,
V, since a vehicle that takes off and lands moves slowly over the ground. Gust axes: along the wind, to its right,
down.

The processes are sampled exactly (variance and autocorrelation) at 50 Hz. Without wind every output is +0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from pydantic import Field

from flownav.compile import equation, larger
from flownav.parameter_files import Number, ParameterModel
from flownav.sensors.gauss_markov import gauss_markov, gauss_markov_coefficients
from flownav.simulation.noise import log_of_unit

PERIOD_S = 0.02
FOOT_M = 0.3048
ROUGHNESS_M = 0.15 * FOOT_M
REFERENCE_SPEED_HEIGHT_M = 20.0 * FOOT_M
LOWEST_HEIGHT_M = 0.5
SQRT3 = 1.7320508075688772
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)


class WindParameters(NamedTuple):
    """Coefficients of one period; the wind blows towards (`toward_n`, `toward_e`). Drives are in m/s."""

    steady_m_s: float  # W20/ln(20 ft/z0)
    toward_n: float
    toward_e: float
    along_sigma_m_s: float
    along_decay: float
    along_drive: float
    # across and down: second-order shaping filters, s[k+1] = F s[k] + lower-triangular drive of two normals
    across_sigma_m_s: float
    across_f11: float
    across_f12: float
    across_f21: float
    across_f22: float
    across_d11: float
    across_d21: float
    across_d22: float
    down_sigma_m_s: float
    down_f11: float
    down_f12: float
    down_f21: float
    down_f22: float
    down_d11: float
    down_d21: float
    down_d22: float


class WindState(NamedTuple):
    """The gust along the wind, and the filters' states across and down [m/s]; gust = s1 + sqrt(3) s2."""

    along: float
    across1: float
    across2: float
    down1: float
    down2: float


class WindNormals(NamedTuple):
    """Standard normals of one period; the start of a flight takes the same set."""

    along: float
    across1: float
    across2: float
    down1: float
    down2: float


class WindVelocity(NamedTuple):
    """Velocity of the air over the ground, NED."""

    wind_n_m_s: float
    wind_e_m_s: float
    wind_d_m_s: float


@equation
def start_wind(n: WindNormals, p: WindParameters) -> WindState:
    """Stationary gusts: both states of a second-order filter have the variance sigma^2/4 and are independent."""
    across, down = 0.5 * p.across_sigma_m_s, 0.5 * p.down_sigma_m_s
    return WindState(
        p.along_sigma_m_s * n.along, across * n.across1, across * n.across2, down * n.down1, down * n.down2
    )


@equation
def step_wind(state: WindState, height_m: float, n: WindNormals, p: WindParameters) -> tuple[WindState, WindVelocity]:
    """The gusts one period on (50 Hz), and the wind there and then, height_m above the ground."""
    across1 = p.across_f11 * state.across1 + p.across_f12 * state.across2 + p.across_d11 * n.across1
    across2 = p.across_f21 * state.across1 + p.across_f22 * state.across2
    down1 = p.down_f11 * state.down1 + p.down_f12 * state.down2 + p.down_d11 * n.down1
    down2 = p.down_f21 * state.down1 + p.down_f22 * state.down2
    after = WindState(
        along=gauss_markov(state.along, p.along_decay, p.along_drive, n.along),
        across1=across1,
        across2=across2 + (p.across_d21 * n.across1 + p.across_d22 * n.across2),
        down1=down1,
        down2=down2 + (p.down_d21 * n.down1 + p.down_d22 * n.down2),
    )
    return after, wind_velocity(after, height_m, p)


@equation
def steady_speed(height_m: float, p: WindParameters) -> float:
    """The logarithmic profile, W20 ln(h/z0)/ln(20 ft/z0)."""
    return p.steady_m_s * -log_of_unit(ROUGHNESS_M / larger(height_m, LOWEST_HEIGHT_M))


@equation
def wind_velocity(state: WindState, height_m: float, p: WindParameters) -> WindVelocity:
    """Steady wind and gusts, turned from the wind's axes to NED."""
    along = steady_speed(height_m, p) + state.along
    across = state.across1 + SQRT3 * state.across2
    down = state.down1 + SQRT3 * state.down2
    return WindVelocity(
        0.0 + (p.toward_n * along - p.toward_e * across),
        0.0 + (p.toward_e * along + p.toward_n * across),
        0.0 + down,
    )


class DrydenScales(NamedTuple):
    """Length and intensity of the gusts at one height; across the wind they are as along it."""

    length_along_m: float
    length_down_m: float
    sigma_along_m_s: float
    sigma_down_m_s: float


def dryden_scales(speed_20ft_m_s: float, height_m: float) -> DrydenScales:
    """MIL-F-8785C's low-altitude model (below 1000 ft)."""
    height_ft = max(height_m, LOWEST_HEIGHT_M) / FOOT_M
    thinning = 0.177 + 0.000823 * height_ft
    sigma_down = 0.1 * speed_20ft_m_s
    return DrydenScales(
        length_along_m=height_ft / thinning**1.2 * FOOT_M,
        length_down_m=height_ft * FOOT_M,
        sigma_along_m_s=sigma_down / thinning**0.4,
        sigma_down_m_s=sigma_down,
    )


def _first_order(sigma_m_s: float, tau_s: float) -> tuple[float, float, float]:
    """sigma, decay and drive of the gust along the wind."""
    decay, drive = gauss_markov_coefficients(tau_s, PERIOD_S)
    return sigma_m_s, decay, drive * sigma_m_s


def _second_order(sigma_m_s: float, tau_s: float) -> tuple[float, float, float, float, float, float, float, float]:
    """sigma, F (2 x 2, by rows) and the lower Cholesky factor of Q of one period, for

        s1' = s2/T,  s2' = -s1/T - 2 s2/T + white noise,   y = s1 + sqrt(3) s2:

    y has the Dryden spectrum with variance sigma^2, s the stationary covariance sigma^2 I/4. The impulse response
    of s is (x, 1 - x) exp(-x) sigma, x = t/T; Q is the integral of its square over the period (Gauss-Legendre: no
    cancellation where the period is short).
    """
    d = PERIOD_S / tau_s
    shrink = math.exp(-d)
    x = 0.5 * d * (NODES + 1.0)
    density = 0.5 * d * WEIGHTS * np.exp(-2.0 * x)
    d11 = math.sqrt(float(np.sum(density * x * x)))
    d21 = float(np.sum(density * x * (1.0 - x))) / d11
    d22 = math.sqrt(float(np.sum(density * (1.0 - x) ** 2)) - d21 * d21)
    f11, f12, f21, f22 = shrink * (1.0 + d), shrink * d, -shrink * d, shrink * (1.0 - d)
    return sigma_m_s, f11, f12, f21, f22, sigma_m_s * d11, sigma_m_s * d21, sigma_m_s * d22


class WindSettings(ParameterModel):
    """A scenario's wind; off by default. The direction is where it blows from, clockwise from north."""

    speed_20ft_m_s: Number = Field(0.0, ge=0.0, le=30.0)
    from_direction_deg: Number = Field(0.0, ge=-360.0, le=360.0)
    gusts: bool = True
    reference_height_m: Number = Field(3.0, ge=LOWEST_HEIGHT_M, le=300.0)

    def parameters(self) -> WindParameters:
        """Coefficients at 50 Hz; all velocities are exactly zero where the speed is."""
        scales = dryden_scales(self.speed_20ft_m_s, self.reference_height_m)
        profile_m_s = self.speed_20ft_m_s / math.log(REFERENCE_SPEED_HEIGHT_M / ROUGHNESS_M)
        carried_m_s = profile_m_s * math.log(self.reference_height_m / ROUGHNESS_M)
        # without wind the gusts have no amplitude and any time constant serves
        tau_along_s = scales.length_along_m / (carried_m_s or 1.0)
        tau_down_s = scales.length_down_m / (carried_m_s or 1.0)
        toward = math.radians(self.from_direction_deg + 180.0)
        share = 1.0 if self.gusts else 0.0
        horizontal, vertical = share * scales.sigma_along_m_s, share * scales.sigma_down_m_s
        return WindParameters(
            profile_m_s,
            math.cos(toward),
            math.sin(toward),
            *_first_order(horizontal, tau_along_s),
            *_second_order(horizontal, tau_along_s),
            *_second_order(vertical, tau_down_s),
        )
