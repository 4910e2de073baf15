"""What a navigator was fed and what it wrote, as the tables of a record: the same for replay, live and simulation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.estimation.gating import Reason
from flownav.measurement import COLUMNS, MAX_VALUES, Array, EventQueue, Sensor
from flownav.navigation.tape import EVENT_NAMES, EXTRA_STATES, LEVELS_AT, Tape
from flownav.record import (
    FED,
    FILTER_STATES,
    POSITION_NED,
    PROTECTION_LEVELS,
    QUATERNION,
    TILTS,
    VELOCITY_BODY,
    VELOCITY_NED,
    Table,
)

Happening = tuple[float, str, str, str, float]  # time [s], source, kind, what the value is, value


class Written(NamedTuple):
    """What one lane's navigator wrote: estimate (n, ESTIMATE_COLUMNS), innovation (m, OFFERS), event (k, 3)."""

    estimate: Array
    innovation: Array
    event: Array


def written_on(tape: Tape, lane: int = 0) -> Written:
    """The rows of one lane of a tape."""
    return Written(tape.estimates(lane), tape.offers(lane), tape.events(lane))


def estimate_table(rows: Array) -> Table:
    """Rows of a tape's estimate: position, body velocity, attitude, standard deviations, protection levels."""
    names = (*POSITION_NED, *VELOCITY_BODY, *QUATERNION, *(f"std_{name}" for name in (*POSITION_NED, *VELOCITY_BODY)))
    followed = bool(np.isfinite(rows[:, LEVELS_AT:]).any())  # a smoother has none
    levels = dict(zip(PROTECTION_LEVELS, rows[:, LEVELS_AT:].T, strict=True)) if followed else {}
    return {"t_s": rows[:, 0], **dict(zip(names, rows[:, 1:17].T, strict=True)), **levels}


def states_table(rows: Array) -> Table:
    """The rest of the same rows: every other state with its standard deviation."""
    spreads = rows[:, 23 + EXTRA_STATES : LEVELS_AT].T
    return {
        "t_s": rows[:, 0],
        **dict(zip(VELOCITY_NED, rows[:, 17:20].T, strict=True)),
        **dict(zip((f"std_{name}" for name in TILTS), rows[:, 20:23].T, strict=True)),
        **dict(zip(FILTER_STATES, rows[:, 23 : 23 + EXTRA_STATES].T, strict=True)),
        **dict(zip((f"std_{name}" for name in FILTER_STATES), spreads, strict=True)),
    }


def innovation_table(rows: Array) -> Table:
    """Rows of a tape's innovation, one for each offered component; `t_s` is the instant that the reading describes."""
    sensor, component, reason = rows[:, 1].astype(int), rows[:, 2].astype(int), rows[:, 8].astype(int)
    sensor_names = np.array(["", *(s.name.lower() for s in Sensor)])
    reasons = np.array([r.label for r in Reason])
    return {
        "t_s": rows[:, 0],
        "sensor": sensor_names[sensor],
        "component": _component_names()[sensor, component],
        "observation": rows[:, 3],
        "observation_variance": rows[:, 4],
        "innovation": rows[:, 5],
        "innovation_variance": rows[:, 6],
        "test_ratio": rows[:, 7],
        "fused": reason == Reason.FUSED,
        "reason": reasons[reason],
    }


def _component_names() -> Array:
    """What each component of a sensor observes, by sensor number and component."""
    names = np.full((max(Sensor) + 1, 3), "", dtype="U16")
    for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.FLOW_VELOCITY, Sensor.POSE, Sensor.PAD):
        names[sensor] = COLUMNS[sensor]
    names[Sensor.LANDED] = COLUMNS[Sensor.GPS_VELOCITY]
    names[Sensor.ATTITUDE] = ("tilt_n_rad", "tilt_e_rad", "heading_rad")
    names[Sensor.MAG] = names[Sensor.YAW] = "heading_rad"
    names[Sensor.FLOW_RATE, :2] = COLUMNS[Sensor.FLOW_RATE][:2]
    names[Sensor.RANGE] = COLUMNS[Sensor.RANGE]
    names[Sensor.BARO] = COLUMNS[Sensor.BARO]
    return names


def happenings(rows: Array) -> list[Happening]:
    """Rows of a tape's events."""
    return [(t_s, *EVENT_NAMES[int(kind)], value) for t_s, kind, value in rows.tolist()]


def fed_rows(queue: EventQueue, arrival_s: Array, segment: int) -> Array:
    """A queue as rows of `record.FED`, (n, len(FED)); segment: which navigator takes it."""
    assert queue.value.shape[1] == queue.variance.shape[1] == MAX_VALUES
    return np.column_stack([
        queue.t_s, arrival_s, queue.sensor, queue.value, queue.variance, queue.quality,
        np.full(len(queue.t_s), segment), queue.withheld, queue.arrived,
    ])  # fmt: skip


def fed_table(rows: Array) -> Table:
    """Such rows as the table."""
    return dict(zip(FED, rows.T, strict=True))
