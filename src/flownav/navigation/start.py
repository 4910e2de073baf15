"""How a navigator starts: a first attitude, and a fix or the local origin."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, arctan2, equation, larger, procedure, replacing, squared
from flownav.core.frames import GRAVITY_M_S2, Quaternion, Rotation, quaternion_from_euler, to_earth
from flownav.core.measurement import Sensor
from flownav.estimation.covariance import begin_lane, lagged, set_covariance, set_variance, states_of
from flownav.estimation.hypotheses import begin_lane_anew
from flownav.estimation.laws import component
from flownav.estimation.named import Attitude, PositionNed, rotation_by
from flownav.estimation.states import ACCEL_BIAS, ATTITUDE, MOST_HYPOTHESES, POSITION, RATE, VELOCITY
from flownav.navigation import calls
from flownav.navigation.before_start import waits
from flownav.navigation.course import with_sought
from flownav.navigation.kernel_settings import FROM_MAG, FROM_YAW, NO_HEADING, Equipment
from flownav.navigation.lagged_flow import start_lag
from flownav.navigation.memory import MEMORY
from flownav.navigation.motion_records import SteadyForce
from flownav.navigation.offers import with_aid
from flownav.navigation.packed import START_SIGMA, load_filter_settings, load_flow_settings, load_imu_settings
from flownav.navigation.place import ON_GROUND
from flownav.navigation.reasons import is_received
from flownav.navigation.records import AidMemory, HeadingMemory, Reading, ScaleDoubt, StartMemory
from flownav.navigation.tape import START, Output
from flownav.navigation.verdicts import Biases, Event, Force, on_lanes

# All chosen for any small vehicle, none fitted to a log; what no test is named beside is not measured.
ORIGIN_SIGMA_M = 0.1  # the local origin, where the navigator's start defines it
LOST_SIGMA_M = 10.0  # the same where the log's fixes define it and came too late, and about a first fix
READ_TILT_RAD = 0.03  # an attitude that was read: three times the autopilot's usual error (ins_tilt_sigma_rad)
STANDING_TILT_RAD = 0.1  # before anything is read: a helicopter hovers with 5.7 deg of roll, a slope may have 3 deg
LEVELLED_FLOOR_RAD = 0.005  # of one from the accelerometer; the sum covers the truth (test_start)
READ_HEADING_RAD = 0.1  # an autopilot's, whose compass is calibrated: outdoor's is 5 to 7 deg off the course for 50 s
UNKNOWN_RAD = 1.5  # one that is to be found from the course: any of half a turn
COMPASS_HEADING_RAD = 0.3  # a raw magnetometer's: twice the usual hard iron (compass_sigma_rad)
DATUM_HEADING_RAD = 1e-3  # the start defines the frame
UNSTATED_HEADING_RAD = 1.0  # the first external heading ends it, 0.5 rad off (test_an_external_heading_is_taken)
LEAST_LEVELLING = 5.0  # readings whose mean is level: 0.1 s at 50 Hz
# so sure a mean will do (0.6 deg); a shaken vehicle's is waited for
LEVELLED_M_S2, LEVELLING_S = 0.1, 1.0
HOVERING_M_S2 = 0.15  # how it may accelerate over that second: chosen; with 0.1 laps from the start err 2.6 sigma


with_started = replacing(StartMemory, "started")


class Rate(NamedTuple):
    """The body rate in the step that was just made, bias off [rad/s]."""

    x_rad_s: float
    y_rad_s: float
    z_rad_s: float


MEMORY.name(Rate, *(RATE + i for i in range(3)))
_, store_attitude = MEMORY.access(Attitude)
_, store_position = MEMORY.access(PositionNed)
_, store_biases = MEMORY.access(Biases)
_, store_rate = MEMORY.access(Rate)
_, store_force = MEMORY.access(Force)
_, store_steady = MEMORY.access(SteadyForce)
_, store_doubt = MEMORY.access(ScaleDoubt)


# -- before the start -----------------------------------------------------------------------------------------
@equation
def noise_of_mean(m: StartMemory) -> float:
    """The variance of the mean specific force about gravity's, of readings shaken each by itself [m2/s4]."""
    return squared(HOVERING_M_S2) + m.shaken / larger(m.readings, 1.0)


@on_lanes(calls.runs)
def runs(m: StartMemory) -> bool:
    """Whether any lane has started."""
    return m.started > 0.0


# -- the start ------------------------------------------------------------------------------------------------
@equation
def has_fix(reading: Reading, sensor: int) -> bool:
    """Whether a fix is at hand."""
    finite = bool(np.isfinite(reading.value_0 + reading.value_1 + reading.value_2))
    return sensor == Sensor.GPS_POSITION and is_received(reading) and finite


