"""The track of any estimator, and one measure for all: the same reference, instants and way of alignment.

No filter, no model of an error, nothing learnt. An estimator that does worse has thrown information away.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import heading_from_quaternion, rotation_from_quaternion, to_earth, velocity_from_flow
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, Table
from flownav.logs.log import Log, attitude_at
from flownav.navigation.rows import EstimateRow
from flownav.navigation.tables import estimate_table
from flownav.scoring.path import columns_of, motion_of, velocity_ned
from flownav.scoring.reference import Alignment, Motion, align, velocity_of

LONGEST_GAP_S = 0.5  # over more, an estimate between two rows is nobody's


class Track(NamedTuple):
    """An estimator's path with its headings, and its velocity north, east [m/s] (n, 2) at the same instants."""

    motion: Motion
    velocity_ne: Array

    @property
    def t_s(self) -> Array:
        """The instants (n,)."""
        return self.motion.t_s


def of_estimate(rows: Array) -> Track:
    """The track of a replay: rows of a tape's estimate."""
    return Track(motion_of(estimate_table(rows)), EstimateRow.of(rows).vel_ned_m_s[:, :2])


def of_table(table: Table) -> Track:
    """The track of an autopilot's estimate; its velocity is NaN where it states none, or no attitude to turn it by."""
    motion, velocity = motion_of(table), velocity_ned(table)
    return Track(motion, np.full((len(motion.t_s), 2), np.nan) if velocity is None else velocity[:, :2])


def says(track: Track, instants_s: Array) -> NDArray[np.bool_]:
    """At which instants (m,) the estimator has a row, or one on either side no more than LONGEST_GAP_S apart."""
    t_s = track.t_s
    if not len(t_s):
        return np.zeros(len(instants_s), bool)
    after = np.clip(np.searchsorted(t_s, instants_s), 1, max(len(t_s) - 1, 1))
    inside = np.asarray((instants_s >= t_s[0]) & (instants_s <= t_s[-1]))
    if len(t_s) < 2:
        return inside
    return np.asarray(inside & (t_s[after] - t_s[after - 1] <= LONGEST_GAP_S))


def at(track: Track, values: Array, instants_s: Array) -> Array:
    """Columns of a track (n, k) at other instants (m,), linear between its rows."""
    return np.column_stack([np.interp(instants_s, track.t_s, column) for column in values.T])


# -- one measure for all -----------------------------------------------------------------------------------------
LEAST_INSTANTS = 10

Flags = NDArray[np.bool_]
Window = tuple[float, float]


class Reference(NamedTuple):
    """The reference of the estimates: "truth", whose frame may be turned, or "gps", with its delay taken off.

    position (n, 3) and velocity (m, 2) north, east, down, each at its own instants.
    """

    against: str
    position_t_s: Array
    position: Array
    velocity_t_s: Array
    velocity: Array


def reference_of(log: Log, gps_delay_s: float) -> Reference | None:
    """The best that the log has; None without any."""
    if log.truth is not None:
        t_s = np.asarray(log.truth["t_s"], float)
        position = columns_of(log.truth, POSITION_NED)
        known = np.isfinite(position).all(axis=1)
        t_s, position = t_s[known], position[known]
        if len(t_s) >= LEAST_INSTANTS:
            return Reference("truth", t_s, position, t_s, velocity_of(t_s, position)[:, :2])
    if Sensor.GPS_POSITION not in log.streams:
        return None
    fixes, speeds = log.streams[Sensor.GPS_POSITION], log.streams.get(Sensor.GPS_VELOCITY)
    position_t_s, moving = fixes.t_s - gps_delay_s, np.zeros((0, 2))
    velocity_t_s = np.zeros(0)
    if speeds is not None:
        known = np.isfinite(speeds.value[:, :2]).all(axis=1)
        velocity_t_s, moving = speeds.t_s[known] - gps_delay_s, speeds.value[known, :2]
    return Reference("gps", position_t_s, fixes.value, velocity_t_s, moving)


def shared_by(tracks: Sequence[Track], instants_s: Array) -> tuple[Flags, list[bool]]:
    """Instants (n,) at which the estimators have rows, and which estimators that leaves in.

    The first always is; another is left out where fewer than LEAST_INSTANTS would be left with it.
    """
    shared: Flags = np.ones(len(instants_s), bool)
    kept = []
    for number, track in enumerate(tracks):
        with_it = np.asarray(shared & says(track, instants_s))
        stays = number == 0 or bool(np.count_nonzero(with_it) >= LEAST_INSTANTS)
        shared = with_it if stays else shared
        kept.append(stays)
    return shared, kept


def errors_of(
    track: Track, reference: Reference, places: Flags, speeds: Flags, window: Window | None = None
) -> dict[str, Any]:
    """Horizontal errors at the instants marked in places (n,) and speeds (m,), and in the window where one is given.

    The reference is laid on the track over these very instants: truth turned and shifted (least squares), GPS shifted.
    None each where fewer than LEAST_INSTANTS are left, or the track states no velocity.
    """
    if window is not None:
        places = places & _within(reference.position_t_s, window)
        speeds = speeds & _within(reference.velocity_t_s, window)
    t_s, position = reference.position_t_s[places], reference.position[places]
    if len(t_s) < LEAST_INSTANTS:
        return {"horizontal_rms_m": None, "velocity_rms_m_s": None, "samples": len(t_s)}
    ours = at(track, track.motion.position, t_s)
    placed = _laid_on(ours, position, reference.against)
    error = ours - placed.moved(position)
    moved = np.column_stack([reference.velocity[speeds], np.zeros(np.count_nonzero(speeds))])
    slip = at(track, track.velocity_ne, reference.velocity_t_s[speeds]) - placed.turned(moved)[:, :2]
    return {"horizontal_rms_m": _rms(error), "velocity_rms_m_s": _rms(slip), "samples": len(t_s)}


