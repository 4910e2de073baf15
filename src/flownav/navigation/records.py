"""Memory of a navigator in each lane, subject by subject, as named records; `memory` holds where they lie.

A field's default is its value before the first reading.
"""

from math import inf, nan
from typing import NamedTuple

from flownav.core.frames import GRAVITY_M_S2

AGREEING = 5.0  # readings of a flow that was blind for long: chosen, a fifth of a second at 25 Hz


class Reading(NamedTuple):
    """One reading of one sensor, its values as `measurement.COLUMNS` has them and the variances that it states.

    Flow has two values more, the vehicle's own turning over its exposure [rad/s]. A variance is NaN where none is
    stated. quality: 0..255. arrived: 0 in a lane whose sensor stayed silent. withheld: 1 where the user takes it away.
    """

    value_0: float = 0.0
    value_1: float = 0.0
    value_2: float = 0.0
    value_3: float = 0.0
    value_4: float = 0.0
    value_5: float = 0.0
    variance_0: float = 0.0
    variance_1: float = 0.0
    variance_2: float = 0.0
    quality: float = 0.0
    arrived: float = 0.0
    withheld: float = 0.0


class StartMemory(NamedTuple):
    """started: 1 once the filter runs. Before that, the newest attitude that was read and its time [s], the mean
    specific force [m/s2] and the number of its readings, the mean square of an axis about it [m2/s4], when the first
    came [s], and the specific force without its vibration (body FRD [m/s2]).
    """

    started: float = 0.0
    attitude_s: float = -inf
    qw: float = 1.0
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    force_x: float = 0.0
    force_y: float = 0.0
    force_z: float = 0.0
    readings: float = 0.0
    shaken: float = 0.0
    since_s: float = 0.0
    felt_x: float = 0.0
    felt_y: float = 0.0
    felt_z: float = -GRAVITY_M_S2


class AidMemory(NamedTuple):
    """aided_s: when something horizontal was fused last; flag: 0, 1 dead reckoning, 2 invalid; height_s: when something
    other than the range measured the height; landed: 1 on the ground; aided: 1 where something horizontal was fused
    lately as an external attitude was read.
    """

    aided_s: float = nan
    flag: float = 0.0
    height_s: float = -inf
    landed: float = 0.0
    aided: float = 0.0


class RangeMemory(NamedTuple):
    """taken_s: of the last range that was fused; refused_s: since when they are refused; last_m and same_s: the last
    value and since when it repeats; down_m: where the vehicle was then; said_s: of the repetition that was reported;
    doubted: 1 once the accelerometer was doubted for it; sigmas: exponential mean of the innovations that were
    fused, in standard deviations; off_m: the last of them; tested_s, contradiction_m: of the last that was tested,
    fused or refused; before_m: contradiction of the one before.
    """

    taken_s: float = -inf
    refused_s: float = nan
    last_m: float = nan
    same_s: float = nan
    down_m: float = 0.0
    stuck_s: float = nan
    doubted: float = 0.0
    sigmas: float = 0.0
    off_m: float = 0.0
    tested_s: float = -inf
    contradiction_m: float = 0.0
    before_m: float = 0.0


class EchoMemory(NamedTuple):
    """The two newest ranges [m], where the vehicle was then (down [m]), and the share of ranges that no neighbour
    confirms.
    """

    newest_m: float = nan
    newest_down_m: float = 0.0
    older_m: float = nan
    older_down_m: float = 0.0
    stray: float = 0.0


class GroundMemory(NamedTuple):
    """known: 1 once ranges have found the ground. A ground that would be new: candidate_m, its down coordinate by the
    newest range; since_s and first_m, when and by which range it was seen first; agreeing, by how many in a row;
    varied: 1 where these were not all the same to the last digit.
    """

    known: float = 0.0
    candidate_m: float = 0.0
    since_s: float = 0.0
    first_m: float = 0.0
    agreeing: float = 0.0
    varied: float = 0.0


class FlowMemory(NamedTuple):
    """taken_s: of the last tested flow; excess: how many times noisier than its model; bias of the sensor's own gyro
    [rad/s] and from how many readings; ratio: mean of nu^2 over its variance; doubted: 1 while that is too
    large; likeness: mean of `flow_noise.alike`; wrong_s: when that was too large last; -infinity where it is not;
    usual: the quality that it usually has; agreed: number of readings that agreed with the one before since it
    was blind for long, less those that did not; AGREEING end the wait.
    """

    taken_s: float = -inf
    excess: float = 1.0
    bias_x: float = 0.0
    bias_y: float = 0.0
    bias_count: float = 0.0
    ratio: float = 1.0
    doubted: float = 0.0
    likeness: float = 0.0
    wrong_s: float = -inf
    usual: float = 0.0
    agreed: float = AGREEING


class FlowSum(NamedTuple):
    """Looks of an angular flow that are too short to be fused alone: when the newest ended [s], for how long they
    looked together [s], and the sums of their values and of their quality, each times its length.
    """

    received_s: float = -inf
    looked_s: float = 0.0
    x: float = 0.0
    y: float = 0.0
    own_x: float = 0.0
    own_y: float = 0.0
    imu_x: float = 0.0
    imu_y: float = 0.0
    quality: float = 0.0


class FlowInnovation(NamedTuple):
    """A component's innovation at the flow reading before [rad/s or m/s]."""

    innovation: float = 0.0


