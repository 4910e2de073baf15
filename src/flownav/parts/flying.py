"""Flights with parts of somebody else's on the compiled loop: one as a scored Record, or a campaign's.

A campaign flies them one after the other, or, where they are equations, on lanes. Last: a log through a filter of
somebody else's, in our navigator's place.
"""

import copy
import hashlib
import inspect
import json
import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from flownav.campaigns.engines import Engine, Local, Part
from flownav.campaigns.local import fly_recorded, record_flown, rows_of
from flownav.campaigns.plan import Ready
from flownav.campaigns.run import Recording
from flownav.core.compile import LANES, ONE_LANE, announce_compilation
from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, VELOCITY_BODY, Record
from flownav.logs.log import Log
from flownav.navigation.kernel_settings import carries_lag
from flownav.navigation.loop import Running
from flownav.navigation.packed import load_flow_settings
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.take import navigator_unit
from flownav.parts.calling import Mistakes, name_of, naming_part, words_of
from flownav.parts.equations import EquationFilter, EquationVehicle, address_of
from flownav.parts.plant import OwnController, OwnReadings, OwnVehicle
from flownav.parts.protocols import Filter, GivenSettings, Parts
from flownav.parts.taking import LARGEST, Taker
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import Replay, replay
from flownav.simulation.assemble import Setup
from flownav.simulation.engine import Flown, Instead, buffers_of, fly_into, learnt_in
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.history import column, columns
from flownav.simulation.plan import Flight, OwnParts
from flownav.simulation.sensing import EPOCH_S
from flownav.simulation.truth import SensorFault

One = TypeVar("One")
ERRORS, TRUE_PLACE = tuple(f"error_{name}" for name in (*POSITION_NED, *VELOCITY_BODY)), ("truth", POSITION_NED)


def fresh(part: One | type[One] | Callable[[], One]) -> One:
    """A part that has flown nothing: of a class or a function a new one, of an object a copy.

    InputError where it cannot be made.
    """
    make: Callable[[], Any] = partial(copy.deepcopy, part)
    if isinstance(part, type) or (callable(part) and not hasattr(part, "start")):
        make = part
    try:
        made: One = make()
    except Exception as mistake:
        raise InputError(f"{name_of(part)}: cannot be made: {words_of(mistake)}") from mistake
    return made


def fresh_parts(parts: Parts) -> Parts:
    """Every part, made anew."""
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
    """The user's own parts, by their names."""
    named: dict[str, Any] = {
        "filter": parts.filter and name_of(parts.filter),
        "sensors": [name_of(part) for part in parts.sensors],
        "vehicle": parts.vehicle and name_of(parts.vehicle),
        "controller": parts.controller and name_of(parts.controller),
    }
    return {name: value for name, value in named.items() if value}


def require_started(flight: Flight, history: Array, name: str) -> None:
    """InputError where a filter had no estimate when the autopilot began to use it, or an impossible one.

    Until its first estimate the autopilot uses the truth. history: (epochs, len(HISTORY), lanes).
    """
    assert flight.table is not None
    first = math.ceil(flight.plan.handover_s / EPOCH_S) + flight.table.horizon_epochs + 1
    finite = np.isfinite(history[first:, column("horizon", "error_pos_n_m")])
    if len(finite) and not finite[0].all():
        silent = int(np.argmin(finite[0]))
        late = np.flatnonzero(finite[:, silent])
        when = (
            f"gave its first estimate at {(first + late[0]) * EPOCH_S:.2f} s" if len(late) else "never gave an estimate"
        )
        raise InputError(
            f"filter {name}: {when}, and the autopilot uses it from {flight.plan.handover_s:g} s on: "
            "estimate() must return one by then"
        )
    errors, places = (history[first:, columns(table, names)] for table, names in (("horizon", ERRORS), TRUE_PLACE))
    wild = np.any(~np.all(np.abs(errors) <= LARGEST, axis=1) & np.all(np.isfinite(places), axis=1), axis=1)
    require_none(wild, EPOCH_S * np.arange(first, first + len(errors), dtype=np.float64), name)


def require_none(wild: ArrayLike, t_s: Array, name: str) -> None:
    """InputError at the first instant at which a filter's estimate is impossible; wild, t_s: (n,)."""
    if np.any(wild):
        at_s = float(t_s[int(np.argmax(wild))])
        raise InputError(f"filter {name}: its estimate of {at_s:.2f} s is not finite, or beyond {LARGEST:g}; mend it")


def fly_parts(
    setup: Setup, parts: Parts, seed: int, index: int, ensemble: Ensemble | None = None,
    fault: SensorFault | None = None, *, written: bool,
) -> Flown:  # fmt: skip
    """Flights of own parts, not yet scored; written: with the navigator's tape and what it was fed."""
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
            instead = address_of(compiled, f"filter {name_of(parts.filter)}")
        elif parts.filter is not None:
            given = GivenSettings(fitted.given.settings.settings(fitted.equipment, fitted.given.noise))
            taker = Taker(parts.filter, given, b.nav, b.tape, mistakes)
            instead = taker.address
        if parts.sensors:
            for sensor in parts.sensors:
                with naming_part(f"sensor {name_of(sensor)}"):
                    sensor.start(seed, index)
            then: Callable[..., None] = taker.called.entry if taker else compiled
            readings = OwnReadings(parts.sensors, table, b, then, mistakes)
            instead = readings.address
        fast = parts.vehicle.unit if isinstance(parts.vehicle, EquationVehicle) else None
        vehicle = OwnVehicle(parts.vehicle, b.work, mistakes) if parts.vehicle and fast is None else None
        controller = OwnController(parts.controller, flight, b.work, mistakes) if parts.controller else None
        if vehicle or controller or fast:
            stepped = vehicle.called.address if vehicle else 0
            if fast:
                stepped = address_of(fast, f"vehicle {name_of(parts.vehicle)}")
            flight = flight._replace(own=OwnParts(stepped, controller.called.address if controller else 0))
        faults = None if fault is None else [fault]
        fly_into(flight, seed, index, ONE_LANE, b, ensemble, Instead(faults=faults, take=instead))
    mistakes.tell()
    if parts.filter is not None:
        require_started(flight, b.history, name_of(parts.filter))
    return Flown(b.history, b.tape, b.fed, learnt_in(b.work, ONE_LANE))


