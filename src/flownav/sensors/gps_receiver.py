"""A GPS receiver, 5 to 10 Hz: position and velocity of its antenna, and its stated accuracies.

Position error of each axis: slow Gauss-Markov (ionosphere, ephemeris) + fast Gauss-Markov (multipath) + white, each
advanced at the receiver's own period. Velocity: the receiver smooths it, a first-order lag, and adds Gauss-Markov and
white errors. (Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed., 9.4 and
14.3.1; Kaplan, Hegarty, Understanding GPS, chapter 7.) What it states as its accuracy is wrong by a share that is
drawn once a flight. Fixes fail in spells.

Positions and velocities NED; the antenna sits at a lever from the centre of gravity, body FRD, which the readings are
of: p + R l, v + R (w x l).
"""

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.core.frames import Rotation, to_earth
from flownav.sensors.geometry import lever_velocity
from flownav.sensors.processes import factor, gauss_markov, lagged, quantised, spell


class GpsReceiverParameters(NamedTuple):
    """Coefficients of one period. `decay` and `drive` are those of unit Gauss-Markov processes."""

    lever_x_m: float
    lever_y_m: float
    lever_z_m: float
    slow_decay: float
    slow_drive: float
    slow_sigma_m: float
    slow_sigma_down_m: float
    fast_decay: float
    fast_drive: float
    fast_sigma_m: float
    fast_sigma_down_m: float
    white_sigma_m: float
    white_sigma_down_m: float
    velocity_decay: float
    velocity_drive: float
    velocity_sigma_m_s: float
    velocity_sigma_down_m_s: float
    velocity_white_m_s: float
    velocity_white_down_m_s: float
    smoothing_keep: float
    smoothing_before: float
    smoothing_now: float
    position_quantum_m: float
    position_steps_per_m: float
    velocity_quantum_m_s: float
    velocity_steps_per_m_s: float
    horizontal_sigma_m: float  # of an axis, all position errors together: what it states, before the share
    vertical_sigma_m: float
    speed_sigma_m_s: float
    stated_spread: float  # share by which stated accuracies are wrong
    error_spread: float  # share by which flights differ in their position errors
    outage_begins_above: float
    outage_ends_above: float


class GpsReceiverTruth(NamedTuple):
    """The vehicle's centre of gravity: position and velocity NED, and body rates."""

    pos_n_m: float
    pos_e_m: float
    pos_d_m: float
    vel_n_m_s: float
    vel_e_m_s: float
    vel_d_m_s: float
    rate_p_rad_s: float
    rate_q_rad_s: float
    rate_r_rad_s: float


class GpsReceiverUnit(NamedTuple):
    """This flight's factors: of the position errors, and of each stated accuracy. As normals: one for each."""

    errors: float
    horizontal_stated: float
    vertical_stated: float
    speed_stated: float


class GpsReceiverStartNormals(NamedTuple):
    """Standard normals of a state's start: every process from its stationary distribution."""

    slow_n: float
    slow_e: float
    slow_d: float
    fast_n: float
    fast_e: float
    fast_d: float
    velocity_n: float
    velocity_e: float
    velocity_d: float
    spare: float


class GpsReceiverNormals(NamedTuple):
    """Standard normals of one period."""

    slow_n: float
    slow_e: float
    slow_d: float
    fast_n: float
    fast_e: float
    fast_d: float
    white_n: float
    white_e: float
    white_d: float
    velocity_n: float
    velocity_e: float
    velocity_d: float
    velocity_white_n: float
    velocity_white_e: float
    velocity_white_d: float
    outage: float


class GpsReceiverState(NamedTuple):
    """Error processes, the antenna's velocity one period ago, what the receiver makes of it, and 1 without a fix."""

    slow_n_m: float
    slow_e_m: float
    slow_d_m: float
    fast_n_m: float
    fast_e_m: float
    fast_d_m: float
    velocity_n_m_s: float
    velocity_e_m_s: float
    velocity_d_m_s: float
    before_n_m_s: float
    before_e_m_s: float
    before_d_m_s: float
    smoothed_n_m_s: float
    smoothed_e_m_s: float
    smoothed_d_m_s: float
    outage: float


