"""Memory of a navigator's motion as named records: inertial readings, spikes, windows, courses, pushes.

A field's default is its value before the first reading.
"""

from math import inf, nan
from typing import NamedTuple


class ImuMemory(NamedTuple):
    """The newest reading (gyro [rad/s], specific force [m/s2], body FRD) and its time; the mean square of its jumps
    [m2/s4]; how far the accelerometer is doubted along body down [m/s2]; gap: 1 after a stretch without readings;
    shaken_most: the greatest mean square of its jumps by which its biases were doubted, fading [m2/s4]; the gyro's
    change from the reading before [rad/s], the accelerometer's along its level axes [m/s2], and the power densities of
    their noise [(rad/s)^2/Hz, (m/s2)^2/Hz].
    """

    read_s: float = -inf
    gyro_x: float = 0.0
    gyro_y: float = 0.0
    gyro_z: float = 0.0
    accel_x: float = 0.0
    accel_y: float = 0.0
    accel_z: float = 0.0
    vibration: float = 0.0
    doubt_m_s2: float = 0.0
    gap: float = 0.0
    shaken_most: float = 0.0
    change_p: float = 0.0
    change_q: float = 0.0
    change_r: float = 0.0
    change_x: float = 0.0
    change_y: float = 0.0
    gyro_power: float = 0.0
    accel_power: float = 0.0


class StandMemory(NamedTuple):
    """does: what the vehicle did in the last window, `still.MOVES`, SHAKEN or RESTS; contact_m: the range when it
    rested last, NaN where it has not; last_m: the last range of all, NaN before the first; windows: how many, one after
    the other, in which it did that; grounded: 1 while it stands, and until the first window ends; gps_m_s: the fastest
    level velocity by GPS in the last window.
    """

    does: float = 0.0
    contact_m: float = nan
    last_m: float = nan
    windows: float = 0.0
    grounded: float = 1.0
    gps_m_s: float = 0.0


class BridgeMemory(NamedTuple):
    """The filter's attitude at the last attitude reading before a gap of the IMU, that reading, and the variances."""

    own_w: float = nan
    own_x: float = nan
    own_y: float = nan
    own_z: float = nan
    read_w: float = nan
    read_x: float = nan
    read_y: float = nan
    read_z: float = nan
    variance_n: float = nan
    variance_e: float = nan
    variance_d: float = nan


class SpikeMemory(NamedTuple):
    """How many inertial readings in a row were refused as spikes; the usual jump from one to the next, of gyro [rad/s]
    and accelerometer [m/s2]; the newest reading, spike or not; and the time over which the last jump was possible [s].
    """

    refused: float = 0.0
    gyro_rad_s: float = 0.0
    accel_m_s2: float = 0.0
    gyro_x: float = 0.0
    gyro_y: float = 0.0
    gyro_z: float = 0.0
    accel_x: float = 0.0
    accel_y: float = 0.0
    accel_z: float = 0.0
    reach_s: float = 0.0


class ImuWindow(NamedTuple):
    """Inertial readings of a window: how many, the first (turning p, q, r [rad/s], specific force x, y, z [m/s2]), sums
    of differences from it, and sums of their squares.
    """

    readings: float = 0.0
    first_p: float = 0.0
    first_q: float = 0.0
    first_r: float = 0.0
    first_x: float = 0.0
    first_y: float = 0.0
    first_z: float = 0.0
    sum_p: float = 0.0
    sum_q: float = 0.0
    sum_r: float = 0.0
    sum_x: float = 0.0
    sum_y: float = 0.0
    sum_z: float = 0.0
    square_p: float = 0.0
    square_q: float = 0.0
    square_r: float = 0.0
    accel_square: float = 0.0


class SeenWindow(NamedTuple):
    """The other readings of a window: lowest and highest range [m] (the highest below 0: none), the newest, their
    number, and the sum of squared changes between two [m2]; sums of the flow's velocity [m/s] and the number of flow
    readings, and the fastest horizontal velocity by GPS [m/s].
    """

    range_low_m: float = 1e9
    range_high_m: float = -1.0
    range_m: float = 0.0
    ranges: float = 0.0
    range_jumps: float = 0.0
    flow_u_m_s: float = 0.0
    flow_v_m_s: float = 0.0
    flows: float = 0.0
    gps_m_s: float = 0.0