@equation
def starts(reading: Reading, m: StartMemory, t_s: float, sensor: int, deadline_s: float) -> bool:
    """Whether a lane whose attitude is known starts: at a fix, or at the local origin with the first flow, pose or word
    that the vehicle stands, where no fix came in time.
    """
    sure = m.shaken <= m.readings * squared(LEVELLED_M_S2) or t_s - m.since_s >= LEVELLING_S
    levels = m.readings >= LEAST_LEVELLING and sure
    waiting = m.started == 0.0 and (bool(np.isfinite(m.attitude_s)) or levels)
    other = sensor == Sensor.FLOW_RATE or sensor == Sensor.FLOW_VELOCITY or sensor == Sensor.POSE
    stands = sensor == Sensor.LANDED and reading.value_0 > ON_GROUND
    heading_here = is_received(reading) and bool(np.isfinite(reading.value_0))
    return waiting and (has_fix(reading, sensor) or (heading_here and (other or stands) and t_s >= deadline_s))


@on_lanes(calls.any_starts)
def any_starts(reading: Reading, m: StartMemory, *, t_s: float, sensor: int, deadline_s: float) -> bool:
    """Whether any lane starts now."""
    return starts(reading, m, t_s, sensor, deadline_s)


class Levelling(NamedTuple):
    """The level by the mean specific force: how far it is believed, the accelerometer's bias forward and to the right
    [m/s2], the variances of tilt, of that bias and of the vertical one, and of tilt and bias together [rad m/s2].
    """

    believed: float
    bias_x: float
    bias_y: float
    tilt_variance: float
    bias_variance: float
    bias_variance_z: float
    shared: float


class FirstState(NamedTuple):
    """First state of a lane, beyond its settings' standard deviations: its place [m], attitude, accelerometer's bias,
    their variances, whether nothing determines the flow's scale, and the force that it feels. starts: false where it
    does not start.
    """

    starts: bool
    position: PositionNed
    attitude: Attitude
    level: Levelling
    position_variance: float
    heading_variance: float
    scale_unstated: bool
    steady: SteadyForce


@procedure
def begin(work: Work, lanes: Lanes, lane: int, first: FirstState, p: Work) -> None:
    """State and covariance of a lane that starts at its first instant. Of a motion before it nothing is known."""
    if not first.starts:
        return
    begin_lane(work, lanes, lane, p, START_SIGMA)
    store_attitude(work, lanes, lane, first.attitude)
    start_lag(work, lanes, lagged(lanes), lane, p[START_SIGMA + VELOCITY], load_flow_settings(p))
    store_position(work, lanes, lane, first.position)
    level = first.level
    store_biases(work, lanes, lane, Biases(0.0, 0.0, 0.0, level.bias_x, level.bias_y, 0.0))
    store_rate(work, lanes, lane, Rate(0.0, 0.0, 0.0))
    store_force(work, lanes, lane, Force(0.0, 0.0, 0.0))
    store_steady(work, lanes, lane, first.steady)
    for i in range(3):
        set_variance(work, lanes, POSITION + i, lane, first.position_variance)
        set_variance(work, lanes, ATTITUDE + i, lane, first.heading_variance if i == 2 else level.tilt_variance)
        set_variance(work, lanes, ACCEL_BIAS + i, lane, level.bias_variance_z if i == 2 else level.bias_variance)
    tie_tilt(work, lanes, lane, rotation_by(first.attitude), level.shared)
    for fault in range(MOST_HYPOTHESES):
        begin_lane_anew(work, lanes, states_of(lanes), fault, lane)
    doubted = load_filter_settings(p).flow_scale_sigma if first.scale_unstated else 0.0
    store_doubt(work, lanes, lane, ScaleDoubt(doubted))


@equation
def tie_tilt(work: Work, lanes: Lanes, lane: int, rotation: Rotation, shared: float) -> None:
    """Set the covariance of tilt and accelerometer bias: a force that was taken for a tilt is no bias.

    By the law of motion dv' = theta x (R f) - R db, whose left side is 0 for a levelled vehicle and R f is -g.
    """
    for j in range(2):
        set_covariance(work, lanes, ATTITUDE, ACCEL_BIAS + j, lane, shared * component(rotation[3:6], j))
        set_covariance(work, lanes, ATTITUDE + 1, ACCEL_BIAS + j, lane, -shared * component(rotation[0:3], j))


MEMORY.sink(FirstState, begin, "p")


