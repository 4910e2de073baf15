"""One flight with parts of somebody else's, on the compiled loop, as a scored Record."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

import numpy as np

from flownav.campaigns.local import record_flown
from flownav.core.compile import ONE_LANE, announce_compilation
from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.core.record import Record
from flownav.navigation.packed import load_flow_settings
from flownav.navigation.take import navigator_unit
from flownav.navigation.told import carries_lag
from flownav.parts.calling import Mistakes, name_of
from flownav.parts.equations import EquationFilter, EquationVehicle
from flownav.parts.plant import OwnController, OwnVehicle
from flownav.parts.protocols import Parts, Told
from flownav.parts.sensing import OwnReadings
from flownav.parts.taking import Taker
from flownav.simulation.assemble import Setup
from flownav.simulation.engine import Flown, Instead, buffers_of, fly_into
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.history import column
from flownav.simulation.plan import Flight, OwnParts
from flownav.simulation.sensing import EPOCH_S
from flownav.simulation.truth import SensorFault

Part = TypeVar("Part")


def fresh(part: Part | type[Part] | Callable[[], Part]) -> Part:
    """A part that has flown nothing: of a class or a function a new one, of an object a copy.

    InputError where it cannot be made.
    """
    make: Callable[[], Any] = partial(copy.deepcopy, part)
    if isinstance(part, type) or (callable(part) and not hasattr(part, "start")):
        make = part
    try:
        made: Part = make()
    except Exception as mistake:
        said = " ".join(str(mistake).split())
        raise InputError(f"{name_of(part)}: cannot be made: {type(mistake).__name__}: {said}") from mistake
    return made


def fresh_parts(parts: Parts) -> Parts:
    """All of them."""
    return Parts(
        parts.filter and fresh(parts.filter), tuple(map(fresh, parts.sensors)), parts.vehicle and fresh(parts.vehicle),
        parts.controller and fresh(parts.controller),
    )  # fmt: skip


def fly_with(
    setup: Setup, parts: Parts, seed: int, index: int = 0, ensemble: Ensemble | None = None,
    fault: SensorFault | None = None,
) -> Record:  # fmt: skip
    """Flight `index` of a seed with these parts, each of which begins anew, as a scored Record.

    InputError where the scenario's filter is the paper's, which is fed otherwise, or where a part makes a mistake.
    """
    flown = fly_parts(setup, parts, seed, index, ensemble, fault, written=True)
    drawn = None
    if ensemble is not None:
        drawn = {name: values[0] for name, values in ensemble.values(seed, index, 1).items()}
    record = record_flown(setup, flown, seed, index, drawn)
    record.manifest["parts"] = names_of(parts)
    if parts.filter is not None:
        record.manifest["filter"] = name_of(parts.filter)
    return record


def names_of(parts: Parts) -> dict[str, Any]:
    """What is not ours, by its name."""
    named: dict[str, Any] = {
        "filter": parts.filter and name_of(parts.filter),
        "sensors": [name_of(part) for part in parts.sensors],
        "vehicle": parts.vehicle and name_of(parts.vehicle),
        "controller": parts.controller and name_of(parts.controller),
    }
    return {name: value for name, value in named.items() if value}


def require_started(flight: Flight, history: Array, name: str) -> None:
    """InputError where a filter had said nothing by when it was to be flown on; until it speaks the truth is flown on.

    history: (epochs, len(HISTORY), lanes).
    """
    assert flight.table is not None
    first = math.ceil(flight.plan.handover_s / EPOCH_S) + flight.table.horizon_epochs + 1
    said = np.isfinite(history[first:, column("horizon", "error_pos_n_m")])
    if len(said) and not said[0].all():
        silent = int(np.argmin(said[0]))
        late = np.flatnonzero(said[:, silent])
        when = f"spoke first at {(first + late[0]) * EPOCH_S:.2f} s" if len(late) else "never said anything"
        raise InputError(
            f"filter {name}: {when}, and is flown on from {flight.plan.handover_s:g} s on: estimate() must say "
            "something by then"
        )


def fly_parts(
    setup: Setup, parts: Parts, seed: int, index: int, ensemble: Ensemble | None = None,
    fault: SensorFault | None = None, *, written: bool,
) -> Flown:  # fmt: skip
    """The same, not yet scored; written: with the navigator's tape and what it was fed."""
    flight = setup.flight if fault is None else setup.flight._replace(fails=True)
    fitted, table = setup.fitted, flight.table
    if fitted is None or table is None:
        raise InputError(f'{setup.scenario.name}: filter = "paper" takes no parts; fly the "landing" sensors with them')
    parts, mistakes = fresh_parts(parts), Mistakes()
    b = buffers_of(flight, ONE_LANE, flight.plan.epochs, written=written or parts.filter is not None)
    compiled = navigator_unit(ONE_LANE, carries_lag(load_flow_settings(flight.settings)))
    with announce_compilation("single-flight"):
        instead: int | None = None
        taker: Taker | None = None
        if isinstance(parts.filter, EquationFilter):
            compiled = parts.filter.unit(ONE_LANE)
            instead = compiled.address
        elif parts.filter is not None:
            told = Told(fitted.told.settings.settings(fitted.equipment, fitted.told.noise))
            taker = Taker(parts.filter, told, b.nav, b.tape, mistakes)
            instead = taker.address
        if parts.sensors:
            for sensor in parts.sensors:
                sensor.start(seed, index)
            then: Callable[..., None] = taker.called.entry if taker else compiled
            readings = OwnReadings(parts.sensors, table, b, then, mistakes)
            instead = readings.address
        fast = parts.vehicle.unit if isinstance(parts.vehicle, EquationVehicle) else None
        vehicle = OwnVehicle(parts.vehicle, b.work, mistakes) if parts.vehicle and fast is None else None
        controller = OwnController(parts.controller, flight, b.work, mistakes) if parts.controller else None
        if vehicle or controller or fast:
            stepped = fast.address if fast else (vehicle.called.address if vehicle else 0)
            flight = flight._replace(own=OwnParts(stepped, controller.called.address if controller else 0))
        faults = None if fault is None else [fault]
        fly_into(flight, seed, index, ONE_LANE, b, ensemble, Instead(faults=faults, take=instead))
    mistakes.tell()
    if parts.filter is not None:
        require_started(flight, b.history, name_of(parts.filter))
    return Flown(b.history, b.tape, b.fed)
