"""What a DataFlash log says besides its sensors: the autopilot's own estimate, a simulator's truth, parameters."""

from __future__ import annotations

import numpy as np

from flownav.core.frames import quaternion_from_euler
from flownav.core.measurement import Array
from flownav.core.record import Table
from flownav.logs.csv_table import CsvTable
from flownav.logs.dataflash.columns import DataFlash, text
from flownav.logs.dataflash.rows import Field, check_rows, held_at, message_rows
from flownav.logs.fixes import Origin, local_ned
from flownav.logs.states import state_table

FARTHEST_M, FASTEST_M_S = 1e5, 300.0
EKF_ORIGIN = 0  # ORGN's Type: the filter's origin; 1 is home
FILTERS = {3: ("EKF3", "XKF"), 2: ("EKF2", "NKF")}  # by AHRS_EKF_TYPE

GEODETIC = (Field("Lat", -90, 90), Field("Lng", -180, 180), Field("Alt", -1000, 20000))
POSITION_VELOCITY = (
    *(Field(f"P{axis}", -FARTHEST_M, FARTHEST_M) for axis in "NED"),
    *(Field(f"V{axis}", -FASTEST_M_S, FASTEST_M_S) for axis in "NED"),
)
ESTIMATE = (
    *POSITION_VELOCITY,
    *(Field("Roll", -181, 181), Field("Pitch", -91, 91), Field("Yaw", -361, 361)),
    Field("C", 0, 255, required=False),
)
TRUE_STATE = (*GEODETIC, *(Field(f"Q{i}", -1.01, 1.01) for i in (1, 2, 3, 4)))


def parameters(log: DataFlash) -> dict[str, float]:
    """The vehicle's parameters by name, as last written."""
    known = log.formats.get("PARM")
    if known is None or not {"Name", "Value"} <= set(known.labels) or known.code("Name") not in "nNZ":
        return {}
    if known.code("Value") in "anNZ":
        return {}
    table = log.table("PARM", ["Name", "Value"])
    return dict(zip(text(table["Name"]), map(float, table["Value"]), strict=True))


def filter_origins(log: DataFlash) -> CsvTable | None:
    """Where the autopilot's local frame had its origin, and from when."""
    fields = (*GEODETIC, Field("Type", EKF_ORIGIN, EKF_ORIGIN))
    table = message_rows(log, "ORGN", fields)
    if table is None:
        return None
    check_rows(table, fields)
    return table if len(table.t_s) else None


def estimate_rows(log: DataFlash, settings: dict[str, float]) -> tuple[str, CsvTable] | None:
    """The filter that flew, by name, and the rows of its primary core; None where it was not logged."""
    preferred = int(settings.get("AHRS_EKF_TYPE", 3)) if np.isfinite(settings.get("AHRS_EKF_TYPE", 3)) else 3
    for kind in sorted(FILTERS, key=lambda kind: kind != preferred):
        name, prefix = FILTERS[kind]
        table = message_rows(log, f"{prefix}1", ESTIMATE)
        if table is None:
            continue
        if "C" in table.columns:
            table.keep(table.columns["C"] == _primary(log, f"{prefix}4", table), "another_core")
        check_rows(table, ESTIMATE)
        if len(table.t_s):
            return name, table
    return None


def _primary(log: DataFlash, name: str, table: CsvTable) -> Array:
    """The core that flew at each row's time; the lowest one where the log does not say."""
    fields = (Field("PI", 0, 8),)
    said = message_rows(log, name, fields)
    if said is not None:
        check_rows(said, fields)
    if said is None or not len(said.t_s):
        return np.full(len(table.t_s), table.columns["C"].min(initial=np.inf))
    return held_at(table.t_s, said.t_s, said.columns["PI"])


def estimate(table: CsvTable, origins: CsvTable | None, origin: Origin | None) -> Table:
    """The estimate about the log's origin; about the filter's own where either is unknown."""
    position = table.matrix("PN", "PE", "PD")
    if origins is not None and origin is not None:
        shift = local_ned(origins.matrix("Lat", "Lng", "Alt"), origin)
        position = position + held_at(table.t_s, origins.t_s, shift)
    angles = np.radians(table.matrix("Roll", "Pitch", "Yaw"))
    quaternion = np.column_stack(quaternion_from_euler(*angles.T))
    return state_table(table.t_s, position, table.matrix("VN", "VE", "VD"), quaternion)


def true_rows(log: DataFlash) -> tuple[CsvTable, CsvTable | None] | None:
    """A simulator's SIM rows (geodetic position and attitude) and SIM2 rows (position and velocity)."""
    tables = []
    for name, fields in (("SIM", TRUE_STATE), ("SIM2", POSITION_VELOCITY)):
        table = message_rows(log, name, fields)
        if table is not None:
            check_rows(table, fields)
        tables.append(table if table is not None and len(table.t_s) else None)
    return (tables[0], tables[1]) if tables[0] is not None else None


def truth(state: CsvTable, motion: CsvTable | None, origin: Origin) -> Table:
    """The truth at the times of SIM, about an origin.

    SIM2's position is finer than SIM's 1e-7 degrees but has the simulator's own origin: its median distance from
    SIM's tells where that is.
    """
    position = local_ned(state.matrix("Lat", "Lng", "Alt"), origin)
    velocity = np.full_like(position, np.nan)
    if motion is not None:
        both = motion.matrix("PN", "PE", "PD", "VN", "VE", "VD")
        inside = (state.t_s >= motion.t_s[0]) & (state.t_s <= motion.t_s[-1])
        moved = np.column_stack([np.interp(state.t_s, motion.t_s, column) for column in both.T])
        velocity[inside] = moved[inside, 3:]
        if inside.any():
            shift = np.median(position[inside] - moved[inside, :3], axis=0)
            position[inside] = moved[inside, :3] + shift
    quaternion = state.matrix("Q1", "Q2", "Q3", "Q4")
    size = np.linalg.norm(quaternion, axis=1)
    return state_table(state.t_s, position, velocity, quaternion / np.where(size > 0, size, np.nan)[:, None])


def stated_limits(settings: dict[str, float], rangefinder: int) -> dict[str, tuple[float, float]]:
    """What the vehicle was told of its rangefinder (counted from 0): centimetres, metres since ArduPilot 4.7."""
    prefix = f"RNGFND{'123456789A'[rangefinder] if 0 <= rangefinder < 10 else ''}_"
    for low, high, metre in (("MIN", "MAX", 1.0), ("MIN_CM", "MAX_CM", 0.01)):
        least, most = settings.get(prefix + low, np.nan) * metre, settings.get(prefix + high, np.nan) * metre
        if 0 <= least < most < np.inf:
            return {"range_m": (least, most)}
    return {}
