"""Flights judged: what they flew on for accuracy, the navigator at its horizon for consistency, and its bound.

What is flown on is the estimate of now, counted from where the vehicle takes its pad to be. The navigator's own stands
at its horizon, some 0.1 s ago and in its own frame, which GPS has put somewhere: there it states its covariance, and
only there the two can be held against each other.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flownav.campaigns.local import counted_steps, largest_horizontal_m, score_history, takeoff_history
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, VELOCITY_BODY
from flownav.core.text import finite, finite_or_none
from flownav.scoring import consistency
from flownav.simulation.assemble import Setup
from flownav.simulation.engine import fly_blocks
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.history import column, columns
from flownav.simulation.plan import Flight

STATES = (*POSITION_NED, *VELOCITY_BODY)
STD = tuple(f"std_{name}" for name in STATES)
HORIZON = tuple(f"error_{name}" for name in STATES)
BOUND_FLIGHTS = 64  # the covariance hardly differs from flight to flight


@dataclass(frozen=True)
class Judged:
    """What a batch of flights leaves: a row of scores and a largest horizontal error a flight, and sums.

    scores (flights, len(SCORE_COLUMNS)); largest_horizontal_m (flights,), in flight and relative to where the vehicle
    takes its pad to be; flown: errors in flight of what was flown on; sums: of the navigator at its horizon; groups:
    steps inside the band, and steps, of each GROUP_FLIGHTS flights one after the other (of all where there are fewer;
    a remainder is left out).
    These two are None for a filter that states no consistency. takeoffs: (flights, len(TAKEOFF_COLUMNS)), None of
    flights that start in the air.
    """

    scores: Array
    largest_horizontal_m: Array
    flown: consistency.ErrorSums
    sums: consistency.ConsistencySums | None
    groups: tuple[tuple[int, int], ...] | None
    takeoffs: Array | None = None


@dataclass(frozen=True)
class Bound:
    """Mean over flights of the bound: variance (epochs, 6) of position NED and body velocity, and sums in flight.

    The first row is the horizon's at the start of the flight.
    """

    variance: Array
    sums: consistency.ErrorSums


def fly_judged(
    flight: Flight,
    seed: int,
    flights: int,
    *,
    ensemble: Ensemble | None = None,
    threads: int | None = None,
    on_progress: Callable[[int], object] = lambda flown: None,
) -> Judged:
    """Fly flights 0 to `flights - 1`, matched or of an ensemble, and judge them; memory grows by a row a flight."""

    def judge(
        history: Array,
    ) -> tuple[Array, Array, consistency.ErrorSums, consistency.ConsistencySums | None, Array | None]:
        estimate = history[:, columns("estimate", STATES)]
        truth = history[:, columns("truth", STATES)]
        in_flight = counted_steps(flight, history) * (1.0 - _on_ground(history))
        flown = consistency.error_sums((estimate - truth) ** 2, _skid_height(flight, history), in_flight)
        up, largest = takeoff_history(flight, history), largest_horizontal_m(flight, history)
        return score_history(flight, history), largest, flown, _at_horizon(flight, history), up

    rows, largest, groups, ups = [], [], [], []
    total: consistency.ConsistencySums | None = None
    group: consistency.ConsistencySums | None = None
    flown_on: consistency.ErrorSums | None = None
    for flown, (scores, horizontal, errors, sums, up) in fly_blocks(flight, seed, 0, flights, judge, threads, ensemble):
        rows.append(scores)
        if up is not None:
            ups.append(up)
        largest.append(horizontal)
        flown_on = errors if flown_on is None else flown_on + errors
        if sums is not None:
            total = sums if total is None else total + sums
            group = sums if group is None else group + sums
            if group.flights >= consistency.GROUP_FLIGHTS:
                groups.append(consistency.inside_steps(group))
                group = None
        on_progress(flown)
    assert flown_on is not None
    in_groups = None if total is None else tuple(groups) or (consistency.inside_steps(total),)
    every = np.concatenate(ups) if ups else None
    return Judged(np.concatenate(rows), np.concatenate(largest), flown_on, total, in_groups, every)


def _at_horizon(flight: Flight, history: Array) -> consistency.ConsistencySums | None:
    """The navigator's consistency: its errors and their squares over what it states, where it stands."""
    if flight.table is None:
        return None
    behind = flight.table.horizon_epochs
    error, nees = history[behind:, columns("horizon", HORIZON)], history[behind:, column("estimate", "nees")]
    sigma = history[behind:, columns("estimate", STD)]
    then = history[: len(history) - behind]
    return consistency.consistency_of_block(error, sigma, nees, _skid_height(flight, then), _on_ground(then))


def bound_of(setup: Setup, seed: int, flights: int, *, threads: int | None = None) -> Bound:
    """The posterior Cramér-Rao bound of the navigator's own model, mean over flights.

    Each flight flies on the truth with every Jacobian taken there (`FlightPlan.along_truth`), so that the covariance is
    the bound along that flight. ValueError where the paper's filter flies.
    """
    table = setup.flight.table
    if table is None:
        raise ValueError(f"{setup.scenario.name}: the bound is the navigator's, and it does not fly")
    flight = setup.flight._replace(plan=setup.flight.plan._replace(fly_on_truth=True, along_truth=True))
    behind = table.horizon_epochs

    def judge(history: Array) -> tuple[Array, consistency.ErrorSums]:
        running = np.isfinite(history[behind:, column("estimate", "nees")])
        variance = np.where(running[:, None], history[behind:, columns("estimate", STD)] ** 2, 0.0)
        then = history[: len(history) - behind]
        sums = consistency.error_sums(variance, _skid_height(flight, then), running * (1.0 - _on_ground(then)))
        return variance.sum(axis=2), sums

    variance, total = np.zeros((flight.plan.epochs - behind, len(STD))), None
    for _, (block, sums) in fly_blocks(flight, seed, 0, flights, judge, threads):
        variance += block
        total = sums if total is None else total + sums
    assert total is not None
    return Bound(variance / flights, total)


def consistency_facts(judged: Judged, bound: Bound) -> dict[str, Any]:
    """What `flownav fly` says of many flights of the navigator; null where no flight flew."""
    assert judged.groups is not None
    assert judged.sums is not None
    inside = consistency.inside_fraction(judged.groups)
    return {
        "rmse_over_bound": finite(consistency.efficiency(judged.sums.errors, bound.sums)),
        "anees_inside_fraction": finite_or_none(inside),
        "error_over_stated": finite(consistency.over_stated(judged.sums)),
    }


def _skid_height(flight: Flight, history: Array) -> Array:
    return -history[:, column("truth", "pos_d_m")] - flight.vehicle.cg_above_skid_m


def _on_ground(history: Array) -> Array:
    return np.asarray(history[:, column("truth", "contact_n")] > 0.0, float)
