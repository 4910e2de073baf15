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

import math
from typing import ClassVar, NamedTuple

from pydantic import Field

from flownav.core.compile import equation, larger
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.parameter_files import Number
from flownav.sensors import processes
from flownav.sensors.sheet import SensorSheet


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
    """Port and air of this flight, from its draws."""
    return BarometerUnit(
        p.offset_sigma_m * n.offset_m,
        p.ramp_step_m * n.ramp_step_m,
        processes.factor(p.wash_spread, n.wash),
        processes.factor(p.wash_spread, n.ground),
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
    drift_m = processes.gauss_markov(state.drift_m, p.drift_decay, p.drift_drive * p.drift_sigma_m, n.drift)
    ramp_m = state.ramp_m + unit.ramp_step_m
    seen_m = truth.altitude_m + (unit.offset_m + drift_m + ramp_m + wash_error(truth, unit, p))
    lagged_m = processes.lagged(state.lagged_m, state.before_m, seen_m, p.lag_keep, p.lag_before, p.lag_now)
    alt_m = processes.quantised(lagged_m + p.sigma_m * n.noise, p.resolution_m, p.steps_per_m)
    return BarometerState(drift_m, ramp_m, seen_m, lagged_m), BarometerReading(alt_m, 255.0, 1.0)


class BarometerSheet(SensorSheet):
    """A barometer where it is fitted.

    wash_share, ground_share: pressure error at the port over the rotor's disk loading, out of ground effect and what
    the ground adds at rotor height 0; wash_spread: the share by which flights differ in them.
    """

    shipped_file: ClassVar[str] = "barometer.toml"

    rate_hz: Number = Field(ge=1.0, le=200.0)  # readings a second
    sigma_m: Number = Field(ge=0.0, le=10.0)  # noise of a reading, standard deviation
    resolution_m: Number = Field(0.0, ge=0.0, le=10.0)  # readings come in whole steps of this; 0: no steps
    lag_s: Number = Field(0.0, ge=0.0, le=10.0)  # time constant of port and sensor, first order; 0: none
    offset_sigma_m: Number = Field(0.0, ge=0.0, le=100.0)  # constant error of a flight, standard deviation
    drift_sigma_m: Number = Field(ge=0.0, le=100.0)  # wandering error, standard deviation
    drift_tau_s: Number = Field(ge=0.0, le=1e5)  # its correlation time; 0: white
    ramp_m_per_h: Number = Field(0.0, ge=0.0, le=1000.0)  # steady drift of a flight, as in warming, standard deviation
    wash_share: Number = Field(0.0, ge=-2.0, le=2.0)  # pressure at the port over disk loading; positive: reads low
    ground_share: Number = Field(0.0, ge=-2.0, le=2.0)  # what rotor height 0 adds to it; fades with height
    wash_spread: Number = Field(0.0, ge=0.0, le=2.0)  # share by which flights differ in both; 0: alike

    def parameters(self, rotor_radius_m: float, air_density_kg_m3: float) -> BarometerParameters:
        """Coefficients of one reading on a vehicle with this rotor (of a multirotor: the disk of all its rotors)."""
        m_per_n = 1.0 / (math.pi * rotor_radius_m**2 * air_density_kg_m3 * GRAVITY_M_S2)
        return BarometerParameters(
            *processes.gauss_markov_coefficients(self.drift_tau_s, self.period_s), self.drift_sigma_m,
            self.ramp_m_per_h / 3600.0 * self.period_s, self.offset_sigma_m,
            self.wash_share * m_per_n, self.ground_share * m_per_n, 1.0 / rotor_radius_m, self.wash_spread,
            *processes.lag_weights(self.lag_s, self.period_s),
            self.sigma_m, self.resolution_m, processes.steps_per_unit(self.resolution_m),
        )  # fmt: skip
