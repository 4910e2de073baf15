"""What there is to know of a helicopter before it flies: trim, linear models beside the paper's, ground effect."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.vehicle import ground_effect
from flownav.vehicle.linearize import INPUTS, STATES, LinearModel, eigenvalues, reduced_model
from flownav.vehicle.loading import describe_vehicle, load_vehicle
from flownav.vehicle.multirotor_parameters import MultirotorParameters
from flownav.vehicle.multirotor_sheet import MultirotorSheet, multirotor_sheet
from flownav.vehicle.paper_model import ReducedModel, load_paper_model
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.trim import Trim, trim

HEIGHTS_OVER_R = (0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0)

_multiplier = ground_effect.multiplier


class VehicleSheet(NamedTuple):
    """Hover out of ground effect: the trim, both reduced models, the paper's, and (z/R, multiplier) pairs."""

    name: str
    vehicle: VehicleParameters
    trim: Trim
    frozen: LinearModel
    quasi_steady: LinearModel
    paper: ReducedModel
    ground_effect: tuple[tuple[float, float], ...]


def vehicle_sheet(path: Path | None = None) -> VehicleSheet | MultirotorSheet:
    """The sheet of a vehicle file, the shipped one where `path` is None. InputError as `load_vehicle` and `trim`."""
    vehicle = load_vehicle(path)
    if isinstance(vehicle, MultirotorParameters):
        return multirotor_sheet(describe_vehicle(path).name, vehicle)
    return helicopter_sheet(describe_vehicle(path).name, vehicle)


def helicopter_sheet(name: str, vehicle: VehicleParameters) -> VehicleSheet:
    """The sheet of a helicopter."""
    hover = trim(vehicle)
    return VehicleSheet(
        name=name,
        vehicle=vehicle,
        trim=hover,
        frozen=reduced_model(vehicle, hover, freeze_inflow=True),
        quasi_steady=reduced_model(vehicle, hover, freeze_inflow=False),
        paper=load_paper_model(),
        ground_effect=ground_effect_in_hover(vehicle, hover.induced_velocity_m_s),
    )


def ground_effect_in_hover(vehicle: VehicleParameters, induced_m_s: float) -> tuple[tuple[float, float], ...]:
    """(hub height over rotor radius, thrust multiplier) pairs of equation 11 without airspeed."""
    radius = vehicle.main_radius_m
    return tuple((ratio, float(_multiplier(ratio * radius, 0.0, induced_m_s, radius))) for ratio in HEIGHTS_OVER_R)


def as_json(sheet: VehicleSheet) -> dict[str, Any]:
    """The sheet as numbers, strings and lists; SI and radians, eigenvalues as [real, imaginary] pairs."""
    hover = sheet.trim
    return {
        "vehicle": sheet.name,
        "trim": {
            "collective_rad": hover.collective_rad,
            "pedal_rad": hover.pedal_rad,
            "roll_rad": hover.roll_rad,
            "pitch_rad": hover.pitch_rad,
            "induced_velocity_m_s": hover.induced_velocity_m_s,
            "power_w": hover.power_w,
            "tail_power_w": hover.tail_power_w,
            "thrust_n": hover.thrust_n,
            "flap_back_rad": hover.a1,
            "flap_right_rad": hover.b1,
            "lon_rad": hover.lon,
            "lat_rad": hover.lat,
        },
        "states": list(STATES),
        "inputs": list(INPUTS),
        "frozen_inflow": _model(sheet.frozen.a, sheet.frozen.b),
        "quasi_steady_inflow": _model(sheet.quasi_steady.a, sheet.quasi_steady.b),
        "paper": _model(sheet.paper.a, sheet.paper.b),
        "ground_effect": [{"z_over_R": ratio, "multiplier": gain} for ratio, gain in sheet.ground_effect],
    }


def _model(a: NDArray[np.float64], b: NDArray[np.float64]) -> dict[str, Any]:
    pairs = [[float(value.real), float(value.imag)] for value in eigenvalues(a)]
    return {"A": a.tolist(), "B": b.tolist(), "eigenvalues": pairs}
