"""The filter's error states and the rows of a lane buffer in which its scalars lie.

The nominal state is position and velocity in the local NED frame, an attitude quaternion, the place of the pad and the
sensors' own errors. Its error is additive but for the attitude, which errs by a small rotation in the earth frame:

    q_true = (1, theta/2) q,   R_true = (I + [theta]x) R

so theta does not turn with the vehicle, and its third component is the heading error, the one that gravity does not
show. Laws name states by the short names of `SHORT_NAMES`, or by the vectors of `VECTORS` and an axis.

Row r of lane k lies at `work[r * len(lanes) + k]`. The filter's rows are the first of the buffer; others may follow.
"""

from itertools import product

from flownav.core.compile import Lanes, Work, procedure
from flownav.core.frames import of_unit_length, quaternion_product

POSITION = 0  # 3, local NED [m]
VELOCITY = 3  # 3, NED [m/s]
ATTITUDE = 6  # 3, rotation error, earth NED [rad]
GYRO_BIAS = 9  # 3, body FRD [rad/s]
ACCEL_BIAS = 12  # 3, body FRD [m/s2]
GPS_SLOW = 15  # 3, NED: slow Gauss-Markov error of GPS position (ionosphere, ephemeris) [m]
GPS_FAST = 18  # 3, NED: fast Gauss-Markov error of GPS position (multipath) [m]
GPS_VELOCITY = 21  # 3, NED: Gauss-Markov error of GPS velocity [m/s]
INS_ERROR = 24  # 3: Gauss-Markov tilt of an external attitude about body x and y, and its heading error [rad]
GROUND = 27  # 1, down coordinate of the ground below [m]
BARO = 28  # 1, pressure altitude less true altitude [m]
FLOW_SCALE = 29  # 1, flow reported over flow by its datasheet, less 1
COMPASS = 30  # 2, deviation of a compass: coefficients of sin and cos of the heading (hard iron) [rad]
VELOCITY_LAG = 32  # 1, how much older GPS velocity is than its time (receivers smooth it) [s]
PAD = 33  # 3, where the pad's centre lies, local NED [m]
STATES = 36
FLOW_LAG = 36  # 4, only where n is STATES_WITH_LAG: the flow sensor's dynamics, x1, x2 forward, x1, x2 right
STATES_WITH_LAG = 40

STATE_NAMES = (
    "pos_n_m", "pos_e_m", "pos_d_m", "vel_n_m_s", "vel_e_m_s", "vel_d_m_s",
    "tilt_n_rad", "tilt_e_rad", "heading_rad",
    "gyro_bias_x_rad_s", "gyro_bias_y_rad_s", "gyro_bias_z_rad_s",
    "accel_bias_x_m_s2", "accel_bias_y_m_s2", "accel_bias_z_m_s2",
    "gps_slow_n_m", "gps_slow_e_m", "gps_slow_d_m", "gps_fast_n_m", "gps_fast_e_m", "gps_fast_d_m",
    "gps_velocity_n_m_s", "gps_velocity_e_m_s", "gps_velocity_d_m_s",
    "ins_roll_rad", "ins_pitch_rad", "ins_heading_rad",
    "ground_d_m", "baro_m", "flow_scale", "compass_sin_rad", "compass_cos_rad", "velocity_lag_s",
    "pad_n_m", "pad_e_m", "pad_d_m", "lag_u1", "lag_u2", "lag_v1", "lag_v2",
)  # fmt: skip

MOST_OBSERVED = 12  # states that one observation reads
MOST_SOURCES = 15  # and one transition
MOST_CONSIDERED = STATES  # states that a correction may leave as they are
MOST_HYPOTHESES = 15  # faults whose effects on the state are followed, and what they left (`hypotheses`)
COLUMNS = STATES_WITH_LAG + MOST_HYPOTHESES

