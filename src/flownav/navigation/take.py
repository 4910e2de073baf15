"""One reading of one sensor on lanes: the filter brought to its instant, the reading judged and fused, its fate noted.

`navigate` is the only way into the filter: a log's and a live link's readings come through `loop.run` on one lane, the
simulator's on one or sixteen. The schedule (which sensor, at what instant) is the same in all lanes; what was read,
whether it arrived, and every verdict are each lane's own.
"""

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import LANES, ONE_LANE, Lanes, Unit, Work, equation, procedure, unit
from flownav.core.measurement import Sensor
from flownav.estimation.covariance import consider, consider_none, lagged, states_of, variance_of, with_lag
from flownav.estimation.error_models import propagate_gauss_markov, propagate_walks
from flownav.estimation.lag import predict_with_lag
from flownav.estimation.motion import hold_still, predict
from flownav.estimation.states import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, POSITION, STATES, VELOCITY
from flownav.navigation.attitude import take_attitude
from flownav.navigation.baro import take_baro
from flownav.navigation.before_start import gather
from flownav.navigation.compass import check_compass, note_push
from flownav.navigation.course import find_heading, note_flow_course, seeks
from flownav.navigation.flow import take_flow
from flownav.navigation.gps import take_gps
from flownav.navigation.ground import walk_below
from flownav.navigation.heading import take_heading
from flownav.navigation.height import take_range
from flownav.navigation.inertial import judge_motion, keep_imu, steady_force, watch_force
from flownav.navigation.journal import note_decay, note_estimate, note_prediction, reset_state
from flownav.navigation.kernel_settings import FROM_MAG, NO_HEADING, Equipment
from flownav.navigation.lagged_flow import flow_lag
from flownav.navigation.memory import (
    CLOCK,
    ERRORS_CLOCK,
    HEADING_SOUGHT,
    LAST_ESTIMATE,
    load_step,
    share,
    shared,
)
from flownav.navigation.offers import note_aid_age, too_old
from flownav.navigation.packed import (
    load_aid_settings,
    load_equipment,
    load_filter_settings,
    load_flow_settings,
    load_height_settings,
    load_imu_settings,
    load_place_settings,
)
from flownav.navigation.pad import take_pad
from flownav.navigation.place import take_landed, take_pose
from flownav.navigation.protection import set_levels
from flownav.navigation.spikes import drop_spikes
from flownav.navigation.start import runs, try_start
from flownav.navigation.still import stand_still
from flownav.navigation.suspicion import mind_faults
from flownav.navigation.tape import ESTIMATE_PERIOD_S, Output, output_of, write_estimate
from flownav.navigation.vibration import add_vibration_noise, limit_biases
from flownav.navigation.windows import watch_gps_velocity, watch_imu, watch_range

LONGEST_STEP_S = 0.1  # chosen, not measured: only pauses of the IMU make longer ones
MOST_STEPS = 10000.0  # chosen: 1000 s in steps of LONGEST_STEP_S; a pause of hours takes longer ones (test_long_pauses)
# Standard deviations: more than this, and correlations are beyond a double's digits. Without it variances are NaN after
# two hours without an aid (test_long_pauses).
LOST_M, LOST_M_S = 1e5, 1e6
LONGEST_LAG_OF_ERRORS_S = 0.1  # chosen: Gauss-Markov errors, of 5 s and more, go on at least so often


@procedure
def navigate(work: Work, lanes: Lanes, p: Work, o: Output, t_s: float, sensor: int) -> None:
    """Take the reading that lies in the rows of `memory.READING`: of `sensor`, describing the instant t_s."""
    if too_old(work, lanes, t_s, sensor, o):
        return
    fitted = load_equipment(p)
    receive(work, lanes, t_s, sensor, fitted, p, o)
    if runs(work, lanes):
        advance(work, lanes, lagged(lanes), t_s, p, o)
    arrive(work, lanes, t_s, sensor, fitted, p, o)
    take(work, lanes, t_s, sensor, fitted, p, o)
    leave(work, lanes, t_s, sensor, p, o)


# -- a reading's way, part by part: on board each may be done at another time (`onboard`) ------------------------
@equation
def receive(work: Work, lanes: Lanes, t_s: float, sensor: int, fitted: Equipment, p: Work, o: Output) -> None:
    """Process a reading for the time before it: drop it if it is a spike, and find the motion up to its instant."""
    inertial_here = sensor == Sensor.IMU and fitted.use_imu
    gather(work, lanes, t_s, sensor)
    if runs(work, lanes):
        if inertial_here:
            drop_spikes(work, lanes, t_s, o)
        step_s = t_s - shared(work, lanes, CLOCK)
        judge_motion(work, lanes, t_s, step_s=step_s, arrived_now=inertial_here, s=load_imu_settings(p), o=o)


