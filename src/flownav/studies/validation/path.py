"""A recorded flight's path, and how a multirotor moves that flies it: attitude, rates and specific force.

The path is the smoothed estimate of the navigator on the log, height over the ground that its range sensor saw,
without what is faster than the path's bandwidth. A multirotor has no force but its thrust, along body -z, and the
drag of its rotors, which grows with the airspeed (Martin, Salaun, The true role of accelerometer feedback in
quadrotor control, ICRA 2010). Acceleration and airspeed therefore give the direction of body z, the heading is the
recorded one, and the rest follows by kinematics:

    z_b = -(a - g + k (v - v_wind)) / |..|,    f = R' (a - g)

NED earth, ground at D = 0; body FRD; time is the log's.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from flownav.core.errors import InputError
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import Array, Sensor
from flownav.logs.log import Log
from flownav.navigation.rows import EstimateRow
from flownav.navigation.tables import states_table
from flownav.replays.session import Replay
from flownav.studies.validation.drawn import AssumedVehicle

GRID_HZ = 50.0
KNOT_EVERY = 5  # of the grid: the path's spline has 10 knots a second
SETTLED_SIGMA_M = 0.1  # the ground is not yet known where its stated deviation is still that of the start
LEAST_HEIGHT_M = 0.1  # of the lens, standing
LIFTED_M = 0.5  # over the standing height, at which the vehicle leans on the wind in full
MOST_DRAG_1_S = 2.0
LEAST_FLIGHT_S = 30.0
DOWN, SCALAR_LAST = 2, [1, 2, 3, 0]
GRAVITY_NED = np.array([0.0, 0.0, GRAVITY_M_S2])


class Lean(NamedTuple):
    """Rotor drag over mass [1/s], and the flight's mean wind, towards north and east [m/s]."""

    drag_1_s: float
    wind_n_m_s: float
    wind_e_m_s: float


class FlownPath(NamedTuple):
    """Position NED [m] and heading [rad] as splines of time, how the vehicle leans, and the span [s]."""

    position: BSpline
    heading: BSpline
    lean: Lean
    standing_m: float
    span_s: tuple[float, float]

    def inside(self, t_s: Array) -> Array:
        """Times held within the span."""
        return np.asarray(np.clip(t_s, *self.span_s))

    def position_m(self, t_s: Array) -> Array:
        """(n, 3) NED."""
        return np.asarray(self.position(self.inside(t_s)))

    def velocity_m_s(self, t_s: Array) -> Array:
        """(n, 3) NED."""
        return np.asarray(self.position(self.inside(t_s), 1))

    def attitude(self, t_s: Array) -> Rotation:
        """Body to earth at each time."""
        t_s = self.inside(t_s)
        heading = np.asarray(self.heading(t_s))
        air = self.velocity_m_s(t_s) - np.array([self.lean.wind_n_m_s, self.lean.wind_e_m_s, 0.0])
        force = np.asarray(self.position(t_s, 2)) - GRAVITY_NED
        force = force + self.lean.drag_1_s * self._lifted(t_s)[:, None] * air
        return upright(force, heading)

    def turn_rad_s(self, t_s: Array, over_s: float) -> Array:
        """Mean rates over the `over_s` before each time, (n, 3) body FRD."""
        turn = self.attitude(t_s - over_s).inv() * self.attitude(t_s)
        return np.asarray(turn.as_rotvec()) / over_s

    def force_m_s2(self, t_s: Array, over_s: float) -> Array:
        """Mean specific force over the `over_s` before each time, (n, 3) body FRD, in the attitude of the middle."""
        change = self.velocity_m_s(t_s) - self.velocity_m_s(t_s - over_s)
        return np.asarray(self.attitude(t_s - 0.5 * over_s).inv().apply(change / over_s - GRAVITY_NED))

    def body_velocity_m_s(self, t_s: Array) -> Array:
        """(n, 3) body FRD."""
        return np.asarray(self.attitude(t_s).inv().apply(self.velocity_m_s(t_s)))

    def _lifted(self, t_s: Array) -> Array:
        """0 on the ground to 1 in flight: a standing vehicle does not lean."""
        share = np.clip((-self.position_m(t_s)[:, 2] - self.standing_m) / LIFTED_M, 0.0, 1.0)
        return np.asarray(share * share * (3.0 - 2.0 * share))


def upright(force: Array, heading_rad: Array) -> Rotation:
    """Attitudes whose body z is against `force` (n, 3) NED and whose x has the heading (n,)."""
    down = -force / np.linalg.norm(force, axis=1, keepdims=True)
    beside = np.column_stack([-np.sin(heading_rad), np.cos(heading_rad), np.zeros_like(heading_rad)])
    ahead = np.cross(beside, down)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([ahead, np.cross(down, ahead), down], axis=2))


