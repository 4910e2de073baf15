"""The GPS/INS unit (MIDG II, 50 Hz): position, velocity and attitude with their errors.

Position error of each axis: slow Gauss-Markov (ionosphere, ephemeris) + fast Gauss-Markov (multipath) +
jitter. Velocity error: Gauss-Markov + white. Attitude error: Gauss-Markov tilt about the body's x and y axes
and Gauss-Markov heading about the vertical. One equation serves both published readings of the unit; the
parameters alone select:

- `white`: what the paper must have simulated (back-solved from its Tables 5 and 6): independent position noise of about
  0.3 m an axis at every 50 Hz sample, nothing else. It is the jitter with time constant zero.
- `midg`: what 2 m CEP means (Table 4): errors of metres that change over minutes, one sample (20 ms) late.
"""

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.core.frames import Quaternion, of_unit_length, quaternion_product
from flownav.sensors.processes import gauss_markov, quantised

PERIOD_S = 0.02


class GpsInsParameters(NamedTuple):
    """Coefficients of one period. `decay` and `drive` are those of unit Gauss-Markov processes."""

    slow_decay: float
    slow_drive: float
    slow_sigma_m: float
    slow_sigma_down_m: float
    fast_decay: float
    fast_drive: float
    fast_sigma_m: float
    fast_sigma_down_m: float
    jitter_decay: float
    jitter_drive: float
    jitter_sigma_m: float
    jitter_sigma_down_m: float
    velocity_decay: float
    velocity_drive: float
    velocity_sigma_m_s: float
    velocity_white_m_s: float
    tilt_decay: float
    tilt_drive: float
    tilt_sigma_rad: float
    heading_decay: float
    heading_drive: float
    heading_sigma_rad: float
    position_quantum_m: float
    position_steps_per_m: float
    velocity_quantum_m_s: float
    velocity_steps_per_m_s: float
    late: float  # 1: readings are one period old; 0: they are current


class NavSolution(NamedTuple):
    """A solution as the unit, or a perfect one, reports it: NED position and velocity, attitude body to earth."""

    pos_n_m: float
    pos_e_m: float
    pos_d_m: float
    vel_n_m_s: float
    vel_e_m_s: float
    vel_d_m_s: float
    qw: float
    qx: float
    qy: float
    qz: float


class GpsInsNormals(NamedTuple):
    """Standard normals of one period; the start of a flight takes the same set."""

    slow_n: float
    slow_e: float
    slow_d: float
    fast_n: float
    fast_e: float
    fast_d: float
    jitter_n: float
    jitter_e: float
    jitter_d: float
    velocity_n: float
    velocity_e: float
    velocity_d: float
    white_n: float
    white_e: float
    white_d: float
    roll: float
    pitch: float
    heading: float


class GpsInsErrors(NamedTuple):
    """The error processes: NED metres, NED m/s, rad."""

    slow_n_m: float
    slow_e_m: float
    slow_d_m: float
    fast_n_m: float
    fast_e_m: float
    fast_d_m: float
    jitter_n_m: float
    jitter_e_m: float
    jitter_d_m: float
    velocity_n_m_s: float
    velocity_e_m_s: float
    velocity_d_m_s: float
    roll_rad: float
    pitch_rad: float
    heading_rad: float


class GpsInsState(NamedTuple):
    """The error processes and the newest solution, held for a late reading (two flat bundles of scalars)."""

    errors: GpsInsErrors
    held: NavSolution


@equation
def attitude_with_error(attitude: Quaternion, roll_rad: float, pitch_rad: float, heading_rad: float) -> Quaternion:
    """q_reported = q(heading about earth down) q_true q(roll, pitch about body x, y), of unit length.

    Errors are small angles: a half angle stands for its tangent, 0.3 % of the error at 10 degrees.
    """
    heading = (1.0, 0.0, 0.0, 0.5 * heading_rad)
    tilt = (1.0, 0.5 * roll_rad, 0.5 * pitch_rad, 0.0)
    return of_unit_length(quaternion_product(quaternion_product(heading, attitude), tilt))


@equation
def _solution(errors: GpsInsErrors, truth: NavSolution, n: GpsInsNormals, p: GpsInsParameters) -> NavSolution:
    """The truth with its errors, in the whole centimetres and cm/s of the unit's message."""
    pos_n_m = truth.pos_n_m + (errors.slow_n_m + errors.fast_n_m + errors.jitter_n_m)
    pos_e_m = truth.pos_e_m + (errors.slow_e_m + errors.fast_e_m + errors.jitter_e_m)
    pos_d_m = truth.pos_d_m + (errors.slow_d_m + errors.fast_d_m + errors.jitter_d_m)
    vel_n_m_s = truth.vel_n_m_s + (errors.velocity_n_m_s + p.velocity_white_m_s * n.white_n)
    vel_e_m_s = truth.vel_e_m_s + (errors.velocity_e_m_s + p.velocity_white_m_s * n.white_e)
    vel_d_m_s = truth.vel_d_m_s + (errors.velocity_d_m_s + p.velocity_white_m_s * n.white_d)
    qw, qx, qy, qz = attitude_with_error(
        (truth.qw, truth.qx, truth.qy, truth.qz), errors.roll_rad, errors.pitch_rad, errors.heading_rad
    )
    return NavSolution(
        quantised(pos_n_m, p.position_quantum_m, p.position_steps_per_m),
        quantised(pos_e_m, p.position_quantum_m, p.position_steps_per_m),
        quantised(pos_d_m, p.position_quantum_m, p.position_steps_per_m),
        quantised(vel_n_m_s, p.velocity_quantum_m_s, p.velocity_steps_per_m_s),
        quantised(vel_e_m_s, p.velocity_quantum_m_s, p.velocity_steps_per_m_s),
        quantised(vel_d_m_s, p.velocity_quantum_m_s, p.velocity_steps_per_m_s),
        qw,
        qx,
        qy,
        qz,
    )