class CourseMemory(NamedTuple):
    """The way as GPS and the flow saw it, weighed by time: sums of v.w and v x w [m2/s], and of both squares; its
    length [m]; when GPS and flow were received [s]; the flow's smoothed velocity by the filter's own heading [m/s].
    """

    along: float = 0.0
    across: float = 0.0
    gps: float = 0.0
    flow: float = 0.0
    travel_m: float = 0.0
    gps_s: float = -inf
    flow_s: float = -inf
    north_m_s: float = 0.0
    east_m_s: float = 0.0


class PushMemory(NamedTuple):
    """The velocity that the accelerometer adds in a block, north and east by the filter's own heading [m/s]; GPS
    velocity at its start, and when that was [s]; sums over blocks as of `CourseMemory`, of changes of velocity [m2/s2].
    """

    push_n: float = 0.0
    push_e: float = 0.0
    v_n: float = 0.0
    v_e: float = 0.0
    since_s: float = -inf
    along: float = 0.0
    across: float = 0.0
    gps: float = 0.0
    own: float = 0.0


class MotionStep(NamedTuple):
    """moves: 1 where the IMU moves the filter over the step at hand."""

    moves: float = 0.0


class SpentMotion(NamedTuple):
    """The motion applied since the last inertial reading: body rate [rad] and specific force [m/s], integrated."""

    gyro_x: float = 0.0
    gyro_y: float = 0.0
    gyro_z: float = 0.0
    accel_x: float = 0.0
    accel_y: float = 0.0
    accel_z: float = 0.0


class OwedMotion(NamedTuple):
    """The motion of past readings that is still to be applied, since no step was long enough, integrated like
    `SpentMotion`.
    """

    gyro_x: float = 0.0
    gyro_y: float = 0.0
    gyro_z: float = 0.0
    accel_x: float = 0.0
    accel_y: float = 0.0
    accel_z: float = 0.0


class ToneMemory(NamedTuple):
    """Tones of the rotor and of its blades in the newest inertial reading's specific force [m/s2], body FRD: each as a
    phasor, the value at hand and that a quarter turn away; the sum that both notches take off the reading; by how much
    the tones are faster than stated [Hz]; the power density of the noise that is left [m2/s3]; the level changes from
    one reading to the next, without tones; and the smoothed force.
    """

    rotor_x: float = 0.0
    rotor_x_across: float = 0.0
    rotor_y: float = 0.0
    rotor_y_across: float = 0.0
    rotor_z: float = 0.0
    rotor_z_across: float = 0.0
    blades_x: float = 0.0
    blades_x_across: float = 0.0
    blades_y: float = 0.0
    blades_y_across: float = 0.0
    blades_z: float = 0.0
    blades_z_across: float = 0.0
    taken_x: float = 0.0
    taken_y: float = 0.0
    taken_z: float = 0.0
    rotor_off_hz: float = 0.0
    blades_off_hz: float = 0.0
    noise_power: float = 0.0
    change_x: float = 0.0
    change_y: float = 0.0
    mean_x: float = 0.0
    mean_y: float = 0.0
    mean_z: float = 0.0


class DriftMemory(NamedTuple):
    """Velocity over the ground NED [m/s] without sways about one place."""

    north_m_s: float = 0.0
    east_m_s: float = 0.0
    down_m_s: float = 0.0


class SteadyForce(NamedTuple):
    """Specific force NED [m/s2], smoothed as a GPS receiver smooths its velocity."""

    north_m_s2: float = 0.0
    east_m_s2: float = 0.0
    down_m_s2: float = 0.0


class ForceBlocks(NamedTuple):
    """Mean specific force along the level body axes [m/s2] over blocks of time: when the block began [s], how many
    readings it has, their sum; the mean of the block before and how that differs from the one before it; how many
    blocks are done, and the power density of what changes between their changes [(m/s2)^2/Hz].
    """

    since_s: float = 0.0
    readings: float = 0.0
    sum_x: float = 0.0
    sum_y: float = 0.0
    mean_x: float = 0.0
    mean_y: float = 0.0
    change_x: float = 0.0
    change_y: float = 0.0
    blocks: float = 0.0
    power: float = 0.0


class MotionMemory(NamedTuple):
    """All that is remembered of inertial readings from step to step."""

    imu: ImuMemory
    spent: SpentMotion
    owed: OwedMotion
    tones: ToneMemory
