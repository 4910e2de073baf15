"""How the viewer is laid out when a record opens: the flight in space on the left, its figures on the right."""

from __future__ import annotations

from typing import Any

import rerun.blueprint as rrb

from flownav.core.record import Record
from flownav.export.trajectory import Trajectory
from flownav.export.viewing.plots import AXES, PLOTS, SPEEDS, sensors_of
from flownav.export.viewing.scene import EARTH, NED, TIMELINE

SHORTEST_EYE_M = 3.0


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