# STATE_NAMES without units, as laws name them
SHORT_NAMES = (
    "pos_n", "pos_e", "pos_d", "vel_n", "vel_e", "vel_d", "tilt_n", "tilt_e", "heading",
    "gyro_bias_x", "gyro_bias_y", "gyro_bias_z", "accel_bias_x", "accel_bias_y", "accel_bias_z",
    "gps_slow_n", "gps_slow_e", "gps_slow_d", "gps_fast_n", "gps_fast_e", "gps_fast_d",
    "gps_velocity_n", "gps_velocity_e", "gps_velocity_d", "ins_roll", "ins_pitch", "ins_heading",
    "ground", "baro", "flow_scale", "compass_sin", "compass_cos", "velocity_lag",
    "pad_n", "pad_e", "pad_d", "lag_u1", "lag_u2", "lag_v1", "lag_v2",
)  # fmt: skip
PLACES = {name: place for place, name in enumerate(SHORT_NAMES)}
# a vector's name means its component `axis`
VECTORS = {
    "pos": POSITION, "vel": VELOCITY, "attitude": ATTITUDE, "gyro_bias": GYRO_BIAS, "accel_bias": ACCEL_BIAS,
    "gps_slow": GPS_SLOW, "gps_fast": GPS_FAST, "gps_velocity": GPS_VELOCITY, "ins_error": INS_ERROR, "pad": PAD,
}  # fmt: skip


# what the velocity that a flow sensor with dynamics sees depends on
SEEN_BY = ("vel_n", "vel_e", "vel_d", "tilt_n", "tilt_e", "heading", "height")


class Rows:
    """Allocates consecutive rows of a lane buffer."""

    def __init__(self, first: int = 0) -> None:
        self.next = first

    def take(self, count: int) -> int:
        """The first of `count` new rows."""
        first = self.next
        self.next += count
        return first


