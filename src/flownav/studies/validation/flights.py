"""Which recorded flights the simulator is held against, and what their logs do not say of the vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from flownav.core.parameter_files import Number, ParameterModel, load, shipped
from flownav.replays.session import table_windows

SHIPPED_FILE = "validation.toml"

Window = tuple[float, float]


class RecordedFlight(ParameterModel):
    """A log's folder, and its GPS outages: `[T0, T1, LENGTH]` each, seconds of the log."""

    log: str
    windows_s: tuple[tuple[Number, Number, Number], ...] = Field(min_length=1)

    def windows(self) -> list[Window]:
        """Each outage [s]. InputError where one cannot be."""
        return [window for whole in self.windows_s for window in table_windows(*whole, option=f"{self.log}: windows_s")]


class AssumedVehicle(ParameterModel):
    """What sensor models ask of a vehicle and a log does not tell; path_bandwidth_hz: of the path that is flown."""

    thrust_n: Number = Field(gt=0.0, le=1e4)
    rotor_radius_m: Number = Field(gt=0.0, le=10.0)
    rotor_speed_rad_s: Number = Field(gt=0.0, le=1e4)
    rotor_speed_spread: Number = Field(ge=0.0, lt=1.0)
    blades: Number = Field(ge=1.0, le=12.0)
    hover_power_w: Number = Field(ge=0.0, le=1e5)
    path_bandwidth_hz: Number = Field(gt=0.1, le=5.0)
    flow_max_height_m: Number = Field(gt=0.0, le=1000.0)


class ValidationFile(ParameterModel):
    """The file of flights."""

    schema_version: Literal[1]
    name: str
    provenance: str
    flight: tuple[RecordedFlight, ...] = Field(min_length=1)
    vehicle: AssumedVehicle


def load_flights(path: Path | None = None) -> ValidationFile:
    """The flights of a file; the shipped ones where `path` is None. InputError names file, key and allowed range."""
    return load(path or shipped(SHIPPED_FILE), ValidationFile)
