"""A record over time, in Rerun's terms, and the viewer's layout when it opens."""

from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from flownav.core.measurement import Array
from flownav.core.record import Record
from flownav.export.trajectory import BOUND, ERROR, Trajectory, error_table
from flownav.export.viewing.scene import COLOURS, EARTH, NED, TIMELINE, times

PLOTS = "/plots"
AXES = ("north_m", "east_m", "down_m")
SPEEDS = ("north_m_s", "east_m_s", "down_m_s")
SHORTEST_EYE_M = 3.0


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


# -- the layout ---------------------------------------------------------------------------------------------
def arrangement(record: Record, paths: list[Trajectory]) -> Any:
    """The blueprint: paths grow with the time, everything else shows the moment under the cursor."""
    grown = rrb.VisibleTimeRange(TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=_now())
    trail = rrb.VisibleTimeRange(TIMELINE, start=rrb.TimeRangeBoundary.cursor_relative(seconds=-5.0), end=_now())
    overrides: dict[Any, Any] = {
        **{f"{NED}/path/{path.name}": rrb.VisibleTimeRanges([grown]) for path in paths},
        f"{NED}/gps": rrb.VisibleTimeRanges([trail]),
    }
    space = rrb.Spatial3DView(
        origin=EARTH, name="Flight (east, north, up)", line_grid=rrb.LineGrid3D(visible=True, spacing=1.0),
        overrides=overrides, eye_controls=_eye(paths),
    )  # fmt: skip
    errors = any(path.name == "truth" for path in paths) and any(path.name == "estimate" for path in paths)
    axis = _axis(paths)
    figures = [rrb.Vertical(*_views("position", AXES, axis), name="Position")]
    figures = [rrb.Vertical(*_views("error", AXES, axis), name="Errors"), *figures] if errors else figures
    if any(path.velocity_m_s is not None for path in paths):
        figures.append(rrb.Vertical(*_views("velocity", SPEEDS, axis), name="Velocity"))
    sensors = sensors_of(record)
    innovations = [rrb.Tabs(*(_view("innovation", sensor, axis) for sensor in sensors), name="Innovations")]
    events = [rrb.TextLogView(origin="/events", name="Events")] if "events" in record.tables else []
    parts: list[tuple[int, Any]] = [
        (5, rrb.Tabs(*figures)),
        *((3, each) for each in innovations if sensors),
        *((2, each) for each in events),
    ]
    right = rrb.Vertical(*(part for _, part in parts), row_shares=[share for share, _ in parts])
    return rrb.Blueprint(
        rrb.Horizontal(space, right, column_shares=[3, 2]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _now() -> Any:
    return rrb.TimeRangeBoundary.cursor_relative()


def _axis(paths: list[Trajectory]) -> Any:
    """The whole flight, in every figure."""
    first, last = min(path.t_s[0] for path in paths), max(path.t_s[-1] for path in paths)
    boundary = rrb.TimeRangeBoundary.absolute
    whole = rrb.TimeRange(start=boundary(seconds=float(first)), end=boundary(seconds=float(last)))
    return rrb.TimeAxis(view_range=whole)


def _views(kind: str, axes: tuple[str, ...], axis: Any) -> list[Any]:
    return [_view(kind, name, axis, legend=False) for name in axes]


def _view(kind: str, name: str, axis: Any, *, legend: bool = True) -> Any:
    title = f"{kind} {name}".replace("_m_s", " (m/s)").replace("_m", " (m)").replace("_", " ")
    return rrb.TimeSeriesView(
        origin=f"{PLOTS}/{kind}/{name}",
        name=title.capitalize(),
        axis_x=axis,
        plot_legend=rrb.PlotLegend(visible=legend),
    )


def _eye(paths: list[Trajectory]) -> Any:
    """From the south-east and above, the whole estimate in sight."""
    ned = paths[0].position_m
    low, high = ned.min(axis=0), ned.max(axis=0)
    north, east, down = (0.5 * (low + high)).tolist()
    away = max(SHORTEST_EYE_M, 1.2 * float(max(high - low)))
    return rrb.EyeControls3D(
        position=(east + 0.7 * away, north - away, -down + 0.6 * away), look_target=(east, north, -down)
    )
