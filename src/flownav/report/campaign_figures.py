"""The figures of a campaign's page and of an envelope's, from its summary and its flights' touchdowns."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.core.text import key_words
from flownav.report.chart import drawn
from flownav.report.panels import Panel
from flownav.report.style import COLOUR, FONT, Drawing, axis, drawing, layout

MOST_DOTS = 2500
FAR_M = 2.0  # from here on distances are drawn on a logarithmic axis
SPEED, DIRECTION = "wind.speed_20ft_m_s", "wind.from_direction_deg"
ROLES = ("estimate", "gps", "flow", "autopilot", "alert", "smoothed", "muted", "pad")
CIRCLES = (("r50_m", "R50", "flow"), ("r95_m", "R95", "estimate"), ("r997_m", "R99.7", "alert"))
SCALE = [[0.0, COLOUR["alert"]], [0.8, "#e8b23a"], [0.95, "#a9cf6a"], [1.0, COLOUR["flow"]]]


class Touchdowns(NamedTuple):
    """Where the flights of a cell first touched, north and east of the pad's centre [m], (flights,); infinite: nowhere.

    distance_m: from the pad's centre, infinite of a flight that crashed or did not touch. pad_m: a side of the pad.
    """

    north_m: Array
    east_m: Array
    distance_m: Array
    pad_m: float


def common_reach_m(cells: Sequence[dict[str, Any]], touched: Sequence[Touchdowns]) -> float:
    """How far from the pad's centre the maps of all cells reach, so that they can be compared [m]: a pad at most.

    Of a cell of which no radius is known it is as far as its flights touched.
    """
    radii = [cell["figures"][name]["value"] or 0.0 for cell in cells for name, _, _ in CIRCLES]
    for cell, one in zip(cells, touched, strict=True):
        if cell["figures"]["r95_m"]["value"] is None:
            radii += one.distance_m[np.isfinite(one.distance_m)].tolist()
    return 1.15 * min(max([0.05, *radii]), max((one.pad_m for one in touched), default=1.0))


def over_the_pad(key: str, cell: dict[str, Any], touched: Touchdowns, reach_m: float) -> Panel:
    """Where a cell's flights first touched, with circles that hold 50, 95 and 99.7 % of all."""
    known = np.isfinite(touched.distance_m)
    every = max(1, int(np.ceil(known.sum() / MOST_DOTS)))
    east, north = touched.east_m[known][::every], touched.north_m[known][::every]
    half, turn = 0.5 * touched.pad_m, np.linspace(0.0, 2.0 * np.pi, 181)
    pad = {"type": "rect", "x0": -half, "x1": half, "y0": -half, "y1": half, "layer": "below",
           "fillcolor": COLOUR["padfill"], "line": {"color": COLOUR["pad"], "width": 1}}  # fmt: skip
    dots = {"type": "scatter", "mode": "markers", "name": "first contact", "x": drawn(east), "y": drawn(north),
            "marker": {"color": COLOUR["truth"], "size": 3, "opacity": 0.35}, "hovertemplate": "%{y:.3f} m north, %{x:.3f} m east<extra></extra>"}  # fmt: skip # noqa: E501
    data: list[dict[str, Any]] = [dots]
    for radius, title, role in CIRCLES:
        figure = cell["figures"][radius]
        if figure["value"] is not None:
            for end, style in (("low", "dot"), ("value", "solid"), ("high", "dot")):
                if figure[end] is not None:
                    line = {"color": COLOUR[role], "width": 2 if end == "value" else 1, "dash": style}
                    name = f"{title} {figure['value']:.3f} m"
                    data.append({"type": "scatter", "mode": "lines", "name": name, "showlegend": end == "value",
                                 "legendgroup": title, "x": drawn(figure[end] * np.sin(turn)), "hoverinfo": "skip",
                                 "y": drawn(figure[end] * np.cos(turn)), "line": line})  # fmt: skip
    look = layout(440) | {"shapes": [pad], "hovermode": "closest"}
    look["xaxis"] = axis("east of the pad's centre (m)") | {"range": [-reach_m, reach_m], "constrain": "domain"}
    look["yaxis"] = axis("north (m)") | {"range": [-reach_m, reach_m], "scaleanchor": "x", "scaleratio": 1}
    missing = int((~known).sum())
    words = f"Solid: the radius that holds that share of all {cell['flights']} flights; dotted: its 95 % interval."
    words += f" {missing} that crashed or did not touch count as infinitely far off." if missing else ""
    outside = int((np.maximum(abs(touched.north_m[known]), abs(touched.east_m[known])) > reach_m).sum())
    words += f" {outside} touched outside of this map." if outside else ""
    alt = f"Places of first contact of {cell['label']} about the pad's centre"
    return Panel(key, cell["label"], words, alt, drawing(data, look))


