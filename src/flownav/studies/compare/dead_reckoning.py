"""The least that a flow sensor can do: flow times range, turned by an attitude, summed from the first reading on.

No filter, no model of an error, nothing learnt. Whoever does worse has thrown information away.
"""

from __future__ import annotations

import numpy as np

from flownav.core.frames import heading_from_quaternion, rotation_from_quaternion, to_earth, velocity_from_flow
from flownav.core.measurement import Array, Sensor, Stream
from flownav.logs.frames import attitude_at
from flownav.scoring.drift import Motion
from flownav.studies.compare.tracks import Track

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
