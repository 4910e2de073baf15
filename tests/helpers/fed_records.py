"""Records that say what a navigator was fed, as `live --record` and `fly` write them."""

from __future__ import annotations

import numpy as np

from flownav.core.measurement import EventQueue, Sensor, merge
from flownav.core.record import Record
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tables import fed_rows, fed_table
from navigation_streams import circle, equipment, fly

FLOWN = fly(circle, 12.0, 0.2)


def queue_of_flight() -> EventQueue:
    """Every seventh fix stayed away, and one flow reading in ten was taken away."""
    queue = merge(FLOWN.streams.values())
    fixes = np.flatnonzero(queue.sensor == Sensor.GPS_POSITION)
    flow = np.flatnonzero(queue.sensor == Sensor.FLOW_RATE)
    queue.arrived[fixes[::7]] = 0.0
    queue.withheld[flow[::10]] = 1.0
    return queue


def record_of(queue: EventQueue, kind: str = "fly", without: tuple[str, ...] = ()) -> Record:
    record = Record({
        "kind": kind,
        "segments": [equipment(FLOWN, queue)._asdict()],
        "parameters": {"filter": NavigatorSettingsFile().model_dump(), "gps_delay_s": 0.0},
    })  # fmt: skip
    table = fed_table(fed_rows(queue, queue.t_s, 0))
    record.add("fed", {name: column for name, column in table.items() if name not in without})
    return record
