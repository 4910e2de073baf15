"""What a navigator remembers of each lane beside the filter's state: one named record a subject, and its rows.

`work` holds the filter's rows first (`estimation.states`), then these: the reading that is being taken, the
memories, and a few scalars that all lanes share, since the schedule of readings is the same in all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.compile import equation, lane_access
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.states import FILTER_ROWS, QUATERNION, Rows
from flownav.measurement import Array, Sensor


class Reading(NamedTuple):
    """One reading of one sensor, its values as `measurement.COLUMNS` has them and the variances that it states.

    Flow has two values more, the vehicle's own turning over its exposure [rad/s]. A variance is NaN where none is
    stated. quality: 0..255. arrived: 0 in a lane whose sensor stayed silent. withheld: 1 where the user takes it away.
    """

    value_0: float
    value_1: float
    value_2: float
    value_3: float
    value_4: float
    value_5: float
    variance_0: float
    variance_1: float
    variance_2: float
    quality: float
    arrived: float
    withheld: float


class StartMemory(NamedTuple):
    """started: 1 once the filter runs. Before that, the newest attitude that was read and its time [s], the mean specific
    force [m/s2] of so many readings, and the mean square of an axis about it [m2/s4].
    """

    started: float
    attitude_s: float
    qw: float
    qx: float
    qy: float
    qz: float
    force_x: float
    force_y: float
    force_z: float
    readings: float
    shaken: float


class AidMemory(NamedTuple):
    """aided_s: when something horizontal was fused last; flag: 0, 1 dead reckoning, 2 invalid; height_s: when something
    other than the range told the height; landed: 1 on the ground.
    """

    aided_s: float
    flag: float
    height_s: float
    landed: float


class ImuMemory(NamedTuple):
    """The newest reading (gyro [rad/s], specific force [m/s2], body FRD) and its time; the mean square of its jumps
    [m2/s4]; how far the accelerometer is doubted along body down [m/s2]; gap: 1 after a stretch without readings.
    """

    read_s: float
    gyro_x: float
    gyro_y: float
    gyro_z: float
    accel_x: float
    accel_y: float
    accel_z: float
    vibration: float
    doubt_m_s2: float
    gap: float


class RangeMemory(NamedTuple):
    """taken_s: of the last range that was fused; refused_s: since when they are refused; last_m and same_s: the last
    value and since when it repeats; down_m: where the vehicle was then; said_s: of the repetition that was reported;
    doubted: 1 once the accelerometer was doubted for it.
    """

    taken_s: float
    refused_s: float
    last_m: float
    same_s: float
    down_m: float
    said_s: float
    doubted: float


class EchoMemory(NamedTuple):
    """The two newest ranges [m], where the vehicle was then (down [m]), and the share of ranges that no neighbour
    confirms.
    """

    newest_m: float
    newest_down_m: float
    older_m: float
    older_down_m: float
    stray: float


class GroundMemory(NamedTuple):
    """known: 1 once ranges have found the ground. A ground that would be new: candidate_m, its down coordinate by the
    newest range; since_s and first_m, when and by which range it was seen first; agreeing, by how many in a row;
    varied: 1 where these were not all the same to the last digit.
    """

    known: float
    candidate_m: float
    since_s: float
    first_m: float
    agreeing: float
    varied: float


class FlowMemory(NamedTuple):
    """taken_s: of the last tested flow; excess: how many times noisier than its model; bias of the sensor's own gyro
    [rad/s] and from how many readings; ratio: mean of nu^2 over its variance; doubted: 1 while that is too large.
    """

    taken_s: float
    excess: float
    bias_x: float
    bias_y: float
    bias_count: float
    ratio: float
    doubted: float


class HeadingMemory(NamedTuple):
    """read_s: when a heading was read last; field_rad: direction of the level magnetic field in the filter's frame."""

    read_s: float
    field_rad: float


class BridgeMemory(NamedTuple):
    """The filter's attitude at the last attitude reading before a gap of the IMU, that reading, and the variances."""

    own_w: float
    own_x: float
    own_y: float
    own_z: float
    read_w: float
    read_x: float
    read_y: float
    read_z: float
    variance_n: float
    variance_e: float
    variance_d: float


class ImuWindow(NamedTuple):
    """Inertial readings of a window: how many, the first (turning p, q, r [rad/s], specific force x, y, z [m/s2]), sums
    of differences from it, and sums of their squares.
    """

    readings: float
    first_p: float
    first_q: float
    first_r: float
    first_x: float
    first_y: float
    first_z: float
    sum_p: float
    sum_q: float
    sum_r: float
    sum_x: float
    sum_y: float
    sum_z: float
    gyro_square: float
    accel_square: float