class OwnPartsEngine:
    """parts: flown in every flight, each beginning anew; a filter of equations alone, on lanes as ours."""

    piece = 1

    def __init__(self, parts: Parts) -> None:
        self.parts = parts

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object] = lambda flown: None
    ) -> Iterator[tuple[Part, Array]]:
        """The rows of each part. InputError where a part of a flight makes a mistake."""
        own = self.parts
        if isinstance(own.filter, EquationFilter) and not (own.sensors or own.vehicle or own.controller):
            with announce_compilation("batch"):
                address = address_of(own.filter.unit(LANES), f"filter {name_of(own.filter)}")
            check = partial(require_started, name=name_of(own.filter))
            yield from Local(instead=address, check=check).fly(cell, seed, parts, on_progress)
            return
        faults = cell.faults(seed)
        for part in parts:
            rows = []
            for number in range(part.first, part.first + part.flights):
                fault = faults(number) if faults else None
                flown = fly_parts(cell.setup, self.parts, seed, number, cell.ensemble, fault, written=False)
                rows.append(rows_of(cell.flight, flown.history))
                on_progress(1)
            yield part, np.concatenate(rows)

    def recording(
        self, setup: Setup, seed: int, index: int, ensemble: Ensemble | None, fault: SensorFault | None, /
    ) -> Record:
        """One of the flights as a scored record."""
        return fly_with(setup, self.parts, seed, index, ensemble, fault)


def recording_of(engine: Engine | None) -> Recording:
    """How the flights of an engine are flown again, one by one."""
    return engine.recording if isinstance(engine, OwnPartsEngine) else fly_recorded


def identities(parts: Parts) -> tuple[str, ...]:
    """The identity of parts in a campaign's folder: kind, name and SHA-256 of their source and numbers.

    That is the class, the source of its file, and the object's own numbers. A campaign resumes with these alone.
    """
    kinds = [("filter", parts.filter), *(("sensor", one) for one in parts.sensors), ("vehicle", parts.vehicle),
             ("controller", parts.controller)]  # fmt: skip
    return tuple(f"{kind} {name_of(part)} {_digest(part)}" for kind, part in kinds if part is not None)


def _digest(part: Any) -> str:
    """Digest of everything that a part is made of, as far as Python shows it."""
    digest = hashlib.sha256()
    made_of = [part if isinstance(part, type) or inspect.isfunction(part) else type(part)]
    if not isinstance(part, type) and not inspect.isfunction(part):
        own = vars(part) if hasattr(part, "__dict__") else {}
        public = {name: value for name, value in own.items() if not name.startswith("_") and name != "unit_source"}
        made_of += [value for value in public.values() if inspect.isfunction(value)]
        numbers = {name: value for name, value in public.items() if not inspect.isfunction(value)}
        try:
            digest.update(json.dumps(numbers, sort_keys=True, default=_plain).encode())
        except (TypeError, ValueError, RecursionError):  # keys of several kinds, or what holds itself
            digest.update(repr(numbers).encode(errors="backslashreplace"))
    for each in made_of:
        digest.update(f"{each.__module__} {each.__qualname__} {_source(each)}".encode())
    return digest.hexdigest()


def _plain(value: Any) -> Any:
    """A value that JSON has no word for."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else repr(value)


def _source(made_of: Any) -> str:
    """The source of the file that a class or a function stands in; of itself where it stands in none (a notebook)."""
    for each in (inspect.getmodule(made_of), made_of):
        try:
            return inspect.getsource(each) if each is not None else ""
        except (OSError, TypeError):
            continue
    return repr(made_of)


def replay_with(log: Log, options: ReplayOptions, settings: NavigatorSettingsFile, part: Filter) -> Replay:
    """A log's readings, prepared as for ours, through this filter, which begins anew.

    InputError as `replay`, and where the filter makes a mistake.
    """
    mistakes, kept = Mistakes(), []

    def instead(running: Running) -> int:
        if isinstance(part, EquationFilter):
            return address_of(part.unit(ONE_LANE), f"filter {name_of(part)}")
        kept.append(Taker(fresh(part), GivenSettings(running.given), running.work, running.tape, mistakes))
        return kept[-1].address

    try:
        flown = replay(log, options, settings, instead=instead)
    except InputError:
        mistakes.tell()  # its own exception is more informative than that it never started
        raise
    mistakes.tell()
    estimate_rows = flown.estimate_rows
    motion = np.column_stack([estimate_rows.pos_ned_m, estimate_rows.vel_frd_m_s, estimate_rows.quaternion])
    require_none(~np.all(np.abs(motion) <= LARGEST, axis=1), estimate_rows.t_s, name_of(part))
    return flown
