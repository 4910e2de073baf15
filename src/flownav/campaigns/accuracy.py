"""The accuracy that the navigator promises case by case, and whether it keeps it (docs/explanation/accuracy.md)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from flownav.campaigns.judged import BOUND_FLIGHTS, Judged, ablations, bound_of, fly_judged
from flownav.campaigns.local import known_exactly
from flownav.campaigns.measures import CRASH, measured
from flownav.campaigns.requirement import SHIPPED, Requirement, load_requirement
from flownav.campaigns.requirement import scenario_of as scenario_required
from flownav.core.text import finite_or_none
from flownav.scoring import consistency
from flownav.scoring.errors import MAX_POSITION_ERROR, attitude_rms, touchdown_rows
from flownav.scoring.landings import REST_DISTANCE, crashed, radius, touchdown_of_flights
from flownav.scoring.percentiles import percentile_with_interval
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.plan import Flight
from flownav.simulation.scenario import Scenario, with_filter
from flownav.vehicle.parameters import MultirotorParameters

CASES = SHIPPED  # requirements by name, with what is flown and what the ensemble must keep
PAPERS_CONDITIONS = ("takeoff", "landing")
LEAST_ANEES, MOST_ANEES = 0.8, 1.15  # errors are 0.9 to 1.07 times as large as stated
LARGEST_AXIS_M = 0.10  # 95th percentile of the matched flights in the paper's conditions
SHARE = 0.95
EFFICIENCY = "RMSE over the bound of the filter's own model, worst state"
ANEES = "ANEES, the squared errors over the stated ones"
# measures of requirements as this table calls them, {share} of the flights [%]
WORDS = {
    "estimate.axis_m": "{share:g}th percentile of the largest error of one axis [m]",
    "estimate.horizontal_m": "{share:g}th percentile of the largest horizontal error [m]",
    "touchdown.rest_m": "touchdown R{share:g} at rest [m]",
}


class Target(NamedTuple):
    """A promise: `value` and the limit that it must not exceed (or, at_least, fall below), of which flights."""

    truth_model: str  # matched or ensemble
    what: str
    value: float
    limit: float
    at_least: bool = False

    @property
    def kept(self) -> bool:
        """Whether the figure is on the right side; NaN is not."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    def sentence(self) -> str:
        """The figure and its limit."""
        side = "at least" if self.at_least else "at most"
        return f"{self.truth_model}: {self.what} {self.value:.3f}, {side} {self.limit:g}"


@dataclass(frozen=True)
class Case:
    """One case's figures, matched and of the ensemble as JSON has them, the targets, and a row for each ablation.

    known: what the vehicle knows exactly, and for how long. vehicle: the name in its file.
    """

    name: str
    vehicle: str
    known: str
    flights: int
    matched: dict[str, Any]
    ensemble: dict[str, Any]
    targets: tuple[Target, ...]
    ablations: dict[str, dict[str, Any]]

    def as_json(self) -> dict[str, Any]:
        """Everything, as JSON has it."""
        targets = [t._asdict() | {"value": finite_or_none(t.value), "kept": t.kept} for t in self.targets]
        own = {"case": self.name, "vehicle": self.vehicle, "known_exactly": self.known, "flights": self.flights}
        both = {"matched": self.matched, "ensemble": self.ensemble}
        return {**own, **both, "targets": targets, "ablations": self.ablations}


def flights_of(cases: Sequence[str], flights: int, ablation_flights: int, vehicle: str | None = None) -> int:
    """How many flights `run_case` will fly for these cases. InputError where the vehicle cannot fly one."""
    total = 0
    for name in cases:
        setup = assemble(scenario_of(name, vehicle))
        variants = len(ablations(setup)) + 1 if ablation_flights else 0
        total += flights * (3 if beside_the_papers(name, setup) else 2) + variants * ablation_flights
    return total


def beside_the_papers(name: str, setup: Setup) -> bool:
    """Whether a case flies the paper's filter, too, which is the model of a helicopter and flies no other kind."""
    return name == "pad_return" and not isinstance(setup.flight.vehicle, MultirotorParameters)


def scenario_of(name: str, vehicle: str | None = None) -> Scenario:
    """A case's scenario; vehicle: another one than its own (`with_vehicle`)."""
    return scenario_required(load_requirement(name), vehicle)


def run_case(
    name: str,
    seed: int,
    flights: int,
    ablation_flights: int,
    on_progress: Callable[[int], object] = lambda flown: None,
    vehicle: str | None = None,
) -> Case:
    """Fly a case matched and as an ensemble, hold it against bound and targets, and take the navigator apart."""
    scenario = scenario_of(name, vehicle)
    setup = assemble(scenario)

    def fly(flight: Flight, count: int, ensemble: Ensemble | None = None) -> Judged:
        return fly_judged(flight, seed, count, ensemble=ensemble, on_progress=on_progress)

    bound = bound_of(setup, seed, min(flights, BOUND_FLIGHTS)).sums
    matched = _facts(fly(setup.flight, flights), bound)
    drawn = fly(setup.flight, flights, setup.ensemble())
    ensemble = _facts(drawn, bound)
    if beside_the_papers(name, setup):
        papers = fly(assemble(with_filter(scenario, "paper")).flight, flights)
        matched["papers_p95_largest_horizontal_m"] = percentile_with_interval(papers.largest_horizontal_m, SHARE)[0]
    taken_apart = {}
    if ablation_flights:
        whole = fly(setup.flight, ablation_flights)
        taken_apart["nothing"] = _cost(whole, whole)
        for lacking, flight in ablations(setup).items():
            taken_apart[lacking] = _cost(fly(flight, ablation_flights), whole)
    targets = (*_matched_targets(name, matched), *_ensemble_targets(load_requirement(name), drawn, ensemble))
    return Case(name, setup.described.name, known_exactly(scenario), flights, matched, ensemble, targets, taken_apart)


