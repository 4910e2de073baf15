"""Summary of a vehicle before it flies.

Of a helicopter: trim, linear models beside the paper's, ground effect. Of a multirotor: hover, battery, loads by
airspeed, ground effect.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.vehicle import linearize
from flownav.vehicle.kinds import describe_vehicle, load_vehicle
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters, full_thrust
from flownav.vehicle.rotor import multiplier
from flownav.vehicle.trim import MultirotorTrim, Trim, trim, trim_multirotor

TRIM_SHOWN = (
    "collective_rad", "pedal_rad", "roll_rad", "pitch_rad", "induced_velocity_m_s", "power_w", "tail_power_w",
    "thrust_n",
)  # fmt: skip
ROTORS_TRIM_SHOWN = ("thrust_n", "speed_rad_s", "induced_velocity_m_s", "power_w", "current_a", "voltage_v")
HEIGHTS_OVER_R = (0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0)


class VehicleSheet(NamedTuple):
    """Hover out of ground effect: the trim, both reduced models, the paper's, and (z/R, multiplier) pairs."""

    name: str
    vehicle: VehicleParameters
    trim: Trim
    frozen: linearize.LinearModel
    quasi_steady: linearize.LinearModel
    paper: linearize.ReducedModel
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
        frozen=linearize.reduced_model(vehicle, hover, freeze_inflow=True),
        quasi_steady=linearize.reduced_model(vehicle, hover, freeze_inflow=False),
        paper=linearize.load_paper_model(),
        ground_effect=ground_effect_in_hover(vehicle, hover.induced_velocity_m_s),
    )


def ground_effect_in_hover(vehicle: VehicleParameters, induced_m_s: float) -> tuple[tuple[float, float], ...]:
    """(hub height over rotor radius, thrust multiplier) pairs of equation 11 without airspeed."""
    radius = vehicle.main_radius_m
    return tuple((ratio, float(multiplier(ratio * radius, 0.0, induced_m_s, radius))) for ratio in HEIGHTS_OVER_R)


def as_json(sheet: VehicleSheet) -> dict[str, Any]:
    """The sheet as numbers, strings and lists; SI and radians, eigenvalues as [real, imaginary] pairs."""
    hover = sheet.trim
    return {
        "vehicle": sheet.name,
        "trim": {
            **{name: getattr(hover, name) for name in TRIM_SHOWN},
            "flap_back_rad": hover.a1,
            "flap_right_rad": hover.b1,
            "lon_rad": hover.lon,
            "lat_rad": hover.lat,
        },
        "states": list(linearize.STATES),
        "inputs": list(linearize.INPUTS),
        "frozen_inflow": _model(sheet.frozen.a, sheet.frozen.b),
        "quasi_steady_inflow": _model(sheet.quasi_steady.a, sheet.quasi_steady.b),
        "paper": _model(sheet.paper.a, sheet.paper.b),
        "ground_effect": [{"z_over_R": ratio, "multiplier": gain} for ratio, gain in sheet.ground_effect],
    }


def _model(a: NDArray[np.float64], b: NDArray[np.float64]) -> dict[str, Any]:
    pairs = [[float(value.real), float(value.imag)] for value in linearize.eigenvalues(a)]
    return {"A": a.tolist(), "B": b.tolist(), "eigenvalues": pairs}


SPEEDS_M_S = (0.0, 2.0, 4.0, 8.0)
ROTOR_HEIGHTS_OVER_R = (1.5, 2.0, 3.0, 4.0, 8.0)


class MultirotorSheet(NamedTuple):
    """Hover out of ground effect; (airspeed, trim) pairs; (height of the rotors over R, share of full thrust) pairs.

    The last has no height at which the feet would carry weight.
    """

    name: str
    vehicle: MultirotorParameters
    trim: MultirotorTrim
    forward: tuple[tuple[float, MultirotorTrim], ...]
    near_ground: tuple[tuple[float, float], ...]


def multirotor_sheet(name: str, vehicle: MultirotorParameters) -> MultirotorSheet:
    """The sheet of a multirotor. InputError as `trim_multirotor`."""
    hover = trim_multirotor(vehicle)
    above = vehicle.rotors_above_cg_m
    return MultirotorSheet(
        name=name,
        vehicle=vehicle,
        trim=hover,
        forward=tuple((speed, trim_multirotor(vehicle, (speed, 0.0, 0.0))) for speed in SPEEDS_M_S),
        near_ground=tuple(
            (ratio, trim_multirotor(vehicle, height_m=ratio * vehicle.radius_m - above).controls.col)
            for ratio in ROTOR_HEIGHTS_OVER_R
            if ratio * vehicle.radius_m - above > vehicle.cg_above_skid_m
        ),
    )


def facts_of(sheet: MultirotorSheet) -> dict[str, Any]:
    """The sheet as numbers and lists; SI and radians, thrust as shares of full thrust."""
    hover = sheet.trim
    return {
        "vehicle": sheet.name,
        "trim": {"thrust_share": hover.controls.col} | {name: getattr(hover, name) for name in ROTORS_TRIM_SHOWN},
        "full_thrust_n": sheet.vehicle.rotor_count * full_thrust(sheet.vehicle),
        "forward": [
            {"speed_m_s": speed, "pitch_rad": at.pitch_rad, "thrust_share": at.controls.col, "power_w": at.power_w}
            for speed, at in sheet.forward
        ],
        "near_ground": [{"z_over_R": ratio, "thrust_share": share} for ratio, share in sheet.near_ground],
    }


def rows_of(sheet: MultirotorSheet) -> list[tuple[str, str]]:
    """Name and figure of everything, for people."""
    hover = sheet.trim
    rows = [
        ("share of full thrust in hover", f"{hover.controls.col:.3f}"),
        ("thrust, N", f"{hover.thrust_n:.2f}"),
        ("full thrust, N", f"{sheet.vehicle.rotor_count * full_thrust(sheet.vehicle):.1f}"),
        ("rotors' speed, rad/s", f"{hover.speed_rad_s:.0f}"),
        ("induced velocity, m/s", f"{hover.induced_velocity_m_s:.2f}"),
        ("shaft power, W", f"{hover.power_w:.0f}"),
        ("current, A", f"{hover.current_a:.2f}"),
        ("voltage, V", f"{hover.voltage_v:.2f}"),
    ]
    for speed, flight in sheet.forward[1:]:
        rows.append((f"pitch at {speed:g} m/s, deg", f"{math.degrees(flight.pitch_rad):.2f}"))
        rows.append((f"share of full thrust at {speed:g} m/s", f"{flight.controls.col:.3f}"))
    rows += [(f"share of full thrust, rotors at {ratio:g} R", f"{share:.3f}") for ratio, share in sheet.near_ground]
    return rows
