"""Every loop's margins at every corner of a vehicle's uncertainty box, flown with the gains of the vehicle as told."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.control.design import gains_for
from flownav.control.gains import AutopilotGains
from flownav.control.loops import LOOPS, loop_gains
from flownav.control.margins import Margins, margins
from flownav.control.sampled import spectral_radius
from flownav.core.errors import InputError
from flownav.vehicle.corners import corners
from flownav.vehicle.kinds import AnyVehicle, hover_of
from flownav.vehicle.loading import load_vehicle
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.plant import LinearPlant, frequency_response, hover_plant, rotor_plant
from flownav.vehicle.trim import Trim

LEAST_PHASE_DEG = 45.0
LEAST_GAIN_DB = 6.0
FREQUENCIES_RAD_S = np.geomspace(0.02, 400.0, 400)
INFLOW_HELD = "inflow held"
ROTOR_FREE = "rotor free"


class LoopMargins(NamedTuple):
    """One loop at one corner; margins are negative where the closed loop is unstable there."""

    loop: str
    corner: str
    margins: Margins


class Box(NamedTuple):
    """All loops at all corners, and the corners that cannot hover."""

    rows: tuple[LoopMargins, ...]
    cannot_hover: tuple[str, ...]


def margins_over_box(path: Path | None = None, *, feels_gusts: bool = True) -> Box:
    """The margins of a vehicle file's loops, nominal first; the shipped vehicle where `path` is None.

    Each corner is judged with the inflow in balance at once, and held; a helicopter's also with its inflow's lag and a
    rotor speed that droops. InputError as `load_vehicle` and, for the vehicle as told, `trim`.
    """
    told = load_vehicle(path)
    gains = gains_for(told, hover_of(told), 0.0, feels_gusts=feels_gusts)
    rows: list[LoopMargins] = []
    lost: list[str] = []
    for corner in corners(path):
        try:
            plants = tuple(_plants(corner.name, corner.vehicle))
        except InputError:
            lost.append(corner.name)
            continue
        for name, plant in plants:
            rows += margins_of(plant, gains, name)
    return Box(tuple(rows), tuple(lost))


def margins_of(plant: LinearPlant, gains: AutopilotGains, corner: str) -> list[LoopMargins]:
    """Each loop of one plant."""
    w = FREQUENCIES_RAD_S
    sign = 1.0 if spectral_radius(plant, gains) < 1.0 else -1.0
    found = loop_gains(frequency_response(plant, w), w, gains)
    return [
        LoopMargins(loop, corner, Margins(*(sign * x for x in margins(found[:, i], w)))) for i, loop in enumerate(LOOPS)
    ]


def short_of_margin(row: LoopMargins) -> bool:
    """Whether a loop keeps less than 45 degrees or 6 dB."""
    return row.margins.phase_deg < LEAST_PHASE_DEG or row.margins.gain_db < LEAST_GAIN_DB


def _plants(name: str, vehicle: AnyVehicle) -> Iterator[tuple[str, LinearPlant]]:
    about = hover_of(vehicle)
    for held in (False, True):
        yield f"{name}, {INFLOW_HELD}" if held else name, hover_plant(vehicle, about, freeze_inflow=held)
    if isinstance(vehicle, VehicleParameters) and isinstance(about, Trim):
        yield f"{name}, {ROTOR_FREE}", rotor_plant(vehicle, about)
