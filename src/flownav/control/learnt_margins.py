"""Stability margins of a vehicle that was learnt in hover: its plant as it was learnt, and the box of the remaining
doubt.

The vehicle of the file with the learnt numbers in it: its inertias moved until the stiffnesses are those, its flapping
and its cyclic servos as they were found. The box of it has the ends of the 95 % intervals of stiffness and lag, crossed
with drag and flapping response, which a stir does not show; mass is moved alone.
"""

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

from flownav.control.design import nominal_model
from flownav.control.gains import AutopilotGains
from flownav.control.learning import Learnt
from flownav.control.learnt_gains import LoopGains, gains_with
from flownav.control.margins import Box, LoopMargins, margins_of
from flownav.core.errors import InputError
from flownav.vehicle.kinds import described_again, flattened
from flownav.vehicle.linearize import hover_plant
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.trim import Trim, trim

CROSSED = ("stiffness", "lag", "drag")
SIDED_95 = 1.96
DRAGS = ("fuselage_area_x_m2", "fuselage_area_y_m2", "flap_response")
DRAG, MASS = 0.35, 0.076  # as the box that the table was searched for (tools/learnt_shapes.py)


def as_learnt(vehicle: VehicleParameters, hover: Trim, learnt: Learnt) -> VehicleParameters:
    """The vehicle of the file with these stiffnesses, this flapping and these servos."""
    nominal = nominal_model(vehicle, hover, -1)
    late = learnt.lag_s - 1.0 / learnt.flap_rate_1_s
    return vehicle._replace(
        inertia_xx_kg_m2=vehicle.inertia_xx_kg_m2 * nominal.roll_stiffness_1_s2 / learnt.roll_stiffness_1_s2,
        inertia_yy_kg_m2=vehicle.inertia_yy_kg_m2 * nominal.pitch_stiffness_1_s2 / learnt.pitch_stiffness_1_s2,
        flap_rate_1_s=learnt.flap_rate_1_s,
        cyclic_frequency_rad_s=2.0 * vehicle.cyclic_damping_ratio / late,
    )


def corners_of(vehicle: VehicleParameters, hover: Trim, learnt: Learnt) -> Iterator[tuple[str, VehicleParameters]]:
    """Corners of the learnt vehicle's uncertainty, each by name."""
    yield "as learnt", as_learnt(vehicle, hover, learnt)
    for k, lag, drag in itertools.product((-1.0, 1.0), repeat=3):
        moved = learnt._replace(
            pitch_stiffness_1_s2=learnt.pitch_stiffness_1_s2 * (1.0 + SIDED_95 * k * learnt.std_pitch_stiffness),
            roll_stiffness_1_s2=learnt.roll_stiffness_1_s2 * (1.0 + SIDED_95 * k * learnt.std_roll_stiffness),
            lag_s=learnt.lag_s * (1.0 + SIDED_95 * lag * learnt.std_lag),
        )
        drags = {name: getattr(vehicle, name) * (1.0 + DRAG * drag) for name in DRAGS}
        name = ", ".join(f"{what} {_sign(side)}" for what, side in zip(CROSSED, (k, lag, drag), strict=True))
        yield name, as_learnt(vehicle, hover, moved)._replace(**drags)
    for heavy in (-1.0, 1.0):
        one = as_learnt(vehicle, hover, learnt)
        yield f"mass {_sign(heavy)}", one._replace(mass_kg=one.mass_kg * (1.0 + MASS * heavy))


def margins_of_learnt(vehicle: VehicleParameters, hover: Trim, learnt: Learnt, gains: AutopilotGains) -> Box:
    """The margins that these gains keep, as learnt and at each corner. InputError where a corner cannot hover."""
    rows: list[LoopMargins] = []
    for name, one in corners_of(vehicle, hover, learnt):
        rows += margins_of(hover_plant(one, trim(one)), gains, name)
    return Box(tuple(rows), ())


def margins_of_record(manifest: Mapping[str, Any], where: str) -> Box:
    """The margins of the gains that a recorded flight found for the vehicle that it learnt. InputError: it learnt none.

    They are computed when they are used: they would cost every flight a quarter of a second.
    """
    learnt, parameters = manifest.get("learnt") or {}, manifest.get("parameters") or {}
    vehicle = flattened(described_again(parameters["vehicle"], where)) if learnt.get("verdict") == "learnt" else None
    if not isinstance(vehicle, VehicleParameters):
        verdict = learnt.get("verdict", "this flight was not to learn its vehicle")
        raise InputError(f"{where}: no vehicle was learnt ({verdict}); `flownav fly approach` learns its own")
    gains = gains_with(AutopilotGains(**parameters["autopilot_gains"]), LoopGains(**learnt["gains"]))
    numbers = {name: learnt[name] for name in Learnt._fields if name in learnt}
    return margins_of_learnt(vehicle, trim(vehicle), Learnt(state=1.0, since=0.0, **numbers), gains)


def _sign(side: float) -> str:
    return "+" if side > 0.0 else "-"
