"""A scenario flown from another height: its path stretched, its speeds kept."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from flownav.core.errors import InputError
from flownav.core.parameter_files import check
from flownav.simulation.scenario import Scenario


def from_height(scenario: Scenario, height_m: float) -> Scenario:
    """The scenario with the greatest height of its path put at height_m (of the skids).

    Every way up to that height or down from it is flown as fast as before, so that it takes longer or less long; what
    comes later, the flight's end, the instant from which it may land and events move along. InputError where the height
    is not above the path's other knots, or the scenario cannot be flown from there.
    """
    knots = scenario.flight.path
    top = max(float(knot.height_m) for knot in knots)
    others = [float(knot.height_m) for knot in knots if knot.height_m < top]
    next_m = max([0.0, *others])
    if not height_m > next_m:
        raise InputError(f"{scenario.name}: height_m {height_m:g}: must lie above the path's next height, {next_m:g} m")
    ends, delays = [], []  # of each stretched way: when it ended, and by how much later it ends now
    for here, following in pairwise(knots):
        rise, fall = here.height_m < top <= following.height_m, following.height_m < top <= here.height_m
        low = float(min(here.height_m, following.height_m))
        if rise or fall:
            ends.append(float(following.t_s))
            delays.append(float(following.t_s - here.t_s) * (height_m - top) / (top - low))
    entries: dict[str, Any] = scenario.model_dump(exclude_unset=True)

    def later(t_s: float) -> float:
        return t_s + sum(delay for end, delay in zip(ends, delays, strict=True) if end <= t_s)

    flight = entries["flight"]
    flight["path"] = [
        knot | {"t_s": later(knot["t_s"]), "height_m": height_m if knot["height_m"] == top else knot["height_m"]}
        for knot in flight["path"]
    ]
    flight["duration_s"] = float(scenario.flight.duration_s) + sum(delays)
    if scenario.flight.may_land_after_s is not None:
        flight["may_land_after_s"] = later(float(scenario.flight.may_land_after_s))
    if "event" in entries:
        entries["event"] = [event | {"at_s": later(event["at_s"])} for event in entries["event"]]
    return check(entries, Scenario, f"{scenario.name} from {height_m:g} m")
