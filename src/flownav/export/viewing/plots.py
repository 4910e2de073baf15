"""What a record says over time, in Rerun's words: errors with their bounds, velocity, innovations, events."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from flownav.core.record import Record
from flownav.export.errors import BOUND, ERROR, error_table
from flownav.export.trajectory import Trajectory
from flownav.export.viewing.scene import COLOURS, times

PLOTS = "/plots"
AXES = ("north_m", "east_m", "down_m")
SPEEDS = ("north_m_s", "east_m_s", "down_m_s")
Array = NDArray[np.float64]


def log_plots(stream: Any, record: Record, paths: list[Trajectory]) -> None:
    """Every series and the events; what a record lacks is left out."""
    _log_positions(stream, paths)
    _log_errors(stream, record, paths)
    _log_velocities(stream, paths)
    _log_innovations(stream, record)
    _log_events(stream, record)


def sensors_of(record: Record) -> list[str]:
    """Sensors with innovations, in the order of their names."""
    table = record.tables.get("innovation", {})
    return sorted(set(map(str, table["sensor"].tolist()))) if {"sensor", "innovation"} <= table.keys() else []


def _log_positions(stream: Any, paths: list[Trajectory]) -> None:
    for path in paths:
        for k, axis in enumerate(AXES):
            _series(stream, f"position/{axis}/{path.name}", path.t_s, path.position_m[:, k], path.name)


def _log_errors(stream: Any, record: Record, paths: list[Trajectory]) -> None:
    """Estimate less truth at the estimate's instants inside the truth's time, within three standard deviations."""
    table = error_table(record, paths)
    if table is None:
        return
    for axis, error, bound in zip(AXES, ERROR, BOUND, strict=True):
        _series(stream, f"error/{axis}/estimate_less_truth", table["t_s"], table[error], "estimate")
        if bound in table:
            for name, sign in (("plus", 1.0), ("minus", -1.0)):
                _series(stream, f"error/{axis}/{name}_3_sigma", table["t_s"], sign * table[bound], "pad")


def _log_velocities(stream: Any, paths: list[Trajectory]) -> None:
    for path in paths:
        if path.velocity_m_s is not None:
            for k, axis in enumerate(SPEEDS):
                _series(stream, f"velocity/{axis}/{path.name}", path.t_s, path.velocity_m_s[:, k], path.name)


def _log_innovations(stream: Any, record: Record) -> None:
    """Each component's innovation in its own unit, a series a component of each sensor."""
    table = record.tables.get("innovation", {})
    if not {"t_s", "sensor", "component", "innovation"} <= table.keys():
        return
    sensor, component = (np.array(list(map(str, table[name].tolist()))) for name in ("sensor", "component"))
    t_s, value = np.asarray(table["t_s"], float), np.asarray(table["innovation"], float)
    for one, other in sorted(set(zip(sensor.tolist(), component.tolist(), strict=True))):
        mine = (sensor == one) & (component == other)
        _series(stream, f"innovation/{one}/{other}", t_s[mine], value[mine])


def _series(stream: Any, name: str, t_s: Array, value: Array, role: str = "") -> None:
    """One curve; rows that are not finite are left out."""
    good = np.isfinite(t_s) & np.isfinite(value)
    if not good.any():
        return
    entity = f"{PLOTS}/" + "/".join(rr.escape_entity_path_part(part) for part in name.split("/"))
    if role:
        stream.log(entity, rr.SeriesLines(colors=[COLOURS[role]], names=[name.split("/")[-1]]), static=True)
    order = np.argsort(t_s[good], kind="stable")
    columns = rr.Scalars.columns(scalars=value[good][order])
    stream.send_columns(entity, indexes=[times(t_s[good][order])], columns=columns)


def _log_events(stream: Any, record: Record) -> None:
    table = record.tables.get("events", {})
    if not {"t_s", "source", "kind"} <= table.keys():
        return
    for row in np.flatnonzero(np.isfinite(np.asarray(table["t_s"], float))).tolist():
        detail = str(table["detail"][row]) if "detail" in table else ""
        value = float(table["value"][row]) if "value" in table else np.nan
        kind = str(table["kind"][row])
        words = f"{table['source'][row]} {kind}" + (f": {detail}" if detail else "")
        words += f" {value:g}" if np.isfinite(value) else ""
        stream.set_time("t_s", duration=float(table["t_s"][row]))
        stream.log("/events", rr.TextLog(words, level="WARN" if kind == "warning" else "INFO"))
    stream.reset_time()