_rows = Rows()
STATE = _rows.take(STATES_WITH_LAG)  # nominal; the three of ATTITUDE stay 0 but within a correction
QUATERNION = _rows.take(4)  # attitude, body to earth
IMU = _rows.take(6)  # gyro [rad/s] and specific force [m/s2], body FRD, that move the filter over the next step
RATE = _rows.take(3)  # body rate in the last step, the gyro's bias taken off [rad/s]
FORCE = _rows.take(3)  # specific force in the last step, bias off, earth NED [m/s2]
MIDDLE = _rows.take(9)  # R_EB in the middle of the last step, row by row
ACCEL_NOISE = _rows.take(2)  # white noise of the specific force in this lane, level and down, density [(m/s2)^2/Hz]
GYRO_NOISE = _rows.take(1)  # and of the body rate [(rad/s)^2/Hz]
# the observation at hand
MEASURED = _rows.take(8)  # what was read
OFFERED = _rows.take(1)  # above 0 in lanes that offer it
NOISE = _rows.take(1)  # its variance
INNOVATION = _rows.take(1)
INNOVATION_VARIANCE = _rows.take(1)  # h P h' + R
TEST_RATIO = _rows.take(1)  # innovation^2 / (gate^2 h P h' + R); above 1 is refused
HELD_BACK = _rows.take(1)  # above 0 in lanes that test readings and fuse none
ACCEPTED = _rows.take(1)  # 1 in lanes where it is to be fused, and then where it was
WEIGHT = _rows.take(1)  # by how much its gain is less than that of a normal innovation
COEFFICIENT = _rows.take(MOST_OBSERVED)  # h on the states that OBSERVED names
OBSERVED = _rows.take(
    1 + MOST_OBSERVED
)  # in the first lane, for all of them: how many states the law reads, then their places
# in the first lane: how many states corrections leave alone; of each its place, and the row that says where (0: all)
CONSIDERED = _rows.take(1 + 2 * MOST_CONSIDERED)
CONSIDERS = _rows.take(1)  # in the first lane: 1 where states are considered at all
GYRO_SHARE = _rows.take(1)  # by how much the gyro's bias is in a flow reading whose turning that gyro took off
HYPOTHESES = _rows.take(1)  # in the first lane: how many faults are followed
SIGNATURE = _rows.take(MOST_HYPOTHESES)  # what one unit of each adds to the reading at hand
SHARE = _rows.take(MOST_HYPOTHESES)  # how much of the state's error the reading shows while the fault is there
INFORMATION = _rows.take(MOST_HYPOTHESES)  # information of innovations on its size [1 / its unit squared]
SCORE = _rows.take(MOST_HYPOTHESES)  # that information times the size that they show
# within a step; beside the states stand the hypotheses
SCRATCH = _rows.take(max(MOST_SOURCES * MOST_SOURCES, 3 * COLUMNS))  # a transition's own block of P, both triangles
# and a correction's columns, in the same rows: none is done within the other
CROSS = SCRATCH  # P h'
GAIN = CROSS + COLUMNS  # K
REST = GAIN + COLUMNS  # P h' - K S/2
SLOPES = _rows.take(2 * len(SEEN_BY))  # derivatives of what a flow sensor with dynamics sees, forward and right
# the packed upper triangle of P, column by column, and beside it a column for each hypothesis: last, so that a compiler
# sees that no element is another row
COVARIANCE = _rows.take(STATES_WITH_LAG * (STATES_WITH_LAG + 1) // 2 + MOST_HYPOTHESES * STATES_WITH_LAG)
FILTER_ROWS = _rows.next

# names of single rows, beside the states', that laws and steps may read or write
ROWS_BY_NAME = {
    **{name: STATE + place for name, place in PLACES.items()},
    **{f"q{part}": QUATERNION + i for i, part in enumerate("wxyz")},
    **{f"gyro_{axis}": IMU + i for i, axis in enumerate("xyz")},
    **{f"accel_{axis}": IMU + 3 + i for i, axis in enumerate("xyz")},
    **{f"rate_{axis}": RATE + i for i, axis in enumerate("xyz")},
    **{f"force_{axis}": FORCE + i for i, axis in enumerate("ned")},
    **{f"middle_{i}": MIDDLE + i for i in range(9)},
    **{f"measured_{i}": MEASURED + i for i in range(8)},
    **{f"{seen}_by_{name}": SLOPES + i for i, (seen, name) in enumerate(product("uv", SEEN_BY))},
    "measured": MEASURED,
    "accel_noise": ACCEL_NOISE,
    "gyro_noise": GYRO_NOISE,
    "gyro_share": GYRO_SHARE,
}
VECTOR_ROWS = {**{name: STATE + first for name, first in VECTORS.items()}, "rate": RATE, "force": FORCE}


@procedure
def fold_attitude(work: Work, lanes: Lanes) -> None:
    """The correction of the attitude error into the quaternion: q <- (1, theta/2) q, of unit length; theta <- 0.

    A lane without a correction keeps every bit.
    """
    for lane in range(len(lanes)):
        north = work[(STATE + ATTITUDE) * len(lanes) + lane]
        east = work[(STATE + ATTITUDE + 1) * len(lanes) + lane]
        down = work[(STATE + ATTITUDE + 2) * len(lanes) + lane]
        turn = (1.0, 0.5 * north, 0.5 * east, 0.5 * down)
        qw = work[QUATERNION * len(lanes) + lane]
        qx = work[(QUATERNION + 1) * len(lanes) + lane]
        qy = work[(QUATERNION + 2) * len(lanes) + lane]
        qz = work[(QUATERNION + 3) * len(lanes) + lane]
        w, x, y, z = of_unit_length(quaternion_product(turn, (qw, qx, qy, qz)))
        corrected = turn[1] != 0.0 or turn[2] != 0.0 or turn[3] != 0.0
        work[QUATERNION * len(lanes) + lane] = w if corrected else qw
        work[(QUATERNION + 1) * len(lanes) + lane] = x if corrected else qx
        work[(QUATERNION + 2) * len(lanes) + lane] = y if corrected else qy
        work[(QUATERNION + 3) * len(lanes) + lane] = z if corrected else qz
        work[(STATE + ATTITUDE) * len(lanes) + lane] = 0.0 if corrected else north
        work[(STATE + ATTITUDE + 1) * len(lanes) + lane] = 0.0 if corrected else east
        work[(STATE + ATTITUDE + 2) * len(lanes) + lane] = 0.0 if corrected else down
