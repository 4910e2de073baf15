"""Colours, fonts and the common layout: one look for the page and all its figures, on light and on dark.

Each colour has a light and a dark value. Figures are built with the light ones; the page's script swaps
them where the reader's system asks for dark, so a role (truth, estimate, ...) has one colour everywhere.
A chart becomes what Plotly's script draws here: each name appears once in the legend and switches all its traces.
Plotly's own Python package is not needed for that: the script takes JSON.
"""

import base64
import json
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.core.text import finite
from flownav.report.chart import (
    CROSS_POINTS,
    DOT_POINTS,
    LINE_POINTS,
    Chart,
    Series,
    drawn,
    gap_before,
    thin,
    thin_dots,
)
from flownav.report.series import Window

# role: (on light, on dark)
PALETTE: dict[str, tuple[str, str]] = {
    "page": ("#f6f7f9", "#14181d"),
    "surface": ("#ffffff", "#1b2027"),
    "ink": ("#1d232a", "#e7eaee"),
    "muted": ("#57616c", "#a3adb8"),
    "rule": ("#dfe3e8", "#323a44"),
    "grid": ("#e9ecef", "#2a313a"),
    "truth": ("#16191d", "#f5f6f7"),
    "estimate": ("#0a5fb4", "#62b3ff"),
    "smoothed": ("#9a2f6b", "#f08bc0"),
    "gps": ("#bf5b0b", "#f2a354"),
    "flow": ("#0e7a5f", "#45cfa2"),
    "autopilot": ("#8339a8", "#cb9df2"),
    "flown": ("#8339a8", "#cb9df2"),  # the estimate used by an autopilot: its own, too
    "imu": ("#7a6000", "#d8bf5a"),
    "command": ("#57616c", "#a3adb8"),
    "gate": ("#b8232a", "#ff8078"),
    "alert": ("#b8232a", "#ff8078"),
    "pad": ("#7d8894", "#8793a0"),
    "band": ("rgba(10,95,180,0.15)", "rgba(98,179,255,0.20)"),
    "window": ("rgba(184,35,42,0.09)", "rgba(255,128,120,0.14)"),
    "shade": ("rgba(29,35,42,0.22)", "rgba(0,0,0,0.7)"),
    # the phases of a flight (scoring/phases.py)
    "phase-ground": ("#c9ced4", "#4a525c"),
    "phase-climb": ("#a9cdf0", "#2f5f8c"),
    "phase-hover": ("#b5dfcd", "#2b6b55"),
    "phase-transit": ("#d9cdee", "#5d4a83"),
    "phase-descent": ("#f4d9ae", "#7c5a22"),
    "phase-approach": ("#f6c296", "#8d5424"),
    "phase-touchdown": ("#f0a5a0", "#96423e"),
    "phase-landed": ("#c9ced4", "#4a525d"),
    # records beside each other
    "record-1": ("#16191d", "#f5f6f7"),
    "record-2": ("#0a5fb4", "#62b3ff"),
    "record-3": ("#bf5b0b", "#f2a354"),
    "record-4": ("#0e7a5f", "#45cfa2"),
    "record-5": ("#8339a8", "#cb9df2"),
    "record-6": ("#9a2f6b", "#f08bc0"),
    "padfill": ("rgba(125,136,148,0.25)", "rgba(135,147,160,0.28)"),
}
COLOUR = {role: light for role, (light, _) in PALETTE.items()}
LIGHT_TO_DARK = dict(PALETTE.values())

FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, "Liberation Sans", sans-serif'

# How a role is drawn as a line over time: the truth comes last and is dashed, so that the estimate shows through.
LINES: dict[str, dict[str, Any]] = {
    "truth": {"color": COLOUR["truth"], "width": 1.3, "dash": "5px,3px"},
    "estimate": {"color": COLOUR["estimate"], "width": 1.6},
    "smoothed": {"color": COLOUR["smoothed"], "width": 1.3},
    "gps": {"color": COLOUR["gps"], "width": 1.5},
    "flow": {"color": COLOUR["flow"], "width": 1.5},
    "autopilot": {"color": COLOUR["autopilot"], "width": 1.4},
    "flown": {"color": COLOUR["flown"], "width": 1.4},
    "imu": {"color": COLOUR["imu"], "width": 1.3},
    "command": {"color": COLOUR["muted"], "width": 1.2, "dash": "2px,3px"},
    "gate": {"color": COLOUR["alert"], "width": 1.2, "dash": "6px,4px"},
}


