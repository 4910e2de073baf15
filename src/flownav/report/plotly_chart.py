"""A chart as a Plotly figure: each name appears once in the legend and switches all its traces."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.report.chart import Chart, Series
from flownav.report.samples import CROSS_POINTS, DOT_POINTS, LINE_POINTS, drawn, gap_before, thin, thin_dots
from flownav.report.series import Array, Window
from flownav.report.style import COLOUR, LINES, axis, layout

FRAME_HEIGHT_PX = 84
GAP_PX = 22
STILL = 1e-6  # an axis whose values differ by less is kept from magnifying their rounding


def figure(chart: Chart) -> Any:
    """The figure, built and checked by Plotly once."""
    from plotly.graph_objects import Figure

    data: list[dict[str, Any]] = []
    named: set[str] = set()
    for row, one_axis in enumerate(chart.axes, 1):
        for one in one_axis.series:
            first = one.name not in named
            named.add(one.name)
            place = {"xaxis": f"x{row}", "yaxis": f"y{row}", "legendgroup": one.name, "showlegend": first}
            data.append({"type": "scatter", "name": one.name, **place, **TRACES[one.kind](one)})
    return Figure({"data": data, "layout": {"template": {}, **_layout(chart)}})


def _line(one: Series) -> dict[str, Any]:
    kept = thin(LINE_POINTS, one.value)
    return _points(one, kept) | {"mode": "lines", "line": LINES[one.role], "hovertemplate": "%{y:.3f}"}


def _dots(one: Series) -> dict[str, Any]:
    marker = {"color": COLOUR[one.role], "size": 3.5, "opacity": 0.5}
    return _readings(one, DOT_POINTS, {"marker": marker, "visible": one.shown or "legendonly"})


def _crosses(one: Series) -> dict[str, Any]:
    line = {"color": COLOUR[one.role], "width": 1.2}
    marker = {"color": COLOUR[one.role], "size": 5.5, "symbol": "x-thin", "line": line}
    return _readings(one, CROSS_POINTS, {"marker": marker})


def _readings(one: Series, budget: int, style: dict[str, Any]) -> dict[str, Any]:
    kept = thin_dots(budget, one.value)
    return _points(one, kept) | {"mode": "markers", "hovertemplate": "%{y:.3f}", **style}


def _points(one: Series, kept: NDArray[np.int64]) -> dict[str, Any]:
    return {"x": drawn(one.t_s[kept]), "y": drawn(one.value[kept])}


def _band(one: Series) -> dict[str, Any]:
    """The area of a band, thinned, and open where nothing was measured for long."""
    t_s, half_width = one.t_s, one.value
    middle = np.zeros(len(t_s)) if one.middle is None else one.middle
    kept = thin(LINE_POINTS, half_width)
    x: list[Array] = []
    y: list[Array] = []
    end = np.array([np.nan])
    for part in np.split(kept, np.flatnonzero(gap_before(t_s, kept)[1:]) + 1):
        x += [t_s[part], t_s[part[::-1]], end]
        y += [(middle + half_width)[part], (middle - half_width)[part[::-1]], end]
    line = {"color": COLOUR["band"], "width": 1}
    shape = {"x": drawn(np.concatenate(x)), "y": drawn(np.concatenate(y)), "mode": "lines", "line": line}
    return {**shape, "fill": "toself", "fillcolor": COLOUR["band"], "hoverinfo": "skip"}


TRACES = {"line": _line, "dots": _dots, "crosses": _crosses, "band": _band}


def _layout(chart: Chart) -> dict[str, Any]:
    count = len(chart.axes)
    made = layout(FRAME_HEIGHT_PX + count * chart.row_height_px) | {"shapes": [], "annotations": []}
    gap = GAP_PX / (count * chart.row_height_px)
    height = (1.0 - gap * (count - 1)) / count
    for row, one in enumerate(chart.axes, 1):
        top, last = 1.0 - (row - 1) * (height + gap), row == count
        across = {"anchor": f"y{row}", "showticklabels": last, "matches": None if row == 1 else "x"}
        made[f"xaxis{row}"] = axis("time (s)" if last else "") | across | {"range": list(chart.window)}
        domain = [max(0.0, top - height), min(1.0, top)]
        upright = axis(escape(one.title, quote=False)) | {"anchor": f"x{row}", "domain": domain, "nticks": 6}
        if one.log:
            upright |= {"type": "log", "dtick": 1, "exponentformat": "none"}
        if one.reversed:
            upright["autorange"] = "reversed"
        if one.from_zero:
            upright["rangemode"] = "tozero"
        if one.within is not None:
            upright["range"] = [-one.within, one.within]
        smallest, largest = one.reach()
        if largest - smallest < STILL:
            upright |= {"range": [smallest - 1.0, largest + 1.0], "autorange": False}
        made[f"yaxis{row}"] = upright
    _shade(made, chart.outages)
    for moment in chart.moments:
        line = {"color": COLOUR["muted"], "width": 1, "dash": "2px,2px"}
        _upright(made, "line", moment.t_s, moment.t_s, line=line)
        _note(made, moment.t_s, moment.name)
    return made


def _shade(made: dict[str, Any], windows: Sequence[Window]) -> None:
    for number, (t0, t1) in enumerate(windows):
        _upright(made, "rect", t0, t1, layer="below", line={"width": 0}, fillcolor=COLOUR["window"])
        if number == 0:
            _note(made, t0, "GPS outage")


def _upright(made: dict[str, Any], kind: str, t0_s: float, t1_s: float, **style: Any) -> None:
    """A line or an area through all axes."""
    place = {"type": kind, "x0": t0_s, "x1": t1_s, "y0": 0, "y1": 1, "xref": "x", "yref": "paper"}
    made["shapes"].append(place | style)


def _note(made: dict[str, Any], t_s: float, text: str) -> None:
    place = {"x": t_s, "y": 1, "xref": "x", "yref": "paper", "xanchor": "left", "yanchor": "top", "xshift": 3}
    font = {"size": 11, "color": COLOUR["muted"]}
    made["annotations"].append(place | {"text": text, "showarrow": False, "font": font})
