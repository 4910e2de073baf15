"""The line that a navigator must hold: flow times range, turned by the raw gyro's heading. Nothing else is clever here.

No filter, no accelerometer, no model of an error. What the vehicle's turning moves in the picture is taken off by the
mean of the raw gyro between two readings. Of a log that begins with a second of rest or more, the gyro's mean there is
taken off first, as any autopilot does when it boots.
"""

from __future__ import annotations

import numpy as np

from flownav.scoring.reference import Motion
from made.flight import Array, Table

WINDOW_S, LEAST_REST_S = 0.2, 1.0
QUIET_RAD_S, QUIET_M_S2 = 0.012, 0.2  # standard deviations within a window: motors off, nobody holds it
LONGEST_HOLD_S = 1.0  # a velocity is held no longer than this over readings of no data


def reckoned(tables: dict[str, Table]) -> Motion:
    """The path and the heading from the first reading on; a row a flow reading that has data."""
    at_s, turning = _gyro(tables["imu"])
    turned = np.vstack([np.zeros(3), np.cumsum(0.5 * (turning[1:] + turning[:-1]) * np.diff(at_s)[:, None], axis=0)])
    heading = turned[:, 2]
    seen = tables.get("flow", tables.get("px4flow", {}))
    t_s, good = seen["t_s"], seen["quality"] > 0.0
    if not good.any():
        return Motion(at_s, np.zeros((len(at_s), 3)), at_s, heading)
    if "flow" in tables:
        upto = np.column_stack([np.interp(t_s, at_s, turned[:, axis]) for axis in range(2)])
        interval = np.diff(t_s, prepend=2.0 * t_s[0] - t_s[1])
        rate = np.diff(upto, axis=0, prepend=upto[:1]) / interval[:, None]
        valid = tables["range"]["valid"] > 0.0
        metres = np.interp(t_s, tables["range"]["t_s"][valid], tables["range"]["range_m"][valid])
        forward = (seen["flow_y_rad_s"] - rate[:, 1]) * metres
        right = -(seen["flow_x_rad_s"] - rate[:, 0]) * metres
    else:
        forward, right = seen["flow_comp_m_x_m_s"], seen["flow_comp_m_y_m_s"]
        metres = seen["ground_distance_m"]
    t_s, forward, right, metres = (column[good] for column in (t_s, forward, right, metres))
    held_s = np.diff(t_s, prepend=t_s[0])
    held_s = np.where(held_s > LONGEST_HOLD_S, np.median(held_s), held_s)
    yaw = np.interp(t_s - 0.5 * held_s, at_s, heading)
    north = np.cumsum((np.cos(yaw) * forward - np.sin(yaw) * right) * held_s)
    east = np.cumsum((np.sin(yaw) * forward + np.cos(yaw) * right) * held_s)
    return Motion(t_s, np.column_stack([north, east, -metres]), at_s, heading)


def _gyro(imu: Table) -> tuple[Array, Array]:
    """Instants (n,) and rates (n, 3) [rad/s], the mean of a rest at first taken off."""
    rates = np.column_stack([imu[f"gyro_{axis}_rad_s"] for axis in "xyz"])
    forces = np.column_stack([imu[f"accel_{axis}_m_s2"] for axis in "xyz"])
    rest = rest_of(imu["t_s"], rates, forces)
    return imu["t_s"], rates - (rates[:rest].mean(axis=0) if rest else 0.0)


def rest_of(t_s: Array, rates: Array, forces: Array) -> int:
    """How many readings at first are at rest, by windows; 0 where that is less than LEAST_REST_S."""
    each = max(round(WINDOW_S / float(np.median(np.diff(t_s)))), 5)
    count = 0
    while count + each <= len(t_s):
        window = slice(count, count + each)
        if (rates[window].std(axis=0) > QUIET_RAD_S).any() or (forces[window].std(axis=0) > QUIET_M_S2).any():
            break
        count += each
    return count if count and t_s[count - 1] - t_s[0] >= LEAST_REST_S else 0
