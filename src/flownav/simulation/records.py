"""Memory of the simulator in each lane beyond the states of vehicle, sensors and autopilot, as named records.

`layout` holds where they lie. Position and velocity over the ground are local NED, attitude is body to earth, and
`forward`, `right` and `below` (of velocities u, v, w) are body FRD.
"""

from typing import NamedTuple

from flownav.sensors.gps_ins import NavSolution


class RotorSpeed(NamedTuple):
    """Speed of a helicopter's main rotor."""

    speed_rad_s: float


class Loads(NamedTuple):
    """The vehicle's loads, for sensors and scores: thrust of the main rotor, or of all; load on the skids; power."""

    thrust_n: float
    contact_n: float
    power_w: float


class Before(NamedTuple):
    """Velocity and attitude at the end of the last inertial period."""

    vel_n_m_s: float
    vel_e_m_s: float
    vel_d_m_s: float
    qw: float
    qx: float
    qy: float
    qz: float


class FlowNormals(NamedTuple):
    """Standard normals of the paper's flow sensor and its sonar."""

    u: float
    v: float
    w: float
    range: float


class Measured(NamedTuple):
    """The measurement of the paper's filter."""

    pos_n_m: float
    pos_e_m: float
    pos_d_m: float
    vel_u_m_s: float
    vel_v_m_s: float
    vel_w_m_s: float


class Arrived(NamedTuple):
    """1 where a component of that measurement came."""

    pos_n: float
    pos_e: float
    pos_d: float
    vel_u: float
    vel_v: float
    vel_w: float


class PaperInput(NamedTuple):
    """The input of the paper's filter: perturbations of the blade angles from trim."""

    lon_rad: float
    lat_rad: float
    col_rad: float
    ped_rad: float


class PaperState(Measured):
    """The state of the paper's filter."""


class Spread(NamedTuple):
    """The variances that a filter states of position over the pad and body velocity."""

    pos_n_m2: float
    pos_e_m2: float
    pos_d_m2: float
    vel_u_m2_s2: float
    vel_v_m2_s2: float
    vel_w_m2_s2: float


class PaperVariance(Spread):
    """The diagonal of its covariance."""


class Felt(NamedTuple):
    """Readings of the IMU, body FRD: mean specific force over the epoch so far, the last, and the mean rates p and
    q.
    """

    mean_x_m_s2: float
    mean_y_m_s2: float
    mean_z_m_s2: float
    last_x_m_s2: float
    last_y_m_s2: float
    last_z_m_s2: float
    mean_roll_rad_s: float
    mean_pitch_rad_s: float


class Landed(NamedTuple):
    """State of the skid switch: 1 on the ground."""

    landed: float


class SeesFlow(NamedTuple):
    """1 where the last reading of the navigator's camera has data."""

    sees: float


class Exposed(NamedTuple):
    """Sums since the last flow: of the true rate, and of what the gyro read about x and y."""

    rate_p_rad_s: float
    rate_q_rad_s: float
    rate_r_rad_s: float
    gyro_x_rad_s: float
    gyro_y_rad_s: float


class Late(NamedTuple):
    """How much older than by its datasheet a sensor's readings are; 0 before the first epoch."""

    late_s: float


class HeldRange(NamedTuple):
    """The range before a fault."""

    range_m: float


class TruthThen(NavSolution):
    """The truth at a remembered instant."""


class InertialThen(NamedTuple):
    """A remembered inertial reading: body rate and specific force."""

    rate_x_rad_s: float
    rate_y_rad_s: float
    rate_z_rad_s: float
    force_x_m_s2: float
    force_y_m_s2: float
    force_z_m_s2: float


class PadPlace(NamedTuple):
    """Where the pad is in the navigator's frame, by the vehicle's knowledge."""

    north_m: float
    east_m: float
    down_m: float


class Estimated(NamedTuple):
    """Estimate of whichever filter flies: position over the pad, body velocity and attitude."""

    pos_n_m: float
    pos_e_m: float
    pos_d_m: float
    vel_u_m_s: float
    vel_v_m_s: float
    vel_w_m_s: float
    qw: float
    qx: float
    qy: float
    qz: float


class Nees(NamedTuple):
    """Its normalised error squared, of position and velocity NED; 0 where the filter states none."""

    nees: float


class HorizonError(Measured):
    """The navigator's position and body velocity at its horizon, less the truth then."""


class AttitudeError(NamedTuple):
    """The rotation from the true attitude to the one that the autopilot uses, earth axes."""

    w: float
    x: float
    y: float
    z: float


class Home(PadPlace):
    """Where the estimate puts the pad."""
