"""The flow sensor's identified dynamics inside the landing filter: two states a channel (docs/landing-filter.md).

The sensor sees the body velocity m = o R_BE v, where o > 1 only below the floor of its own sonar, and reports
gain x1 of x' = [0 1; -c -b] x + [0 1]' m. The filter carries x, so that a reading corrects what was, some
80 ms ago, as well as what is.
"""

from __future__ import annotations

from flownav.compile import equation, larger
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.landing.algebra import set_coefficient, transform
from flownav.estimation.landing.settings import FlowLag
from flownav.estimation.landing.states import ATTITUDE, FLOW_LAG, GROUND, POSITION, VELOCITY, LandingRows
from flownav.frames import Rotation, Vector, rotation_from_quaternion

LEAST_RANGE_M = 0.05
LEAST_UPRIGHT = 0.1
SEEN = (
    VELOCITY, VELOCITY + 1, VELOCITY + 2, ATTITUDE, ATTITUDE + 1, ATTITUDE + 2, POSITION + 2, GROUND,
)  # fmt: skip
FORWARD, RIGHT = (FLOW_LAG, FLOW_LAG + 1), (FLOW_LAG + 2, FLOW_LAG + 3)
FORWARD_SOURCES, RIGHT_SOURCES = (*FORWARD, *SEEN), (*RIGHT, *SEEN)
WIDTH = len(FORWARD_SOURCES)


@equation
def body_velocity_jacobian(axis: Vector, vel_n: float, vel_e: float, vel_d: float) -> Vector:
    """d(axis . v)/d theta for a body axis in earth NED: (I + [theta]x) axis . v = axis . v + theta . (axis x v)."""
    return (
        axis[1] * vel_d - axis[2] * vel_e,
        axis[2] * vel_n - axis[0] * vel_d,
        axis[0] * vel_e - axis[1] * vel_n,
    )


@equation
def lens_range(rotation: Rotation, height_m: float, lens_below_m: float) -> tuple[float, float, float, float]:
    """r = height/R_33 - lens [m], and its slopes on height and on the attitude error about north and east.

    The distance from lens to level ground along body down; theta turns R_33 by theta_n R_23 - theta_e R_13. At
    least LEAST_RANGE_M, where the slopes are 0.
    """
    upright = larger(rotation[8], LEAST_UPRIGHT)
    free = height_m / upright - lens_below_m
    slope = 1.0 / upright if free.real > LEAST_RANGE_M else 0.0
    by_tilt = slope * height_m / upright
    return larger(free, LEAST_RANGE_M), slope, -by_tilt * rotation[5], by_tilt * rotation[2]


@equation
def see(work: Work, lanes: Lanes, rows: LandingRows, channel: int, lag: FlowLag, first: int) -> None:
    """rows.seen of a channel (0 forward, 1 right) and its Jacobian on SEEN, from coefficient `first` on."""
    for lane in range(len(lanes)):
        rotation = rotation_from_quaternion(
            work[rows.attitude * len(lanes) + lane],
            work[(rows.attitude + 1) * len(lanes) + lane],
            work[(rows.attitude + 2) * len(lanes) + lane],
            work[(rows.attitude + 3) * len(lanes) + lane],
        )
        axis = (
            rotation[0] if channel == 0 else rotation[1],
            rotation[3] if channel == 0 else rotation[4],
            rotation[6] if channel == 0 else rotation[7],
        )
        vel_n = work[(rows.state + VELOCITY) * len(lanes) + lane]
        vel_e = work[(rows.state + VELOCITY + 1) * len(lanes) + lane]
        vel_d = work[(rows.state + VELOCITY + 2) * len(lanes) + lane]
        along = axis[0] * vel_n + axis[1] * vel_e + axis[2] * vel_d
        turn = body_velocity_jacobian(axis, vel_n, vel_e, vel_d)
        below = work[(rows.state + GROUND) * len(lanes) + lane] - work[(rows.state + POSITION + 2) * len(lanes) + lane]
        range_m, by_height, by_north, by_east = lens_range(rotation, below, lag.lens_below_m)
        low = range_m.real < lag.sonar_floor_m
        over = lag.sonar_floor_m / range_m if low else 1.0
        by_range = -over * along / range_m if low else 0.0
        work[(rows.seen + channel) * len(lanes) + lane] = over * along
        work[(rows.coefficient + first) * len(lanes) + lane] = over * axis[0]
        work[(rows.coefficient + first + 1) * len(lanes) + lane] = over * axis[1]
        work[(rows.coefficient + first + 2) * len(lanes) + lane] = over * axis[2]
        work[(rows.coefficient + first + 3) * len(lanes) + lane] = over * turn[0] + by_range * by_north
        work[(rows.coefficient + first + 4) * len(lanes) + lane] = over * turn[1] + by_range * by_east
        work[(rows.coefficient + first + 5) * len(lanes) + lane] = over * turn[2]
        work[(rows.coefficient + first + 6) * len(lanes) + lane] = -by_range * by_height
        work[(rows.coefficient + first + 7) * len(lanes) + lane] = by_range * by_height


