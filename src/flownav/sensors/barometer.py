"""A barometer's altitude: a pressure that drifts, the rotor's wash on the static port, a lag, noise.

- Drift: Gauss-Markov (weather, temperature) and a ramp of this flight (warming after switch-on).
- Wash: a rotor of disk loading T/A leaves a pressure error of a share of it at the port, and near the ground, where the
  wake is turned and the pressure under the rotor rises, more: T/A (wash + ground/(1 + (z/R)^2)), z the height of the
  rotor, R its radius. Too much pressure reads as too low: altitude error = -pressure/(rho g). The rise fades with
  height as the influence of a rotor's image in the ground does (Cheeseman, Bennett, ARC R&M 3021, 1955: (R/4z)^2), held
  finite on the ground; how much of it reaches the port is the datasheet's and differs between flights.
- Altitude and errors pass the sensor's first-order lag; noise and resolution come after.

Altitudes are metres over the place of take-off, positive upwards.
"""

from __future__ import annotations

from typing import NamedTuple

from flownav.core.compile import equation, larger
from flownav.sensors.chance import factor
from flownav.sensors.first_order import lagged
from flownav.sensors.gauss_markov import gauss_markov
from flownav.sensors.quantisation import quantised


class BarometerParameters(NamedTuple):
    """Coefficients of one reading."""

    drift_decay: float
    drift_drive: float
    drift_sigma_m: float
    ramp_step_m: float  # standard deviation of what the ramp adds in one period
    offset_sigma_m: float
    wash_m_per_n: float  # altitude error per newton of thrust: out of ground effect
    ground_m_per_n: float  # and what the ground adds at rotor height 0
    per_radius_1_m: float  # 1/R
    wash_spread: float
    lag_keep: float
    lag_before: float
    lag_now: float
    sigma_m: float
    resolution_m: float
    steps_per_m: float


class BarometerTruth(NamedTuple):
    """Altitude of the port over the place of take-off, height of the rotor over the ground, and its thrust."""

    altitude_m: float
    rotor_height_m: float
    thrust_n: float


class BarometerUnit(NamedTuple):
    """This flight: offset, what the ramp adds a period, and factors of both kinds of wash. As normals: one for each."""

    offset_m: float
    ramp_step_m: float
    wash: float
    ground: float


class BarometerStartNormals(NamedTuple):
    """Standard normals of a state's start."""

    drift: float
    spare: float


class BarometerNormals(NamedTuple):
    """Standard normals of one reading."""

    drift: float
    noise: float


class BarometerState(NamedTuple):
    """Drift, ramp, and the lag's input one reading ago and output [m]."""

    drift_m: float
    ramp_m: float
    before_m: float
    lagged_m: float


class BarometerReading(NamedTuple):
    """Altitude, positive upwards; quality is 255 and a reading always arrives (the sensor is wired)."""

    alt_m: float
    quality: float
    arrived: float


@equation
def draw_barometer(n: BarometerUnit, p: BarometerParameters) -> BarometerUnit:
    """What this flight's port and air are like."""
    return BarometerUnit(
        p.offset_sigma_m * n.offset_m,
        p.ramp_step_m * n.ramp_step_m,
        factor(p.wash_spread, n.wash),
        factor(p.wash_spread, n.ground),
    )


@equation
def wash_error(truth: BarometerTruth, unit: BarometerUnit, p: BarometerParameters) -> float:
    """Altitude error that the rotor makes [m]: negative where it raises the pressure at the port."""
    radii = larger(truth.rotor_height_m, 0.0) * p.per_radius_1_m
    near = unit.ground * p.ground_m_per_n / (1.0 + radii * radii)
    return -truth.thrust_n * (unit.wash * p.wash_m_per_n + near)


@equation
def start_barometer(
    truth: BarometerTruth, unit: BarometerUnit, n: BarometerStartNormals, p: BarometerParameters
) -> BarometerState:
    """Settled on the altitude of the first moment, the drift from its stationary distribution."""
    drift_m = p.drift_sigma_m * n.drift
    seen_m = truth.altitude_m + (unit.offset_m + drift_m + wash_error(truth, unit, p))
    return BarometerState(drift_m, 0.0, seen_m, seen_m)


@equation
def step_barometer(
    state: BarometerState, unit: BarometerUnit, truth: BarometerTruth, n: BarometerNormals, p: BarometerParameters
) -> tuple[BarometerState, BarometerReading]:
    """One reading."""
    drift_m = gauss_markov(state.drift_m, p.drift_decay, p.drift_drive * p.drift_sigma_m, n.drift)
    ramp_m = state.ramp_m + unit.ramp_step_m
    seen_m = truth.altitude_m + (unit.offset_m + drift_m + ramp_m + wash_error(truth, unit, p))
    lagged_m = lagged(state.lagged_m, state.before_m, seen_m, p.lag_keep, p.lag_before, p.lag_now)
    alt_m = quantised(lagged_m + p.sigma_m * n.noise, p.resolution_m, p.steps_per_m)
    return BarometerState(drift_m, ramp_m, seen_m, lagged_m), BarometerReading(alt_m, 255.0, 1.0)