@equation
def arrive(work: Work, lanes: Lanes, t_s: float, sensor: int, fitted: Equipment, p: Work, o: Output) -> None:
    """The filter is at the reading's instant; where it waits for its start it starts, if this reading lets it."""
    running = bool(runs(work, lanes))
    if running and sensor == Sensor.IMU and fitted.use_imu:
        keep_imu(work, lanes, t_s)
    if sensor == Sensor.IMU:
        watch_imu(work, lanes)
        watch_force(work, lanes, t_s)
    if t_s - shared(work, lanes, ERRORS_CLOCK) >= LONGEST_LAG_OF_ERRORS_S:
        catch_up_errors(work, lanes, t_s, p, o)
    share(work, lanes, CLOCK, t_s)
    if not running or len(lanes) > 1:
        try_start(work, lanes, t_s, sensor, fitted, p, o)
    watch_others(work, lanes, sensor)
    consider_datum(work, lanes, fitted)


@equation
def leave(work: Work, lanes: Lanes, t_s: float, sensor: int, p: Work, o: Output) -> None:
    """Finish after a reading is taken: test whether the vehicle stands; then `go_on`."""
    if sensor == Sensor.IMU:
        stand_still(work, lanes, t_s, p, o)
    go_on(work, lanes, t_s, p, o)


@equation
def go_on(work: Work, lanes: Lanes, t_s: float, p: Work, o: Output) -> None:
    """Aids grow old, and an estimate may be due."""
    consider_none(work, lanes)
    running = bool(runs(work, lanes))
    if running:
        note_aid_age(work, lanes, t_s, load_aid_settings(p), o)
    if t_s - shared(work, lanes, LAST_ESTIMATE) >= ESTIMATE_PERIOD_S:
        share(work, lanes, LAST_ESTIMATE, t_s)
        if running:
            limit_biases(work, lanes, load_imu_settings(p))
            set_levels(work, lanes)
            write_estimate(work, lanes, t_s, o)
            if len(lanes) == 1:
                note_estimate(work, lanes, o)


@equation
def watch_others(work: Work, lanes: Lanes, sensor: int) -> None:
    """Note ranges and GPS velocities for the test of whether the vehicle stands."""
    if sensor == Sensor.RANGE:
        watch_range(work, lanes)
    elif sensor == Sensor.GPS_VELOCITY:
        watch_gps_velocity(work, lanes)


@equation
def consider_datum(work: Work, lanes: Lanes, fitted: Equipment) -> None:
    """A heading that nothing refers to the earth is a datum: only the gyro moves it, and only rest determines its bias.
    One that is yet to be found from the course is one until then, and by it GPS would turn every push into tilt.
    """
    datum = fitted.heading == NO_HEADING and not np.isfinite(fitted.deadline_s)
    if not fitted.use_attitude and (datum or seeks(work, lanes)):
        sought = 0 if datum else HEADING_SOUGHT
        consider(work, lanes, ATTITUDE + 2, sought)
        consider(work, lanes, GYRO_BIAS + 2, sought)
        if sought > 0:
            for i in range(2):
                consider(work, lanes, ATTITUDE + i, sought)
                consider(work, lanes, GYRO_BIAS + i, sought)
            for i in range(3):
                consider(work, lanes, ACCEL_BIAS + i, sought)


@procedure
def take(work: Work, lanes: Lanes, t_s: float, sensor: int, fitted: Equipment, p: Work, o: Output) -> None:
    """Each sensor's own way."""
    if sensor == Sensor.GPS_POSITION or sensor == Sensor.GPS_VELOCITY:
        catch_up_errors(work, lanes, t_s, p, o)
        take_gps(work, lanes, t_s, sensor, p, o)
        if sensor == Sensor.GPS_VELOCITY:
            find_heading(work, lanes, t_s, o)
            if fitted.heading != NO_HEADING and fitted.use_imu:
                check_compass(work, lanes, t_s, o)
    elif sensor == Sensor.FLOW_RATE or sensor == Sensor.FLOW_VELOCITY:
        take_flow(work, lanes, lagged(lanes), t_s, sensor, fitted.flow_gyro_is_imu, p, o)
        if fitted.heading == NO_HEADING or fitted.use_imu:
            note_flow_course(work, lanes, t_s, sensor == Sensor.FLOW_RATE, sought=fitted.heading == NO_HEADING)
    elif sensor == Sensor.RANGE:
        take_range(work, lanes, t_s, sensor, p, o)
    elif sensor == Sensor.BARO:
        take_baro(work, lanes, t_s, sensor, p, o)
    elif sensor == Sensor.ATTITUDE:
        catch_up_errors(work, lanes, t_s, p, o)
        take_attitude(work, lanes, t_s, sensor, fitted, p, o)
    elif sensor == Sensor.YAW or (sensor == Sensor.MAG and fitted.heading == FROM_MAG):
        catch_up_errors(work, lanes, t_s, p, o)
        take_heading(work, lanes, t_s, sensor, fitted, p, o)
    elif sensor == Sensor.POSE:
        take_pose(work, lanes, t_s, sensor, p, o)
    elif sensor == Sensor.PAD:
        take_pad(work, lanes, t_s, sensor, p, o)
    elif sensor == Sensor.LANDED:
        take_landed(work, lanes, t_s, sensor, p, o)