@equation
def drive(work: Work, lanes: Lanes, rows: LandingRows, channel: int, gain_1: float, gain_2: float) -> None:
    """Coefficients of x1 and x2: the seen velocity's Jacobian (left by `see` in the second row) times their gains."""
    for s in range(len(SEEN)):
        second = rows.coefficient + WIDTH + 2 + s
        for lane in range(len(lanes)):
            element = work[second * len(lanes) + lane]
            work[(rows.coefficient + 2 + s) * len(lanes) + lane] = gain_1 * element
            work[second * len(lanes) + lane] = gain_2 * element
    for lane in range(len(lanes)):
        seen = work[(rows.seen + channel) * len(lanes) + lane]
        work[(rows.state + FLOW_LAG + 2 * channel) * len(lanes) + lane] += gain_1 * seen
        work[(rows.state + FLOW_LAG + 2 * channel + 1) * len(lanes) + lane] += gain_2 * seen


@equation
def lag_step(
    work: Work, lanes: Lanes, rows: LandingRows, channel: int, own: tuple[float, float, float, float],
    gain_1: float, gain_2: float, lag: FlowLag,
) -> None:  # fmt: skip
    """x <- own x + gain m of one channel, with the covariance."""
    see(work, lanes, rows, channel, lag, WIDTH + 2)
    first = rows.state + FLOW_LAG + 2 * channel
    for lane in range(len(lanes)):
        x1, x2 = work[first * len(lanes) + lane], work[(first + 1) * len(lanes) + lane]
        work[first * len(lanes) + lane] = own[0] * x1 + own[1] * x2
        work[(first + 1) * len(lanes) + lane] = own[2] * x1 + own[3] * x2
    drive(work, lanes, rows, channel, gain_1, gain_2)
    set_coefficient(work, lanes, rows, 0, own[0])
    set_coefficient(work, lanes, rows, 1, own[1])
    set_coefficient(work, lanes, rows, WIDTH, own[2])
    set_coefficient(work, lanes, rows, WIDTH + 1, own[3])
    if channel == 0:
        transform(work, lanes, rows, FORWARD, FORWARD_SOURCES)
    else:
        transform(work, lanes, rows, RIGHT, RIGHT_SOURCES)


@equation
def lag_starts(work: Work, lanes: Lanes, rows: LandingRows, lag: FlowLag) -> None:
    """What the velocity at the start of a prediction leaves in the sensor at its end."""
    own = (lag.f11, lag.f12, lag.f21, lag.f22)
    for channel in range(2):
        lag_step(work, lanes, rows, channel, own, lag.start_1, lag.start_2, lag)


@equation
def lag_ends(work: Work, lanes: Lanes, rows: LandingRows, lag: FlowLag) -> None:
    """What the velocity at the end of a prediction adds."""
    for channel in range(2):
        lag_step(work, lanes, rows, channel, (1.0, 0.0, 0.0, 1.0), lag.end_1, lag.end_2, lag)
