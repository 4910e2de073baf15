"""What an estimator or a simulator says of the vehicle's state, as the Record's tables name it."""

from __future__ import annotations

import numpy as np

from flownav.core.frames import rotation_from_quaternion, to_body
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Table


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
