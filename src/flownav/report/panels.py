"""A panel (one figure with its words) and the stack of axes that most figures are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.report.series import CROSS_POINTS, DOT_POINTS, LINE_POINTS, Array, Moment, Window, thin, thin_dots
from flownav.report.style import COLOUR, LINES, axis, layout

ROW_HEIGHT_PX = 138
FRAME_HEIGHT_PX = 84
GAP_PX = 22


@dataclass(frozen=True)
class Panel:
    """One figure of the page, or in `absent` the words that say why it is not there.

    caption: what to look for (shown); alt: what is drawn (for screen readers); figure: a Plotly figure.
    """

    key: str
    title: str
    caption: str = ""
    alt: str = ""
    figure: Any = None
    absent: str = ""
    wide: bool = False
    needs_webgl: bool = False


@dataclass(frozen=True)
class Section:
    """A heading and its panels."""

    key: str
    title: str
    panels: tuple[Panel, ...]


def drawn(values: Array) -> NDArray[np.float32]:
    """Values as the page carries them: single precision halves its size."""
    with np.errstate(over="ignore"):
        return np.asarray(values, np.float32)


class Stack:
    """Axes stacked over one time axis. Each `name` appears once in the legend and switches all its traces.

    Rows count from 1. The figure is built, and checked by Plotly, once: by `figure`.
    """

    def __init__(self, titles: Sequence[str], row_height_px: int = ROW_HEIGHT_PX) -> None:
        self.names: list[str] = []
        self._count = len(titles)
        self._data: list[dict[str, Any]] = []
        self._layout = layout(FRAME_HEIGHT_PX + self._count * row_height_px)
        self._layout |= {"shapes": [], "annotations": []}
        self._reach = np.full((self._count, 2), np.nan)  # smallest and largest value drawn on each axis
        gap = GAP_PX / (self._count * row_height_px)
        height = (1.0 - gap * (self._count - 1)) / self._count
        for row, title in enumerate(titles, 1):
            top = 1.0 - (row - 1) * (height + gap)
            last = row == self._count
            across = {"anchor": f"y{row}", "showticklabels": last, "matches": None if row == 1 else "x"}
            self._layout[f"xaxis{row}"] = axis("time (s)" if last else "") | across
            domain = [max(0.0, top - height), min(1.0, top)]
            self._layout[f"yaxis{row}"] = axis(title) | {"anchor": f"x{row}", "domain": domain, "nticks": 6}

    def _add(self, row: int, name: str, trace: dict[str, Any]) -> None:
        self._reach[row - 1] = _reach(np.append(self._reach[row - 1], trace["y"]))
        first = name not in self.names
        if first:
            self.names.append(name)
        place = {"xaxis": f"x{row}", "yaxis": f"y{row}"}
        self._data.append({"type": "scatter", "name": name, "legendgroup": name, "showlegend": first, **place, **trace})

    def line(self, row: int, role: str, name: str, t_s: Array, values: Array) -> None:
        """A line in a role's style, thinned."""
        kept = thin(LINE_POINTS, values)
        points = {"x": drawn(t_s[kept]), "y": drawn(values[kept])}
        self._add(row, name, {**points, "mode": "lines", "line": LINES[role], "hovertemplate": "%{y:.3f}"})

    def dots(self, row: int, colour: str, name: str, t_s: Array, values: Array, *, shown: bool = True) -> None:
        """Readings as dots, thinned; not shown, they wait in the legend."""
        marker = {"color": COLOUR[colour], "size": 3.5, "opacity": 0.5}
        self._readings(row, name, t_s, values, DOT_POINTS, {"marker": marker, "visible": shown or "legendonly"})

    def crosses(self, row: int, colour: str, name: str, t_s: Array, values: Array) -> None:
        """Exceptional readings as crosses, thinned to fewer than dots."""
        line = {"color": COLOUR[colour], "width": 1.2}
        marker = {"color": COLOUR[colour], "size": 5.5, "symbol": "x-thin", "line": line}
        self._readings(row, name, t_s, values, CROSS_POINTS, {"marker": marker})

    def _readings(self, row: int, name: str, t_s: Array, values: Array, budget: int, style: dict[str, Any]) -> None:
        known = np.flatnonzero(~np.isnan(values))
        if len(known):
            kept = known[thin_dots(budget, values[known])]
            points = {"x": drawn(t_s[kept]), "y": drawn(values[kept])}
            self._add(row, name, {**points, "mode": "markers", "hovertemplate": "%{y:.3f}", **style})

    def band(self, row: int, name: str, t_s: Array, half_width: Array) -> None:
        """The area between -half_width and +half_width, thinned, and open where nothing was measured for long."""
        kept = thin(LINE_POINTS, half_width)
        x: list[Array] = []
        y: list[Array] = []
        end = np.array([np.nan])
        for part in np.split(kept, np.flatnonzero(_gap_before(t_s, kept)[1:]) + 1):
            x += [t_s[part], t_s[part[::-1]], end]
            y += [half_width[part], -half_width[part[::-1]], end]
        line = {"color": COLOUR["band"], "width": 1}
        shape = {"x": drawn(np.concatenate(x)), "y": drawn(np.concatenate(y)), "mode": "lines", "line": line}
        self._add(row, name, {**shape, "fill": "toself", "fillcolor": COLOUR["band"], "hoverinfo": "skip"})

    def log_axis(self, row: int) -> None:
        """Make an upright axis logarithmic."""
        self._layout[f"yaxis{row}"] |= {"type": "log", "dtick": 1, "exponentformat": "none"}

    def reverse(self, row: int) -> None:
        """Draw an axis with its positive end down, as z of NED."""
        self._layout[f"yaxis{row}"]["autorange"] = "reversed"

    def within(self, row: int, half_height: float) -> None:
        """Let an upright axis reach from -half_height to +half_height."""
        self._layout[f"yaxis{row}"]["range"] = [-half_height, half_height]

    def from_zero(self) -> None:
        """Let every upright axis start at zero."""
        for row in range(1, self._count + 1):
            self._layout[f"yaxis{row}"]["rangemode"] = "tozero"

    def figure(self, window: Window, moments: Iterable[Moment] = (), outages: Iterable[Window] = ()) -> Any:
        """The Plotly figure over a window of time, with the moments and GPS outages inside it marked.

        An axis whose values hardly differ is kept from magnifying their rounding.
        """
        from plotly.graph_objects import Figure

        for row, (smallest, largest) in enumerate(self._reach, 1):
            self._layout[f"xaxis{row}"]["range"] = list(window)
            if largest - smallest < 1e-6:
                self._layout[f"yaxis{row}"] |= {"range": [smallest - 1.0, largest + 1.0], "autorange": False}
        self._shade([outage for outage in outages if outage[0] < window[1] and outage[1] > window[0]])
        for moment in moments:
            if window[0] <= moment.t_s <= window[1]:
                line = {"color": COLOUR["muted"], "width": 1, "dash": "2px,2px"}
                self._upright("line", moment.t_s, moment.t_s, line=line)
                self._note(moment.t_s, moment.name)
        return Figure({"data": self._data, "layout": {"template": {}, **self._layout}})

    def _shade(self, windows: Sequence[Window]) -> None:
        for number, (t0, t1) in enumerate(windows):
            self._upright("rect", t0, t1, layer="below", line={"width": 0}, fillcolor=COLOUR["window"])
            if number == 0:
                self._note(t0, "GPS outage")

    def _upright(self, kind: str, t0_s: float, t1_s: float, **style: Any) -> None:
        """A line or an area through all axes."""
        place = {"type": kind, "x0": t0_s, "x1": t1_s, "y0": 0, "y1": 1, "xref": "x", "yref": "paper"}
        self._layout["shapes"].append(place | style)

    def _note(self, t_s: float, text: str) -> None:
        place = {"x": t_s, "y": 1, "xref": "x", "yref": "paper", "xanchor": "left", "yanchor": "top", "xshift": 3}
        font = {"size": 11, "color": COLOUR["muted"]}
        self._layout["annotations"].append(place | {"text": text, "showarrow": False, "font": font})


def _gap_before(t_s: Array, kept: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether a kept sample follows a pause since the one kept before: half a second, and twenty usual intervals.

    A pause lies between two neighbours of the whole series, so thinning makes none.
    """
    interval = np.diff(t_s, prepend=t_s[:1])
    pauses = np.cumsum(interval > max(0.5, 20.0 * float(np.median(interval)) if len(interval) else 0.0))
    return np.asarray(np.diff(pauses[kept], prepend=pauses[kept[:1]]) > 0)


def _reach(values: Array) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)


def listed(names: Iterable[str]) -> str:
    """Names as a sentence has them: "a, b and c"."""
    names = list(names)
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else "nothing"
