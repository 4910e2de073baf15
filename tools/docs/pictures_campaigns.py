"""Pictures of many flights: touchdowns, what a requirement needs, how rare an error is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from drawing import COLOURS, axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import flownav

FLIGHTS = 256
ENVELOPE = Path(__file__).parents[2] / "docs" / "explanation" / "control.md"  # `make envelope` writes the table into it
ENVELOPE_BEGIN, ENVELOPE_END = "<!-- make envelope: begin -->", "<!-- make envelope: end -->"


def touchdowns() -> Figure:
    """Where 256 dispersed approaches come to rest about the pad's centre, with R50 and R95."""
    result = flownav.campaign("approach", flights=FLIGHTS)
    flights = result.to_pandas()
    east, north = flights["touchdown.rest.east_m"], flights["touchdown.rest.north_m"]
    figure, axis = axes(height=4.2)
    axis.scatter(east, north, s=10)
    for name, style in (("r50_m", "--"), ("r95_m", "-")):
        radius = result.figure(name)["value"]
        axis.add_patch(
            Circle(
                (0, 0),
                radius,
                fill=False,
                linestyle=style,
                color=COLOURS[1],
                label=f"{name[:3].upper()} {radius:.3f} m",
            )
        )
    reach = 1.3 * result.figure("r95_m")["value"]
    axis.set(
        xlabel="east of the pad's centre [m]",
        ylabel="north [m]",
        aspect="equal",
        xlim=(-reach, reach),
        ylim=(-reach, reach),
    )
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def flights_needed() -> Figure:
    """How many flights a requirement needs at 90 % confidence, by the share that must succeed and the failures."""
    from flownav.campaigns.tolerance import needed

    shares = 1 - np.logspace(-1, -4, 60)
    figure, axis = axes()
    for failures in (0, 1, 2):
        axis.plot(1 - shares, [needed(float(share), 0.90, failures) for share in shares], label=f"{failures} failures")
    axis.set(xscale="log", yscale="log", xlabel="share that may fail", ylabel="flights needed")
    axis.invert_xaxis()
    axis.legend()
    return figure


def tail() -> Figure:
    """Share of 1000 dispersed landings whose largest position error of one axis is beyond a figure."""
    flights = flownav.campaign("landing", flights=1000).to_pandas()
    figure, axis = axes()
    for column, label in (
        ("max_position_error_m", "largest error of one axis"),
        ("touchdown.rest.distance_m", "distance from the pad at rest"),
    ):
        values = np.sort(flights[column].to_numpy(dtype=float))
        axis.step(values, 1 - np.arange(len(values)) / len(values), where="post", label=label)
    axis.set(yscale="log", xscale="log", xlabel="metres", ylabel="share of flights beyond it")
    axis.legend()
    return figure


def envelope() -> Figure:
    """How surely flights land, crash and how near they come to rest, by the wind at 20 ft, and the wind stated."""
    table = envelope_of(ENVELOPE.read_text(encoding="utf-8"))
    stated = flownav.Vehicle.load().file.wind.max_speed_20ft_m_s
    figure, (shares, near) = axes(1, 2, 3.0)
    for colour, (case, rows) in zip(COLOURS, table.items(), strict=False):
        speed, landed, crashed, r95 = np.array(rows).T
        shares.plot(speed, landed, "o-", markersize=3, color=colour, label=f"{case}: landed")
        shares.plot(speed, crashed, "x:", markersize=4, color=colour, label="crashed")
        near.plot(speed, r95, "o-", markersize=3, color=colour, label=case)
    for axis in (shares, near):
        axis.axvline(stated, color="#6b7280", linestyle="--", linewidth=1.0, label="stated limit")
    shares.set(xlabel="wind at 20 ft [m/s]", ylabel="share of flights [%]", ylim=(-3, 103))
    near.set(xlabel="wind at 20 ft [m/s]", ylabel="R95 at rest [m]", ylim=(0, None))
    shares.legend(loc="center left")
    near.legend()
    return figure


def envelope_of(page: str) -> dict[str, list[tuple[float, float, float, float]]]:
    """The page's table by case: wind at 20 ft [m/s], landed and crashed [%], R95 at rest [m] (NaN: too few land).

    ValueError where the page has none.
    """
    found: dict[str, list[tuple[float, float, float, float]]] = {}
    for line in page.partition(ENVELOPE_BEGIN)[2].partition(ENVELOPE_END)[0].splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[0].startswith("`"):
            r95 = cells[4].partition(" ")[0]
            row = (*map(float, cells[1:4]), np.nan if r95 == "none" else float(r95))
            found.setdefault(cells[0].strip("`"), []).append(row)
    if not found:
        raise ValueError(f"no table after {ENVELOPE_BEGIN}; `make envelope` writes it")
    return found