def axis(title: str = "") -> dict[str, Any]:
    """A 2-D axis in the report's look; the title carries the unit."""
    return {
        "title": {"text": title, "standoff": 6, "font": {"color": COLOUR["muted"], "size": 12}},
        "gridcolor": COLOUR["grid"],
        "linecolor": COLOUR["rule"],
        "zerolinecolor": COLOUR["rule"],
        "tickfont": {"color": COLOUR["muted"], "size": 11},
        "showline": True,
        "ticks": "outside",
        "tickcolor": COLOUR["rule"],
        "ticklen": 4,
        "nticks": 8,
    }


def layout(height_px: int) -> dict[str, Any]:
    """The layout that every figure shares: transparent ground, fonts, legend above, room for the axes."""
    return {
        "height": height_px,
        "autosize": True,
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": FONT, "size": 12, "color": COLOUR["ink"]},
        "margin": {"l": 60, "r": 14, "t": 36, "b": 44},
        "legend": {"orientation": "h", "x": 0, "y": 1, "xanchor": "left", "yanchor": "bottom", "font": {"size": 12}},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": COLOUR["muted"], "activecolor": COLOUR["estimate"]},
        "hovermode": "x unified",
        "hoverlabel": {
            "bgcolor": COLOUR["surface"],
            "bordercolor": COLOUR["rule"],
            "font": {"family": FONT, "size": 12, "color": COLOUR["ink"]},
        },
        "uirevision": "keep",
    }


FRAME_HEIGHT_PX = 84
GAP_PX = 22
LEAST_SPAN = 1e-6  # an axis whose values differ by less is kept from magnifying their rounding


class Drawing(NamedTuple):
    """Traces and a layout as Plotly's script takes them (plotly.com/javascript/reference); columns are arrays."""

    data: list[dict[str, Any]]
    layout: dict[str, Any]

    def to_json(self) -> str:
        """Both as JSON: an array as its bytes (`dtype`, `bdata`), a number that is none as null."""
        return json.dumps(finite(_packed(self._asdict())), allow_nan=False)


TYPED = {"float64": "f8", "float32": "f4", "int32": "i4", "uint8": "u1"}  # what plotly.js reads from bytes


def _packed(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _packed(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_packed(one) for one in value]
    if isinstance(value, np.ndarray) and value.dtype.name in TYPED:
        little = np.ascontiguousarray(value, value.dtype.newbyteorder("<"))
        packed = {"dtype": TYPED[value.dtype.name], "bdata": base64.b64encode(little.tobytes()).decode()}
        return packed | ({"shape": ", ".join(map(str, value.shape))} if value.ndim > 1 else {})
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def figure(chart: Chart) -> Drawing:
    """The Plotly drawing of a chart."""
    data: list[dict[str, Any]] = []
    named: set[str] = set()
    for row, one_axis in enumerate(chart.axes, 1):
        for one in one_axis.series:
            first = one.name not in named
            named.add(one.name)
            place = {"xaxis": f"x{_nth(row)}", "yaxis": f"y{_nth(row)}", "legendgroup": one.name, "showlegend": first}
            data.append({"type": "scatter", "name": one.name, **place, **TRACES[one.kind](one)})
    return drawing(data, _layout(chart))


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


def _nth(row: int) -> str:
    """The first axis has no number."""
    return "" if row == 1 else str(row)


def _layout(chart: Chart) -> dict[str, Any]:
    count = len(chart.axes)
    made = layout(FRAME_HEIGHT_PX + count * chart.row_height_px) | {"shapes": [], "annotations": []}
    gap = GAP_PX / (count * chart.row_height_px)
    height = (1.0 - gap * (count - 1)) / count
    for row, one in enumerate(chart.axes, 1):
        top, last = 1.0 - (row - 1) * (height + gap), row == count
        across = {"anchor": f"y{_nth(row)}", "showticklabels": last, "range": list(chart.window)}
        made[f"xaxis{_nth(row)}"] = axis("time (s)" if last else "") | across | ({"matches": "x"} if row > 1 else {})
        domain = [max(0.0, top - height), min(1.0, top)]
        upright = axis(escape(one.title, quote=False)) | {"anchor": f"x{_nth(row)}", "domain": domain, "nticks": 6}
        if one.log:
            upright |= {"type": "log", "dtick": 1, "exponentformat": "none"}
        if one.reversed:
            upright["autorange"] = "reversed"
        if one.from_zero:
            upright["rangemode"] = "tozero"
        if one.within is not None:
            upright["range"] = [-one.within, one.within]
        smallest, largest = one.reach()
        if largest - smallest < LEAST_SPAN:
            upright |= {"range": [smallest - 1.0, largest + 1.0], "autorange": False}
        made[f"yaxis{_nth(row)}"] = upright
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


def drawing(data: Sequence[dict[str, Any]], look: dict[str, Any]) -> Drawing:
    """Traces in this layout alone, without a template's."""
    return Drawing(list(data), {"template": {}, **{name: value for name, value in look.items() if value is not None}})
