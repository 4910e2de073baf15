"""The datasheet of a barometer, and the coefficients that follow from it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

from pydantic import Field

from flownav.core.frames import GRAVITY_M_S2
from flownav.core.parameter_files import Number
from flownav.sensors.barometer import BarometerParameters
from flownav.sensors.first_order import lag_weights
from flownav.sensors.gauss_markov import gauss_markov_coefficients
from flownav.sensors.quantisation import steps_per_unit
from flownav.sensors.sheet import SensorSheet


class BarometerSheet(SensorSheet):
    """A barometer where it is fitted.

    wash_share, ground_share: pressure error at the port over the rotor's disk loading, out of ground effect and what
    the ground adds at rotor height 0; wash_spread: the share by which flights differ in them.
    """

    shipped_file: ClassVar[str] = "barometer.toml"

    rate_hz: Number = Field(ge=1.0, le=200.0)
    sigma_m: Number = Field(ge=0.0, le=10.0)
    resolution_m: Number = Field(0.0, ge=0.0, le=10.0)
    lag_s: Number = Field(0.0, ge=0.0, le=10.0)
    offset_sigma_m: Number = Field(0.0, ge=0.0, le=100.0)
    drift_sigma_m: Number = Field(ge=0.0, le=100.0)
    drift_tau_s: Number = Field(ge=0.0, le=1e5)
    ramp_m_per_h: Number = Field(0.0, ge=0.0, le=1000.0)
    wash_share: Number = Field(0.0, ge=-2.0, le=2.0)
    ground_share: Number = Field(0.0, ge=-2.0, le=2.0)
    wash_spread: Number = Field(0.0, ge=0.0, le=2.0)

    def parameters(self, rotor_radius_m: float, air_density_kg_m3: float) -> BarometerParameters:
        """Coefficients of one reading on a vehicle with this rotor (of a multirotor: the disk of all its rotors)."""
        m_per_n = 1.0 / (math.pi * rotor_radius_m**2 * air_density_kg_m3 * GRAVITY_M_S2)
        return BarometerParameters(
            *gauss_markov_coefficients(self.drift_tau_s, self.period_s), self.drift_sigma_m,
            self.ramp_m_per_h / 3600.0 * self.period_s, self.offset_sigma_m,
            self.wash_share * m_per_n, self.ground_share * m_per_n, 1.0 / rotor_radius_m, self.wash_spread,
            *lag_weights(self.lag_s, self.period_s),
            self.sigma_m, self.resolution_m, steps_per_unit(self.resolution_m),
        )  # fmt: skip


def load_barometer_sheet(path: Path | str | None = None) -> BarometerSheet:
    """The barometer of a file; the shipped one where `path` is None."""
    return BarometerSheet.read(path)
