"""The envelope as one HTML page: a polar map of the share of flights that landed, by the wind."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flownav.core import guard
from flownav.report.style import COLOUR, FONT

SCALE = [[0.0, COLOUR["alert"]], [0.8, "#e8b23a"], [0.95, "#a9cf6a"], [1.0, COLOUR["flow"]]]


def write_envelope(title: str, rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Write the page, whole or not at all; rows as `flownav envelope --json` has them. OSError where it cannot be."""
    page = envelope_figure(title, rows).to_html(include_plotlyjs=True, full_html=True)
    guard.write_page(page, path)


def envelope_figure(title: str, rows: Sequence[dict[str, Any]]) -> Any:
    """A ring for each speed, a sector for each direction that the wind blows from; north is up."""
    from plotly.graph_objects import Barpolar, Figure

    speeds = sorted({row["speed_20ft_m_s"] for row in rows})
    directions = sorted({row["from_direction_deg"] for row in rows})
    figure = Figure()
    inner = 0.0
    for speed in speeds:
        ring = [row for row in rows if row["speed_20ft_m_s"] == speed]
        figure.add_trace(
            Barpolar(
                base=[inner] * len(ring),
                r=[speed - inner] * len(ring),
                theta=[row["from_direction_deg"] for row in ring],
                width=[360.0 / len(directions)] * len(ring),
                marker={"color": [row["success"]["rate"] for row in ring], "coloraxis": "coloraxis",
                        "line": {"color": COLOUR["surface"], "width": 1}},
                hovertext=[_words(row) for row in ring],
                hoverinfo="text",
                showlegend=False,
            )
        )  # fmt: skip
        inner = speed
    figure.update_layout(
        title={"text": title},
        font={"family": FONT, "color": COLOUR["ink"]},
        coloraxis={"colorscale": SCALE, "cmin": 0.0, "cmax": 1.0,
                   "colorbar": {"title": {"text": "landed"}, "tickformat": ".0%"}},
        polar={"angularaxis": {"rotation": 90, "direction": "clockwise", "ticksuffix": "°"},
               "radialaxis": {"ticksuffix": " m/s", "angle": 90}},
    )  # fmt: skip
    return figure


def _words(row: dict[str, Any]) -> str:
    rate, rest = row["success"], row["rest"]["r95_m"]
    return (
        f"{row['speed_20ft_m_s']:g} m/s from {row['from_direction_deg']:g}°<br>landed {100.0 * rate['rate']:.1f} % "
        f"(95 % interval {100.0 * rate['low']:.1f}..{100.0 * rate['high']:.1f} %)<br>crashed {row['crashed']}<br>"
        f"R95 at rest {'-' if rest is None else f'{rest:.3f} m'}"
    )