@equation
def start_gps_ins(truth: NavSolution, n: GpsInsNormals, p: GpsInsParameters) -> GpsInsState:
    """Every process drawn from its stationary distribution (a flight does not start with a zero error).

    The first late reading is the solution of this instant.
    """
    errors = GpsInsErrors(
        slow_n_m=p.slow_sigma_m * n.slow_n,
        slow_e_m=p.slow_sigma_m * n.slow_e,
        slow_d_m=p.slow_sigma_down_m * n.slow_d,
        fast_n_m=p.fast_sigma_m * n.fast_n,
        fast_e_m=p.fast_sigma_m * n.fast_e,
        fast_d_m=p.fast_sigma_down_m * n.fast_d,
        jitter_n_m=p.jitter_sigma_m * n.jitter_n,
        jitter_e_m=p.jitter_sigma_m * n.jitter_e,
        jitter_d_m=p.jitter_sigma_down_m * n.jitter_d,
        velocity_n_m_s=p.velocity_sigma_m_s * n.velocity_n,
        velocity_e_m_s=p.velocity_sigma_m_s * n.velocity_e,
        velocity_d_m_s=p.velocity_sigma_m_s * n.velocity_d,
        roll_rad=p.tilt_sigma_rad * n.roll,
        pitch_rad=p.tilt_sigma_rad * n.pitch,
        heading_rad=p.heading_sigma_rad * n.heading,
    )
    return GpsInsState(errors, _solution(errors, truth, n, p))


@equation
def _next_errors(e: GpsInsErrors, n: GpsInsNormals, p: GpsInsParameters) -> GpsInsErrors:
    """Every process one period on."""
    slow, slow_down = p.slow_drive * p.slow_sigma_m, p.slow_drive * p.slow_sigma_down_m
    fast, fast_down = p.fast_drive * p.fast_sigma_m, p.fast_drive * p.fast_sigma_down_m
    jitter, jitter_down = p.jitter_drive * p.jitter_sigma_m, p.jitter_drive * p.jitter_sigma_down_m
    velocity = p.velocity_drive * p.velocity_sigma_m_s
    tilt, heading = p.tilt_drive * p.tilt_sigma_rad, p.heading_drive * p.heading_sigma_rad
    return GpsInsErrors(
        slow_n_m=gauss_markov(e.slow_n_m, p.slow_decay, slow, n.slow_n),
        slow_e_m=gauss_markov(e.slow_e_m, p.slow_decay, slow, n.slow_e),
        slow_d_m=gauss_markov(e.slow_d_m, p.slow_decay, slow_down, n.slow_d),
        fast_n_m=gauss_markov(e.fast_n_m, p.fast_decay, fast, n.fast_n),
        fast_e_m=gauss_markov(e.fast_e_m, p.fast_decay, fast, n.fast_e),
        fast_d_m=gauss_markov(e.fast_d_m, p.fast_decay, fast_down, n.fast_d),
        jitter_n_m=gauss_markov(e.jitter_n_m, p.jitter_decay, jitter, n.jitter_n),
        jitter_e_m=gauss_markov(e.jitter_e_m, p.jitter_decay, jitter, n.jitter_e),
        jitter_d_m=gauss_markov(e.jitter_d_m, p.jitter_decay, jitter_down, n.jitter_d),
        velocity_n_m_s=gauss_markov(e.velocity_n_m_s, p.velocity_decay, velocity, n.velocity_n),
        velocity_e_m_s=gauss_markov(e.velocity_e_m_s, p.velocity_decay, velocity, n.velocity_e),
        velocity_d_m_s=gauss_markov(e.velocity_d_m_s, p.velocity_decay, velocity, n.velocity_d),
        roll_rad=gauss_markov(e.roll_rad, p.tilt_decay, tilt, n.roll),
        pitch_rad=gauss_markov(e.pitch_rad, p.tilt_decay, tilt, n.pitch),
        heading_rad=gauss_markov(e.heading_rad, p.heading_decay, heading, n.heading),
    )


@equation
def step_gps_ins(
    state: GpsInsState, truth: NavSolution, n: GpsInsNormals, p: GpsInsParameters
) -> tuple[GpsInsState, NavSolution]:
    """One period: the errors move on and the unit reports the truth with them, this one's or the one before's."""
    errors = _next_errors(state.errors, n, p)
    fresh = _solution(errors, truth, n, p)
    held = state.held
    late = p.late > 0.5
    reading = NavSolution(
        pos_n_m=held.pos_n_m if late else fresh.pos_n_m,
        pos_e_m=held.pos_e_m if late else fresh.pos_e_m,
        pos_d_m=held.pos_d_m if late else fresh.pos_d_m,
        vel_n_m_s=held.vel_n_m_s if late else fresh.vel_n_m_s,
        vel_e_m_s=held.vel_e_m_s if late else fresh.vel_e_m_s,
        vel_d_m_s=held.vel_d_m_s if late else fresh.vel_d_m_s,
        qw=held.qw if late else fresh.qw,
        qx=held.qx if late else fresh.qx,
        qy=held.qy if late else fresh.qy,
        qz=held.qz if late else fresh.qz,
    )
    return GpsInsState(errors, fresh), reading
