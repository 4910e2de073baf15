"""Stability margins of a loop from its frequency response L(jω), where L = -1 is the edge of stability.

`margins_over_box` has those of every loop at every corner of a vehicle's uncertainty box, flown with the gains of the
file's nominal vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.control.design import gains_for
from flownav.control.gains import AutopilotGains
from flownav.control.loops import LOOPS, loop_gains, spectral_radius
from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.core.text import finite
from flownav.vehicle.corners import corners
from flownav.vehicle.kinds import AnyVehicle, hover_of, load_vehicle
from flownav.vehicle.linearize import Complex, LinearPlant, frequency_response, hover_plant, rotor_plant
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.trim import Trim

# MIL-DTL-9490E's limits for a rigid vehicle's loops. Gains that keep them for the nominal vehicle alone drift a tenth
# as far, and keep 10 degrees and 1 dB at a corner; those with 7 and 1.9 were unstable inside the box (control.md).
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
    rotor speed that droops. InputError as `load_vehicle` and, for the nominal vehicle, `trim`.
    """
    vehicle_ = load_vehicle(path)
    gains = gains_for(vehicle_, hover_of(vehicle_), 0.0, feels_gusts=feels_gusts)
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


class Margins(NamedTuple):
    """The least phase [deg], gain [dB] and delay [s] that take a closed loop to the edge of stability.

    phase_deg: more lag or more lead, whichever is less, over all crossings of |L| = 1. gain_db: more or less gain,
    over all crossings of the negative real axis. delay_s: over all crossings of |L| = 1. Infinite without a crossing.
    """

    phase_deg: float
    gain_db: float
    delay_s: float

    def finite(self) -> dict[str, float | None]:
        """By name, null where nothing takes the loop to its edge."""
        found: dict[str, float | None] = finite(self._asdict())
        return found


def margins(loop: Complex, omega_rad_s: Array) -> Margins:
    """The margins of L(jω) (n,) on a grid of frequencies fine enough to interpolate on."""
    log_w, phase = np.log(omega_rad_s), np.unwrap(np.angle(loop))
    level = np.log(np.abs(loop))
    gain_crossings, phases = _crossings(level, phase)
    at_w = np.exp(np.interp(gain_crossings, np.arange(len(log_w)), log_w))
    from_edge = _wrapped(phases - np.pi)
    lag = np.mod(from_edge, 2.0 * np.pi)
    levels = [_crossings(phase - edge, level)[1] for edge in _edges(phase)]
    return Margins(
        phase_deg=float(np.degrees(np.min(np.abs(from_edge), initial=np.inf))),
        gain_db=float(20.0 / np.log(10.0) * min((np.min(np.abs(x), initial=np.inf) for x in levels), default=np.inf)),
        delay_s=float(np.min(lag / at_w, initial=np.inf)),
    )


def _edges(phase: Array) -> Array:
    """The odd multiples of π within reach of an unwrapped phase."""
    first, last = np.floor(phase.min() / np.pi), np.ceil(phase.max() / np.pi)
    multiples = np.arange(first, last + 1.0)
    return np.asarray(np.pi * multiples[np.mod(multiples, 2.0) == 1.0])


def _crossings(crossing: Array, read: Array) -> tuple[Array, Array]:
    """Where `crossing` changes sign, as a fractional index, and what `read` is there."""
    at = np.nonzero(np.diff(np.signbit(crossing)))[0]
    share = crossing[at] / (crossing[at] - crossing[at + 1])
    return at + share, read[at] + share * (read[at + 1] - read[at])


def _wrapped(angle: Array) -> Array:
    return np.asarray(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)