class SeenWindow(NamedTuple):
    """What else was read in a window: lowest and highest range [m] (the highest below 0: none), sums of the flow's
    velocity [m/s] and of how many, and the fastest level velocity by GPS [m/s].
    """

    range_low_m: float
    range_high_m: float
    flow_u_m_s: float
    flow_v_m_s: float
    flows: float
    gps_m_s: float


class WhitenessMemory(NamedTuple):
    """A block of innovations along one body axis: since when [s], their sum in standard deviations, how many. The block
    before, the mean square of blocks, and when it ended [s].
    """

    since_s: float
    total: float
    count: float
    before: float
    square: float
    ended_s: float


class RejectionMemory(NamedTuple):
    """How often GPS was refused for one state, one after the other, and since when."""

    times: float
    since_s: float


_rows = Rows(FILTER_ROWS)
READING = _rows.take(len(Reading._fields))
START = _rows.take(len(StartMemory._fields))
AID = _rows.take(len(AidMemory._fields))
IMU_HEARD = _rows.take(len(ImuMemory._fields))
RANGE = _rows.take(len(RangeMemory._fields))
ECHO = _rows.take(len(EchoMemory._fields))
GROUND_SEEN = _rows.take(len(GroundMemory._fields))
FLOW = _rows.take(len(FlowMemory._fields))
HEADING = _rows.take(len(HeadingMemory._fields))
BRIDGE = _rows.take(len(BridgeMemory._fields))
REJECTION = _rows.take(6 * len(RejectionMemory._fields))  # of position and velocity, north, east, down
IMU_WINDOW = _rows.take(len(ImuWindow._fields))
SEEN_WINDOW = _rows.take(len(SeenWindow._fields))
WHITENESS = _rows.take(3 * len(WhitenessMemory._fields))  # forward, right, down
ACCEL_FACTOR = _rows.take(3)  # how many times noisier than told the accelerometer is, by each of these
STANDS = _rows.take(1)  # what the vehicle did in the last window: `still.MOVES`, SHAKEN or RESTS
CONTACT = _rows.take(1)  # the range when it rested last [m]; NaN where it has not
BARO_KNOWN = _rows.take(1)
PAD_KNOWN = _rows.take(1)  # 0 no, or how: STOOD_ON, LEFT, SEEN of `place`
# what becomes of the component that is offered
REASON = _rows.take(1)
OBSERVATION = _rows.take(1)
LEVEL_RATIO = _rows.take(1)  # the larger test ratio of a fix's north and east
LENS_RANGE = _rows.take(1)  # from the lens to the ground, along the boresight [m]
INNOVATION_BEFORE = _rows.take(3)  # of the flow's components, at the reading before
KNOWN = _rows.take(1)  # 1 where that range is known
TURNING = _rows.take(2)  # what the flow saw of the vehicle's turning [rad/s]
TESTED = _rows.take(1)
SPENT = _rows.take(6)  # what moved the filter since the last inertial reading: rate and specific force, integrated
OWED = _rows.take(6)  # what past readings said and no step was long enough to pay, integrated
STEADY_FORCE = _rows.take(3)  # specific force NED [m/s2], smoothed as a GPS receiver smooths its velocity
MOVING = _rows.take(1)  # 1 where the IMU moves the filter over the step at hand
# shared by all lanes (kept in the first)
CLOCK = _rows.take(1)  # the instant that the filter has reached [s]
WRITTEN = _rows.take(1)  # the last estimate's [s]
ERRORS_CLOCK = _rows.take(1)  # the instant that the Gauss-Markov errors have reached [s]
STILL_CLOCK = _rows.take(1)  # the end of the last window [s]
LAST = _rows.take(max(Sensor) + 1)  # of each sensor, the newest instant [s]
WORK_ROWS = _rows.next

load_reading, store_reading = lane_access(Reading, READING)
load_start, store_start = lane_access(StartMemory, START)
load_aid, store_aid = lane_access(AidMemory, AID)
load_imu, store_imu = lane_access(ImuMemory, IMU_HEARD)
load_range, store_range = lane_access(RangeMemory, RANGE)
load_echo, store_echo = lane_access(EchoMemory, ECHO)
load_ground, store_ground = lane_access(GroundMemory, GROUND_SEEN)
load_flow, store_flow = lane_access(FlowMemory, FLOW)
load_heading, store_heading = lane_access(HeadingMemory, HEADING)
load_imu_window, store_imu_window = lane_access(ImuWindow, IMU_WINDOW)
load_seen_window, store_seen_window = lane_access(SeenWindow, SEEN_WINDOW)
load_bridge, store_bridge = lane_access(BridgeMemory, BRIDGE)

