"""Plain figures, something against something, in the report's look; those over time are `report.panels.Stack`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flownav.paper.published import HEIGHTS_M
from flownav.report.samples import drawn
from flownav.report.style import COLOUR, axis, layout

PAPER, HERE = "gps", "estimate"  # whose figures: the colour of each
HEIGHT_COLOURS = dict(zip(HEIGHTS_M, ("estimate", "flow", "gps", "autopilot"), strict=True))
HEIGHT_SYMBOLS = dict(zip(HEIGHTS_M, ("circle", "square", "diamond", "triangle-up"), strict=True))


def dots(name: str, colour: str, x: ArrayLike, y: ArrayLike, **style: Any) -> dict[str, Any]:
    """A cloud of markers; style: parts of the marker."""
    marker = {"color": COLOUR[colour], "size": 7, "opacity": 0.75, **style}
    return _trace(name, x, y, {"mode": "markers", "marker": marker})


def line(
    name: str, colour: str, x: ArrayLike, y: ArrayLike, dash: str = "solid", width: float = 1.6, markers: bool = False
) -> dict[str, Any]:
    """A line, with markers at its points if asked."""
    style = {"mode": "lines+markers" if markers else "lines", "marker": {"size": 7}}
    return _trace(name, x, y, {**style, "line": {"color": COLOUR[colour], "width": width, "dash": dash}})


def _trace(name: str, x: ArrayLike, y: ArrayLike, style: dict[str, Any]) -> dict[str, Any]:
    points = {"x": drawn(np.asarray(x, float)), "y": drawn(np.asarray(y, float))}
    return {"type": "scatter", "name": name, **points, "hovertemplate": "%{x:.3g}, %{y:.4g}", **style}


def figure(
    traces: list[dict[str, Any]], x_title: str, y_title: str, height_px: int = 380, **axes: dict[str, Any]
) -> Any:
    """The Plotly figure; axes: what xaxis and yaxis have beside their looks."""
    from plotly.graph_objects import Figure

    looks = layout(height_px) | {"hovermode": "closest"}
    looks["xaxis"] = axis(x_title) | {"zeroline": False} | axes.get("xaxis", {})
    looks["yaxis"] = axis(y_title) | {"zeroline": False} | axes.get("yaxis", {})
    return Figure({"data": traces, "layout": {"template": {}, **looks}})


def pictures(images: list[tuple[str, ArrayLike]], height_px: int = 300) -> Any:
    """Grey pictures 0 to 255 side by side, each with its title; rows run downwards."""
    from plotly.graph_objects import Figure

    looks = layout(height_px) | {"hovermode": "closest", "annotations": []}
    data, gap = [], 0.06
    width = (1.0 - gap * (len(images) - 1)) / len(images)
    for k, (title, image) in enumerate(images, 1):
        left = (k - 1) * (width + gap)
        number = "" if k == 1 else str(k)
        data.append(
            {
                "type": "heatmap",
                "name": title,
                "z": np.asarray(image, np.uint8),
                "zmin": 0,
                "zmax": 255,
                "colorscale": [[0, "rgb(0,0,0)"], [1, "rgb(255,255,255)"]],
                "showscale": False,
                "xaxis": f"x{number}",
                "yaxis": f"y{number}",
                "hovertemplate": "%{x}, %{y}: grey %{z}",
            }
        )
        square = {"showgrid": False, "zeroline": False, "constrain": "domain"}
        across = {"domain": [left, left + width], "anchor": f"y{number}"}
        down = {"anchor": f"x{number}", "scaleanchor": f"x{number}", "autorange": "reversed", "constraintoward": "top"}
        looks[f"xaxis{number}"] = axis("pixels") | square | across
        looks[f"yaxis{number}"] = axis() | square | down
        place = {"x": left + 0.5 * width, "y": 1.0, "xref": "paper", "yref": "paper"}
        middle = {"xanchor": "center", "yanchor": "bottom", "showarrow": False}
        looks["annotations"].append({"text": title, "font": {"size": 12, "color": COLOUR["ink"]}, **place, **middle})
    return Figure({"data": data, "layout": {"template": {}, **looks}})


def heights_axis() -> dict[str, Any]:
    """An axis of the four heights."""
    return {"tickvals": list(HEIGHTS_M), "range": [0.5, 1.6]}
