"""The figures of a certificate: touchdowns, the tail of each measure, the envelope, inputs ranked, the split."""

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.core.text import key_words
from flownav.report.campaign_figures import DIRECTION, SPEED
from flownav.report.chart import drawn
from flownav.report.panels import Panel
from flownav.report.style import COLOUR, Drawing, axis, drawing, layout

KNOWN_WORDS = {
    "build": "known once built",
    "day": "known on the day",
    "never": "never known",
}
MOST_DOTS = 4000
MOST_BARS = 12
LINE_LETTERS = 42  # of an axis's title: a longer one would be cut off on a phone
LEAST_JOINT_INDEX = 2.0  # sum of total indices, beyond which inputs act mostly together
# what a field of the envelope is: its words, its colour's role, and which fields are so
FIELDS = (
    ("pass", "flow", lambda field: field["verdict"] == "pass"),
    ("not shown, no failure", "estimate", lambda field: field["verdict"] == "not shown" and field["failures"] == 0),
    ("not shown, with failures", "gps", lambda field: field["verdict"] == "not shown" and field["failures"] > 0),
    ("fail", "alert", lambda field: field["verdict"] == "fail"),
)


def touchdowns(facts: Mapping[str, Any], shown: Mapping[str, Any]) -> Panel:
    """Where the flights touched, about the pad's centre, with the circles that hold half and most of them."""
    key, title = "touchdowns", "Touchdowns"
    if not shown["places"]:
        return Panel(key, title, absent="The requirement is not of touchdowns.")
    north, east, bad = shown["north_m"], shown["east_m"], shown["failed"]
    touched = np.isfinite(north) & np.isfinite(east)
    data: list[dict[str, Any]] = []
    for name, radius, role, dash in _circles(facts, shown):
        turn = np.linspace(0.0, 2.0 * np.pi, 121)
        line = {"color": COLOUR[role], "width": 1.6, "dash": dash}
        data.append({"type": "scatter", "x": drawn(radius * np.sin(turn)), "y": drawn(radius * np.cos(turn)),
                     "mode": "lines", "name": name, "hoverinfo": "skip", "line": line})  # fmt: skip
    for name, role, symbol, size, which in (
        ("met", "estimate", "circle", 4, touched & ~bad), ("not met", "alert", "x", 7, touched & bad),
    ):  # fmt: skip
        place = np.flatnonzero(which)
        place = place[:: -(-len(place) // MOST_DOTS)] if role == "estimate" and len(place) else place
        if len(place):
            marker = {"color": COLOUR[role], "size": size, "symbol": symbol, "opacity": 0.6}
            data.append({"type": "scatter", "x": drawn(east[place]), "y": drawn(north[place]), "mode": "markers",
                         "name": name, "hovertemplate": "north %{y:.3f} m, east %{x:.3f} m<extra></extra>",
                         "marker": marker})  # fmt: skip
    away = np.hypot(north[touched], east[touched])
    far = 1.15 * _far(away, [radius for _, radius, _, _ in _circles(facts, shown)])
    north_axis = axis("north (m)") | {"scaleanchor": "x", "scaleratio": 1, "range": [-far, far]}
    east_axis = axis("east (m)") | {"range": [-far, far], "constrain": "domain"}
    look = layout(460) | {"xaxis": east_axis, "yaxis": north_axis, "hovermode": "closest"}
    without, beyond = int((~touched).sum()), int((away > far).sum())
    caption = f"{'At rest' if shown['of'] == 'rest' else 'First contact'}, about the pad's centre."
    caption += f" Without a touchdown that counts: {without} of {len(north)} flights." if without else ""
    caption += f" {beyond} of {len(north)} flights touched beyond the picture's edge." if beyond else ""
    alt = f"Scatter of {int(touched.sum())} touchdowns about the pad's centre; {int(bad.sum())} flights do not meet it."
    return Panel(key, title, caption, alt, drawing(data, look))


def _far(figures: Array, marks: Sequence[float]) -> float:
    """How far a picture reaches: all that is marked and 99 of 100 figures, but not to single ones far off."""
    usual = float(np.quantile(figures, 0.99)) if len(figures) else 0.0
    most = 4.0 * max(marks, default=usual)
    return max(min(usual, most), *marks, 1e-6)


def _circles(facts: Mapping[str, Any], shown: Mapping[str, Any]) -> list[tuple[str, float, str, str]]:
    """Circles about the pad's centre: name, radius [m], colour's role, dash."""
    away = np.sort(np.where(np.isfinite(shown["north_m"]), np.hypot(shown["north_m"], shown["east_m"]), np.inf))
    found = []
    for share, name, dash in ((0.5, "R50", "dot"), (0.95, "R95", "dash")):
        radius = float(away[max(int(np.ceil(share * len(away))) - 1, 0)])
        if np.isfinite(radius):
            found.append((f"{name} {radius:.3f} m", radius, "muted", dash))
    for one in facts["requirement"]["requirements"]:
        if one["measure"] in ("touchdown.horizontal_m", "touchdown.rest_m") and "at_most" in one:
            return [*found, (f"limit {one['at_most']:g} m", one["at_most"], "alert", "solid")]
    return found


def tail(one: Mapping[str, Any], figures: Array) -> Panel:
    """How often a measure is exceeded, on a logarithmic scale, beside its limit and the share that may exceed it."""
    key, title = f"tail-{one['measure'].replace('.', '-')}", f"How often is it exceeded: {one['words']}"
    upper = "at_most" in one
    if not upper:
        title = f"How often is it not reached: {one['words']}"
    limit, bound = one["at_most" if upper else "at_least"], one["tolerance_bound"]
    finite = np.sort(figures[np.isfinite(figures)])
    if len(np.unique(finite)) < 3:
        return Panel(key, title, absent=f"{one['measure']} is yes or no: there is no distribution to draw.")
    count = len(figures)
    beyond = (count - 1 - np.arange(len(finite))) / count if upper else np.arange(len(finite)) / count
    kept = np.unique(np.round(np.concatenate([np.linspace(0, len(finite) - 1, 400), _last(finite, upper)])).astype(int))
    x, y = finite[kept], np.maximum(beyond[kept], 0.3 / count)
    data: list[dict[str, Any]] = []
    data.append({"type": "scatter", "x": drawn(x), "y": drawn(y), "mode": "lines", "name": "flights",
                 "line": {"color": COLOUR["estimate"], "width": 1.8},
                 "hovertemplate": "%{x:.3f} " + one["unit"] + ": %{y:.2%} beyond<extra></extra>"})  # fmt: skip
    ends_x = [min(float(x[0]), limit), max(float(x[-1]), limit)]
    lines = [(f"limit {limit:g} {one['unit']}".rstrip(), "alert", [limit, limit], [0.3 / count, 1.0], "solid"),
             (f"may be beyond: {100 * (1 - one['probability']):.3g} %", "muted", ends_x,
              [1.0 - one["probability"]] * 2, "dash")]  # fmt: skip
    if bound is not None:
        lines.append(
            (f"tolerance bound {bound:.3f} {one['unit']}".rstrip(), "flow", [bound, bound], [0.3 / count, 1.0], "dot")
        )
    for name, role, at_x, at_y, dash in lines:
        data.append({"type": "scatter", "x": at_x, "y": at_y, "mode": "lines", "name": name, "hoverinfo": "skip",
                     "line": {"color": COLOUR[role], "width": 1.5, "dash": dash}})  # fmt: skip
    scale = axis("share of flights beyond") | {"type": "log", "tickformat": "~p", "dtick": 1, "nticks": 0}
    across = axis("<br>".join(wrap(one["words"] + (f" ({one['unit']})" if one["unit"] else ""), LINE_LETTERS)))
    if float(finite.min()) >= 0.0:
        across["range"] = [0.0, 1.1 * _far(finite, [limit] if bound is None else [limit, bound])]
    look = layout(430) | {"xaxis": across, "yaxis": scale, "hovermode": "closest"}
    caption = "The curve must pass below the corner of the two lines; the tolerance bound is where it surely does."
    infinite = int((~np.isfinite(figures)).sum())
    caption += f" Flights without a figure, which count as beyond all: {infinite}." if infinite else ""
    alt = f"Share of flights in which it is beyond a value: {one['words']}."
    return Panel(key, title, caption, alt, drawing(data, look))


def _last(finite: Array, upper: bool) -> NDArray[np.int64]:
    """The places of the outermost flights, which are all drawn."""
    last = np.arange(min(200, len(finite)))
    return len(finite) - 1 - last if upper else last


def envelope(facts: Mapping[str, Any]) -> Panel:
    """Where in the conditions the requirement is shown."""
    found = facts["envelope"]
    axes, fields = found["axes"], found["bins"]
    key, title = "envelope", "Envelope of passing conditions"
    if not fields:
        return Panel(
            key, title, absent="Nothing in the conditions has a range: the statement holds for the cells below."
        )
    data: list[dict[str, Any]] = []
    polar = axes == [SPEED, DIRECTION]
    for words, role, test in FIELDS:
        inside = [field for field in fields if field["flights"] and test(field)]
        data.append(_fields(axes, inside, words, COLOUR[role], polar))
    look = layout(470)
    if polar:
        look["polar"] = {
            "bgcolor": "rgba(0,0,0,0)",
            "angularaxis": {"rotation": 90, "direction": "clockwise", "ticksuffix": "°", "gridcolor": COLOUR["rule"],
                            "linecolor": COLOUR["rule"], "tickfont": {"color": COLOUR["muted"]}},
            "radialaxis": {"ticksuffix": " m/s", "angle": 45, "tickangle": 45, "gridcolor": COLOUR["rule"],
                           "linecolor": COLOUR["ink"], "nticks": 5, "tickfont": {"color": COLOUR["ink"], "size": 11}},
        }  # fmt: skip
    elif len(axes) == 2:
        look |= {"xaxis": axis(key_words(axes[0])), "yaxis": axis(key_words(axes[1]))}
    else:
        look |= {"xaxis": axis(key_words(axes[0])),
                 "yaxis": axis("share of flights that meet it") | {"tickformat": ".1%"}}  # fmt: skip
    look |= {"barmode": "overlay", "hovermode": "closest"}
    smallest = min(field["flights"] for field in fields)
    need = found["flights_needed_in_a_field"]
    caption = (
        "Each field is judged by its own flights, at the same probability and confidence: it may be wrong as often."
    )
    if smallest < need:
        caption += f" A field alone needs {need} flights to pass; the emptiest has {smallest}."
    caption += " Direction is where the wind blows from." if polar else ""
    alt = f"Verdicts of {len(fields)} fields over {' and '.join(map(key_words, axes))}."
    return Panel(key, title, caption, alt, drawing(data, look), wide=True)


def _fields(
    axes: Sequence[str], fields: Sequence[Mapping[str, Any]], words: str, colour: str, polar: bool
) -> dict[str, Any]:
    """The fields of one kind as bars that stand on their lower edge."""
    marker = {"color": colour, "opacity": 0.7, "line": {"color": COLOUR["surface"], "width": 1.5}}
    labels = [_field_words(axes, field) for field in fields]
    shared = {"name": words, "hovertext": labels, "hoverinfo": "text", "marker": marker}
    if polar:
        low, turn = [np.array([field[name] for field in fields]).reshape(-1, 2) for name in axes]
        return shared | {"type": "barpolar", "base": low[:, 0].tolist(), "r": np.diff(low).ravel().tolist(),
                         "theta": turn.mean(axis=1).tolist(), "width": np.diff(turn).ravel().tolist()}  # fmt: skip
    first = np.array([field[axes[0]] for field in fields]).reshape(-1, 2)
    across: dict[str, Any] = {"x": first.mean(axis=1).tolist(), "width": np.diff(first).ravel().tolist()}
    if len(axes) == 2:
        second = np.array([field[axes[1]] for field in fields]).reshape(-1, 2)
        across |= {"base": second[:, 0].tolist(), "y": np.diff(second).ravel().tolist()}
    else:
        share = np.array([field["share"] for field in fields])
        low, high = (np.array([field[name] for field in fields]) for name in ("low", "high"))
        bars = {"type": "data", "symmetric": False, "array": (high - share).tolist(),
                "arrayminus": (share - low).tolist(), "color": COLOUR["ink"], "thickness": 1}  # fmt: skip
        across |= {"y": share.tolist(), "error_y": bars}
    return shared | {"type": "bar", **across}


def _field_words(axes: Sequence[str], field: Mapping[str, Any]) -> str:
    where = [f"{key_words(name)}: {field[name][0]:.3g} to {field[name][1]:.3g}" for name in axes]
    return "<br>".join([
        *where,
        f"{field['failures']} of {field['flights']} flights fail: {field['verdict']}",
        f"share that meets it {100 * field['low']:.1f} to {100 * field['high']:.1f} %",
    ])  # fmt: skip


def ranking(facts: Mapping[str, Any]) -> list[Panel]:
    """Inputs by what they do to the outcome, and the split of uncertainty."""
    key, title = "ranking", "Inputs ranked by what they do to the outcome"
    if not facts["ranking"]:
        return [Panel(key, title, absent="No ranking was flown (--ranking 0).")]
    if facts["ranking_of"] == "nothing":
        words = (
            f"All {facts['ranking_flights']} flights of the ranking have the same outcome: there is nothing to rank."
        )
        return [Panel(key, title, absent=words)]
    of = "the ranks of " if facts["ranking_of"] == "ranks" else ""
    where = "" if facts["ranking_cell"] == "all flights" else f" in the worst cell ({facts['ranking_cell']})"
    caption = (
        f"Sobol indices of {of}{facts['ranking_measure']}{where}, {facts['ranking_flights']} flights, 90 % intervals. "
        "First: what knowing the input alone would take away; total: what stays while it alone is unknown."
    )
    caption += " Ranks, since figures that are infinite or far off would decide alone." if of else ""
    if sum(row["total"] for row in facts["ranking"]) > LEAST_JOINT_INDEX:
        caption += (
            " The totals add up to far more than 1: inputs act together, and with the noise, which acts otherwise after"
            " a small change of any. Then the first indices show what helps."
        )
    bars = [dict(row) | {"name": _broken(row["input"])} for row in facts["ranking"][:MOST_BARS]]
    split = [dict(row) | {"name": KNOWN_WORDS[row["known"]]} for row in facts["split"]]
    alt = f"Bars of {len(bars)} inputs, the first being {bars[0]['name']}."
    sentence = "The same of all inputs that could be known together, and of those that nobody can know, noise included."
    return [
        Panel(key, title, caption, alt, _bars(bars, 90 + 34 * len(bars)), wide=True),
        Panel("split", "Uncertainty by who could know it", sentence, "Bars of three classes of inputs.",
              _bars(split, 90 + 46 * len(split)), wide=True),
    ]  # fmt: skip


def _broken(name: str) -> str:
    """A key in words, a long one on two lines."""
    words = key_words(name)
    front, colon, last = words.partition(": ")
    return f"{front}:<br>{last}" if colon and len(words) > 22 else words


def _bars(rows: Sequence[Mapping[str, Any]], height_px: int) -> Drawing:
    """Total and first index of each row as horizontal bars with intervals, the largest on top."""
    data: list[dict[str, Any]] = []
    for which, role in (("first", "estimate"), ("total", "pad")):
        value = np.clip([row[which] for row in rows], 0.0, 1.0)  # an index is a share; estimates scatter beyond
        low, high = np.clip(np.array([row[f"{which}_interval"] for row in rows]).T, 0.0, 1.0)
        bars = {"type": "data", "symmetric": False, "array": np.maximum(high - value, 0.0).tolist(),
                "arrayminus": np.maximum(value - low, 0.0).tolist(), "color": COLOUR["ink"],
                "thickness": 1, "width": 3}  # fmt: skip
        data.append({"type": "bar", "x": value.tolist(), "y": [row["name"] for row in rows], "orientation": "h",
                     "name": which, "marker": {"color": COLOUR[role]}, "error_x": bars,
                     "hovertemplate": "%{y}: " + which + " %{x:.3f}<extra></extra>"})  # fmt: skip
    look = layout(height_px) | {"barmode": "group", "bargap": 0.35, "bargroupgap": 0.08, "hovermode": "closest"}
    look["xaxis"] = axis("share of the<br>outcome's variance") | {"rangemode": "tozero"}
    look["yaxis"] = axis() | {"autorange": "reversed", "automargin": True, "nticks": 0, "ticks": ""}
    return drawing(data, look)