class Look(NamedTuple):
    """The flow reading at hand: the vehicle's turning [rad/s]; the range from the lens to the ground along the
    boresight by the filter [m], and known: 1 where that is well known; R_33; unranged: 1 where no range measures the
    height of the flow now: none lately, or a disputed one, or strays; by how much the newest range disputes that height
    [m]; the verdict on the whole reading (`reasons`); and unscaled: 1 where nothing absolute is at hand that the flow's
    scale could be learnt against.
    """

    turning_x: float = 0.0
    turning_y: float = 0.0
    range_m: float = 0.0
    known: float = 0.0
    upright: float = 0.0
    unranged: float = 0.0
    disputed_m: float = 0.0
    reason: float = 0.0
    unscaled: float = 0.0


class HeadingMemory(NamedTuple):
    """read_s: when a heading was read last; field_rad: direction of the level magnetic field in the filter's frame;
    refuted: 1 once what is read as heading was found to be wrong; sought: 1 while a heading that no sensor reads is to
    be found from the course; fused_rad2: the variance with which the heading at hand is fused [rad2];
    agreed_s: since when headings passed their gate, NaN where none did; refused_s: since when they are refused, NaN
    where the last one passed.
    """

    read_s: float = -inf
    field_rad: float = nan
    refuted: float = 0.0
    sought: float = 0.0
    fused_rad2: float = nan
    agreed_s: float = nan
    refused_s: float = nan


class WitnessMemory(NamedTuple):
    """All that is remembered of one component of a range, a barometer or GPS.

    factor: its noise over its stated noise [variance]; its innovation before, when that was [s], and the number of
    innovations that the factor was estimated from. known: 1 once its datum was found. How often it was refused, one
    after the other, and since when; when it was fused last; leapt: 1 where the first of them was far beyond the gate.
    """

    factor: float = 1.0
    before: float = 0.0
    received_s: float = -inf
    readings: float = 0.0
    known: float = 0.0
    times: float = 0.0
    since_s: float = -inf
    fused_s: float = -inf
    leapt: float = 0.0


class WhitenessMemory(NamedTuple):
    """A block of innovations along one body axis: since when [s], their sum in standard deviations, how many. The mean
    of the blocks before, the mean square of blocks, and when the last ended [s]; factor: how many times noisier than
    stated the accelerometer is along that axis.
    """

    since_s: float = 0.0
    total: float = 0.0
    readings: float = 0.0
    before: float = 0.0
    square: float = 1.0
    ended_s: float = -inf
    factor: float = 1.0


class LevelMemory(NamedTuple):
    """ratio: the largest test ratio of the components that are judged together: of a place, a velocity or a pad fix."""

    ratio: float = 0.0


class GpsMemory(NamedTuple):
    """last_fix_s: when GPS last measured north or east; moved_n_m and moved_e_m: how far resets to GPS moved the
    position, back and forth added up.
    """

    last_fix_s: float = -inf
    moved_n_m: float = 0.0
    moved_e_m: float = 0.0


class WalkMemory(NamedTuple):
    """A GPS position that walks off: alike_n and alike_e: how alike its innovations along north and east are while flow
    and the receiver's own velocity contradict them; found_s: when it was last found to walk [s].
    """

    alike_n: float = 0.0
    alike_e: float = 0.0
    found_s: float = -inf


class PadMemory(NamedTuple):
    """known: 0 where the pad is not, or how it is: NEVER_STOOD, STOOD_ON, LEFT, SEEN of `place`; agreeing: fixes in a
    row that see something at one place, which is not where the pad is known to be; aloft_s: since when a vehicle that
    stood nowhere is reported to fly; last_: where the latest fix saw something, local NED [m].
    """

    known: float = 0.0
    agreeing: float = 0.0
    aloft_s: float = inf
    last_n_m: float = inf
    last_e_m: float = inf
    last_d_m: float = inf


class FlowSignMemory(NamedTuple):
    """The filter's prediction of the flow at the reading before [rad/s or m/s]; the turning that it saw then [rad/s];
    and the speed of both channels together over the ground, turning and all [m/s].
    """

    read_x: float = 0.0
    read_y: float = 0.0
    turning_x: float = 0.0
    turning_y: float = 0.0
    speed_m_s: float = 0.0


class SuspicionMemory(NamedTuple):
    """suspected: 0, or 1 and the number of the fault of `hypotheses` that is suspected; suspected_s: since when.
    puzzled_s: when innovations last hinted at a flow that is reversed or swapped. left_over_m: how far off a fault may
    have put the position before it was excluded.
    """

    suspected: float = 0.0
    suspected_s: float = 0.0
    puzzled_s: float = -inf
    left_over_m: float = 0.0


class Levels(NamedTuple):
    """Protection levels at the last estimate [m]."""

    horizontal_m: float = nan
    vertical_m: float = nan


class ScaleDoubt(NamedTuple):
    """Standard deviation of a flow scale that nothing determines; 0 where the filter learns it."""

    sigma: float = 0.0


class RangingMemory(NamedTuple):
    """All that is remembered of ranges."""

    range: RangeMemory
    echo: EchoMemory
    ground: GroundMemory


class FixMemory(NamedTuple):
    """All that is remembered of GPS, and of the pad that goes along with it."""

    witness: WitnessMemory
    gps: GpsMemory
    pad: PadMemory
