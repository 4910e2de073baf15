"""A ULog's content besides its sensors: PX4's modes, messages, set-points, battery, whether EKF2 took the flow."""

from collections.abc import Iterator

import numpy as np

from flownav.core.record import POSITION_NED, QUATERNION, Table
from flownav.logs.happened import CLIPPING, FUSES_FLOW, MODE, Happened, changes, in_time, messages, px4_mode
from flownav.logs.ulog_topics import Topics

ASKED = ("vehicle_local_position_setpoint", "vehicle_attitude_setpoint")
EVENT_TOPICS = (
    "vehicle_status",
    "estimator_status_flags",
    "estimator_status",
    "vehicle_imu_status",
    "battery_status",
    *ASKED,
)
FIELDS = (
    "nav_state",
    "cs_opt_flow",
    "control_mode_flags",
    "accel_clipping",
    "q_d",
    "voltage_v",
    "current_a",
    "remaining",
)
FLOW_BIT = 1 << 3  # of estimator_status.control_mode_flags (PX4-Autopilot, msg/EstimatorStatus.msg)
CLIPPING_S = 1.0


def happened(topics: Topics) -> tuple[Happened, ...]:
    """All events in the topics and the logged strings, in order of time."""
    texts = ((t_s - topics.start_s, text) for t_s, text in topics.messages)
    return in_time([*_states(topics), *messages(texts)])


def _states(topics: Topics) -> Iterator[Happened]:
    mode = topics.fullest("vehicle_status", needs=("nav_state",))
    if mode is not None:
        yield from changes(MODE, mode.t_s, mode.columns["nav_state"], px4_mode)
    flags = topics.fullest("estimator_status_flags", needs=("cs_opt_flow",))
    status = topics.fullest("estimator_status", needs=("control_mode_flags",))
    if flags is not None:
        yield from changes(FUSES_FLOW, flags.t_s, (flags.columns["cs_opt_flow"] > 0.0).astype(float))
    elif status is not None:
        bits = np.nan_to_num(status.columns["control_mode_flags"]).astype(np.int64)
        yield from changes(FUSES_FLOW, status.t_s, ((bits & FLOW_BIT) > 0).astype(float))
    clipped = topics.fullest("vehicle_imu_status", needs=[f"accel_clipping[{axis}]" for axis in range(3)])
    if clipped is not None:
        yield from changes(CLIPPING, clipped.t_s, clipped.vector("accel_clipping", 3).sum(axis=1), least_s=CLIPPING_S)


def setpoints(topics: Topics) -> tuple[Table, ...]:
    """PX4's set-points: position in its local frame, and attitude; a component that it does not control is NaN."""
    place, attitude = topics.fullest(ASKED[0], needs="xyz"), topics.fullest(ASKED[1], needs=["q_d[0]", "q_d[3]"])
    found = []
    if place is not None:
        found.append({"t_s": place.t_s, **dict(zip(POSITION_NED, map(place.column, "xyz"), strict=True))})
    if attitude is not None:
        found.append({"t_s": attitude.t_s, **dict(zip(QUATERNION, attitude.parts("q_d", 4), strict=True))})
    return tuple(found)


def battery(topics: Topics) -> Table | None:
    """The battery that was reported most often; None where none was, or none with a voltage."""
    rows = topics.fullest("battery_status", needs=("voltage_v",))
    if rows is None or not (rows.column("voltage_v") > 0.0).any():
        return None
    known = {}
    for name, here, scale in (("voltage_v", "voltage_v", 1.0), ("current_a", "current_a", 1.0),
                              ("remaining", "remaining_percent", 100.0)):  # fmt: skip
        if rows.has(name):
            values = rows.column(name)
            known[here] = np.where(values >= 0.0, scale * values, np.nan)  # -1: not known
    return {"t_s": rows.t_s, **known}