_FRESH: dict[int, tuple[float, ...]] = {
    QUATERNION: (1.0, 0.0, 0.0, 0.0),
    START: StartMemory(0.0, -np.inf, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    AID: AidMemory(np.nan, 0.0, -np.inf, 0.0),
    IMU_HEARD: ImuMemory(-np.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    RANGE: RangeMemory(-np.inf, np.nan, np.nan, np.nan, 0.0, np.nan, 0.0),
    ECHO: EchoMemory(np.nan, 0.0, np.nan, 0.0, 0.0),
    FLOW: FlowMemory(-np.inf, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    HEADING: HeadingMemory(-np.inf, np.nan),
    BRIDGE: BridgeMemory(*([np.nan] * len(BridgeMemory._fields))),
    SEEN_WINDOW: SeenWindow(1e9, -1.0, 0.0, 0.0, 0.0, 0.0),
    CONTACT: (np.nan,),
    ACCEL_FACTOR: (1.0, 1.0, 1.0),
    WHITENESS: (0.0, 0.0, 0.0, 0.0, 1.0, -np.inf) * 3,
    STILL_CLOCK: (-np.inf,),
    CLOCK: (-np.inf,),
    WRITTEN: (-np.inf,),
    ERRORS_CLOCK: (-np.inf,),
    LAST: (-np.inf,) * (max(Sensor) + 1),
}


def new_work(lanes: Lanes) -> Array:
    """The lane buffer of a navigator that has heard nothing, (WORK_ROWS * len(lanes),)."""
    work = np.zeros((WORK_ROWS, len(lanes)))
    for first, values in _FRESH.items():
        work[first : first + len(values)] = np.array(values)[:, None]
    return work.ravel()


@equation
def shared(work: Work, lanes: Lanes, row: int) -> float:
    """A scalar that all lanes share."""
    value: float = work[row * len(lanes)]
    return value


@equation
def share(work: Work, lanes: Lanes, row: int, value: float) -> None:
    """Set a scalar that all lanes share."""
    work[row * len(lanes)] = value


@equation
def of_lane(work: Work, lanes: Lanes, row: int, lane: int) -> float:
    """One row's value in a lane."""
    value: float = work[row * len(lanes) + lane]
    return value


@equation
def set_lane(work: Work, lanes: Lanes, row: int, lane: int, value: float) -> None:
    """Set one row's value in a lane."""
    work[row * len(lanes) + lane] = value


@equation
def load_rejection(work: Work, lanes: Lanes, place: int, lane: int) -> RejectionMemory:
    """How often GPS was refused for a state: place 0 to 5, position and velocity."""
    row = REJECTION + 2 * place
    return RejectionMemory(work[row * len(lanes) + lane], work[(row + 1) * len(lanes) + lane])


@equation
def store_rejection(work: Work, lanes: Lanes, place: int, lane: int, value: RejectionMemory) -> None:
    """And back."""
    row = REJECTION + 2 * place
    work[row * len(lanes) + lane] = value.times
    work[(row + 1) * len(lanes) + lane] = value.since_s


@equation
def load_whiteness(work: Work, lanes: Lanes, axis: int, lane: int) -> WhitenessMemory:
    """Of body axis 0, 1 or 2."""
    row = WHITENESS + 6 * axis
    return WhitenessMemory(
        work[row * len(lanes) + lane], work[(row + 1) * len(lanes) + lane], work[(row + 2) * len(lanes) + lane],
        work[(row + 3) * len(lanes) + lane], work[(row + 4) * len(lanes) + lane], work[(row + 5) * len(lanes) + lane],
    )  # fmt: skip


@equation
def store_whiteness(work: Work, lanes: Lanes, axis: int, lane: int, value: WhitenessMemory) -> None:
    """And back."""
    row = WHITENESS + 6 * axis
    work[row * len(lanes) + lane] = value.since_s
    work[(row + 1) * len(lanes) + lane] = value.total
    work[(row + 2) * len(lanes) + lane] = value.count
    work[(row + 3) * len(lanes) + lane] = value.before
    work[(row + 4) * len(lanes) + lane] = value.square
    work[(row + 5) * len(lanes) + lane] = value.ended_s