class GpsReceiverReading(NamedTuple):
    """The antenna's position and velocity, stated variances of an axis, quality 0 and not arrived without a fix."""

    pos_n_m: float
    pos_e_m: float
    pos_d_m: float
    vel_n_m_s: float
    vel_e_m_s: float
    vel_d_m_s: float
    horizontal_variance_m2: float
    vertical_variance_m2: float
    speed_variance_m2_s2: float
    quality: float
    arrived: float


@equation
def draw_gps_receiver(n: GpsReceiverUnit, p: GpsReceiverParameters) -> GpsReceiverUnit:
    """How good reception is on this flight, and how wrong the receiver is about it."""
    return GpsReceiverUnit(
        factor(p.error_spread, n.errors),
        factor(p.stated_spread, n.horizontal_stated),
        factor(p.stated_spread, n.vertical_stated),
        factor(p.stated_spread, n.speed_stated),
    )


@equation
def _antenna_velocity(
    truth: GpsReceiverTruth, rotation: Rotation, p: GpsReceiverParameters
) -> tuple[float, float, float]:
    """v + R (w x l), NED."""
    north, east, down = lever_velocity(
        rotation, truth.rate_p_rad_s, truth.rate_q_rad_s, truth.rate_r_rad_s, p.lever_x_m, p.lever_y_m, p.lever_z_m
    )
    return truth.vel_n_m_s + north, truth.vel_e_m_s + east, truth.vel_d_m_s + down


@equation
def start_gps_receiver(
    truth: GpsReceiverTruth, rotation: Rotation, n: GpsReceiverStartNormals, p: GpsReceiverParameters
) -> GpsReceiverState:
    """Every process drawn from its stationary distribution, the smoothing settled on the velocity of this instant."""
    north, east, down = _antenna_velocity(truth, rotation, p)
    return GpsReceiverState(
        slow_n_m=p.slow_sigma_m * n.slow_n,
        slow_e_m=p.slow_sigma_m * n.slow_e,
        slow_d_m=p.slow_sigma_down_m * n.slow_d,
        fast_n_m=p.fast_sigma_m * n.fast_n,
        fast_e_m=p.fast_sigma_m * n.fast_e,
        fast_d_m=p.fast_sigma_down_m * n.fast_d,
        velocity_n_m_s=p.velocity_sigma_m_s * n.velocity_n,
        velocity_e_m_s=p.velocity_sigma_m_s * n.velocity_e,
        velocity_d_m_s=p.velocity_sigma_down_m_s * n.velocity_d,
        before_n_m_s=north,
        before_e_m_s=east,
        before_d_m_s=down,
        smoothed_n_m_s=north,
        smoothed_e_m_s=east,
        smoothed_d_m_s=down,
        outage=0.0,
    )


@equation
def _smoothed(output: float, before: float, now: float, p: GpsReceiverParameters) -> float:
    """The receiver's velocity filter, one period on."""
    return lagged(output, before, now, p.smoothing_keep, p.smoothing_before, p.smoothing_now)


