"""The paths of a record as Plotly figures, from above and in space, for notebooks."""

from __future__ import annotations

from typing import Any

import numpy as np

from flownav.report.figures_path import Paths, drawn_rows
from flownav.report.samples import DOT_POINTS, LINE_POINTS, drawn, thin, thin_dots
from flownav.report.series import Array, Track
from flownav.report.style import COLOUR, LINES, axis, layout

# A 3-D view at most, in Plotly's units: the camera sees it whole.
BOX_DIAGONAL, BOX_HEIGHT = 1.65, 1.1
WIDEST_M = 1e9  # of a path that is drawn: what goes further is damage
HEIGHT_PX = 470


def _line_of(role: str, path: Track) -> Array:
    """A path as it is drawn: thinned, and open where it jumps."""
    kept, jumps = drawn_rows(role, path)
    return np.insert(path.value[kept], jumps, np.nan, axis=0)


def from_above(paths: Paths) -> Any:
    """Top view: north up, east to the right, both to the same scale."""
    from plotly.graph_objects import Figure

    figure = Figure()
    figure.update_layout(template="none", **{**layout(HEIGHT_PX), "hovermode": "closest"})
    figure.update_xaxes({**axis("y, east (m)"), "zeroline": False})
    figure.update_yaxes({**axis("x, north (m)"), "zeroline": False, "scaleanchor": "x", "scaleratio": 1})
    if paths.pad is not None:
        north, east, _ = paths.pad.corners().T
        _flat(figure, "pad", north, east, mode="lines", line={"color": COLOUR["pad"], "width": 1.5}, fill="toself",
              fillcolor=COLOUR["padfill"], hoverinfo="skip")  # fmt: skip
    if paths.gps is not None:
        kept = thin_dots(DOT_POINTS, paths.gps.value[:, 0], paths.gps.value[:, 1])
        marker = {"color": COLOUR["gps"], "size": 3.5, "opacity": 0.45}
        _flat(figure, "GPS", paths.gps.value[kept, 0], paths.gps.value[kept, 1], mode="markers", marker=marker)
    for role, name, path in paths.tracks:
        values = _line_of(role, path)
        _flat(figure, name, values[:, 0], values[:, 1], mode="lines", line={**LINES[role], "dash": "solid"})
    estimate = paths.estimate()
    for number, window in enumerate(paths.outages if estimate is not None else ()):
        part = estimate.within(window).value  # type: ignore[union-attr]
        if len(part):
            kept = thin(LINE_POINTS, part[:, 0], part[:, 1])
            _flat(figure, "estimate in an outage", part[kept, 0], part[kept, 1], mode="lines", showlegend=number == 0,
                  legendgroup="outage", line={"color": COLOUR["alert"], "width": 2.2})  # fmt: skip
    if paths.touch is not None:
        marker = {"symbol": "x-thin", "size": 12, "line": {"width": 2.5, "color": COLOUR["alert"]}}
        _flat(figure, "touchdown", paths.touch[:1], paths.touch[1:2], mode="markers", marker=marker)
    return figure


def _flat(figure: Any, name: str, north: Array, east: Array, **style: Any) -> None:
    style.setdefault("hovertemplate", "north %{y:.2f} m, east %{x:.2f} m")
    if style.get("hoverinfo"):
        style.pop("hovertemplate")
    figure.add_scatter(x=drawn(east), y=drawn(north), name=name, **style)


def in_space(paths: Paths) -> Any:
    """3-D view; height is drawn upwards, to a scale of its own where the path is very flat or slender."""
    from plotly.graph_objects import Figure

    figure = Figure()
    scene_axis = {"backgroundcolor": "rgba(0,0,0,0)", "gridcolor": COLOUR["rule"], "zerolinecolor": COLOUR["rule"],
                  "tickfont": {"color": COLOUR["muted"], "size": 10}, "showspikes": False, "nticks": 5}  # fmt: skip
    named = dict(zip(("xaxis", "yaxis", "zaxis"), ("east (m)", "north (m)", "height (m)"), strict=True))
    titles = {name: {"text": text, "font": {"size": 11}} for name, text in named.items()}
    scene: dict[str, Any] = {name: {**scene_axis, "title": title} for name, title in titles.items()}
    look = {"eye": {"x": 1.15, "y": -1.35, "z": 0.6}, "center": {"x": 0, "y": 0, "z": -0.08}}
    scene |= {"aspectmode": "manual", "aspectratio": _sides(paths), "camera": look, "dragmode": "turntable"}
    margin = {"l": 0, "r": 0, "t": 36, "b": 0}
    figure.update_layout(template="none", scene=scene, **{**layout(HEIGHT_PX), "margin": margin})
    if paths.pad is not None:
        figure.add_scatter3d(**_space(paths.pad.corners()), mode="lines", name="pad", hoverinfo="skip",
                             line={"color": COLOUR["pad"], "width": 4})  # fmt: skip
    if paths.gps is not None:
        kept = thin_dots(DOT_POINTS, *paths.gps.value.T)
        figure.add_scatter3d(**_space(paths.gps.value[kept]), mode="markers", name="GPS", visible="legendonly",
                             marker={"color": COLOUR["gps"], "size": 2, "opacity": 0.5})  # fmt: skip
    for role, name, path in paths.tracks:
        figure.add_scatter3d(**_space(_line_of(role, path)), mode="lines", name=name,
                             line={"color": COLOUR[role], "width": 5 if role == "truth" else 3})  # fmt: skip
    if paths.touch is not None:
        figure.add_scatter3d(**_space(paths.touch[None, :]), mode="markers", name="touchdown",
                             marker={"symbol": "x", "size": 4, "color": COLOUR["alert"]})  # fmt: skip
    return figure


def _sides(paths: Paths) -> dict[str, float]:
    """Sides of the box of a 3-D view, true to scale unless the path is very flat or slender."""
    points = np.concatenate([paths.main()[2].value, *([paths.pad.corners()] if paths.pad is not None else [])])
    spans = np.nanmax(points, axis=0) - np.nanmin(points, axis=0)
    north, east, height = np.clip(np.nan_to_num(spans, nan=0.0, posinf=WIDEST_M), 1e-3, WIDEST_M)
    across = max(north, east)
    to_scale = bool(across / 6.0 < height < 6.0 * across)
    sides = np.array([east, north, height if to_scale else 0.6 * across])
    sides = np.maximum(sides * min(BOX_DIAGONAL / np.linalg.norm(sides), BOX_HEIGHT / sides[2]), 0.1)
    return dict(zip("xyz", map(float, sides), strict=True))


def _space(ned: Array) -> dict[str, Any]:
    return {"x": drawn(ned[:, 1]), "y": drawn(ned[:, 0]), "z": drawn(-ned[:, 2]),
            "hovertemplate": "north %{y:.2f} m, east %{x:.2f} m, height %{z:.2f} m"}  # fmt: skip