def _facts(judged: Judged, bound: consistency.ErrorSums) -> dict[str, Any]:
    """Accuracy and consistency of a batch; null for a figure without a finite value. bound: the matched flights'."""
    assert judged.sums is not None
    assert judged.groups is not None
    axis = percentile_with_interval(judged.scores[:, MAX_POSITION_ERROR], SHARE)
    horizontal = percentile_with_interval(judged.largest_horizontal_m, SHARE)
    landings = touchdown_rows(judged.scores)
    within = consistency.within_band(judged.groups, judged.sums)
    return {
        "crashed": int(crashed(landings).sum()),
        "touchdown": touchdown_of_flights(landings),
        "p95_largest_axis_m": finite_or_none(axis[0]),
        "p95_largest_horizontal_m": finite_or_none(horizontal[0]),
        "p95_largest_horizontal_interval_m": [finite_or_none(x) for x in horizontal[1:]],
        "rms_error": [finite_or_none(x) for x in judged.flown.root_mean_square()],
        "rms_error_at_horizon": [finite_or_none(x) for x in judged.sums.errors.root_mean_square()],
        "rms_attitude_deg": attitude_rms(judged.attitude_deg),
        "anees": consistency.anees(judged.sums),
        "anees_inside_fraction": within.as_stated,
        "anees_inside_fraction_sized": finite_or_none(within.sized),
        "anees_inside_fraction_sized_at_each_step": finite_or_none(within.sized_at_each_step),
        "anees_inside_fraction_of_all_flights": consistency.inside_fraction([consistency.inside_steps(judged.sums)]),
        "error_over_stated": consistency.over_stated(judged.sums),
        "rmse_over_bound": consistency.efficiency(judged.sums.errors, bound),
        "rmse_over_bound_by_height": consistency.efficiency_by_height(judged.sums.errors, bound),
    }


def _matched_targets(name: str, facts: dict[str, Any]) -> tuple[Target, ...]:
    """The promises of a case whose truth is as the filter's models state."""
    worst = float(np.max(list(facts["rmse_over_bound"].values())))
    consistent = _consistent("matched", facts)
    if name in PAPERS_CONDITIONS:
        words = WORDS["estimate.axis_m"].format(share=100.0 * SHARE)
        largest = Target("matched", words, _or_infinite(facts["p95_largest_axis_m"]), LARGEST_AXIS_M)
        return largest, Target("matched", EFFICIENCY, worst, 1.10), *consistent
    if name == "pad_return":
        efficient = Target("matched", EFFICIENCY, worst, 1.15)
        if "papers_p95_largest_horizontal_m" not in facts:
            return efficient, *consistent
        gain = facts["papers_p95_largest_horizontal_m"] / _or_infinite(facts["p95_largest_horizontal_m"])
        better = Target("matched", "largest pad-relative error, the paper's filter over ours", gain, 4.0, at_least=True)
        return efficient, better, *consistent
    return consistent


def _ensemble_targets(asked: Requirement, judged: Judged, facts: dict[str, Any]) -> tuple[Target, ...]:
    """The promises of a case whose truth the filter does not know: its requirement, and its consistency.

    Here a requirement is held against the figure of the flights themselves; `flownav certify` judges what they show.
    """
    rows = np.column_stack([judged.scores, judged.largest_horizontal_m])
    found, crashes = [], []
    for table in asked.requirement:
        figures = measured(table.measure, rows)
        if table.measure == CRASH:
            crashes.append(Target("ensemble", "crashes", float(figures.sum()), float(table.allowed_failures)))
        else:
            words = WORDS[table.measure].format(share=100.0 * table.probability)
            value = percentile_with_interval(figures, table.probability)[0]
            found.append(Target("ensemble", words, value, table.limit, at_least=not table.upper))
    return (*found, *_consistent("ensemble", facts), *crashes)


def _consistent(truth_model: str, facts: dict[str, Any]) -> tuple[Target, ...]:
    """The two limits of the ANEES, which is 1 where errors are as large as stated."""
    anees = _or_infinite(facts["anees"])
    lower, upper = (
        Target(truth_model, ANEES, anees, limit, low) for limit, low in ((LEAST_ANEES, True), (MOST_ANEES, False))
    )
    return lower, upper


def _cost(judged: Judged, whole: Judged) -> dict[str, Any]:
    """A variant's figures, and the errors of the estimate in use over those of the whole navigator."""
    squares, wholes = judged.flown.root_mean_square() ** 2, whole.flown.root_mean_square() ** 2
    assert judged.sums is not None
    landings = touchdown_rows(judged.scores)

    def ratio(states: slice) -> float:
        return float(np.sqrt(squares[states].sum() / wholes[states].sum()))

    return {
        "p95_largest_horizontal_m": finite_or_none(percentile_with_interval(judged.largest_horizontal_m, SHARE)[0]),
        "horizontal_rms_ratio": ratio(slice(0, 2)),
        "vertical_rms_ratio": ratio(slice(2, 3)),
        "horizontal_speed_rms_ratio": ratio(slice(3, 5)),
        "anees": consistency.anees(judged.sums),
        "rest_r95_m": radius(landings, REST_DISTANCE)["r95_m"],
        "crashed": int(crashed(landings).sum()),
    }


def _or_infinite(number: float | None) -> float:
    return np.inf if number is None else number