def tails(cells: Sequence[dict[str, Any]], touched: Sequence[Touchdowns]) -> Panel:
    """The share of flights that touched farther off than a distance, on a logarithmic axis."""
    data, farthest = [], 0.05
    for number, (cell, one) in enumerate(zip(cells, touched, strict=True)):
        far = np.sort(one.distance_m)
        beyond = 1.0 - np.arange(1, len(far) + 1) / len(far)
        places = np.geomspace(1, len(far), 300).astype(int)
        kept = np.unique(np.concatenate([places - 1, len(far) - places]))
        kept = kept[np.isfinite(far[kept]) & (beyond[kept] > 0.0)]
        if len(kept):
            farthest = max(farthest, float(far[kept].max()))
            line = {"color": COLOUR[ROLES[number % len(ROLES)]], "width": 1.6, "shape": "hv"}
            mode = "lines" if len(kept) > 2 else "lines+markers"
            data.append({"type": "scatter", "mode": mode, "name": cell["label"], "x": drawn(far[kept]),
                         "y": drawn(100.0 * beyond[kept]), "line": line, "hovertemplate": "%{y:.3g} %"})  # fmt: skip
    look = layout(360)
    look["xaxis"] = axis("distance from the pad's centre (m)")
    look["xaxis"] |= {"type": "log"} if farthest > FAR_M else {"range": [0.0, 1.05 * farthest]}
    look["yaxis"] = axis("flights beyond (%)") | {"type": "log", "dtick": 1}
    words = "The share of all flights that first touched farther off than this, those that crashed among them."
    figure = drawing(data, look)
    return Panel("tails", "Share beyond a distance", words, "Share of flights beyond a distance from the pad", figure)


def convergence(cells: Sequence[dict[str, Any]]) -> Panel | None:
    """How the followed figure and its interval settled as the flights came in."""
    data: list[dict[str, Any]] = []
    lands = any("r95_m" in cell["figures"] for cell in cells)
    for number, cell in enumerate(cells):
        if lands and "r95_m" not in cell["figures"]:
            continue
        steps = [step for step in cell["convergence"] if step["value"] is not None]
        if not steps:
            continue
        colour, flights = COLOUR[ROLES[number % len(ROLES)]], [step["flights"] for step in steps]
        for end in ("low", "high"):
            data.append({"type": "scatter", "mode": "lines", "x": flights, "y": [step[end] for step in steps],
                         "line": {"color": colour, "width": 0.8, "dash": "dot"}, "showlegend": False,
                         "name": cell["label"], "legendgroup": cell["label"], "hoverinfo": "skip"})  # fmt: skip
        data.append({"type": "scatter", "mode": "lines", "x": flights, "y": [step["value"] for step in steps],
                     "line": {"color": colour, "width": 1.8}, "name": cell["label"], "legendgroup": cell["label"],
                     "hovertemplate": "%{y:.3f} m"})  # fmt: skip
    if not data:
        return None
    what = "R95 at contact" if lands else "p95 of the largest error of one axis"
    look = layout(360) | {"xaxis": axis("flights") | {"type": "log", "dtick": 1}}
    look["yaxis"] = axis(f"{what} (m)") | {"rangemode": "tozero"}
    words = "Solid: the figure after each number of flights; dotted: its 95 % interval, not widened for repeated looks."
    alt = f"{what} against the number of flights"
    return Panel("convergence", "How it settled", words, alt, drawing(data, look))


def swept_envelopes(cells: Sequence[dict[str, Any]]) -> list[Panel | None]:
    """Envelopes of a campaign that sweeps the wind's speed and direction: a ring a speed, a sector a direction.

    One for each scenario and truth model.
    """
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for cell in cells:
        if {SPEED, DIRECTION} <= set(cell["values"]) and "r95_m" in cell["figures"]:
            found.setdefault((cell["scenario"], cell["truth_model"]), []).append(cell)
    return [_swept_envelope(f"wind-swept-{k}", " ".join(who), own) for k, (who, own) in enumerate(found.items())]


def _swept_envelope(key: str, label: str, own: list[dict[str, Any]]) -> Panel | None:
    speeds = sorted({cell["values"][SPEED] for cell in own})
    if len(speeds) < 2:
        return None
    between = (0.5 * (slow + fast) for slow, fast in pairwise(speeds))
    edges = [0.0, *between, speeds[-1] + 0.5 * (speeds[-1] - speeds[-2])]
    ring = dict(zip(speeds, pairwise(edges), strict=True))
    bins = []
    for cell in own:
        landed, speed = cell["figures"]["landed"], cell["values"][SPEED]
        inner, outer = ring[speed]
        bins.append({
            "from_m_s": inner, "to_m_s": outer, "flown_m_s": speed, "direction_deg": cell["values"][DIRECTION] % 360.0,
            "landed": landed["value"], "low": landed["low"], "high": landed["high"], "flights": cell["flights"],
        })  # fmt: skip
    return envelope(key, {"label": label, "envelope": bins})


