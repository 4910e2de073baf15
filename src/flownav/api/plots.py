"""How a record shows itself: two lines on a terminal, a small table in a notebook, plain figures of `Record.plot`."""

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, VELOCITY_BODY, Column, Record, mapping
from flownav.report.panels import plotly
from flownav.scoring.recorded import at_instants, scored_table

POSITION_TITLES = ("north [m]", "east [m]", "down [m]")
VELOCITY_TITLES = ("forward [m/s]", "right [m/s]", "down [m/s]")
COLOURS = {"estimate": "#2a78d6", "truth": "#e08a00", "GPS": "#9aa0a6", "band": "rgba(42,120,214,0.25)"}
MOST_DOTS = 4000
SIGMAS = 2.0
STATED = "2 sigma stated"
LEGEND = {"orientation": "h", "yanchor": "bottom", "y": 1.0, "xanchor": "right", "x": 1.0}
LEAST_SHARE = 0.6  # of the longest axis of a path that the shortest one is drawn


class Line(NamedTuple):
    """One line or cloud of dots: its name, instants [s] and columns (n, k); dots: no line between them."""

    name: str
    t_s: Array
    values: Array
    dots: bool = False


def figure_of(record: Record, what: str) -> Any:
    """A figure by its name. InputError for another name, and where the record lacks what it shows."""
    if what not in FIGURES:
        raise InputError(f"plot {what!r}: must be {', '.join(list(FIGURES)[:-1])} or {list(FIGURES)[-1]}")
    return FIGURES[what](record)


def position(record: Record) -> Any:
    """North, east and down: estimate, truth, GPS."""
    sources = (("gps_position", "GPS"), ("truth", "truth"), (scored_table(record), "estimate"))
    return _stack(record, "Position", POSITION_TITLES, POSITION_NED, sources)


def velocity(record: Record) -> Any:
    """Velocity along the body's axes: estimate and truth."""
    return _stack(record, "Velocity", VELOCITY_TITLES, VELOCITY_BODY, _paths(record))


def errors(record: Record) -> Any:
    """Errors of position and velocity while they are scored, within twice the standard deviation that is stated.

    A simulated flight's position is the one that is scored, from where the pad is taken to be: of that none is stated,
    since the filter's own is from where GPS puts the flight. Velocities are the filter's, at its own instants.
    """
    if "truth" not in record.tables:
        raise InputError("plot 'errors': the record has no truth; plot 'innovations' shows how GPS disagrees")
    truth, own = record.tables["truth"], record.tables["estimate"]
    scored, t_s = record.tables[scored_table(record)], np.asarray(truth["t_s"], float)
    sources = [(scored, POSITION_NED)] + [(own, VELOCITY_BODY)] * (set(VELOCITY_BODY) <= own.keys() & truth.keys())
    error = np.hstack([at_instants(table, names, t_s) - _matrix(truth, names) for table, names in sources])
    error[~_scored(record, t_s)] = np.nan
    titles = (*POSITION_TITLES, *VELOCITY_TITLES)[: error.shape[1]]
    figure = _rows(f"Errors, {_title(record)}", titles, [Line("estimate", t_s, error)])
    for row, name in enumerate(name for _, names in sources for name in names):
        stated = () if scored is not own and name in POSITION_NED else (f"std_{name}",)
        for column in own.keys() & set(stated):
            sigma = SIGMAS * at_instants(own, (column,), t_s)[:, 0]
            _band(figure, row + 1, t_s, np.where(np.isfinite(error[:, row]), sigma, np.nan))
    return figure


