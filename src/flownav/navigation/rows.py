"""The rows of a tape, by name: the filter's estimate at an instant, the outcome of a component, a happening.

Each is a record of one row's numbers in a kernel, and of whole columns where `of` takes rows apart.
"""

from __future__ import annotations

from typing import Annotated, Any, Generic, NamedTuple, TypeVar

import numpy as np

from flownav.core.compile import Lanes, Work, columns_of, equation, gathering, row_of, row_store, width_of
from flownav.core.frames import Rotation, Vector, to_body
from flownav.core.measurement import Array
from flownav.estimation.covariance import covariance_of, variance_of
from flownav.estimation.motion import rotation_of
from flownav.estimation.states import (
    ATTITUDE,
    GYRO_BIAS,
    INNOVATION,
    INNOVATION_VARIANCE,
    NOISE,
    POSITION,
    QUATERNION,
    STATE,
    STATES,
    TEST_RATIO,
    VELOCITY,
)
from flownav.navigation.memory import OBSERVATION, PROTECTION, REASON, SCALE_DOUBT, load_start
from flownav.navigation.reasons import BEFORE_START, DUPLICATE, LATE

EXTRA_STATES = range(GYRO_BIAS, STATES)  # those that have no name of their own here: `record.FILTER_STATES`
Value = TypeVar("Value")


class EstimateRow(NamedTuple, Generic[Value]):
    """The estimate at an instant, which is NaN for a lane that has not started, with standard deviations.

    std_tilt_ned_rad: of the attitude's error about north, east and down. states: from the gyro's bias on.
    protection_m: levels, horizontal and vertical.
    """

    t_s: Value
    pos_ned_m: Annotated[Value, 3]
    vel_frd_m_s: Annotated[Value, 3]
    quaternion: Annotated[Value, 4]
    std_pos_ned_m: Annotated[Value, 3]
    std_vel_frd_m_s: Annotated[Value, 3]
    vel_ned_m_s: Annotated[Value, 3]
    std_tilt_ned_rad: Annotated[Value, 3]
    states: Annotated[Value, len(EXTRA_STATES)]
    std_states: Annotated[Value, len(EXTRA_STATES)]
    protection_m: Annotated[Value, 2]

    @classmethod
    def of(cls, rows: Array) -> EstimateRow[Array]:
        """The columns of rows (n, ESTIMATE_COLUMNS)."""
        found: EstimateRow[Array] = columns_of(cls, rows)
        return found


class InnovationRow(NamedTuple, Generic[Value]):
    """Outcome of one component of a reading; t_s: the instant that it describes.

    sensor: `measurement.Sensor`; component: of its observation; innovation, its variance and test_ratio are NaN where
    nothing was tested; reason: `gating.Reason`.
    """

    t_s: Value
    sensor: Value
    component: Value
    observation: Value
    observation_variance: Value
    innovation: Value
    innovation_variance: Value
    test_ratio: Value
    reason: Value

    @classmethod
    def of(cls, rows: Array) -> InnovationRow[Array]:
        """The columns of rows (n, INNOVATION_COLUMNS)."""
        found: InnovationRow[Array] = columns_of(cls, rows)
        return found


class EventRow(NamedTuple, Generic[Value]):
    """A happening; kind: a place in `tape.EVENT_NAMES`, which names the value's meaning."""

    t_s: Value
    kind: Value
    value: Value

    @classmethod
    def of(cls, rows: Array) -> EventRow[Array]:
        """The columns of rows (n, EVENT_COLUMNS)."""
        found: EventRow[Array] = columns_of(cls, rows)
        return found


ESTIMATE_COLUMNS, INNOVATION_COLUMNS, EVENT_COLUMNS = map(width_of, (EstimateRow, InnovationRow, EventRow))
store_estimate, store_innovation, store_event = map(row_store, (EstimateRow, InnovationRow, EventRow))


# -- what became of a component ----------------------------------------------------------------------------
@equation
def innovation_row(
    work: Work, lanes: Lanes, lane: int, t_s: float, sensor: int, component: int
) -> InnovationRow[float]:
    """Outcome of one lane's component; where nothing was tested, the test's values are NaN."""
    reason = work[REASON * len(lanes) + lane]
    tested = reason != BEFORE_START and reason != DUPLICATE and reason != LATE
    return InnovationRow(
        t_s, sensor, component, work[OBSERVATION * len(lanes) + lane], work[NOISE * len(lanes) + lane],
        work[INNOVATION * len(lanes) + lane] if tested else np.nan,
        work[INNOVATION_VARIANCE * len(lanes) + lane] if tested else np.nan,
        work[TEST_RATIO * len(lanes) + lane] if tested else np.nan,
        reason,
    )  # fmt: skip


