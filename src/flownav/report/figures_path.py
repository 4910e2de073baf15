"""The path over the ground: top view and 3-D view over the pad."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flownav.measurement import Sensor
from flownav.record import POSITION_NED, Record
from flownav.report.panels import Panel, drawn, listed
from flownav.report.series import (
    DOT_POINTS,
    LINE_POINTS,
    Array,
    Track,
    at,
    estimates,
    moments,
    outages,
    readings,
    thin,
    thin_dots,
    track,
)
from flownav.report.style import COLOUR, LINES, axis, layout

# A 3-D view at most, in Plotly's units: the camera sees it whole.
BOX_DIAGONAL, BOX_HEIGHT = 1.65, 1.1
WIDEST_M = 1e9  # of a path that is drawn: what goes further is damage
JUMP_M = 0.5  # from one row to the next


class Pad(NamedTuple):
    """The landing pad: a square on the ground about the origin, length of a side [m]."""

    size_m: float

    def corners(self) -> Array:
        """North, east, down of the closed outline, shape (5, 3)."""
        half = 0.5 * self.size_m
        north, east = half * np.array([-1, 1, 1, -1, -1]), half * np.array([-1, -1, 1, 1, -1])
        return np.column_stack([north, east, np.zeros(5)])


def pad(record: Record) -> Pad | None:
    """The pad of manifest["pad_size_m"], None where the record states none."""
    size_m = record.manifest.get("pad_size_m")
    return Pad(float(size_m)) if isinstance(size_m, (int, float)) else None


def _touchdown(record: Record, paths: list[tuple[str, str, Track]]) -> Array | None:
    touch = next((m.t_s for m in moments(record) if m.name == "touchdown"), None)
    if touch is None:
        return None
    point = at(np.array([touch]), paths[-1][2])[0]
    return None if np.isnan(point).any() else point


def ground_track(record: Record) -> Panel:
    """Top view: north up the page, east to the right, GPS readings, paths, pad, outages."""
    key, title = "ground-track", "Ground track"
    paths, gps = estimates(record, POSITION_NED), readings(record, Sensor.GPS_POSITION)
    if not paths:
        return Panel(key, title, absent="The record holds no positions.")
    from plotly.graph_objects import Figure

    figure = Figure()
    figure.update_layout(template="none", **{**layout(470), "hovermode": "closest"})
    figure.update_xaxes({**axis("y, east (m)"), "zeroline": False})
    figure.update_yaxes({**axis("x, north (m)"), "zeroline": False, "scaleanchor": "x", "scaleratio": 1})
    where = pad(record)
    if where is not None:
        north, east, _ = where.corners().T
        _flat(figure, "pad", north, east, mode="lines", line={"color": COLOUR["pad"], "width": 1.5}, fill="toself",
              fillcolor=COLOUR["padfill"], hoverinfo="skip")  # fmt: skip
    if gps is not None:
        kept = thin_dots(DOT_POINTS, gps.value[:, 0], gps.value[:, 1])
        marker = {"color": COLOUR["gps"], "size": 3.5, "opacity": 0.45}
        _flat(figure, "GPS", gps.value[kept, 0], gps.value[kept, 1], mode="markers", marker=marker)
    for role, name, path in paths:
        values = _drawn_path(role, path)
        _flat(figure, name, values[:, 0], values[:, 1], mode="lines", line={**LINES[role], "dash": "solid"})
    _outage_parts(figure, record)
    touch = _touchdown(record, paths)
    if touch is not None:
        marker = {"symbol": "x-thin", "size": 12, "line": {"width": 2.5, "color": COLOUR["alert"]}}
        _flat(figure, "touchdown", touch[:1], touch[1:2], mode="markers", marker=marker)
    caption = "Seen from above, both axes to the same scale."
    caption += f" The pad is {where.size_m:g} m square." if where is not None else ""
    drawn_names = [str(trace.name) for trace in figure.data if trace.showlegend is not False]
    return Panel(key, title, caption, f"Path over the ground from above: {listed(drawn_names)}.", figure)


def _drawn_path(role: str, path: Track) -> Array:
    """A path as it is drawn: thinned, and what is flown on open where it jumps, as a pad is found."""
    steps = np.linalg.norm(np.diff(path.value, axis=0), axis=1) if role == "flown" else np.zeros(0)
    jumps = np.flatnonzero(steps > JUMP_M) + 1
    kept = np.union1d(thin(LINE_POINTS, *path.value.T), np.concatenate([jumps - 1, jumps]))
    return np.insert(path.value[kept], np.searchsorted(kept, jumps), np.nan, axis=0)


def _flat(figure: Any, name: str, north: Array, east: Array, **style: Any) -> None:
    style.setdefault("hovertemplate", "north %{y:.2f} m, east %{x:.2f} m")
    if style.get("hoverinfo"):
        style.pop("hovertemplate")
    figure.add_scatter(x=drawn(east), y=drawn(north), name=name, **style)


def _outage_parts(figure: Any, record: Record) -> None:
    """The estimate's path while GPS was withheld, in the colour of alarm."""
    estimate = track(record, "estimate", POSITION_NED)
    for number, window in enumerate(outages(record) if estimate is not None else ()):
        part = estimate.within(window).value  # type: ignore[union-attr]
        if len(part):
            kept = thin(LINE_POINTS, part[:, 0], part[:, 1])
            _flat(figure, "estimate in an outage", part[kept, 0], part[kept, 1], mode="lines", showlegend=number == 0,
                  legendgroup="outage", line={"color": COLOUR["alert"], "width": 2.2})  # fmt: skip


