"""Flights of the landing filter judged for consistency and efficiency, and the bound that they are held against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.campaign.local import score_history
from flownav.record import POSITION_NED, VELOCITY_BODY
from flownav.scoring.consistency import (
    GROUP_FLIGHTS,
    ConsistencySums,
    ErrorSums,
    consistency_of_block,
    efficiency,
    error_sums,
    inside_fraction,
    inside_steps,
    largest_horizontal_error,
    percentile_with_interval,
)
from flownav.scoring.errors import CRASHED, SCORE_COLUMNS
from flownav.simulation.assemble import Setup
from flownav.simulation.engine import fly_blocks
from flownav.simulation.flight import Flight
from flownav.simulation.history import column, columns
from flownav.simulation.sensing import EPOCH_S

Array = NDArray[np.float64]

STD = tuple(f"std_{name}" for name in (*POSITION_NED, *VELOCITY_BODY))
TOUCHDOWN_ERROR = SCORE_COLUMNS.index("touchdown.horizontal_error_m")
BOUND_FLIGHTS = 64  # the covariance hardly differs from flight to flight
R_SHARE = 0.95


@dataclass(frozen=True)
class Judged:
    """What a batch of flights leaves: a row of scores and a largest horizontal error a flight, and sums.

    scores (flights, len(SCORE_COLUMNS)); largest_horizontal_m (flights,), relative to where the vehicle noted its
    pad; groups: steps inside the band, and steps, of each GROUP_FLIGHTS flights one after the other (of all where
    there are fewer; a remainder is left out). Both are None for a filter that states no consistency.
    """

    scores: Array
    largest_horizontal_m: Array
    errors: ErrorSums
    sums: ConsistencySums | None
    groups: tuple[tuple[int, int], ...] | None


@dataclass(frozen=True)
class Bound:
    """Mean over flights of the bound: variance (epochs, 6) of position NED and body velocity, and sums in flight."""

    variance: Array
    sums: ErrorSums


def fly_judged(
    flight: Flight,
    seed: int,
    flights: int,
    *,
    threads: int | None = None,
    on_progress: Callable[[int], object] = lambda flown: None,
) -> Judged:
    """Fly flights 0 to `flights - 1` and judge them; memory grows by a row of scores a flight."""
    home = home_epoch(flight)

    def judge(history: Array) -> tuple[Array, Array, ConsistencySums]:
        estimate = history[:, columns("estimate", (*POSITION_NED, *VELOCITY_BODY))]
        truth = history[:, columns("truth", (*POSITION_NED, *VELOCITY_BODY))]
        nees = history[:, column("estimate", "nees")]
        sums = consistency_of_block(estimate, truth, nees, _skid_height(flight, history), _on_ground(history))
        return score_history(flight, history), largest_horizontal_error(estimate, truth, home), sums

    rows, largest, groups = [], [], []
    total = group = None
    for flown, (scores, horizontal, sums) in fly_blocks(flight, seed, 0, flights, judge, threads):
        rows.append(scores)
        largest.append(horizontal)
        total = sums if total is None else total + sums
        group = sums if group is None else group + sums
        if group.flights >= GROUP_FLIGHTS:
            groups.append(inside_steps(group))
            group = None
        on_progress(flown)
    assert total is not None
    found = np.concatenate(rows), np.concatenate(largest), total.errors
    if flight.landing is None:
        return Judged(*found, None, None)
    return Judged(*found, total, tuple(groups) or (inside_steps(total),))


def bound_of(setup: Setup, seed: int, flights: int, *, threads: int | None = None) -> Bound:
    """The posterior Cramér-Rao bound of the landing filter's model, mean over flights.

    Each flight flies on the truth with every Jacobian taken there (`LandingSetup.along_truth`), so that the
    covariance is the bound along that flight. ValueError where another filter flies.
    """
    landing = setup.flight.landing
    if landing is None:
        raise ValueError(f"{setup.scenario.name}: the bound is the landing filter's, and it does not fly")
    flight = setup.flight._replace(landing=landing._replace(along_truth=True))

    def judge(history: Array) -> tuple[Array, ErrorSums]:
        variance = history[:, columns("estimate", STD)] ** 2
        sums = error_sums(variance, _skid_height(flight, history), 1.0 - _on_ground(history))
        return variance.sum(axis=2), sums

    variance, total = np.zeros((flight.plan.epochs, len(STD))), None
    for _, (block, sums) in fly_blocks(flight, seed, 0, flights, judge, threads):
        variance += block
        total = sums if total is None else total + sums
    assert total is not None
    return Bound(variance / flights, total)


def home_epoch(flight: Flight) -> int | None:
    """The step at which the vehicle last notes where its pad is; None where it takes the filter's origin for it."""
    if not flight.plan.home_at_start:
        return None
    parked = flight.plan.starts_on_ground and flight.plan.takeoff_at_s > 0.0
    last = int(np.ceil(flight.plan.takeoff_at_s / EPOCH_S)) - 1 if parked else 0
    return min(last, flight.plan.epochs - 1)


def consistency_facts(judged: Judged, bound: Bound) -> dict[str, Any]:
    """What `flownav fly` says of many flights of the landing filter; null where no flight landed or flew."""
    assert judged.groups is not None
    inside = inside_fraction(judged.groups)
    low, high = touchdown_radius(judged)[1:]
    return {
        "efficiency": {state: _finite(ratio) for state, ratio in efficiency(judged.errors, bound.sums).items()},
        "anees_inside_fraction": _finite(inside),
        "r95_m": _finite(touchdown_radius(judged)[0]),
        "r95_interval_m": [_finite(low), _finite(high)],
    }


def touchdown_radius(judged: Judged) -> tuple[float, float, float]:
    """R95 of the touchdown and its 95 % interval [m]; a flight that crashed or never landed is infinitely far off."""
    missed = judged.scores[:, TOUCHDOWN_ERROR]
    away = np.where(np.isnan(missed) | (judged.scores[:, CRASHED] > 0.0), np.inf, missed)
    return percentile_with_interval(away, R_SHARE)


def _finite(number: float) -> float | None:
    return number if np.isfinite(number) else None


def _skid_height(flight: Flight, history: Array) -> Array:
    return -history[:, column("truth", "pos_d_m")] - flight.vehicle.cg_above_skid_m


def _on_ground(history: Array) -> Array:
    return np.asarray(history[:, column("truth", "contact_n")] > 0.0, float)
