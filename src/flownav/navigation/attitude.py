"""An external attitude: all of it where there is no IMU, else its heading, where down is, and the way across a gap."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, procedure, replacing, squared
from flownav.core.frames import (
    Quaternion,
    conjugate,
    heading_from_quaternion,
    quaternion_product,
    rotation_from_quaternion,
)
from flownav.estimation.covariance import consider, consider_none, variance_of
from flownav.estimation.laws import component
from flownav.estimation.laws.attitude import attitude, bridged_attitude, level
from flownav.estimation.named import Attitude
from flownav.estimation.states import ATTITUDE, CONSIDERS, FLOW_LAG, GYRO_BIAS, INS_ERROR, MEASURED
from flownav.navigation import calls
from flownav.navigation.heading import HeadingVerdict, conclude_heading, offered_heading
from flownav.navigation.kernel_settings import FROM_ATTITUDE, AttitudeSettings, Equipment
from flownav.navigation.memory import LEVEL_READ, MEMORY, share, shared
from flownav.navigation.motion_records import BridgeMemory, ImuMemory
from flownav.navigation.offers import conclude, observe_innovation
from flownav.navigation.packed import load_attitude_settings
from flownav.navigation.reasons import FUSED, SILENT, usable_in_flight
from flownav.navigation.records import AidMemory, HeadingMemory, Reading, StartMemory
from flownav.navigation.tape import Output
from flownav.navigation.verdicts import Offer, on_lanes

# 1.1 deg between two logged attitudes: chosen, not measured. Without the bridge a gap of 3 s in a turn costs a radian
# of heading (test_a_gap_of_the_imu_is_bridged_by_the_logged_attitude).
BRIDGE_SIGMA_RAD = 0.02

with_aided = replacing(AidMemory, "aided")
with_gap = replacing(ImuMemory, "gap")


class MeasuredAttitude(NamedTuple):
    """A quaternion, as the observation law of an attitude reads it."""

    w: float
    x: float
    y: float
    z: float


class AttitudeVariance(NamedTuple):
    """The variances of the filter's attitude about north, east and down [rad2]."""

    about_n: float
    about_e: float
    about_d: float


@equation
def attitude_variance(work: Work, lanes: Lanes, lane: int) -> AttitudeVariance:
    """The variances of a lane's attitude."""
    return AttitudeVariance(
        variance_of(work, lanes, ATTITUDE, lane),
        variance_of(work, lanes, ATTITUDE + 1, lane),
        variance_of(work, lanes, ATTITUDE + 2, lane),
    )


MEMORY.name(MeasuredAttitude, *(MEASURED + i for i in range(4)))
MEMORY.derive(AttitudeVariance, attitude_variance)
AIDED = MEMORY.row(AidMemory, "aided")


# -- an external attitude -----------------------------------------------------------------------------------
@equation
def read_attitude(reading: Reading, started: float) -> tuple[bool, Quaternion]:
    """Whether a quaternion that was read is one, and may be taken; and it, of unit length."""
    size = np.sqrt(
        squared(reading.value_0) + squared(reading.value_1) + squared(reading.value_2) + squared(reading.value_3)
    )
    sound = usable_in_flight(reading, size, 0.0, started) == FUSED and size > 0.5 and size < 2.0
    return sound, (reading.value_0 / size, reading.value_1 / size, reading.value_2 / size, reading.value_3 / size)


class AttitudeOffer(NamedTuple):
    """One axis of an attitude: its law reads all of it."""

    offer: Offer
    measured: MeasuredAttitude


@equation
def offered_attitude(read: Quaternion, variance: float, sound: bool) -> AttitudeOffer:
    """An attitude in the lanes where it is sound; the others are silent."""
    w, x, y, z = read
    return AttitudeOffer(Offer(w, variance, FUSED if sound else SILENT), MeasuredAttitude(w, x, y, z))


@on_lanes(calls.judge_attitude)
def judge_attitude(reading: Reading, start: StartMemory, *, s: AttitudeSettings) -> AttitudeOffer:
    """The quaternion that was read, where no IMU serves."""
    sound, read = read_attitude(reading, start.started)
    return offered_attitude(read, s.ins_tilt_white_rad * s.ins_tilt_white_rad, sound)


@on_lanes(calls.judge_heading)
def judge_heading(
    reading: Reading, start: StartMemory, m: HeadingMemory, *, t_s: float, s: AttitudeSettings
) -> HeadingVerdict:
    """The heading of an external attitude."""
    sound, read = read_attitude(reading, start.started)
    read_rad = heading_from_quaternion(read[0], read[1], read[2], read[3])
    return offered_heading(t_s, read_rad, np.nan, FUSED if sound else SILENT, m, s)


@procedure
def take_attitude(work: Work, lanes: Lanes, t_s: float, sensor: int, fitted: Equipment, p: Work, o: Output) -> None:
    """An autopilot's or INS's attitude: all of it where no IMU serves, its heading where nothing else gives one."""
    s = load_attitude_settings(p)
    if fitted.use_attitude:
        for axis in range(3):
            judge_attitude(work, lanes, s)
            attitude(work, lanes, axis)
            observe_innovation(work, lanes)
            conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)
        return
    bridge(work, lanes, t_s, sensor, s, o)
    if fitted.heading == FROM_ATTITUDE:
        judge_heading(work, lanes, t_s, s)
        conclude_heading(work, lanes, t_s, sensor, s, o)
    take_level(work, lanes, t_s, sensor, s, o)