def envelope(key: str, cell: dict[str, Any]) -> Panel | None:
    """The share that landed by the wind's speed and the direction that it blew from."""
    if not cell["envelope"]:
        return None
    rings = sorted({one["from_m_s"] for one in cell["envelope"]})
    directions = sorted({one["direction_deg"] for one in cell["envelope"]})
    steps = np.diff([*directions, directions[0] + 360.0])
    data = []
    for ring in rings:
        own = [one for one in cell["envelope"] if one["from_m_s"] == ring and one["landed"] is not None]
        theta, ends = [one["direction_deg"] for one in own], [one["to_m_s"] for one in own]
        labels, share = [_wind_words(one) for one in own], [one["landed"] for one in own]
        data.append(_ring(ring, ends, theta, float(steps.min()), share, labels))
    quiet = {"gridcolor": COLOUR["grid"], "tickfont": {"color": COLOUR["muted"]}, "linecolor": COLOUR["rule"]}
    low = min((one["landed"] for one in cell["envelope"] if one["landed"] is not None), default=0.0)
    look = (
        layout(420)
        | {
            "hovermode": "closest",
            "coloraxis": {"colorscale": SCALE, "cmin": min(low, 0.9), "cmax": 1.0,
                          "colorbar": {"title": {"text": "landed"}, "tickformat": ".0%", "thickness": 12}},
            "polar": {"bgcolor": "rgba(0,0,0,0)",
                      "angularaxis": {"rotation": 90, "direction": "clockwise", "ticksuffix": "°", **quiet},
                      "radialaxis": {"ticksuffix": " m/s", "angle": 90, "nticks": 4, **quiet}},
        }
    )  # fmt: skip
    words = "Share that landed, by the wind at 20 ft and where it blew from (north is up)."
    return Panel(key, cell["label"], words, f"Share landed by the wind of {cell['label']}", drawing(data, look))


def sensitivity(key: str, cell: dict[str, Any]) -> Panel | None:
    """Which of the drawn inputs go with a touchdown far off: rank correlations with their intervals."""
    known_rows = cell["sensitivity"][::-1]
    if not known_rows:
        return None
    values = [one["rank_correlation"] for one in known_rows]
    sure = [one["low"] > 0.0 or one["high"] < 0.0 for one in known_rows]
    bars = {
        "type": "bar", "orientation": "h", "x": values, "showlegend": False,
        "y": [key_words(one["input"]) for one in known_rows],
        "marker": {"color": [COLOUR["estimate"] if each else COLOUR["pad"] for each in sure]},
        "error_x": {"type": "data", "symmetric": False, "color": COLOUR["muted"], "thickness": 1, "width": 3,
                    "array": [one["high"] - one["rank_correlation"] for one in known_rows],
                    "arrayminus": [one["rank_correlation"] - one["low"] for one in known_rows]},
        "hovertemplate": "%{x:.2f}<extra></extra>",
    }  # fmt: skip
    look = layout(90 + 26 * len(known_rows)) | {"hovermode": "closest"}
    look["xaxis"] = axis("correlation") | {"tickangle": 0, "nticks": 4}  # a phone has room for no more
    look["yaxis"] = axis() | {"automargin": True, "nticks": len(known_rows)}
    words = (
        "The twelve strongest of Spearman's rank correlations with how far off it touched, with 95 % intervals; grey: "
        "it may be nothing."
    )
    return Panel(
        key, cell["label"], words, f"Rank correlations of the inputs of {cell['label']}", drawing([bars], look)
    )


def swept_numbers(cells: Sequence[dict[str, Any]]) -> list[str]:
    """The names that are swept over at least three numbers."""
    names = dict.fromkeys(name for cell in cells for name in cell["values"])
    numbers = {name: {value for cell in cells if isinstance(value := cell["values"][name], float)} for name in names}
    return [name for name, values in numbers.items() if len(values) >= 3]


