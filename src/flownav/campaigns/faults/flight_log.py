"""A simulated flight as the log that its vehicle would have recorded: what its own sensors said, when it arrived."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flownav.core.measurement import COLUMNS, Array, Sensor, Stream
from flownav.core.record import FED, Record
from flownav.logs.log import Log
from flownav.navigation.loop import STATED_VARIANCES
from flownav.simulation.assemble import Setup

VALUE, VARIANCE = FED.index("value_0"), FED.index("variance_0")


def log_of(record: Record, setup: Setup) -> Log:
    """The log of a recorded flight of `setup`, with the flight's truth and what its autopilot flew on beside it.

    Each stream states the age of its readings as the sensor's datasheet does. ValueError where the flight carries no
    sensors of its own (it flew on the paper's filter).
    """
    if "fed" not in record.tables or setup.fitted is None:
        raise ValueError("the flight has no sensors of its own; fly it on the navigator")
    fed, limits = record.matrix("fed", FED), setup.sensor.limits
    streams = {sensor: stream_of(fed, sensor, float(setup.fitted.ages_s[sensor])) for sensor in Sensor}
    ranger = setup.fitted.sheets.range_sensor
    ranges = {} if ranger is None else {"range_m": (float(ranger.floor_m), float(ranger.ceiling_m))}
    return Log(
        Path(f"{setup.scenario.name} (simulated)"),
        {sensor: stream for sensor, stream in streams.items() if len(stream)},
        truth=record.tables["truth"],
        autopilot=record.tables["flown"],
        autopilot_name="flownav",
        limits=ranges
        | {
            "flow_height_m": (float(limits.min_height_m), float(limits.max_height_m)),
            "flow_rad_s": (0.0, float(limits.max_flow_rad_s)),
        },
    )


def stream_of(fed: Array, sensor: Sensor, delay_s: float) -> Stream:
    """One sensor's readings that arrived, of rows as `record.FED` has them."""
    mine = (fed[:, FED.index("sensor")] == sensor) & (fed[:, FED.index("arrived")] > 0.0)
    rows, width = fed[mine], len(COLUMNS[sensor])
    variance = np.full((len(rows), width), np.nan)
    stated = min(width, STATED_VARIANCES)
    variance[:, :stated] = rows[:, VARIANCE : VARIANCE + stated]
    return Stream.of(
        sensor,
        rows[:, FED.index("arrival_s")],
        rows[:, VALUE : VALUE + width],
        variance=variance,
        quality=rows[:, FED.index("quality")],
        delay_s=delay_s,
    )
