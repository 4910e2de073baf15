"""What a navigator remembers of each lane beside the filter's state: one named record a subject, and its rows.

`work` holds the filter's rows first (`estimation.states`), then these: the reading that is being taken, the
memories, and a few scalars that all lanes share, since the schedule of readings is the same in all of them.
"""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, lane_access
from flownav.estimation.hypotheses import COUNT as FAULTS_FOLLOWED
from flownav.estimation.states import CONSIDERS, FILTER_ROWS, HYPOTHESES, MOST_HYPOTHESES, QUATERNION, SHARE, Rows
from flownav.measurement import Array, Sensor
from flownav.navigation.records import (
    AidMemory,
    BridgeMemory,
    CourseMemory,
    EchoMemory,
    FlowMemory,
    GroundMemory,
    HeadingMemory,
    ImuMemory,
    ImuWindow,
    NoiseMemory,
    PushMemory,
    RangeMemory,
    Reading,
    RejectionMemory,
    SeenWindow,
    SpikeMemory,
    StartMemory,
    WhitenessMemory,
)

UNHELD_S = 1.0  # without a fix of GPS, nothing but flow tells the velocity

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
SPIKE = _rows.take(len(SpikeMemory._fields))
IMU_WINDOW = _rows.take(len(ImuWindow._fields))
SEEN_WINDOW = _rows.take(len(SeenWindow._fields))
NOISE_FOLLOWED = _rows.take(8 * 3)  # `records.NoiseMemory` of range, barometer, GPS position and velocity by axis
WHITENESS = _rows.take(3 * len(WhitenessMemory._fields))  # forward, right, down
ACCEL_FACTOR = _rows.take(3)  # how many times noisier than told the accelerometer is, by each of these
COURSE = _rows.take(len(CourseMemory._fields))
PUSH = _rows.take(len(PushMemory._fields))
COMPASS_OFF = _rows.take(1)  # 1 once what is read as heading was found to be wrong
AIDED = _rows.take(1)  # 1 where something horizontal was fused lately, at an external attitude
BLIND = _rows.take(1)  # 1 where no range tells the height of the flow now: none lately, or a disputed one, or strays
SOUGHT = _rows.take(1)  # 1 while a heading that no sensor reads is to be found
GPS_FUSED = _rows.take(1)  # when GPS last told north or east [s]
STANDS = _rows.take(1)  # what the vehicle did in the last window: `still.MOVES`, SHAKEN or RESTS
CONTACT = _rows.take(1)  # the range when it rested last [m]; NaN where it has not
BARO_KNOWN = _rows.take(1)
PAD_KNOWN = _rows.take(1)  # 0 no, or how: STOOD_ON, LEFT, SEEN of `place`
PAD_BESIDE = _rows.take(2)  # where the pad was from the vehicle as that went to GPS, along an axis, and its variance
ASTRAY = _rows.take(1)  # 1 where the first component of the fix at hand was refused
PAD_STRAYS = _rows.take(1)  # fixes of a pad in a row that were refused
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
SCALE_DOUBT = _rows.take(1)  # standard deviation of a flow scale that nothing can tell; 0 where the filter learns it
MOVING = _rows.take(1)  # 1 where the IMU moves the filter over the step at hand
FLOW_BEFORE = _rows.take(2)  # what the flow sensor was to read at the reading before, by the filter [rad/s or m/s]
TURNED_BEFORE = _rows.take(2)  # TURNING at the reading before
FLOW_SPEED = _rows.take(1)  # of both together, over the ground, turning and all [m/s]
PUZZLED_AT = _rows.take(1)  # when innovations last hinted at a flow that is reversed or swapped [s]
PROTECTION = _rows.take(2)  # levels at the last estimate, horizontal and vertical [m]
GPS_MOVED = _rows.take(2)  # how far resets to GPS have moved the position, north and east, back and forth summed up [m]
LEFT_OVER = _rows.take(1)  # how far off a fault may have put the position before it was excluded [m]
SUSPECTED_AT = _rows.take(1)  # since when a fault is suspected [s]
SUSPECTED = _rows.take(1)  # 0, or 1 and the number of the fault of `hypotheses` that is suspected
# shared by all lanes (kept in the first)
CLOCK = _rows.take(1)  # the instant that the filter has reached [s]
WRITTEN = _rows.take(1)  # the last estimate's [s]
ERRORS_CLOCK = _rows.take(1)  # the instant that the Gauss-Markov errors have reached [s]
STILL_CLOCK = _rows.take(1)  # the end of the last window [s]
DRIFT_SINCE = _rows.take(1)  # from when a drift of GPS is sought [s]
LEVEL_READ = _rows.take(1)  # when an external attitude was last taken for level [s]
LAST = _rows.take(max(Sensor) + 1)  # of each sensor, the newest instant [s]
OWN_ROWS = 512
OWN = _rows.take(OWN_ROWS)  # the memory of a filter of somebody else's in the navigator's place (`parts.equations`)
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
load_spike, store_spike = lane_access(SpikeMemory, SPIKE)
load_course, store_course = lane_access(CourseMemory, COURSE)
load_push, store_push = lane_access(PushMemory, PUSH)
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
    FLOW: FlowMemory(-np.inf, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -np.inf, 0.0),
    HEADING: HeadingMemory(-np.inf, np.nan),
    BRIDGE: BridgeMemory(*([np.nan] * len(BridgeMemory._fields))),
    SEEN_WINDOW: SeenWindow(1e9, -1.0, 0.0, 0.0, 0.0, 0.0),
    CONTACT: (np.nan,),
    NOISE_FOLLOWED: (1.0, 0.0, -np.inf) * 8,
    ACCEL_FACTOR: (1.0, 1.0, 1.0),
    WHITENESS: (0.0, 0.0, 0.0, 0.0, 1.0, -np.inf) * 3,
    STILL_CLOCK: (-np.inf,),
    CONSIDERS: (1.0,),
    PUZZLED_AT: (-np.inf,),
    PROTECTION: (np.nan, np.nan),
    HYPOTHESES: (FAULTS_FOLLOWED,),
    SHARE: (1.0,) * MOST_HYPOTHESES,
    DRIFT_SINCE: (-np.inf,),
    COURSE: CourseMemory(0.0, 0.0, 0.0, 0.0, 0.0, -np.inf, -np.inf, 0.0, 0.0),
    PUSH: PushMemory(0.0, 0.0, 0.0, 0.0, -np.inf, 0.0, 0.0, 0.0, 0.0),
    GPS_FUSED: (-np.inf,),
    CLOCK: (-np.inf,),
    WRITTEN: (-np.inf,),
    ERRORS_CLOCK: (-np.inf,),
    LEVEL_READ: (-np.inf,),
    LAST: (-np.inf,) * (max(Sensor) + 1),
}


