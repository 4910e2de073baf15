"""The datasheet of a GPS receiver, and the coefficients that follow from it."""

import math
from typing import ClassVar

from pydantic import Field

from flownav.core.parameter_files import Number, ParameterModel
from flownav.sensors.gps_receiver import GpsReceiverParameters
from flownav.sensors.processes import gauss_markov_coefficients, lag_weights, steps_per_unit
from flownav.sensors.sheet import Lever, SensorSheet, Spells


class PositionErrors(ParameterModel):
    """Slow, fast and white error of an axis; `spread`: the share by which flights differ in all of them."""

    slow_sigma_m: Number = Field(ge=0.0, le=100.0)  # ionosphere and orbits: standard deviation, north and east
    slow_sigma_down_m: Number = Field(ge=0.0, le=100.0)  # the same, down
    slow_tau_s: Number = Field(ge=0.0, le=1e5)  # its correlation time; 0: white
    fast_sigma_m: Number = Field(ge=0.0, le=100.0)  # multipath: standard deviation, north and east
    fast_sigma_down_m: Number = Field(ge=0.0, le=100.0)  # the same, down
    fast_tau_s: Number = Field(ge=0.0, le=1e5)  # its correlation time; 0: white
    white_sigma_m: Number = Field(ge=0.0, le=100.0)  # noise of a fix: standard deviation, north and east
    white_sigma_down_m: Number = Field(ge=0.0, le=100.0)  # the same, down
    quantum_m: Number = Field(0.0, ge=0.0, le=1.0)  # positions come in whole steps of this; 0: no steps
    spread: Number = Field(0.0, ge=0.0, le=2.0)  # share by which flights differ in all of them; 0: alike


class VelocityErrors(ParameterModel):
    """Correlated and white error of an axis, and the time constant of the receiver's own smoothing."""

    sigma_m_s: Number = Field(ge=0.0, le=10.0)  # lasting error: standard deviation, north and east
    sigma_down_m_s: Number = Field(ge=0.0, le=10.0)  # the same, down
    tau_s: Number = Field(ge=0.0, le=1e5)  # its correlation time; 0: white
    white_m_s: Number = Field(ge=0.0, le=10.0)  # noise of a fix: standard deviation, north and east
    white_down_m_s: Number = Field(ge=0.0, le=10.0)  # the same, down
    smoothing_tau_s: Number = Field(0.0, ge=0.0, le=2.0)  # lag of the receiver's own smoothing; 0: none
    quantum_m_s: Number = Field(0.0, ge=0.0, le=1.0)  # velocities come in whole steps of this; 0: no steps


class GpsReceiverSheet(SensorSheet):
    """A receiver. `stated_spread`: the share by which the accuracies that it states are wrong."""

    shipped_file: ClassVar[str] = "gps_receiver.toml"

    rate_hz: Number = Field(ge=0.2, le=50.0)  # fixes a second
    position: PositionErrors
    velocity: VelocityErrors
    stated_spread: Number = Field(0.0, ge=0.0, le=2.0)  # share by which the accuracies that it states are wrong
    outage: Spells = Spells()
    antenna: Lever = Lever()

    @property
    def horizontal_sigma_m(self) -> float:
        """Standard deviation of a horizontal axis, all position errors together."""
        e = self.position
        return math.hypot(e.slow_sigma_m, e.fast_sigma_m, e.white_sigma_m)

    @property
    def vertical_sigma_m(self) -> float:
        """Standard deviation of the vertical position."""
        e = self.position
        return math.hypot(e.slow_sigma_down_m, e.fast_sigma_down_m, e.white_sigma_down_m)

    @property
    def speed_sigma_m_s(self) -> float:
        """Standard deviation of a horizontal velocity, its lag apart."""
        return math.hypot(self.velocity.sigma_m_s, self.velocity.white_m_s)

    def parameters(self) -> GpsReceiverParameters:
        """Coefficients of one period."""
        e, v, period = self.position, self.velocity, self.period_s
        return GpsReceiverParameters(
            self.antenna.forward_m, self.antenna.right_m, self.antenna.down_m,
            *gauss_markov_coefficients(e.slow_tau_s, period), e.slow_sigma_m, e.slow_sigma_down_m,
            *gauss_markov_coefficients(e.fast_tau_s, period), e.fast_sigma_m, e.fast_sigma_down_m,
            e.white_sigma_m, e.white_sigma_down_m,
            *gauss_markov_coefficients(v.tau_s, period), v.sigma_m_s, v.sigma_down_m_s, v.white_m_s, v.white_down_m_s,
            *lag_weights(v.smoothing_tau_s, period),
            e.quantum_m, steps_per_unit(e.quantum_m), v.quantum_m_s, steps_per_unit(v.quantum_m_s),
            self.horizontal_sigma_m, self.vertical_sigma_m, self.speed_sigma_m_s,
            self.stated_spread, e.spread, *self.outage.levels(period),
        )  # fmt: skip