# -- from instant to instant ----------------------------------------------------------------------------------
@procedure
def advance(work: Work, lanes: Lanes, lag: bool | None, t_s: float, p: Work, o: Output) -> None:
    """Bring the filter to an instant, in steps short enough for its laws; lanes without a fresh IMU coast.

    lag: `covariance.lagged`, whether the flow sensor's dynamics are states.
    """
    steps, dt_s = steps_to(work, lanes, t_s)
    for _ in range(steps):
        step_once(work, lanes, lag, dt_s, p, o)
    if steps > 0:
        give_up(work, lanes, o)


@equation
def steps_to(work: Work, lanes: Lanes, t_s: float) -> tuple[int, float]:
    """In how many steps, of how many seconds each, the filter comes to an instant; none where that is no way ahead."""
    ahead_s = t_s - shared(work, lanes, CLOCK)
    if not ahead_s > 0.0 or not np.isfinite(ahead_s):
        return 0, 0.0
    steps = int(min(np.ceil(ahead_s / LONGEST_STEP_S), MOST_STEPS))
    return steps, ahead_s / steps


@equation
def step_once(work: Work, lanes: Lanes, lag: bool | None, dt_s: float, p: Work, o: Output) -> None:
    """One step of the filter's motion and of all that goes along with it."""
    settings = load_filter_settings(p)
    for lane in range(len(lanes)):
        if load_step(work, lanes, lane).moves == 0.0:
            hold_still(work, lanes, lane)
    if lag is not None:
        predict_with_lag(work, lanes, dt_s, settings, flow_lag(load_flow_settings(p), dt_s))
    else:
        predict(work, lanes, STATES, dt_s, settings)
    steady_force(work, lanes, dt_s)
    note_push(work, lanes, dt_s)
    propagate_walks(work, lanes, dt_s, settings)
    walk_below(work, lanes, dt_s, load_height_settings(p), load_place_settings(p))
    add_vibration_noise(work, lanes, dt_s, load_imu_settings(p))
    if len(lanes) == 1:
        note_prediction(work, lanes, dt_s, o)


@procedure
def give_up(work: Work, lanes: Lanes, o: Output) -> None:
    """A position that minutes without an aid have spread over 100 km is lost: it keeps that doubt, and no correlations.

    A covariance that has grown further cannot be corrected: a fix whose variance is smaller by sixteen digits leaves
    variances below zero, and NaN for their roots.
    """
    for axis in range(3):
        for lane in range(len(lanes)):
            if variance_of(work, lanes, POSITION + axis, lane) > LOST_M * LOST_M:
                reset_state(work, lanes, lane, POSITION + axis, LOST_M * LOST_M, o)
            if variance_of(work, lanes, VELOCITY + axis, lane) > LOST_M_S * LOST_M_S:
                reset_state(work, lanes, lane, VELOCITY + axis, LOST_M_S * LOST_M_S, o)


@procedure
def catch_up_errors(work: Work, lanes: Lanes, t_s: float, p: Work, o: Output) -> None:
    """The Gauss-Markov errors, brought to an instant. They turn with nothing, so this may wait until they are read.

    When they are is the schedule's alone, whichever lanes run, so that a lane is what it would be by itself.
    """
    before_s = shared(work, lanes, ERRORS_CLOCK)
    share(work, lanes, ERRORS_CLOCK, t_s)
    dt_s = t_s - before_s
    if not dt_s > 0.0 or not np.isfinite(dt_s):
        return
    propagate_gauss_markov(work, lanes, states_of(lanes), dt_s, load_filter_settings(p))
    mind_faults(work, lanes, t_s, dt_s, o)
    if len(lanes) == 1:
        note_decay(dt_s, o)


# -- units --------------------------------------------------------------------------------------------------
def take_one(
    work: Work, p: Work, estimate: Work, innovation: Work, event: Work, entry: Work, state: Work, covariance: Work,
    room: NDArray[np.int64], used: NDArray[np.int64], t_s: float, sensor: int, lanes: Lanes,
) -> None:  # fmt: skip
    """`navigate` with a C interface: pointers of the lane buffer, the packed settings and the tape."""
    o = output_of(estimate, innovation, event, entry, state, covariance, room, used)
    navigate(work, lanes, p, o, t_s, sensor)


UNIT_SIGNATURE = "p p p p p p p p q q d i"
navigate_one = unit(take_one, UNIT_SIGNATURE, lanes=ONE_LANE)
navigate_lanes = unit(take_one, UNIT_SIGNATURE, lanes=LANES)
navigate_one_with_lag = unit(take_one, UNIT_SIGNATURE, lanes=with_lag(ONE_LANE))
navigate_lanes_with_lag = unit(take_one, UNIT_SIGNATURE, lanes=with_lag(LANES))


def navigator_unit(lanes: Lanes, lag: bool) -> Unit:
    """The unit for these lanes; lag: with the flow sensor's dynamics as states. It is compiled when it is run."""
    if lag:
        return navigate_one_with_lag if len(lanes) == 1 else navigate_lanes_with_lag
    return navigate_one if len(lanes) == 1 else navigate_lanes
