"""The record of a live session as a Log: what its filter was fed, in the very order, so that a replay is exact."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from flownav.errors import InputError
from flownav.logs.log import FedSegment, Log
from flownav.measurement import COLUMNS, MAX_VALUES, Array, EventQueue, Sensor, Stream
from flownav.provenance import hash_of
from flownav.record import FED, Record


def read_live_record(path: Path, *, flow_instance: int | None = None) -> Log:
    """Read a record that `flownav live --record` wrote.

    InputError where it cannot be read, is no live session's, holds nothing, or a flow instance is asked for.
    """
    if flow_instance is not None:
        raise InputError(f"--flow-instance: {path} holds what a live filter was fed, of one flow sensor; leave it out")
    record = Record.load(path)
    if record.manifest.get("kind") != "live" or "fed" not in record.tables:
        raise InputError(
            f"{path}: a record of kind {record.manifest.get('kind')!r}; `flownav live --record` writes one"
        )
    try:
        fed = record.matrix("fed", FED)
        segments = [dict(segment) for segment in record.manifest["segments"]]
        parameters = dict(record.manifest["parameters"])
        if not len(fed):
            raise InputError(f"{path}: the session heard nothing that its filter could use")
        numbers = fed[:, FED.index("segment")].astype(int)
        parts = tuple(FedSegment(_floats(segments[i]), _queue(fed, numbers == i)) for i in range(len(segments)))
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a whole live record ({error}); record the session again") from error
    return Log(
        path,
        _streams(fed),
        _origin(parameters),
        record.tables.get("truth"),
        {path.name: hash_of(path)},
        (f"a live session of {len(parts)} navigator{'s' * (len(parts) != 1)}: fed again as it was fed",),
        fed=parts,
        fed_settings=parameters,
    )


def _floats(equipment: dict[str, Any]) -> dict[str, Any]:
    """JSON writes infinity as a name that Python reads back; whatever wrote it, these are numbers."""
    return {name: value if isinstance(value, bool) else float(value) for name, value in equipment.items()}


def _origin(parameters: dict[str, Any]) -> tuple[float, float, float] | None:
    stated = parameters.get("origin_lat_lon_deg_alt_m")
    return None if stated is None else (float(stated[0]), float(stated[1]), float(stated[2]))


def _queue(fed: Array, rows: Any) -> EventQueue:
    """The rows as the navigator took them; `row` counts within each sensor's stream."""
    value, variance = FED.index("value_0"), FED.index("variance_0")
    sensor = fed[:, FED.index("sensor")].astype(np.int64)
    place = np.zeros(len(fed), np.int64)
    for kind in np.unique(sensor):
        place[sensor == kind] = np.arange(np.count_nonzero(sensor == kind))
    part = fed[rows]
    return EventQueue(
        np.ascontiguousarray(part[:, 0]),
        sensor[rows],
        np.ascontiguousarray(part[:, value : value + MAX_VALUES]),
        np.ascontiguousarray(part[:, variance : variance + MAX_VALUES]),
        np.ascontiguousarray(part[:, FED.index("quality")]),
        place[rows],
    )


def _streams(fed: Array) -> dict[Sensor, Stream]:
    """Each sensor's readings, for the scores and findings; flow with the two columns that the feeding added."""
    value, variance = FED.index("value_0"), FED.index("variance_0")
    streams = {}
    for sensor in Sensor:
        rows = fed[fed[:, FED.index("sensor")] == sensor]
        if len(rows):
            width = len(COLUMNS[sensor])
            arrival = rows[:, FED.index("arrival_s")]
            streams[sensor] = Stream.of(
                sensor,
                arrival,
                rows[:, value : value + width],
                variance=rows[:, variance : variance + width],
                quality=rows[:, FED.index("quality")],
                delay_s=float(np.median(arrival - rows[:, 0])),
            )
    return streams