def innovations(record: Record) -> Any:
    """Innovations over their standard deviation, a row a sensor: within 2 in 95 of 100 where the filter is right."""
    table = record.tables.get("innovation")
    if table is None or not len(table["t_s"]):
        raise InputError("plot 'innovations': the record has none; only our own filter and own parts state them")
    sensors = np.asarray(table["sensor"], str)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal = np.asarray(table["innovation"], float) / np.sqrt(np.asarray(table["innovation_variance"], float))
    known = np.isfinite(normal)
    names = list(dict.fromkeys(sensors[known].tolist()))
    figure = _empty(f"Innovations over their standard deviation, {_title(record)}", names)
    for row, name in enumerate(names, 1):
        chosen = np.flatnonzero(known & (sensors == name))
        chosen = chosen[:: max(1, len(chosen) // MOST_DOTS)]
        t_s = np.asarray(table["t_s"], float)[chosen]
        _trace(figure, row, "estimate", t_s, normal[chosen], dots=True, legend=False)
        for edge in (-SIGMAS, SIGMAS):
            figure.add_hline(y=edge, row=row, col=1, line_width=1, line_dash="dot", line_color=COLOURS["truth"])
    return figure


def path(record: Record) -> Any:
    """The path in space, east, north and height; the estimate while it is scored."""
    figure, spans = plotly().Figure(), np.zeros(3)
    for table, name in _paths(record):
        line = _line(record, table, name, POSITION_NED)
        if line is not None:
            shown = line.values.copy()
            if name == "estimate":
                shown[~_scored(record, line.t_s)] = np.nan
            north, east, down = shown.T
            spans = np.fmax(spans, [np.nanmax(axis) - np.nanmin(axis) for axis in (east, north, down)])
            style = {"color": COLOURS[name], "width": 4}
            figure.add_scatter3d(x=east, y=north, z=-down, mode="lines", name=name, line=style)
    if not figure.data:
        raise InputError("plot 'path': the record has no path")
    shares = np.clip(spans / max(spans.max(), 1e-9), LEAST_SHARE, 1.0)
    scene = {
        "xaxis_title": "east [m]", "yaxis_title": "north [m]", "zaxis_title": "height [m]", "aspectmode": "manual",
        "aspectratio": dict(zip("xyz", map(float, shares), strict=True)),
    }  # fmt: skip
    figure.update_layout(
        title=f"Path, {_title(record)}", scene=scene, scene_camera={"eye": {"x": 1.2, "y": -1.2, "z": 0.4}},
        margin={"l": 0, "r": 0, "b": 0, "t": 50}, height=700, legend=LEGEND,
    )  # fmt: skip
    return figure


FIGURES: dict[str, Callable[[Record], Any]] = {
    "position": position,
    "velocity": velocity,
    "errors": errors,
    "innovations": innovations,
    "path": path,
}


def _paths(record: Record) -> tuple[tuple[str, str], ...]:
    """Tables that hold a path, and what each is called."""
    return ("truth", "truth"), (scored_table(record), "estimate")


def _scored(record: Record, t_s: Array) -> NDArray[np.bool_]:
    """Which instants (n,) of a simulated flight count in its scores; all of another record.

    Before the hand-over the estimate is the truth, and on the ground no autopilot uses it.
    """
    judged = record.tables.get("judging", {})
    if "counted" not in judged:
        return np.ones(len(t_s), bool)
    row = np.clip(np.searchsorted(judged["t_s"], t_s, side="right") - 1, 0, len(judged["t_s"]) - 1)
    return np.asarray(judged["counted"][row] > 0.0)


def _title(record: Record) -> str:
    return str(record.manifest.get("scenario") or record.manifest.get("log") or record.manifest.get("kind") or "")


def _line(record: Record, table: str, name: str, columns: tuple[str, ...], *, dots: bool = False) -> Line | None:
    """Columns of a table; None where the record has not all of them."""
    found = record.tables.get(table, {})
    if not {"t_s", *columns} <= found.keys():
        return None
    return Line(name, np.asarray(found["t_s"], float), _matrix(found, columns), dots)


def _matrix(table: Mapping[str, Column], columns: Sequence[str]) -> Array:
    return np.column_stack([np.asarray(table[name], float) for name in columns])


def _stack(
    record: Record, what: str, titles: Sequence[str], columns: tuple[str, ...], sources: Sequence[tuple[str, str]]
) -> Any:
    """Plot of some states from these tables, GPS as dots. InputError where no table has any."""
    lines = [_line(record, table, name, columns, dots=name == "GPS") for table, name in sources]
    known = [line for line in lines if line is not None]
    if not known:
        raise InputError(f"plot: the record has nothing to draw for {what.lower()}")
    return _rows(f"{what}, {_title(record)}", titles, known)


def _rows(title: str, titles: Sequence[str], lines: Sequence[Line]) -> Any:
    """Lines in a row of axes each, over one time axis."""
    figure = _empty(title, titles)
    for line in lines:
        for row in range(line.values.shape[1]):
            _trace(figure, row + 1, line.name, line.t_s, line.values[:, row], dots=line.dots, legend=row == 0)
    return figure


def _empty(title: str, titles: Sequence[str]) -> Any:
    plotly()
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=len(titles), cols=1, shared_xaxes=True, vertical_spacing=0.04)
    figure.update_layout(title=title, height=110 + 150 * len(titles), hovermode="x unified", margin={"t": 70, "b": 40})
    figure.update_layout(legend=LEGEND)
    for row, name in enumerate(titles, 1):
        figure.update_yaxes(title_text=name, row=row, col=1)
    figure.update_xaxes(title_text="time [s]", row=len(titles), col=1)
    return figure


def _trace(figure: Any, row: int, name: str, t_s: Array, values: Array, *, dots: bool, legend: bool) -> None:
    how = {"mode": "markers", "marker": {"size": 3, "color": COLOURS[name]}} if dots else {
        "mode": "lines", "line": {"width": 1.5, "color": COLOURS[name]},
    }  # fmt: skip
    figure.add_scatter(x=t_s, y=values, name=name, legendgroup=name, showlegend=legend, row=row, col=1, **how)


def _band(figure: Any, row: int, t_s: Array, half: Array) -> None:
    """Add the stated band about zero."""
    known = np.isfinite(half)
    around = np.concatenate([half[known], -half[known][::-1]])
    first = all(trace.name != STATED for trace in figure.data)
    figure.add_scatter(
        x=np.concatenate([t_s[known], t_s[known][::-1]]), y=around, fill="toself", fillcolor=COLOURS["band"],
        line={"width": 0}, hoverinfo="skip", name=STATED, legendgroup="band", showlegend=first,
        row=row, col=1,
    )  # fmt: skip


def lines_of(record: Record) -> list[str]:
    """Text lines of a record: what flew, its result, and its tables."""
    names, rows = list(record.tables), len(next(iter(record.tables.values()), {}).get("t_s", ()))
    some = f" ({', '.join(names[:5])}{', ...' if len(names) > 5 else ''})" if names else ""
    return [
        f"<Record {what_of(record)}: {headline_of(record) or 'not scored'};",
        f" {len(names)} tables{some}, {rows} rows in the first>",
    ]


def what_of(record: Record) -> str:
    """Title of a record: kind, scenario or log, filter, and duration."""
    facts = record.manifest
    source = facts.get("scenario") or facts.get("log") or facts.get("kind") or "nothing"
    seed = f", seed {facts['seed']} flight {facts.get('flight', 0)}" if "seed" in facts else ""
    cut = (facts.get("parameters") or {}).get("gps_outages_s") or []
    outages = f", GPS cut {len(cut)} time{'s' * (len(cut) != 1)}" if cut else ""
    lasts = f", {float(facts['duration_s']):.1f} s" if facts.get("duration_s") is not None else ""
    parts = mapping(facts.get("parts"))
    named = [(name, parts.get(name)) for name in ("sensors", "vehicle", "controller")]
    own = "".join(f", own {name} {', '.join(one) if isinstance(one, list) else one}" for name, one in named if one)
    return f"{facts.get('kind', '?')} {source}{seed}, filter {facts.get('filter', '?')}{own}{outages}{lasts}"


def headline_of(record: Record) -> str:
    """The score that matters most of this kind of record; "" where it has none."""
    scores = record.manifest.get("scores") or {}
    covered = record.manifest.get("covered_fraction", 1.0)
    thin = f" (the estimate covers {100.0 * covered:.0f} %)" if covered < 0.99 else ""
    touchdown = scores.get("touchdown")
    if thin:
        largest = scores.get("max_position_error_m")
        return (f"largest error of one axis {largest:.3f} m" if largest is not None else "scored in part") + thin
    if touchdown:
        ends = (touchdown.get(name) or {} for name in ("rest", "contact"))
        away = next((end["distance_m"] for end in ends if end.get("distance_m") is not None), None)
        return f"{touchdown['verdict']}" + (f", {away:.3f} m from the pad's centre" if away is not None else "")
    if scores.get("max_position_error_m") is not None:
        return f"largest error of one axis {scores['max_position_error_m']:.3f} m"
    if scores.get("outages"):
        found = [cut["horizontal_rms_m"] for cut in scores["outages"] if cut["horizontal_rms_m"] is not None]
        if found:
            return f"without GPS at most {max(found):.2f} m rms horizontally"
    if scores.get("truth"):
        return f"{scores['truth']['horizontal_rms_m']:.2f} m rms horizontally against {scores['truth']['reference']}"
    if scores.get("velocity_rms_m_s") is not None:
        return f"velocity {scores['velocity_rms_m_s']:.3f} m/s rms against GPS"
    return ""


def html_of(record: Record) -> str:
    """A table of facts and one of the record's tables; every text is escaped."""
    facts: list[tuple[str, Any]] = [("flight", what_of(record)), ("result", headline_of(record) or "not scored")]
    verdict = getattr(record, "verdict", "")
    facts += [("verdict", verdict)] if verdict else []
    facts += [("command", _words(record.manifest["command"]))] if record.manifest.get("command") else []
    head = "".join(
        f"<tr><th>{escape(name)}</th><td colspan='2'>{escape(str(value))}</td></tr>" for name, value in facts
    )
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{len(table.get('t_s', ()))}</td><td>{escape(_columns(table))}</td></tr>"
        for name, table in record.tables.items()
    )
    return f"<table>{head}<tr><th>table</th><th>rows</th><th>columns</th></tr>{rows}</table>"


def _words(command: Any) -> str:
    return " ".join(map(str, command)) if isinstance(command, list | tuple) else str(command)


def _columns(table: dict[str, Any]) -> str:
    names = [name for name in table if name != "t_s"]
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