# -- the estimate ------------------------------------------------------------------------------------------
@equation
def of_unknown_scale(work: Work, lanes: Lanes, state: int, lane: int) -> float:
    """Error of a horizontal position [m], from the start on, or velocity [m/s] due to a flow scale that no sensor
    determines: one standard deviation.
    """
    unknown: float = work[SCALE_DOUBT * len(lanes) + lane] * work[(STATE + state) * len(lanes) + lane]
    return unknown


@equation
def position_variance(work: Work, lanes: Lanes, axis: int, lane: int) -> float:
    """Variance of position [m2]; level, with the error of a flow scale that nothing determines."""
    unknown_m = of_unknown_scale(work, lanes, POSITION + axis, lane) if axis < 2 else 0.0
    return variance_of(work, lanes, POSITION + axis, lane) + unknown_m * unknown_m


@equation
def position_deviation(work: Work, lanes: Lanes, axis: int, lane: int) -> float:
    """Its square root [m]."""
    deviation: float = np.sqrt(position_variance(work, lanes, axis, lane))
    return deviation


@equation
def tilt_deviation(work: Work, lanes: Lanes, axis: int, lane: int) -> float:
    """Standard deviation of the attitude about an axis of the earth [rad]."""
    deviation: float = np.sqrt(variance_of(work, lanes, ATTITUDE + axis, lane))
    return deviation


@equation
def deviation_of(work: Work, lanes: Lanes, state: int, lane: int) -> float:
    """Standard deviation of a state, 0 where rounding has left its variance below that."""
    deviation: float = np.sqrt(max(variance_of(work, lanes, state, lane), 0.0))
    return deviation


@equation
def body_velocity_variance(work: Work, lanes: Lanes, lane: int, north: float, east: float, down: float) -> float:
    """e' P_vv e of one body axis e in earth NED [m2/s2], with the error of a flow scale that nothing determines."""
    axis = (north, east, down)
    unknown = north * of_unknown_scale(work, lanes, VELOCITY, lane)
    unknown += east * of_unknown_scale(work, lanes, VELOCITY + 1, lane)
    variance = unknown * unknown
    for j in range(3):
        for k in range(3):
            variance += axis[j] * covariance_of(work, lanes, VELOCITY + j, VELOCITY + k, lane) * axis[k]
    return max(variance, 0.0)


@equation
def body_velocity_deviations(work: Work, lanes: Lanes, lane: int, rotation: Rotation) -> Vector:
    """Standard deviations of the velocity along the body's axes [m/s]; rotation: body to earth."""
    return (
        np.sqrt(body_velocity_variance(work, lanes, lane, rotation[0], rotation[3], rotation[6])),
        np.sqrt(body_velocity_variance(work, lanes, lane, rotation[1], rotation[4], rotation[7])),
        np.sqrt(body_velocity_variance(work, lanes, lane, rotation[2], rotation[5], rotation[8])),
    )


load_position = gathering(row_of, range(STATE + POSITION, STATE + POSITION + 3))
load_velocity = gathering(row_of, range(STATE + VELOCITY, STATE + VELOCITY + 3))
load_quaternion = gathering(row_of, range(QUATERNION, QUATERNION + 4))
load_extra_states = gathering(row_of, range(STATE + EXTRA_STATES.start, STATE + EXTRA_STATES.stop))
load_protection = gathering(row_of, range(PROTECTION, PROTECTION + 2))
position_deviations = gathering(position_deviation, range(3))
tilt_deviations = gathering(tilt_deviation, range(3))
extra_deviations = gathering(deviation_of, EXTRA_STATES)


@equation
def estimate_row(work: Work, lanes: Lanes, lane: int, t_s: float) -> EstimateRow[Any]:
    """One lane's estimate as a row, with standard deviations and protection levels."""
    started = load_start(work, lanes, lane).started > 0.0
    rotation = rotation_of(work, lanes, lane)
    velocity = load_velocity(work, lanes, lane)
    return EstimateRow(
        t_s if started else np.nan,
        load_position(work, lanes, lane),
        to_body(rotation, velocity[0], velocity[1], velocity[2]),
        load_quaternion(work, lanes, lane),
        position_deviations(work, lanes, lane),
        body_velocity_deviations(work, lanes, lane, rotation),
        velocity,
        tilt_deviations(work, lanes, lane),
        load_extra_states(work, lanes, lane),
        extra_deviations(work, lanes, lane),
        load_protection(work, lanes, lane),
    )