# -- where it puts down ---------------------------------------------------------------------------------------
@on_lanes(calls.note_aided)
def note_aided(aid: AidMemory) -> AidMemory:
    """Whether something horizontal was fused lately."""
    return with_aided(aid, aided=1.0 if aid.flag < 2.0 else 0.0)


@on_lanes(calls.judge_level)
def judge_level(reading: Reading, start: StartMemory, *, axis: int, s: AttitudeSettings) -> Offer:
    """Down by the quaternion that was read, along a body axis, in the lanes where it is one; the others are silent."""
    sound, read = read_attitude(reading, start.started)
    rotation = rotation_from_quaternion(read[0], read[1], read[2], read[3])
    down = component((rotation[6], rotation[7], 0.0), axis)
    return Offer(down, s.ins_tilt_white_rad * s.ins_tilt_white_rad, FUSED if sound else SILENT)


@procedure
def take_level(work: Work, lanes: Lanes, t_s: float, sensor: int, s: AttitudeSettings, o: Output) -> None:
    """Where an external attitude puts down, beside an IMU. While something horizontal aids the filter, it corrects the
    reading's slow error and nothing else; where nothing does it is taken.
    """
    smoothing = shared(work, lanes, CONSIDERS) == 0.0  # no state is merely considered then: it would move them all
    if smoothing or t_s - shared(work, lanes, LEVEL_READ) < s.ins_tilt_time_s:
        return
    share(work, lanes, LEVEL_READ, t_s)
    note_aided(work, lanes)
    consider_motion(work, lanes)
    for axis in range(2):
        judge_level(work, lanes, axis, s)
        level(work, lanes, axis)
        observe_innovation(work, lanes)
        conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)


@equation
def consider_motion(work: Work, lanes: Lanes) -> None:
    """An aided filter knows its motion better than the autopilot's attitude does; and down determines no heading."""
    consider_none(work, lanes)
    for state in range(FLOW_LAG):
        heads = state == ATTITUDE + 2 or state == GYRO_BIAS + 2 or state == INS_ERROR + 2
        if state != INS_ERROR and state != INS_ERROR + 1:
            consider(work, lanes, state, 0 if heads else AIDED)


# -- across a gap of the IMU ------------------------------------------------------------------------------------
class BridgeHead(NamedTuple):
    """The attitudes on this side of a gap that may come. crossed: one has come, and is to be crossed."""

    bridge: BridgeMemory
    crossed: bool


@on_lanes(calls.note_bridge)
def note_bridge(
    reading: Reading, start: StartMemory, imu: ImuMemory, own: Attitude, variance: AttitudeVariance, m: BridgeMemory
) -> BridgeHead:
    """Without a gap the filter's attitude and the read one are noted."""
    sound, read = read_attitude(reading, start.started)
    gap = imu.gap > 0.0
    noted = BridgeMemory(
        own.qw, own.qx, own.qy, own.qz, read[0], read[1], read[2], read[3],
        variance.about_n, variance.about_e, variance.about_d,
    )  # fmt: skip
    return BridgeHead(noted if sound and not gap else m, sound and gap)


@on_lanes(calls.judge_bridged)
def judge_bridged(reading: Reading, start: StartMemory, imu: ImuMemory, m: BridgeMemory, *, axis: int) -> AttitudeOffer:
    """The attitude that the filter would have, had it turned over the gap as the read one did."""
    sound, read = read_attitude(reading, start.started)
    crosses = imu.gap > 0.0 and bool(np.isfinite(m.own_w)) and sound
    back = conjugate((m.read_w, m.read_x, m.read_y, m.read_z))
    turned = quaternion_product((m.own_w, m.own_x, m.own_y, m.own_z), quaternion_product(back, read))
    before = component((m.variance_n, m.variance_e, m.variance_d), axis)
    return offered_attitude(turned, before + squared(BRIDGE_SIGMA_RAD), crosses)


@on_lanes(calls.close_gap)
def close_gap(m: ImuMemory) -> ImuMemory:
    """No gap is open any more."""
    return with_gap(m, gap=0.0)


@procedure
def bridge(work: Work, lanes: Lanes, t_s: float, sensor: int, s: AttitudeSettings, o: Output) -> None:
    """Across a gap of the IMU the filter turns as the read attitude did: q_before conj(read_before) read, measured.

    Its variance is what the filter's was before the gap, and BRIDGE_SIGMA_RAD for the time between the two.
    """
    if not note_bridge(work, lanes):
        return
    for axis in range(3):
        judge_bridged(work, lanes, axis)
        bridged_attitude(work, lanes, axis)
        observe_innovation(work, lanes)
        conclude(work, lanes, t_s, sensor, axis, s.gate_sigma, o)
    close_gap(work, lanes)
