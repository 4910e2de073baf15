"""Into the project's frames: axes forward-left-up, attitudes and mean rates at given instants, tables of states.

ROS, Crazyflie, Betaflight and INAV have axes forward-left-up. A vector changes the signs of y and z. A rotation of body
FLU to an earth with z up becomes one of body FRD to NED: from east-north-up both sides are turned, from north-west-up
(a heading counted from x) both are half-turned about x. REP 103 (https://www.ros.org/reps/rep-0103.html) has ROS's.
"""

import numpy as np

from flownav.core.frames import quaternion_product, rotation_from_quaternion, to_body
from flownav.core.measurement import Array, Stream
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Table

ROOT_HALF = float(np.sqrt(0.5))
NED_FROM_ENU = (0.0, ROOT_HALF, ROOT_HALF, 0.0)
FLU_FROM_FRD = (0.0, 1.0, 0.0, 0.0)


def frd(vector: Array) -> Array:
    """Vectors (n, 3) of body FLU in body FRD; of north-west-up in NED likewise."""
    return np.asarray(vector * (1.0, -1.0, -1.0))


def ned(vector: Array) -> Array:
    """Vectors (n, 3) of east-north-up in north-east-down."""
    return np.asarray(vector[:, [1, 0, 2]] * (1.0, 1.0, -1.0))


def ned_from_frd(wxyz: Array) -> Array:
    """Quaternions (n, 4) of body FLU to ENU, as those of body FRD to NED."""
    left = quaternion_product(NED_FROM_ENU, tuple(wxyz.T))
    return np.column_stack(quaternion_product(left, FLU_FROM_FRD))


def ned_from_frd_of_nwu(wxyz: Array) -> Array:
    """Quaternions (n, 4) of body FLU to north-west-up, as those of body FRD to NED."""
    return np.asarray(wxyz * (1.0, 1.0, -1.0, -1.0))


# -- attitudes and rates ------------------------------------------------------------------------------------
def mean_over(t_s: Array, value: Array, start_s: Array, end_s: Array) -> Array:
    """Mean of sampled columns over intervals, linear between the samples; value (n, k) -> (m, k).

    Intervals have a length above 0; outside the samples the nearest one holds.
    """
    step_s, lasts_s = np.diff(t_s), end_s - start_s
    outside = [(np.minimum(at - t_s[0], 0.0), np.maximum(at - t_s[-1], 0.0)) for at in (start_s, end_s)]
    means = np.empty((len(start_s), value.shape[1]))
    for k in range(value.shape[1]):
        column = np.ascontiguousarray(value[:, k])
        integral = np.zeros(len(t_s))
        np.cumsum(0.5 * (column[1:] + column[:-1]) * step_s, out=integral[1:])
        begun, ended = (
            np.interp(at, t_s, integral) + before * column[0] + after * column[-1]
            for at, (before, after) in zip((start_s, end_s), outside, strict=True)
        )
        means[:, k] = (ended - begun) / lasts_s
    return means


def attitude_at(attitude: Stream, instants_s: Array) -> Array:
    """Unit quaternions (m, 4) at given instants, linear between the logged ones, held outside them."""
    agree = np.where(np.sum(attitude.value[1:] * attitude.value[:-1], axis=1) < 0, -1.0, 1.0)
    continuous = attitude.value * np.concatenate([[1.0], np.cumprod(agree)])[:, None]
    blended = np.column_stack([np.interp(instants_s, attitude.t_s, column) for column in continuous.T])
    return np.asarray(blended / np.linalg.norm(blended, axis=1)[:, None])


def attitude_rates(attitude: Stream, start_s: Array, end_s: Array) -> Array:
    """Mean body rates (m, 3) [rad/s] that turn the attitude at start into that at end: free of gyro bias.

    The rotation from start to end is conj(q0) q1; its vector part is half the turn for the small turns between.
    """
    w0, x0, y0, z0 = attitude_at(attitude, start_s).T
    w1, x1, y1, z1 = attitude_at(attitude, end_s).T
    scalar = w0 * w1 + x0 * x1 + y0 * y1 + z0 * z1
    vector = np.column_stack([
        w0 * x1 - x0 * w1 - y0 * z1 + z0 * y1,
        w0 * y1 + x0 * z1 - y0 * w1 - z0 * x1,
        w0 * z1 - x0 * y1 + y0 * x1 - z0 * w1,
    ])  # fmt: skip
    sine = np.linalg.norm(vector, axis=1)
    half_angle = np.arctan2(sine, np.abs(scalar))
    stretch = np.where(sine > 1e-12, half_angle / np.maximum(sine, 1e-12), 1.0) * np.where(scalar < 0, -1.0, 1.0)
    return np.asarray(2.0 * vector * stretch[:, None] / (end_s - start_s)[:, None])


# -- states -------------------------------------------------------------------------------------------------
def state_table(t_s: Array, position_ned_m: Array, velocity_ned_m_s: Array, quaternion: Array | None) -> Table:
    """Position, and where the attitude (n, 4), body FRD to earth NED, is known body velocity and attitude."""
    table: Table = {"t_s": t_s, **dict(zip(POSITION_NED, position_ned_m.T, strict=True))}
    if quaternion is None:
        return table
    body = np.column_stack(to_body(rotation_from_quaternion(*quaternion.T), *velocity_ned_m_s.T))
    table |= dict(zip(VELOCITY_BODY, body.T, strict=True))
    return table | dict(zip(QUATERNION, quaternion.T, strict=True))


def in_order(table: Table) -> Table:
    """The rows in the order of their times; ties keep theirs."""
    order = np.argsort(table["t_s"], kind="stable")
    return {name: column[order] for name, column in table.items()}
