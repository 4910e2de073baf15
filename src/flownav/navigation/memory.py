"""Memory of a navigator in each lane, beyond the filter's state: one named record a subject, and its rows.

`work` holds the filter's rows first (`estimation.states`), then these: the reading that is being taken, the
memories, and a few scalars that all lanes share, since the schedule of readings is the same in all of them.
"""

import numpy as np

from flownav.core.compile import Lanes, Layout, Work, equation
from flownav.core.measurement import Array, Sensor
from flownav.estimation.named import Attitude, PositionNed, VelocityNed
from flownav.estimation.states import (
    CONSIDERS,
    FILTER_ROWS,
    HYPOTHESES,
    MOST_HYPOTHESES,
    POSITION,
    QUATERNION,
    SHARE,
    STATE,
    VELOCITY,
)
from flownav.navigation.motion_records import (
    BridgeMemory,
    CourseMemory,
    DriftMemory,
    ForceBlocks,
    ImuMemory,
    ImuWindow,
    MotionStep,
    OwedMotion,
    PushMemory,
    SeenWindow,
    SpentMotion,
    SpikeMemory,
    StandMemory,
    SteadyForce,
    ToneMemory,
)
from flownav.navigation.records import (
    AidMemory,
    EchoMemory,
    FlowInnovation,
    FlowMemory,
    FlowSignMemory,
    FlowSum,
    GpsMemory,
    GroundMemory,
    HeadingMemory,
    LevelMemory,
    Levels,
    Look,
    PadMemory,
    RangeMemory,
    Reading,
    ScaleDoubt,
    StartMemory,
    SuspicionMemory,
    WalkMemory,
    WhitenessMemory,
    WitnessMemory,
)

UNHELD_S = 1.0  # without a fix of GPS, nothing but flow measures the velocity: chosen as PX4's time to dead reckoning

MEMORY = Layout(FILTER_ROWS)
MEMORY.name(PositionNed, *(STATE + POSITION + i for i in range(3)))
MEMORY.name(VelocityNed, *(STATE + VELOCITY + i for i in range(3)))
MEMORY.name(Attitude, *(QUATERNION + i for i in range(4)))
READING = MEMORY.keep(Reading)
START = MEMORY.keep(StartMemory)
MEMORY.keep(AidMemory)
MEMORY.keep(ImuMemory)
RANGE = MEMORY.keep(RangeMemory)
MEMORY.keep(EchoMemory)
GROUND_SEEN = MEMORY.keep(GroundMemory)
FLOW = MEMORY.keep(FlowMemory)
HEADING = MEMORY.keep(HeadingMemory)
MEMORY.keep(BridgeMemory)
MEMORY.keep(SpikeMemory)
MEMORY.keep(ImuWindow)
MEMORY.keep(SeenWindow)
MEMORY.keep(WitnessMemory, 8, "place")  # of range, barometer, GPS position and velocity by axis
MEMORY.keep(WhitenessMemory, 3, "axis")  # forward, right, down
COURSE = MEMORY.keep(CourseMemory)
MEMORY.keep(PushMemory)
MEMORY.keep(StandMemory)
MEMORY.keep(GpsMemory)
MEMORY.keep(WalkMemory)
MEMORY.keep(LevelMemory)
MEMORY.keep(PadMemory)
GROUNDED = MEMORY.row(StandMemory, "grounded")
PAD_KNOWN = MEMORY.row(PadMemory, "known")
HEADING_SOUGHT = MEMORY.row(HeadingMemory, "sought")
# what becomes of the component that is offered
REASON = MEMORY.take(1)
OBSERVATION = MEMORY.take(1)
MEMORY.keep(Look)
MEMORY.keep(FlowInnovation, 3, "component")
RANGE_MISSING = MEMORY.row(Look, "unranged")
SCALE_UNSTATED = MEMORY.row(Look, "unscaled")
SCALE_DOUBT = MEMORY.keep(ScaleDoubt)
MEMORY.keep(SteadyForce)
MEMORY.keep(DriftMemory)
for _record in (ForceBlocks, MotionStep, SpentMotion, OwedMotion, ToneMemory, FlowSignMemory, SuspicionMemory, FlowSum):
    MEMORY.keep(_record)