def path_of(flown: Replay, vehicle: AssumedVehicle) -> FlownPath:
    """The path of a smoothed replay. InputError where it is too short to be flown again."""
    if flown.smoothed is None:
        raise ValueError("a smoothed replay is needed")
    rows = flown.smoothed[np.concatenate([np.diff(EstimateRow.of(flown.smoothed).t_s) > 0.0, [True]])]
    row = EstimateRow.of(rows)
    start, end = float(row.t_s[0]), float(row.t_s[-1])
    if end - start < LEAST_FLIGHT_S:
        raise InputError(
            f"{flown.log.path}: {end - start:.0f} s are too short; {LEAST_FLIGHT_S:g} s of flight are needed"
        )
    ned = row.pos_ned_m.copy()
    ned[:, DOWN] = np.minimum(ned[:, DOWN] - ground_of(rows), -LEAST_HEIGHT_M)
    heading = np.unwrap(rotation_of(row).as_euler("ZYX")[:, 0])
    grid_s = np.arange(start, end, 1.0 / GRID_HZ)
    sections = butter(4, vehicle.path_bandwidth_hz, fs=GRID_HZ, output="sos")
    on_grid = np.column_stack([np.interp(grid_s, row.t_s, column) for column in (*ned.T, heading)])
    smooth = sosfiltfilt(sections, on_grid, axis=0)[::KNOT_EVERY]
    knots_s = grid_s[::KNOT_EVERY]
    standing_m = float(-np.max(smooth[:, 2]))
    return FlownPath(
        make_interp_spline(knots_s, smooth[:, :3], k=5),
        make_interp_spline(knots_s, smooth[:, 3], k=5),
        lean_of(flown.log, rows),
        standing_m,
        (float(knots_s[0]), float(knots_s[-1])),
    )


def rotation_of(row: EstimateRow[Array]) -> Rotation:
    """The attitudes, body to earth."""
    return Rotation.from_quat(row.quaternion[:, SCALAR_LAST])


def ground_of(rows: Array) -> Array:
    """The ground's depth in the filter's frame [m], (n,); before it is found, where it was first found."""
    states = states_table(rows)
    ground = np.asarray(states["ground_d_m"], float)
    known = np.flatnonzero(np.asarray(states["std_ground_d_m"], float) > SETTLED_SIGMA_M)
    if not len(known):
        return np.full_like(ground, np.max(EstimateRow.of(rows).pos_ned_m[:, DOWN]) + LEAST_HEIGHT_M)
    return np.asarray(np.where(np.arange(len(ground)) < known[0], ground[known[0]], ground))


def lean_of(log: Log, rows: Array) -> Lean:
    """Rotor drag and mean wind that the log's accelerometer shows: f_xy = -k (v - wind)_xy + bias, least squares.

    No IMU, or one that shows no drag: none.
    """
    imu = log.streams.get(Sensor.IMU)
    if imu is None:
        return Lean(0.0, 0.0, 0.0)
    instants_s = EstimateRow.of(rows).t_s
    t_s = np.arange(instants_s[0], instants_s[-1], 0.2)
    row = EstimateRow.of(rows[np.clip(np.searchsorted(instants_s, t_s), 0, len(rows) - 1)])
    attitude = rotation_of(row)
    velocity = attitude.inv().apply(row.vel_ned_m_s)
    north, east = (attitude.inv().apply(axis) for axis in np.eye(3)[:2])
    summed = np.vstack([np.zeros(3), np.cumsum(imu.value[:, 3:6], axis=0)])
    first, last = np.searchsorted(imu.t_s, t_s - 0.1), np.searchsorted(imu.t_s, t_s + 0.1)
    some = last > first
    force = (summed[last[some]] - summed[first[some]]) / (last - first)[some, None]
    ones, none = np.ones(int(some.sum())), np.zeros(int(some.sum()))
    columns = [
        np.column_stack([-velocity[some, axis], north[some, axis], east[some, axis], *bias])
        for axis, bias in ((0, (ones, none)), (1, (none, ones)))
    ]
    found, *_ = np.linalg.lstsq(np.vstack(columns), force[:, :2].T.reshape(-1), rcond=None)
    drag = float(found[0])
    if not 0.0 < drag < MOST_DRAG_1_S:
        return Lean(0.0, 0.0, 0.0)
    return Lean(drag, float(found[1]) / drag, float(found[2]) / drag)