def new_work(lanes: Lanes, *, faults: bool = True) -> Array:
    """The lane buffer of a navigator that has heard nothing, (WORK_ROWS * len(lanes),).

    faults: whether it follows what faults would do; that changes no bit of its estimate.
    """
    work = np.zeros((WORK_ROWS, len(lanes)))
    for first, values in _FRESH.items():
        work[first : first + len(values)] = np.array(values)[:, None]
    if not faults:
        work[HYPOTHESES] = 0.0
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
def held_by_gps(work: Work, lanes: Lanes, lane: int, t_s: float) -> bool:
    """Whether GPS told the level velocity or place of a lane lately."""
    return t_s - work[GPS_FUSED * len(lanes) + lane] <= UNHELD_S  # type: ignore[no-any-return]


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
    work[(row + 2) * len(lanes) + lane] = value.readings
    work[(row + 3) * len(lanes) + lane] = value.before
    work[(row + 4) * len(lanes) + lane] = value.square
    work[(row + 5) * len(lanes) + lane] = value.ended_s


@equation
def load_noise(work: Work, lanes: Lanes, place: int, lane: int) -> NoiseMemory:
    """Of the component at a place of NOISE_FOLLOWED."""
    row = NOISE_FOLLOWED + 3 * place
    return NoiseMemory(
        work[row * len(lanes) + lane], work[(row + 1) * len(lanes) + lane], work[(row + 2) * len(lanes) + lane]
    )


@equation
def store_noise(work: Work, lanes: Lanes, place: int, lane: int, value: NoiseMemory) -> None:
    """And back."""
    row = NOISE_FOLLOWED + 3 * place
    work[row * len(lanes) + lane] = value.factor
    work[(row + 1) * len(lanes) + lane] = value.before
    work[(row + 2) * len(lanes) + lane] = value.heard_s
