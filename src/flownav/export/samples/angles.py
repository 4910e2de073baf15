"""A table's attitudes as Z-Y-X Euler angles, and its velocities in the earth frame."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from flownav.core.measurement import Array
from flownav.core.record import QUATERNION, VELOCITY_BODY, Table


def angles_of(table: Table) -> Array:
    """Roll, pitch, yaw of a table's quaternions, (n, 3) [rad]."""
    return np.asarray(_rotations(table).as_euler("ZYX")[:, ::-1])


def velocities_ned(table: Table) -> Array:
    """A table's velocities, kept in body axes, as north, east, down (n, 3) [m/s]."""
    body = np.column_stack([np.asarray(table[name], float) for name in VELOCITY_BODY])
    return np.asarray(_rotations(table).apply(body))


def _rotations(table: Table) -> Rotation:
    """Body to earth."""
    w, x, y, z = (np.asarray(table[name], float) for name in QUATERNION)
    return Rotation.from_quat(np.column_stack([x, y, z, w]))
