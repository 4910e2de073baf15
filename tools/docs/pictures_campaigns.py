"""Pictures of many flights: touchdowns, what a requirement needs, how rare an error is."""

from __future__ import annotations

import numpy as np
from drawing import COLOURS, axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import flownav

FLIGHTS = 256


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