def _laid_on(ours: Array, reference: Array, against: str) -> Alignment:
    if against == "truth":
        return align(ours, reference)
    north, east, down = (ours - reference).mean(axis=0).tolist()
    return Alignment(0.0, (north, east, down))


def _within(t_s: Array, window: Window) -> Flags:
    return np.asarray((t_s >= window[0]) & (t_s <= window[1]))


def _rms(error: Array) -> float | None:
    """Root mean square of the horizontal length [the unit of error]; None of too few, or of what is not known."""
    squares = np.sum(error[:, :2] ** 2, axis=1)
    squares = squares[np.isfinite(squares)]
    return float(np.sqrt(np.mean(squares))) if len(squares) >= LEAST_INSTANTS else None


# -- the least that a flow sensor can do -------------------------------------------------------------------------
LONGEST_STEP_S = 1.0  # a longer pause of the flow counts as standing: nothing was seen to move
STALE_S = 1.0  # an angular rate further from any range than this has no height to be multiplied by
LEAST_UPRIGHT = 0.2  # cosine of the tilt beyond which the ground is not below


def dead_reckoned(flow: Stream, distance: Stream | None, attitude: Stream) -> Track | None:
    """The path from the local origin that the flow tells; None where it is angular and there is no range.

    flow: FLOW_RATE as replay prepares it (its gyro columns take the rotation off) or FLOW_VELOCITY; quality 0, what is
    no number, and an angular rate without a range within STALE_S are no motion. distance: RANGE, along the boresight.
    attitude: body to earth; its heading is the path's. The vehicle is taken to move level, at the height of its range.
    """
    known = _known(distance)
    if len(flow) < 2 or (known is None and flow.sensor == Sensor.FLOW_RATE):
        return None
    t_s = flow.t_s - flow.delay_s
    quaternion = attitude_at(_at_its_instants(attitude), t_s)
    rotation = rotation_from_quaternion(*quaternion.T)
    upright = np.maximum(rotation[8], LEAST_UPRIGHT)
    range_m = np.zeros(len(t_s)) if known is None else np.interp(t_s, *known)
    forward, right = _body_velocity(flow, range_m)
    sinking = -(rotation[6] * forward + rotation[7] * right) / upright
    moving = np.column_stack(to_earth(rotation, *np.array([forward, right, sinking])))[:, :2]
    seen = flow.quality > 0
    if known is not None and flow.sensor == Sensor.FLOW_RATE:
        seen &= _since(known[0], t_s) <= STALE_S
    velocity = np.where(seen[:, None], moving, 0.0)
    velocity = np.where(np.isfinite(velocity), velocity, 0.0)
    position = np.column_stack([_summed(t_s, velocity), -range_m * upright])
    w, x, y, z = quaternion.T
    return Track(Motion(t_s, position, t_s, np.asarray(heading_from_quaternion(w, x, y, z))), velocity)


def _known(distance: Stream | None) -> tuple[Array, Array] | None:
    """Instants and ranges [m] that are numbers; None without one."""
    if distance is None:
        return None
    good = np.isfinite(distance.value[:, 0]) & (distance.quality > 0)
    return (distance.t_s[good] - distance.delay_s, distance.value[good, 0]) if good.any() else None


def _since(readings_s: Array, t_s: Array) -> Array:
    """How far each instant (n,) is from the nearest reading [s]."""
    after = np.clip(np.searchsorted(readings_s, t_s), 1, max(len(readings_s) - 1, 1))
    last = len(readings_s) - 1
    return np.minimum(abs(readings_s[np.minimum(after, last)] - t_s), abs(t_s - readings_s[after - 1]))


def _at_its_instants(attitude: Stream) -> Stream:
    """The attitude at the times that it describes."""
    return Stream.of(Sensor.ATTITUDE, attitude.t_s - attitude.delay_s, attitude.value)


def _body_velocity(flow: Stream, range_m: Array) -> tuple[Array, Array]:
    """Forward and right [m/s]; PX4's convention: flow_x = w_x - v_y/r, flow_y = w_y + v_x/r."""
    if flow.sensor == Sensor.FLOW_VELOCITY:
        return flow.value[:, 0], flow.value[:, 1]
    flow_x, flow_y, gyro_x, gyro_y = flow.value[:, :4].T
    return velocity_from_flow(flow_x - gyro_x, flow_y - gyro_y, range_m)


def _summed(t_s: Array, velocity: Array) -> Array:
    """Positions (n, 2) from velocities, by trapezoids; none over a longer pause than LONGEST_STEP_S."""
    step = np.diff(t_s)
    step = np.where(step <= LONGEST_STEP_S, step, 0.0)
    moved = 0.5 * (velocity[1:] + velocity[:-1]) * step[:, None]
    return np.vstack([np.zeros(2), np.cumsum(moved, axis=0)])