def over_a_sweep(cells: Sequence[dict[str, Any]], name: str) -> Panel:
    """A figure over a swept number, one line for what else differs."""
    lands = any("r95_m" in cell["figures"] for cell in cells)
    what, words = ("landed", "share that landed (%)") if lands else ("p95_axis_m", "p95 of one axis (m)")
    lines: dict[str, list[dict[str, Any]]] = {}
    for cell in cells:
        rest = [f"{key}={value:g}" if isinstance(value, float) else f"{key}={value}"
                for key, value in cell["values"].items() if key != name]  # fmt: skip
        lines.setdefault(" ".join([cell["scenario"], *rest, cell["truth_model"]]), []).append(cell)
    data, times = [], 100.0 if lands else 1.0
    for number, (label, own) in enumerate(lines.items()):
        known = [(cell["values"][name], cell["figures"].get(what)) for cell in own]
        known_rows = [(value, figure) for value, figure in known if figure and figure["value"] is not None]
        colour = COLOUR[ROLES[number % len(ROLES)]]
        ends = {side: [times * abs((f["value"] if f[end] is None else f[end]) - f["value"]) for _, f in known_rows]
                for side, end in (("array", "high"), ("arrayminus", "low"))}  # fmt: skip
        data.append({"type": "scatter", "mode": "lines+markers", "name": label, "x": [x for x, _ in known_rows],
                     "y": [times * f["value"] for _, f in known_rows], "line": {"color": colour, "width": 1.6},
                     "error_y": {"type": "data", "symmetric": False, "color": colour, "thickness": 1, **ends},
                     })  # fmt: skip
    look = layout(360)
    look["xaxis"], look["yaxis"] = axis(key_words(name)), axis(words)
    key = f"sweep-{name.replace('.', '-')}"
    over = key_words(name)
    return Panel(key, over, "Bars: 95 % intervals.", f"{words} over {over}", drawing(data, look), wide=True)


def _ring(
    inner: float, outer: Sequence[float], theta: Sequence[float], width: float, share: Sequence[float],
    words: Sequence[str],
) -> dict[str, Any]:  # fmt: skip
    """Sectors between two radii, coloured by the share that landed."""
    line = {"color": COLOUR["surface"], "width": 1}
    return {
        "type": "barpolar", "base": [inner] * len(theta), "r": [end - inner for end in outer], "theta": theta,
        "width": [width] * len(theta), "marker": {"color": share, "coloraxis": "coloraxis", "line": line},
        "hovertext": words, "hoverinfo": "text", "showlegend": False,
    }  # fmt: skip


def _wind_words(one: dict[str, Any]) -> str:
    speed = f"{one['flown_m_s']:g}" if "flown_m_s" in one else f"{one['from_m_s']:.1f} to {one['to_m_s']:.1f}"
    return (
        f"{speed} m/s from about {one['direction_deg']:g}°<br>"
        f"landed {100 * one['landed']:.1f} % ({100 * one['low']:.1f} to {100 * one['high']:.1f} %) of {one['flights']}"
    )


def envelope_figure(title: str, rows: Sequence[dict[str, Any]]) -> Drawing:
    """A ring for each speed, a sector for each direction that the wind blows from; north is up."""
    speeds = sorted({row["speed_20ft_m_s"] for row in rows})
    directions = sorted({row["from_direction_deg"] for row in rows})
    data, inner = [], 0.0
    for speed in speeds:
        ring = [row for row in rows if row["speed_20ft_m_s"] == speed]
        theta, share = [row["from_direction_deg"] for row in ring], [row["success"]["rate"] for row in ring]
        width, labels = 360.0 / len(directions), [_words(row) for row in ring]
        data.append(_ring(inner, [speed] * len(ring), theta, width, share, labels))
        inner = speed
    quiet = {"gridcolor": "white", "linecolor": "white", "ticks": ""}
    look = {
        "title": {"text": title, "x": 0.05},
        "font": {"family": FONT, "color": COLOUR["ink"]},
        "coloraxis": {"colorscale": SCALE, "cmin": 0.0, "cmax": 1.0,
                      "colorbar": {"title": {"text": "landed"}, "tickformat": ".0%", "outlinewidth": 0, "ticks": ""}},
        "polar": {"bgcolor": "#E5ECF6",
                  "angularaxis": {"rotation": 90, "direction": "clockwise", "ticksuffix": "°", **quiet},
                  "radialaxis": {"ticksuffix": " m/s", "angle": 90, **quiet}},
    }  # fmt: skip
    return drawing(data, look)


def _words(row: dict[str, Any]) -> str:
    rate, rest = row["success"], row["rest"]["r95_m"]
    return (
        f"{row['speed_20ft_m_s']:g} m/s from {row['from_direction_deg']:g}°<br>landed {100.0 * rate['rate']:.1f} % "
        f"(95 % interval {100.0 * rate['low']:.1f}..{100.0 * rate['high']:.1f} %)<br>crashed {row['crashed']}<br>"
        f"R95 at rest {'-' if rest is None else f'{rest:.3f} m'}"
    )