@equation
def _next_state(
    s: GpsReceiverState, truth: GpsReceiverTruth, rotation: Rotation, n: GpsReceiverNormals, p: GpsReceiverParameters
) -> GpsReceiverState:
    """Every process one period on."""
    slow, slow_down = p.slow_drive * p.slow_sigma_m, p.slow_drive * p.slow_sigma_down_m
    fast, fast_down = p.fast_drive * p.fast_sigma_m, p.fast_drive * p.fast_sigma_down_m
    velocity, velocity_down = p.velocity_drive * p.velocity_sigma_m_s, p.velocity_drive * p.velocity_sigma_down_m_s
    north, east, down = _antenna_velocity(truth, rotation, p)
    return GpsReceiverState(
        slow_n_m=gauss_markov(s.slow_n_m, p.slow_decay, slow, n.slow_n),
        slow_e_m=gauss_markov(s.slow_e_m, p.slow_decay, slow, n.slow_e),
        slow_d_m=gauss_markov(s.slow_d_m, p.slow_decay, slow_down, n.slow_d),
        fast_n_m=gauss_markov(s.fast_n_m, p.fast_decay, fast, n.fast_n),
        fast_e_m=gauss_markov(s.fast_e_m, p.fast_decay, fast, n.fast_e),
        fast_d_m=gauss_markov(s.fast_d_m, p.fast_decay, fast_down, n.fast_d),
        velocity_n_m_s=gauss_markov(s.velocity_n_m_s, p.velocity_decay, velocity, n.velocity_n),
        velocity_e_m_s=gauss_markov(s.velocity_e_m_s, p.velocity_decay, velocity, n.velocity_e),
        velocity_d_m_s=gauss_markov(s.velocity_d_m_s, p.velocity_decay, velocity_down, n.velocity_d),
        before_n_m_s=north,
        before_e_m_s=east,
        before_d_m_s=down,
        smoothed_n_m_s=_smoothed(s.smoothed_n_m_s, s.before_n_m_s, north, p),
        smoothed_e_m_s=_smoothed(s.smoothed_e_m_s, s.before_e_m_s, east, p),
        smoothed_d_m_s=_smoothed(s.smoothed_d_m_s, s.before_d_m_s, down, p),
        outage=spell(s.outage, n.outage, p.outage_begins_above, p.outage_ends_above),
    )


@equation
def step_gps_receiver(
    state: GpsReceiverState,
    unit: GpsReceiverUnit,
    truth: GpsReceiverTruth,
    rotation: Rotation,
    n: GpsReceiverNormals,
    p: GpsReceiverParameters,
) -> tuple[GpsReceiverState, GpsReceiverReading]:
    """The fix of this instant (it arrives `latency_s` later), one period after the last."""
    s = _next_state(state, truth, rotation, n, p)
    lever_n, lever_e, lever_d = to_earth(rotation, p.lever_x_m, p.lever_y_m, p.lever_z_m)
    error_n = unit.errors * (s.slow_n_m + s.fast_n_m + p.white_sigma_m * n.white_n)
    error_e = unit.errors * (s.slow_e_m + s.fast_e_m + p.white_sigma_m * n.white_e)
    error_d = unit.errors * (s.slow_d_m + s.fast_d_m + p.white_sigma_down_m * n.white_d)
    vel_n = s.smoothed_n_m_s + (s.velocity_n_m_s + p.velocity_white_m_s * n.velocity_white_n)
    vel_e = s.smoothed_e_m_s + (s.velocity_e_m_s + p.velocity_white_m_s * n.velocity_white_e)
    vel_d = s.smoothed_d_m_s + (s.velocity_d_m_s + p.velocity_white_down_m_s * n.velocity_white_d)
    horizontal = unit.horizontal_stated * p.horizontal_sigma_m
    vertical = unit.vertical_stated * p.vertical_sigma_m
    speed = unit.speed_stated * p.speed_sigma_m_s
    return s, GpsReceiverReading(
        quantised(truth.pos_n_m + lever_n + error_n, p.position_quantum_m, p.position_steps_per_m),
        quantised(truth.pos_e_m + lever_e + error_e, p.position_quantum_m, p.position_steps_per_m),
        quantised(truth.pos_d_m + lever_d + error_d, p.position_quantum_m, p.position_steps_per_m),
        quantised(vel_n, p.velocity_quantum_m_s, p.velocity_steps_per_m_s),
        quantised(vel_e, p.velocity_quantum_m_s, p.velocity_steps_per_m_s),
        quantised(vel_d, p.velocity_quantum_m_s, p.velocity_steps_per_m_s),
        horizontal * horizontal,
        vertical * vertical,
        speed * speed,
        0.0 if s.outage > 0.5 else 255.0,
        0.0 if s.outage > 0.5 else 1.0,
    )
