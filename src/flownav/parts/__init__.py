"""Parts that somebody else wrote: a filter, a sensor, a vehicle or a controller in one file, flown in place of ours."""

from flownav.parts.protocols import (
    Controller,
    Estimate,
    Filter,
    Flown,
    Imu,
    Innovation,
    Outputs,
    Parts,
    Reading,
    SensorModel,
    Told,
    Truth,
    Values,
    VehicleModel,
)

__all__ = [
    "Controller",
    "Estimate",
    "Filter",
    "Flown",
    "Imu",
    "Innovation",
    "Outputs",
    "Parts",
    "Reading",
    "SensorModel",
    "Told",
    "Truth",
    "Values",
    "VehicleModel",
]