PROTECTION = MEMORY.keep(Levels)  # horizontal and vertical
SUSPECTED = MEMORY.row(SuspicionMemory, "suspected")
# shared by all lanes (kept in the first)
CLOCK = MEMORY.take(1)  # the instant that the filter has reached [s]
LAST_ESTIMATE = MEMORY.take(1)  # the last estimate's [s]
ERRORS_CLOCK = MEMORY.take(1)  # the instant that the Gauss-Markov errors have reached [s]
STILL_CLOCK = MEMORY.take(1)  # the end of the last window [s]
HOLD_CLOCK = MEMORY.take(1)  # when a stand was last held to be one [s]
DRIFT_SINCE = MEMORY.take(1)  # from when a drift of GPS is sought [s]
LEVEL_READ = MEMORY.take(1)  # when an external attitude was last taken for level [s]
NEWEST_OF_SENSOR = MEMORY.take(max(Sensor) + 1)  # of each sensor, the newest instant [s]
OWN_ROWS = 512
OWN_FILTER = MEMORY.take(OWN_ROWS)  # of somebody else's filter in the navigator's place (`parts.equations`)
WORK_ROWS = MEMORY.next

load_reading, store_reading = MEMORY.access(Reading)
load_start, store_start = MEMORY.access(StartMemory)
load_aid, _ = MEMORY.access(AidMemory)
load_imu, store_imu = MEMORY.access(ImuMemory)
load_flow, _ = MEMORY.access(FlowMemory)
load_gps, _ = MEMORY.access(GpsMemory)
load_spike, store_spike = MEMORY.access(SpikeMemory)
load_step, _ = MEMORY.access(MotionStep)
load_sign, store_sign = MEMORY.access(FlowSignMemory)
load_suspicion, store_suspicion = MEMORY.access(SuspicionMemory)
_, store_levels = MEMORY.access(Levels)
load_whiteness, _ = MEMORY.access(WhitenessMemory)
load_look, _ = MEMORY.access(Look)
load_range, _ = MEMORY.access(RangeMemory)

_FRESH: dict[int, tuple[float, ...]] = {
    QUATERNION: (1.0, 0.0, 0.0, 0.0),
    STILL_CLOCK: (-np.inf,),
    HOLD_CLOCK: (-np.inf,),
    CONSIDERS: (1.0,),
    HYPOTHESES: (MOST_HYPOTHESES,),
    SHARE: (1.0,) * MOST_HYPOTHESES,
    DRIFT_SINCE: (-np.inf,),
    CLOCK: (-np.inf,),
    LAST_ESTIMATE: (-np.inf,),
    ERRORS_CLOCK: (-np.inf,),
    LEVEL_READ: (-np.inf,),
    NEWEST_OF_SENSOR: (-np.inf,) * (max(Sensor) + 1),
}


def new_work(lanes: Lanes, *, faults: bool = True) -> Array:
    """The lane buffer of a new navigator, (WORK_ROWS * len(lanes),).

    faults: whether it follows what faults would do; that changes no bit of its estimate.
    """
    work = np.zeros((WORK_ROWS, len(lanes)))
    MEMORY.put_fresh(work)
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
def holds(gps: GpsMemory, t_s: float) -> bool:
    """Whether GPS measured the horizontal velocity or position lately."""
    return t_s - gps.last_fix_s <= UNHELD_S


@equation
def held_by_gps(work: Work, lanes: Lanes, lane: int, t_s: float) -> bool:
    """Whether GPS measured a lane's horizontal velocity or position lately."""
    return holds(load_gps(work, lanes, lane), t_s)


@equation
def set_lane(work: Work, lanes: Lanes, row: int, lane: int, value: float) -> None:
    """Set one row's value in a lane."""
    work[row * len(lanes) + lane] = value
