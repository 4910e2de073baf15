"""The readings of a carried sensor on a path, by the equations that the simulator flies, called one by one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, get_type_hints

from flownav.simulation.truth import CARRIED
from flownav.studies.validation.drawn import Flight

Seen = dict[Any, Any]  # records by their kinds


def readings(
    flight: Flight, name: str, drawn: str, p: Any, seen: Sequence[Seen], step: Callable[..., Any] | None = None
) -> list[Any]:
    """What a carried sensor reads of what it sees, one reading after the other, by the equations of its row.

    drawn: the name of its draws; p: its coefficients; step: its equation, where the row's takes more than the sensor's.
    """
    one = next(sensor for sensor in CARRIED if sensor.name == name)
    step, values, kept = step or one.step, [], {one.parameters: p}
    kept[one.unit] = lawful(one.draw, kept | {one.unit: one.unit(*normals_of(flight, f"{drawn} unit", one.unit))})
    if one.start is not None:
        begun = {} if one.begun is None else {one.begun: one.begun(*normals_of(flight, f"{drawn} start", one.begun))}
        kept[one.state] = lawful(one.start, kept | begun | seen[0])
    normals = flight.normals(drawn, len(seen), len(one.normals._fields)).tolist()
    for now, of_this in zip(seen, normals, strict=True):
        read = lawful(step, kept | now | {one.normals: one.normals(*of_this)})
        if one.state is not None:
            kept[one.state], read = read
        values.append(read)
    return values


def lawful(law: Callable[..., Any], records: Seen) -> Any:
    """What a law says of the records that its parameters are annotated with."""
    return law(*(records[kind] for name, kind in hints_of(law).items() if name != "return"))


hints_of = lru_cache(get_type_hints)


def normals_of(flight: Flight, name: str, record: Any) -> list[float]:
    """Standard normals of what is drawn once a flight, one for each field of a record."""
    drawn: list[float] = flight.normals(name, 1, len(record._fields))[0].tolist()
    return drawn
