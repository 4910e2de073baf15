"""The envelope: how surely a scenario's flights land, over the wind's speed and the direction that it blows from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from flownav.campaigns.local import fly_many
from flownav.core.parameter_files import check
from flownav.scoring.errors import touchdown_rows
from flownav.scoring.landings import CONTACT_DISTANCE, REST_DISTANCE, crashed, radius, success
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.scenario import Scenario


def directions_deg(count: int) -> list[float]:
    """So many directions, even over the circle, from north on."""
    return [360.0 * k / count for k in range(count)]


def fly_envelope(
    scenario: Scenario,
    speeds_m_s: Sequence[float],
    directions: Sequence[float],
    seed: int,
    flights: int,
    *,
    dispersed: bool,
    on_progress: Callable[[int], None] = lambda flown: None,
) -> list[dict[str, Any]]:
    """A row for each speed at 20 ft [m/s] and direction [deg], of `flights` flights, the same noise in each.

    dispersed: of an ensemble whose vehicle and sensors are drawn; the wind is the cell's, and is not.
    """
    rows = []
    for speed in speeds_m_s:
        for direction in directions:
            setup = in_wind(scenario, speed, direction)
            ensemble = setup.ensemble() if dispersed else None
            scores = fly_many(setup.flight, seed, flights, ensemble=ensemble, on_progress=on_progress)
            landings = touchdown_rows(scores)
            rows.append(
                {
                    "speed_20ft_m_s": speed,
                    "from_direction_deg": direction,
                    "success": success(landings),
                    "crashed": int(crashed(landings).sum()),
                    "contact": radius(landings, CONTACT_DISTANCE),
                    "rest": radius(landings, REST_DISTANCE),
                }
            )
    return rows


def in_wind(scenario: Scenario, speed_m_s: float, direction_deg: float) -> Setup:
    """The scenario in this wind, which its dispersion leaves alone; gusts as the scenario has them."""
    wind = scenario.wind.model_dump() | {"speed_20ft_m_s": speed_m_s, "from_direction_deg": direction_deg}
    setup = assemble(check(scenario.model_dump(exclude_unset=True) | {"wind": wind}, Scenario, scenario.name))
    still = {name: entry for name, entry in setup.dispersion.items() if not name.startswith("wind.")}
    return replace(setup, dispersion=still)
