"""The datasheet of a switch under the skids, and the coefficients that follow from it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

from pydantic import Field, ValidationInfo, field_validator

from flownav.core.parameter_files import Number
from flownav.sensors.chance import level_of
from flownav.sensors.sheet import SensorSheet
from flownav.sensors.skid_switch import SkidSwitchParameters


class SkidSwitchSheet(SensorSheet):
    """A switch. Loads are shares of the vehicle's weight; stuck shares are of flights."""

    shipped_file: ClassVar[str] = "skid_switch.toml"

    rate_hz: Number = Field(ge=1.0, le=1000.0)
    closing_share: Number = Field(gt=0.0, le=1.0)
    opening_share: Number = Field(gt=0.0, le=1.0)
    sigma_share: Number = Field(0.0, ge=0.0, le=1.0)
    debounce_s: Number = Field(ge=0.0, le=5.0)
    stuck_open_share: Number = Field(0.0, ge=0.0, le=0.5)
    stuck_closed_share: Number = Field(0.0, ge=0.0, le=0.5)

    @field_validator("opening_share")
    @classmethod
    def _below(cls, value: float, info: ValidationInfo) -> float:
        if value > info.data.get("closing_share", 1.0):
            raise ValueError(f"at most closing_share = {info.data['closing_share']:g} is needed")
        return value

    def parameters(self, weight_n: float) -> SkidSwitchParameters:
        """Coefficients of one reading on a vehicle of this weight."""
        return SkidSwitchParameters(
            closing_load_n=self.closing_share * weight_n,
            opening_load_n=self.opening_share * weight_n,
            sigma_n=self.sigma_share * weight_n,
            debounce_readings=max(1.0, float(math.ceil(self.debounce_s * self.rate_hz - 1e-9))),
            stuck_open_above=level_of(self.stuck_open_share),
            stuck_closed_below=-level_of(self.stuck_closed_share),
        )


def load_skid_switch_sheet(path: Path | str | None = None) -> SkidSwitchSheet:
    """The switch of a file; the shipped one where `path` is None."""
    return SkidSwitchSheet.read(path)
