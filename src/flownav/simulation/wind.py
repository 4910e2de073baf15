"""Wind: a steady part and Dryden gusts (MIL-F-8785C, low altitude).

With h in feet and W20 the wind speed at 20 ft:

    steady speed  W20 ln(h/z0)/ln(20/z0),  z0 = 0.15 ft (terminal flight phases)
    L_w = h                                   sigma_w = 0.1 W20
    L_u = L_v = h/(0.177 + 0.000823 h)^1.2    sigma_u = sigma_v = sigma_w/(0.177 + 0.000823 h)^0.4

    H_u(s) = sigma_u sqrt(2 T_u/pi) / (1 + T_u s)
    H_w(s) = sigma_w sqrt(T_w/pi) (1 + sqrt(3) T_w s) / (1 + T_w s)^2,   H_v alike,   T = L/V

Both come down to nothing at the ground: the steady speed is that of the rotor's height, by the logarithmic law down to
its roughness length z0, and below the reference height the gusts shrink as it does, so that the turbulence's
intensity sigma_u/V stays (the specification's sigma does not know the ground). z0 is a setting; the specification's
is 0.15 ft. Two simplifications, stated: the gusts' scales are those of the reference height (near the ground L_w would
shrink with h, and quicker gusts push less), and the frozen gust field is carried past the vehicle at the reference
height's steady speed, V, since a vehicle that takes off and lands moves slowly over the ground. Gust axes: along the
wind, to its right, down.

A vehicle of width b feels the field's gradients as if the air turned (MIL-F-8785C's angular gusts):

    H_p(s) = sigma_w sqrt(0.8/V) (pi/4b)^(1/6) / (L_w^(1/3) (1 + 4b s/(pi V)))
    q = (s/V) w / (1 + 4b s/(pi V)),   r = -(s/V) v / (1 + 3b s/(pi V))

with the signs of a field that is carried along the wind: w = w0 + p y - q x, v = v0 + r x.

The processes are sampled exactly (variance and autocorrelation) at 50 Hz. Without wind every output is +0.
"""

import math
from typing import NamedTuple

import numpy as np
from pydantic import Field

from flownav.core.compile import equation, larger, log_of_unit, smaller
from flownav.core.parameter_files import Number, ParameterModel
from flownav.sensors.processes import gauss_markov, gauss_markov_coefficients

PERIOD_S = 0.02
FOOT_M = 0.3048
ROUGHNESS_M = 0.15 * FOOT_M  # MIL-F-8785C's z0 of the terminal flight phase
SPAN_M = 1.0  # of a vehicle whose span is unknown: chosen
REFERENCE_SPEED_HEIGHT_M = 20.0 * FOOT_M
LOWEST_HEIGHT_M = 0.5  # chosen: the model's lengths go to nothing at the ground (its own limit is 10 ft)
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
    roughness_m: float
    per_reference: float  # 1/ln(reference height/z0)
    # gradients: standard deviation of the roll [rad/s], its filter; how fast slow gusts follow; 1/m of what is quicker
    roll_sigma_rad_s: float
    roll_decay: float
    roll_drive: float
    down_follow: float
    pitch_1_m: float
    across_follow: float
    yaw_1_m: float


class WindState(NamedTuple):
    """The gust along the wind, and the filters' states across and down [m/s]; gust = s1 + sqrt(3) s2.

    roll: of the air about the wind [rad/s]; slow: the gusts across and down without what is smaller than the vehicle.
    """

    along: float
    across1: float
    across2: float
    down1: float
    down2: float
    roll: float
    across_slow: float
    down_slow: float


class WindNormals(NamedTuple):
    """Standard normals of one period; the start of a flight takes the same set."""

    along: float
    across1: float
    across2: float
    down1: float
    down2: float
    roll: float


class WindVelocity(NamedTuple):
    """Velocity of the air over the ground, NED, and its gradients as a rotation of the air."""

    wind_n_m_s: float
    wind_e_m_s: float
    wind_d_m_s: float
    turn_n_rad_s: float
    turn_e_rad_s: float
    turn_d_rad_s: float


@equation
def start_wind(n: WindNormals, p: WindParameters) -> WindState:
    """Stationary gusts: both states of a second-order filter have the variance sigma^2/4 and are independent."""
    across, down = 0.5 * p.across_sigma_m_s, 0.5 * p.down_sigma_m_s
    return WindState(
        p.along_sigma_m_s * n.along, across * n.across1, across * n.across2, down * n.down1, down * n.down2,
        p.roll_sigma_rad_s * n.roll, across * (n.across1 + SQRT3 * n.across2), down * (n.down1 + SQRT3 * n.down2),
    )  # fmt: skip


