"""How long a certificate takes on this machine: a few of its flights are flown, and their time is scaled up."""

import math
import os
import time
from typing import Any

from flownav.campaigns.certification.again import SAMPLE
from flownav.campaigns.certification.cells import plan_of
from flownav.campaigns.engines import Local, Part
from flownav.campaigns.plan import Ready
from flownav.campaigns.ranking import flights_of
from flownav.campaigns.requirement import load_requirement
from flownav.core.compile import LANES, announce_compilation

RANKING_ROWS = 64  # as `flownav certify` has them unless it is asked for others


def pace_of(requirement: str) -> dict[str, Any]:
    """How many flights `flownav certify` flies for a requirement in all, and about how long they take here.

    requirement: a shipped name, or a file. Gives flights, those of the plan, of the check and of the ranking of the
    inputs, and seconds [s], without compiling. InputError where it cannot be flown.
    """
    plan = plan_of(load_requirement(requirement))
    cell = plan.ready(0)
    inputs = 0 if cell.ensemble is None else len(cell.ensemble.entries)
    flights = plan.flights * len(plan.cells) + SAMPLE + flights_of(inputs, RANKING_ROWS)
    flown = len(LANES) * (os.cpu_count() or 1)
    with announce_compilation("simulator"):
        _seconds(cell, plan.seed, len(LANES))
    return {"flights": flights, "seconds": math.ceil(flights / flown * _seconds(cell, plan.seed, flown))}


def _seconds(cell: Ready, seed: int, flights: int) -> float:
    """The time that this number of flights takes [s]."""
    began = time.perf_counter()
    for _ in Local().fly(cell, seed, [Part(0, 0, flights)]):
        pass
    return time.perf_counter() - began
