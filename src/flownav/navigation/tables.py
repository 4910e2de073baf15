"""Tables of a record: a navigator's readings and its output, the same for replay, live and simulation."""

from typing import NamedTuple

import numpy as np

from flownav.core.measurement import MAX_VALUES, Array, EventQueue, Sensor
from flownav.core.record import (
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
from flownav.estimation.gating import Reason
from flownav.navigation.rows import EstimateRow, InnovationRow
from flownav.navigation.tape import EVENT_NAMES, OBSERVES, Tape

Happening = tuple[float, str, str, str, float]  # time [s], source, kind, what the value is, value


class Written(NamedTuple):
    """Output of one lane's navigator: rows of a tape's estimate, innovation and event (`navigation.rows`)."""

    estimate: Array
    innovation: Array
    event: Array


def written_on(tape: Tape, lane: int = 0) -> Written:
    """The rows of one lane of a tape."""
    return Written(tape.estimates(lane), tape.offers(lane), tape.events(lane))


def estimate_table(rows: Array) -> Table:
    """Rows of a tape's estimate: position, body velocity, attitude, standard deviations, protection levels."""
    row = EstimateRow.of(rows)
    followed = bool(np.isfinite(row.protection_m).any())  # a smoother has none
    return {
        "t_s": row.t_s,
        **_named(POSITION_NED, row.pos_ned_m),
        **_named(VELOCITY_BODY, row.vel_frd_m_s),
        **_named(QUATERNION, row.quaternion),
        **_named(_stds(POSITION_NED), row.std_pos_ned_m),
        **_named(_stds(VELOCITY_BODY), row.std_vel_frd_m_s),
        **(_named(PROTECTION_LEVELS, row.protection_m) if followed else {}),
    }


def states_table(rows: Array) -> Table:
    """The rest of the same rows: every other state with its standard deviation."""
    row = EstimateRow.of(rows)
    return {
        "t_s": row.t_s,
        **_named(VELOCITY_NED, row.vel_ned_m_s),
        **_named(_stds(TILTS), row.std_tilt_ned_rad),
        **_named(FILTER_STATES, row.states),
        **_named(_stds(FILTER_STATES), row.std_states),
    }


def _named(names: tuple[str, ...], columns: Array) -> Table:
    """Columns (n, len(names)) by their names in a record."""
    return dict(zip(names, columns.T, strict=True))


def _stds(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"std_{name}" for name in names)


def innovation_table(rows: Array) -> Table:
    """Rows of a tape's innovation, one for each offered component; `t_s` is the instant that the reading describes."""
    offered = InnovationRow.of(rows)
    sensor, component, reason = (column.astype(int) for column in (offered.sensor, offered.component, offered.reason))
    sensor_names = np.array(["", *(s.name.lower() for s in Sensor)])
    reasons = np.array([r.label for r in Reason])
    return {
        "t_s": offered.t_s,
        "sensor": sensor_names[sensor],
        "component": _component_names()[sensor, component],
        "observation": offered.observation,
        "observation_variance": offered.observation_variance,
        "innovation": offered.innovation,
        "innovation_variance": offered.innovation_variance,
        "test_ratio": offered.test_ratio,
        "fused": reason == Reason.FUSED,
        "reason": reasons[reason],
    }


def _component_names() -> Array:
    """Names of the quantities that a sensor observes, by sensor number and component."""
    names = np.full((max(Sensor) + 1, 3), "", dtype="U16")
    for sensor, observed in OBSERVES.items():
        names[sensor, : len(observed)] = observed
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
