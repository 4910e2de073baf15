"""Own parts as the API takes them: by name, as a class or as an object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flownav.core.errors import InputError
from flownav.parts.calling import name_of
from flownav.parts.naming import OURS, part_of, require
from flownav.parts.protocols import Parts


def split(filter: Any, sensors: Sequence[Any], vehicle: Any, controller: Any) -> tuple[Parts, str | None, Any]:
    """What is somebody else's, and the names of filter and vehicle that are the scenario's (None where they are not).

    A filter by another name than ours is an entry point's or a file's. InputError where an object is no such part.
    """
    own_filter, own_vehicle = None, None
    if filter is not None and not (isinstance(filter, str) and filter in OURS["filter"]):
        own_filter, filter = _part("filter", filter), None
    if vehicle is not None and (hasattr(vehicle, "derivative") or (isinstance(vehicle, str) and ":" in vehicle)):
        own_vehicle, vehicle = _part("vehicle", vehicle), None
    if isinstance(sensors, str) or not isinstance(sensors, Sequence):
        raise InputError("sensors: a list of them is needed, such as sensors=[MyRange]")
    own_sensors = tuple(_part("sensor", sensor) for sensor in sensors)
    own_controller = None if controller is None else _part("controller", controller)
    return Parts(own_filter, own_sensors, own_vehicle, own_controller), filter, vehicle


def own_filter(filter: Any) -> Any:
    """The filter of a replay that is not ours; None where ours is meant."""
    if isinstance(filter, str) and filter == "paper":
        raise InputError("--filter paper: the paper's filter flies in simulation only, where it is fed as it was")
    return None if filter is None or (isinstance(filter, str) and filter == "landing") else _part("filter", filter)


def _part(kind: str, part: Any) -> Any:
    """A part by its name, or the one that is given."""
    if isinstance(part, str):
        return part_of(kind, part)
    require(kind, part, name_of(part))
    return part