@equation
def levelling(m: StartMemory, bias_sigma: float, rectified: float, read: bool, unknown: bool) -> Levelling:
    """Tilt and accelerometer's bias by the mean specific force g theta + b + n of a vehicle that does not accelerate.

    A tilt of STANDING_TILT_RAD and a bias, with what vibration makes of it, are expected; the noise n is what shakes
    the readings, over their number. rectified: of what shakes an accelerometer, how much lasts in its mean. Where the
    heading is to be found, tilt (north, east) and bias (body) stay untied.
    """
    lasting = squared(bias_sigma) + squared(rectified) * m.shaken
    tilted, doubt = squared(GRAVITY_M_S2 * STANDING_TILT_RAD), lasting + noise_of_mean(m)
    believed, of_bias = tilted / (tilted + doubt), lasting / (tilted + doubt)
    shaken = squared(bias_sigma) + larger(squared(rectified), 1.0) * m.shaken
    return Levelling(
        1.0 if read else believed,
        0.0 if read else of_bias * m.force_x,
        0.0 if read else of_bias * m.force_y,
        squared(READ_TILT_RAD) if read else squared(STANDING_TILT_RAD) * (1.0 - believed) + squared(LEVELLED_FLOOR_RAD),
        shaken if read else lasting * (1.0 - of_bias),
        shaken,
        0.0 if read or unknown else GRAVITY_M_S2 * squared(STANDING_TILT_RAD) * of_bias,
    )


@equation
def heading_sigma(read: bool, lost: bool, unknown: bool, field_rad: float, heading: float) -> float:
    """How unsure the first heading is [rad]. lost: the start does not define the frame; unknown: no sensor determines
    it.
    """
    known = heading == NO_HEADING and not lost
    turned = DATUM_HEADING_RAD if known else (READ_HEADING_RAD if read else COMPASS_HEADING_RAD)
    turned = UNKNOWN_RAD if unknown else turned
    is_stated = heading == FROM_YAW or (heading == FROM_MAG and not read)
    return UNSTATED_HEADING_RAD if is_stated and not np.isfinite(field_rad) else turned


class Beginning(NamedTuple):
    """Result of a lane's start: its first state, memories and event."""

    first: FirstState
    start: StartMemory
    aid: AidMemory
    heading: HeadingMemory
    event: Event


@on_lanes(calls.start_lanes)
def start_lanes(
    reading: Reading, m: StartMemory, aid: AidMemory, heading: HeadingMemory, *, t_s: float, sensor: int,
    fitted: Equipment, bias_sigma: float, rectified: float,
) -> Beginning:  # fmt: skip
    """The first instant of the lanes that start."""
    begins = starts(reading, m, t_s, sensor, fitted.deadline_s)
    at_fix = has_fix(reading, sensor)
    read, lost = bool(np.isfinite(m.attitude_s)), bool(np.isfinite(fitted.deadline_s))
    unknown = fitted.heading == NO_HEADING and lost and not read
    levels = levelling(m, bias_sigma, rectified, read, unknown)
    w, x, y, z = (m.qw, m.qx, m.qy, m.qz) if read else level(m, levels.believed, heading.field_rad, fitted)
    turned = heading_sigma(read, lost, unknown, heading.field_rad, fitted.heading)
    attitude = Attitude(w, x, y, z)
    spread = LOST_SIGMA_M if lost else ORIGIN_SIGMA_M
    fix = PositionNed(reading.value_0, reading.value_1, reading.value_2)
    return Beginning(
        FirstState(
            begins,
            fix if at_fix else PositionNed(0.0, 0.0, 0.0),
            attitude,
            levels,
            spread * spread,
            turned * turned,
            not lost,
            SteadyForce(*to_earth(rotation_by(attitude), m.felt_x, m.felt_y, m.felt_z)),
        ),
        with_started(m, started=1.0 if begins else m.started),
        with_aid(aid, aided_s=t_s if begins else aid.aided_s, flag=0.0 if begins else aid.flag),
        with_sought(heading, sought=(1.0 if unknown else 0.0) if begins else heading.sought),
        Event(START if begins else -1, 1.0 if at_fix else 0.0),
    )


@procedure
def try_start(work: Work, lanes: Lanes, t_s: float, sensor: int, fitted: Equipment, p: Work, o: Output) -> bool:
    """Start the lanes that can start. Whether any lane runs."""
    if waits(work, lanes) and any_starts(work, lanes, t_s, sensor, deadline_s=fitted.deadline_s):
        start_lanes(
            work,
            lanes,
            t_s,
            sensor,
            fitted,
            bias_sigma=p[START_SIGMA + ACCEL_BIAS],
            rectified=load_imu_settings(p).vibration_rectified_share,
            p=p,
            o=o,
        )
    return bool(runs(work, lanes))


@equation
def level(m: StartMemory, believed: float, field_rad: float, fitted: Equipment) -> Quaternion:
    """Roll and pitch from the mean specific force as far as it is believed (1: wholly); heading from the magnetometer
    or an external heading where one was received, else north.

    The field was noted in the axes of a vehicle that takes itself to be level and to head north.
    """
    roll = believed * arctan2(-m.force_y, -m.force_z)
    pitch = believed * arctan2(m.force_x, np.sqrt(m.force_y * m.force_y + m.force_z * m.force_z))
    heading_here = (fitted.heading == FROM_MAG or fitted.heading == FROM_YAW) and bool(np.isfinite(field_rad))
    north_rad = fitted.declination_rad if fitted.heading == FROM_MAG else 0.0
    return quaternion_from_euler(roll, pitch, north_rad - field_rad if heading_here else 0.0)
