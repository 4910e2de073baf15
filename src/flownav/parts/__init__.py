"""Parts that somebody else wrote: a filter, a sensor, a vehicle or a controller in one file, flown in place of ours."""

from flownav.control.guidance import Reference
from flownav.parts.protocols import (
    Controller,
    Estimate,
    Filter,
    Flown,
    GivenSettings,
    Imu,
    Innovation,
    Outputs,
    Parts,
    Reading,
    SensorModel,
    Truth,
    Values,
    VehicleModel,
)
from flownav.vehicle.state import Around, Controls

Told = GivenSettings  # its earlier name

__all__ = [
    "Around",
    "Controller",
    "Controls",
    "Estimate",
    "Filter",
    "Flown",
    "GivenSettings",
    "Imu",
    "Innovation",
    "Outputs",
    "Parts",
    "Reading",
    "Reference",
    "SensorModel",
    "Told",
    "Truth",
    "Values",
    "VehicleModel",
]
