"""Figures 17 to 31: the report's own panels of the median take-off and landing, under the paper's numbers."""

from __future__ import annotations

from dataclasses import replace

from flownav.paper.flights import Flights
from flownav.paper.lift_off import LiftOff
from flownav.report import figures_errors, figures_filter, figures_states
from flownav.report.figures_states import View
from flownav.report.panels import Panel
from flownav.report.series import moments
from flownav.scoring.percentiles import spread

ZOOM_S = (10.0, 20.0)
# of each table: figures of position, velocity, velocity zoomed, position error, velocity error
FIGURES = {5: ("17", "Figure 18: velocity", "19 to 21", "26", "27"), 6: ("22", "Velocity", "23 to 25", "29", "30")}


def panels(flights: Flights) -> list[Panel]:
    """Everything the paper draws of a flight."""
    record, name = flights.record, flights.scenario
    what = {"takeoff": "take-off"}.get(name, name)
    position, velocity, zoomed, position_error, velocity_error = FIGURES[flights.table]
    errors = (
        ("position", position_error, figures_errors.position_error(record)),
        ("velocity", velocity_error, figures_errors.velocity_error(record)),
    )
    found = [
        figures_states.position(record, View(f"{name}-position", f"Figure {position}: position, {what}")),
        figures_states.velocity(record, View(f"{name}-velocity", f"{velocity}, {what}")),
        figures_states.velocity(record, View(f"{name}-zoom", f"Figures {zoomed}: velocity from 10 to 20 s", ZOOM_S)),
        *(
            replace(panel, key=f"{name}-{quantity}-error", title=f"Figure {number}: {quantity} error, {what}")
            for quantity, number, panel in errors
        ),
    ]
    lift_off = next((moment for moment in moments(record) if moment.name == "lift-off"), None)
    if flights.table == 5 and lift_off is not None:
        transient = figures_errors.lift_off_transient(record, lift_off)
        title = "Figure 28: thrust and vertical velocity at lift-off"
        found.append(replace(transient, key="figure-28", title=title, caption=lift_off_caption(flights.lift_off)))
    if flights.table == 6:
        radius = figures_filter.radius_of_uncertainty(record)
        found.append(replace(radius, key="figure-31", title="Figure 31: reduction of the radius of uncertainty"))
    return found


def lift_off_caption(of: LiftOff | None) -> str:
    """Where the transient comes from: the paper says the sensor's shake."""
    if of is None:
        return "The error in w about lift-off."
    shaken, unshaken, share = (spread(of_all) for of_all in (of.shaken_m_s, of.unshaken_m_s, of.frozen_inflow_share))
    if shaken is None or unshaken is None or share is None:
        return "The error in w about lift-off."
    return (
        f"The largest error in w about lift-off is {shaken['median']:.3f} m/s, median of {len(of.shaken_m_s)} "
        f"take-offs, and {unshaken['median']:.3f} m/s in the same flights with a sensor that does not shake: "
        f"{100.0 * share['median']:.0f} % of the transient ({100.0 * share['p05']:.0f} to {100.0 * share['p95']:.0f} % "
        "from flight to flight) is the filter's own model, whose printed B_red keeps the inflow frozen, not the shake "
        "that the paper explains it by. Single flights differ, since the shake may add to the transient or take from "
        "it; the two sizes depend on how the collective moves at lift-off, so on the autopilot's gains and path."
    )