def path_over_pad(record: Record) -> Panel:
    """3-D view of the path over the pad; height is drawn upwards."""
    key, title = "path-3d", "Path over the pad" if pad(record) else "Path in space"
    paths, where = estimates(record, POSITION_NED), pad(record)
    gps = readings(record, Sensor.GPS_POSITION)
    if not paths:
        return Panel(key, title, absent="The record holds no positions.")
    from plotly.graph_objects import Figure

    figure = Figure()
    scene_axis = {"backgroundcolor": "rgba(0,0,0,0)", "gridcolor": COLOUR["rule"], "zerolinecolor": COLOUR["rule"],
                  "tickfont": {"color": COLOUR["muted"], "size": 10}, "showspikes": False, "nticks": 5}  # fmt: skip
    named = dict(zip(("xaxis", "yaxis", "zaxis"), ("east (m)", "north (m)", "height (m)"), strict=True))
    titles = {name: {"text": text, "font": {"size": 11}} for name, text in named.items()}
    scene: dict[str, Any] = {name: {**scene_axis, "title": title} for name, title in titles.items()}
    look = {"eye": {"x": 1.15, "y": -1.35, "z": 0.6}, "center": {"x": 0, "y": 0, "z": -0.08}}
    sides, to_scale = _proportions(paths, where)
    scene |= {"aspectmode": "manual", "aspectratio": sides, "camera": look, "dragmode": "turntable"}
    margin = {"l": 0, "r": 0, "t": 36, "b": 0}
    figure.update_layout(template="none", scene=scene, **{**layout(470), "margin": margin})
    if where is not None:
        corners = where.corners()
        figure.add_mesh3d(**_space(corners[:4]), i=[0, 0], j=[1, 2], k=[2, 3], color=COLOUR["pad"], opacity=0.35,
                          hoverinfo="skip", showlegend=False)  # fmt: skip
        figure.add_scatter3d(**_space(corners), mode="lines", name="pad", hoverinfo="skip",
                             line={"color": COLOUR["pad"], "width": 4})  # fmt: skip
    if gps is not None:
        kept = thin_dots(DOT_POINTS, *gps.value.T)
        figure.add_scatter3d(**_space(gps.value[kept]), mode="markers", name="GPS", visible="legendonly",
                             marker={"color": COLOUR["gps"], "size": 2, "opacity": 0.5})  # fmt: skip
    for role, name, path in paths:
        figure.add_scatter3d(**_space(_drawn_path(role, path)), mode="lines", name=name,
                             line={"color": COLOUR[role], "width": 5 if role == "truth" else 3})  # fmt: skip
    touch = _touchdown(record, paths)
    if touch is not None:
        figure.add_scatter3d(**_space(touch[None, :]), mode="markers", name="touchdown",
                             marker={"symbol": "x", "size": 4, "color": COLOUR["alert"]})  # fmt: skip
    caption = "Drag to turn; the legend switches the GPS readings on."
    caption += "" if to_scale else " Height is drawn to a scale of its own."
    alt = f"Path in space: {listed([name for _, name, _ in paths])}{', over the pad' if where else ''}."
    return Panel(key, title, caption, alt, figure, needs_webgl=True)


def _proportions(paths: list[tuple[str, str, Track]], where: Pad | None) -> tuple[dict[str, float], bool]:
    """Sides of the box of a 3-D view, and whether they are true to scale: a very flat or slender path is not."""
    points = np.concatenate([paths[-1][2].value, *([where.corners()] if where is not None else [])])
    spans = np.nanmax(points, axis=0) - np.nanmin(points, axis=0)
    north, east, height = np.clip(np.nan_to_num(spans, nan=0.0, posinf=WIDEST_M), 1e-3, WIDEST_M)
    across = max(north, east)
    to_scale = bool(across / 6.0 < height < 6.0 * across)
    sides = np.array([east, north, height if to_scale else 0.6 * across])
    sides = np.maximum(sides * min(BOX_DIAGONAL / np.linalg.norm(sides), BOX_HEIGHT / sides[2]), 0.1)
    return dict(zip("xyz", map(float, sides), strict=True)), to_scale


def _space(ned: Array) -> dict[str, Any]:
    return {"x": drawn(ned[:, 1]), "y": drawn(ned[:, 0]), "z": drawn(-ned[:, 2]),
            "hovertemplate": "north %{y:.2f} m, east %{x:.2f} m, height %{z:.2f} m"}  # fmt: skip