@equation
def step_wind(state: WindState, height_m: float, n: WindNormals, p: WindParameters) -> tuple[WindState, WindVelocity]:
    """The gusts one period on (50 Hz), and the wind there and then, height_m above the ground."""
    across1 = p.across_f11 * state.across1 + p.across_f12 * state.across2 + p.across_d11 * n.across1
    across2 = p.across_f21 * state.across1 + p.across_f22 * state.across2
    down1 = p.down_f11 * state.down1 + p.down_f12 * state.down2 + p.down_d11 * n.down1
    down2 = p.down_f21 * state.down1 + p.down_f22 * state.down2
    across2 = across2 + (p.across_d21 * n.across1 + p.across_d22 * n.across2)
    down2 = down2 + (p.down_d21 * n.down1 + p.down_d22 * n.down2)
    # the means over the period: what is quicker than the slow gusts has neither lead nor lag
    across = 0.5 * ((state.across1 + across1) + SQRT3 * (state.across2 + across2))
    down = 0.5 * ((state.down1 + down1) + SQRT3 * (state.down2 + down2))
    after = WindState(
        along=gauss_markov(state.along, p.along_decay, p.along_drive, n.along),
        across1=across1,
        across2=across2,
        down1=down1,
        down2=down2,
        roll=gauss_markov(state.roll, p.roll_decay, p.roll_drive, n.roll),
        across_slow=state.across_slow + p.across_follow * (across - state.across_slow),
        down_slow=state.down_slow + p.down_follow * (down - state.down_slow),
    )
    return after, wind_velocity(after, height_m, p)


@equation
def log_height(height_m: float, p: WindParameters) -> float:
    """ln(h/z0), 0 at and below the roughness length."""
    return -log_of_unit(p.roughness_m / larger(height_m, p.roughness_m))


@equation
def wind_velocity(state: WindState, height_m: float, p: WindParameters) -> WindVelocity:
    """Steady wind, gusts and their gradients at a height over the ground, turned from the wind's axes to NED."""
    high = log_height(height_m, p)
    share = smaller(high * p.per_reference, 1.0)  # of the reference height's gusts
    across, down = state.across1 + SQRT3 * state.across2, state.down1 + SQRT3 * state.down2
    along = p.steady_m_s * high + share * state.along
    pitch, yaw = p.pitch_1_m * (down - state.down_slow), -p.yaw_1_m * (across - state.across_slow)
    across = share * across
    return WindVelocity(
        0.0 + (p.toward_n * along - p.toward_e * across),
        0.0 + (p.toward_e * along + p.toward_n * across),
        0.0 + share * down,
        0.0 + share * (p.toward_n * state.roll - p.toward_e * pitch),
        0.0 + share * (p.toward_e * state.roll + p.toward_n * pitch),
        0.0 + share * yaw,
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


def _gradients(
    sigma_down_m_s: float, length_down_m: float, span_m: float, carried_m_s: float
) -> tuple[float, float, float, float, float, float, float]:
    """Coefficients: roll's sigma, decay and drive; of pitch and yaw how fast the slow gusts follow, 1/m of the rest.

    The variance of p is its spectrum's integral, sigma_w^2 0.8 (pi L_w/4b)^(1/3) pi^2/(8 L_w b).
    """
    broad = (math.pi * length_down_m / (4.0 * span_m)) ** (1.0 / 3.0)
    sigma = sigma_down_m_s * math.sqrt(0.1 * math.pi**2 * broad / (length_down_m * span_m))
    tau_s = 4.0 * span_m / (math.pi * carried_m_s)
    return (
        *_first_order(sigma, tau_s),
        -math.expm1(-PERIOD_S / tau_s),
        math.pi / (4.0 * span_m),
        -math.expm1(-PERIOD_S / (0.75 * tau_s)),
        math.pi / (3.0 * span_m),
    )


class WindSettings(ParameterModel):
    """A scenario's wind; off by default. The direction is where it blows from, clockwise from north.

    roughness_m: z0 of the ground that the wind comes over, from .0005 (water) over .005 (concrete, mown grass) and .03
    (a meadow) to .1 (low crops), after Davenport and Wieringa.
    """

    speed_20ft_m_s: Number = Field(0.0, ge=0.0, le=30.0)  # steady speed at 20 ft (6.1 m) over the ground; 0: no wind
    from_direction_deg: Number = Field(0.0, ge=-360.0, le=360.0)  # where it blows from, clockwise from north
    gusts: bool = True  # whether there is Dryden turbulence (MIL-F-8785C)
    reference_height_m: Number = Field(3.0, ge=LOWEST_HEIGHT_M, le=300.0)  # the gusts' size and length are its
    roughness_m: Number = Field(ROUGHNESS_M, ge=1e-4, le=0.4)

    def parameters(self, span_m: float = SPAN_M) -> WindParameters:
        """Coefficients at 50 Hz for a vehicle so wide; all velocities are exactly zero where the speed is."""
        scales = dryden_scales(self.speed_20ft_m_s, self.reference_height_m)
        profile_m_s = self.speed_20ft_m_s / math.log(REFERENCE_SPEED_HEIGHT_M / self.roughness_m)
        reference = math.log(self.reference_height_m / self.roughness_m)
        carried_m_s = profile_m_s * reference
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
            self.roughness_m,
            1.0 / reference,
            *_gradients(vertical, scales.length_down_m, span_m, carried_m_s or 1.0),
        )
