"""The probability of a rare event, part by part, how well it is known, and what it most likely looks like."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from flownav.campaigns.measures import Event
from flownav.campaigns.rare import walk
from flownav.campaigns.rare.branches import Branch, Space
from flownav.campaigns.rare.likely import Response, effective, rank_inputs, rank_noise, responses_to
from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array
from flownav.core.text import finite_or_none
from flownav.scoring.percentiles import share_with_interval
from flownav.scoring.touchdown import Limits
from flownav.simulation.assemble import Setup

CONFIDENCE = 0.95
LARGEST_CV = 0.3
PILOT_FLIGHTS = 512  # a level
ISLANDS, ISLAND_FLIGHTS = 8, 512  # a level: 512 walks side by side, and seven degrees of freedom for the interval
# without it 94, 93 and 87 % of 400 intervals of 95 % hold a truth of 1e-3, 1e-4 and 1e-6 (rare-events.md)
WIDER_A_LEVEL = 0.07
DIRECT_FLIGHTS = 4096  # at once, where there are no levels to climb
FAR = 3.7  # -ln((1 - CONFIDENCE) / 2): none of n flights shows that the probability is below FAR / n
NEGLIGIBLE, SMALL = 0.02, 0.1  # of the event's other part: not worth flights, or not worth more of them
LEAST_PROBABILITY = 1e-9  # no probability below that is sought
PILOTS_FACTOR = 5.0  # a pilot's own estimate is seldom too small by more than this factor


class Found(NamedTuple):
    """A probability, its interval and coefficient of variation (infinite: nothing happened, `high` is all there is).

    freedom: degrees of freedom of cv. levels: each with the share of the flights beyond it. beyond: the flights that
    showed it, of these weights, whose sum is the probability.
    """

    probability: float
    low: float
    high: float
    cv: float
    freedom: float
    levels: tuple[tuple[float, float], ...]
    beyond: walk.States
    weights: Array


def find(walker: walk.Walker, limit: float, most: int, beside: float = 0.0) -> Found:
    """The probability of a response beyond the limit: by levels where the response has them, else at random.

    Islands are flown in lots of ISLANDS until the coefficient of variation is small enough or `most` flights are used
    up. beside: the probability of the event's other part: where the pilot finds next to nothing beside it, or at all,
    it is left at that, and the probability counts as 0 with what it may be as `high`.
    """
    negligible = max(NEGLIGIBLE * beside, LEAST_PROBABILITY)
    ladder = walk.climb(walker, limit, PILOT_FLIGHTS, most // 2, negligible)
    if not ladder.reached and ladder.above < negligible:
        levels, high = tuple((level, np.nan) for level in ladder.levels), PILOTS_FACTOR * ladder.above
        return Found(0.0, 0.0, high, np.inf, np.inf, levels, walker.fresh(0), np.zeros(0))
    if not ladder.reached:
        return at_random(walker, limit, most - walker.flown)
    price = ISLANDS * (
        1.0 + (len(ladder.levels) - 1) * (1.0 - 1.0 / walk.WALK_STATES)
    )  # of a flight of every island and level
    count = min(int((most - walker.flown) / price) // walk.WALK_STATES * walk.WALK_STATES, ISLAND_FLIGHTS)
    lots: list[walk.Islands] = []
    while True:
        lots.append(walk.fly_islands(walker, ladder, ISLANDS, count))
        found = found_on(ladder, lots, count)
        small = found.cv * found.probability <= SMALL * beside
        if found.cv <= LARGEST_CV or small or walker.flown + price * count > most:
            return found


def found_on(ladder: walk.Ladder, lots: list[walk.Islands], count: int) -> Found:
    """The joint result of islands of `count` flights a level: the mean of their estimates."""
    estimates = np.concatenate([lot.estimates for lot in lots])
    islands, mean = len(estimates), float(estimates.mean())
    shares = np.concatenate([lot.shares for lot in lots]).mean(axis=0)
    levels = tuple(zip(ladder.levels, shares.tolist(), strict=True))
    beyond = walk.together([lot.beyond for lot in lots])
    if mean == 0.0:
        return Found(0.0, 0.0, FAR / (islands * count), np.inf, np.inf, levels, beyond.at(np.arange(0)), np.zeros(0))
    cv = float(estimates.std(ddof=1)) / mean / np.sqrt(islands)
    own = [lot.estimates[lot.island] / np.bincount(lot.island)[lot.island] for lot in lots]
    low, high = interval_of(mean, cv, islands - 1, len(levels))
    return Found(mean, low, high, cv, islands - 1, levels, beyond, np.concatenate(own) / islands)


def interval_of(mean: float, cv: float, freedom: float, levels: int) -> tuple[float, float]:
    """The interval of a mean whose logarithm is nearly normal, as that of a product of many shares is: Student's t.

    Islands that miss the same few flights agree, the more so the more levels they climbed: WIDER_A_LEVEL.
    """
    from scipy.stats import t

    wider = 1.0 + WIDER_A_LEVEL * levels
    factor = float(np.exp(wider * t.ppf(0.5 + 0.5 * CONFIDENCE, freedom) * np.sqrt(np.log1p(cv * cv))))
    return mean / factor, min(mean * factor, 1.0)


def at_random(walker: walk.Walker, limit: float, most: int) -> Found:
    """The share of flights drawn at random, its interval after Clopper and Pearson: of a response without levels."""
    happened, flown = [walker.fresh(0)], 0
    while flown < most:
        states = walker.fresh(min(DIRECT_FLIGHTS, most - flown))
        happened.append(states.at(np.flatnonzero(states.response > limit)))
        flown += len(states.response)
    beyond = walk.together(happened)
    hits = len(beyond.response)
    share, low, high = share_with_interval(hits, flown, CONFIDENCE)
    cv = float(np.sqrt((1.0 - hits / flown) / hits)) if hits else np.inf
    levels = ((limit, share),)
    return Found(share, low, high, cv, np.inf, levels, beyond, np.full(hits, 1.0 / flown))


def together_with(parts: list[Found]) -> tuple[float, float, float, float]:
    """Probability, interval and coefficient of variation of an event in parts that exclude each other.

    A part of which nothing was found adds to the upper end alone.
    """
    known = [part for part in parts if part.probability > 0.0]
    unseen = sum(part.high for part in parts if part.probability == 0.0)
    if not known:
        return 0.0, 0.0, min(unseen, 1.0), np.inf
    variances = np.array([(part.cv * part.probability) ** 2 for part in known])
    total, variance = sum(part.probability for part in known), float(variances.sum())
    cv = np.sqrt(variance) / total
    if len(known) == 1:
        low, high = known[0].low, known[0].high
    else:  # Welch and Satterthwaite's degrees of freedom
        freedom = variance**2 / max(float((variances**2 / [part.freedom for part in known]).sum()), 1e-300)
        low, high = interval_of(total, cv, freedom, max(len(part.levels) for part in known))
    return total, low, min(high + unseen, 1.0), cv


# -- all parts ---------------------------------------------------------------------------------------------------
FEWEST_FLIGHTS, MOST_FLIGHTS = 2000, 100_000
USUAL_FLIGHTS = 512  # that define a usual touchdown


@dataclass(frozen=True)
class Rare:
    """The result. cv None: the event never happened, and the interval is all that is known.

    parts: of the event, each with its probability and its levels. inputs, noise: as `likely` ranks them. branch: the
    most likely flight, of this response; None where the event never happened.
    """

    event: str
    probability: float
    low: float
    high: float
    cv: float | None
    flights: int
    parts: list[dict[str, Any]]
    inputs: list[dict[str, Any]]
    noise: list[dict[str, Any]]
    branch: Branch | None
    branch_response: float | None

    @property
    def known(self) -> bool:
        """Whether the coefficient of variation is as small as was asked for."""
        return self.cv is not None and self.cv <= LARGEST_CV

    def as_json(self) -> dict[str, Any]:
        """Everything but the flight, which is a file of its own."""
        own = {name: getattr(self, name) for name in ("event", "probability", "low", "high", "cv", "flights")}
        likely = {"inputs": self.inputs, "noise": self.noise, "response": finite_or_none(self.branch_response)}
        return own | {"confidence": CONFIDENCE, "parts": self.parts, "likely": likely}


def estimate_rare(
    setup: Setup,
    event: Event,
    *,
    seed: int,
    flights: int = MOST_FLIGHTS,
    dispersed: bool = True,
    threads: int | None = None,
    on_progress: Callable[[int], object] = lambda flown: None,
) -> Rare:
    """How probable an event is, by subset simulation, in at most `flights` flights.

    Fewer are flown where the coefficient of variation is LARGEST_CV sooner. With the same seed and number of flights it
    is the same on any number of threads. InputError where `flights` is too small, or as `Ensemble`.
    """
    if flights < FEWEST_FLIGHTS:
        raise InputError(f"{arg('flights')} {flights}: a rare event needs {FEWEST_FLIGHTS} or more")
    space = Space(setup, seed, dispersed=dispersed)
    responses = responses_to(event, Limits(**setup.flight.limits._asdict()), space.usual(USUAL_FLIGHTS, threads))
    on_progress(USUAL_FLIGHTS)
    found: list[Found] = []
    left, flown = flights - USUAL_FLIGHTS, []
    for part, response in enumerate(responses):
        walker = walk.Walker(_respond(space, response, threads, on_progress), len(space.names), space.spans, seed, part)
        beside = sum(one.probability for one in found)
        found.append(find(walker, response.limit, left // (len(responses) - part), beside))
        flown.append(walker.flown)
        left -= walker.flown
    probability, low, high, cv = together_with(found)
    facts = [_facts(*each) for each in zip(responses, found, flown, strict=True)]
    inputs, noise = ([], []) if probability == 0.0 else differences(space, found)
    branch, at = (None, None) if probability == 0.0 else most_likely(space, responses, found, inputs)
    flights, spread = USUAL_FLIGHTS + sum(flown), finite_or_none(cv)
    return Rare(str(event), probability, low, high, spread, flights, facts, inputs, noise, branch, at)


def _respond(
    space: Space, response: Response, threads: int | None, on_progress: Callable[[int], object]
) -> Callable[[Array, walk.Streams], Array]:
    """Flights to their response."""

    def respond(inputs: Array, streams: walk.Streams) -> Array:
        rows = space.fly(inputs, streams, threads)
        on_progress(len(rows))
        return response.of(rows)

    return respond


def differences(space: Space, found: list[Found]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """How the inputs and the noise of the event's flights differ from those of all flights."""
    beyond, weights = walk.together([part.beyond for part in found]), np.concatenate([part.weights for part in found])
    independent = effective(weights) / walk.WALK_STATES
    inputs = rank_inputs(space.names, beyond.inputs, weights, independent)
    noise = rank_noise(space.flight, space.seed, beyond, weights, independent)
    return inputs, noise


def most_likely(
    space: Space, responses: list[Response], found: list[Found], inputs: list[dict[str, Any]]
) -> tuple[Branch, float]:
    """The flight to look at, and its response: of the event's likelier part.

    It is the one whose ranked inputs are the most probable together; where no input is ranked, the one least far in
    the event.
    """
    part = int(np.argmax([one.probability for one in found]))
    beyond = found[part].beyond
    likely_inputs = [space.names.index(row["input"]) for row in inputs]
    far = (
        (beyond.inputs[:, likely_inputs] ** 2).sum(axis=1) if likely_inputs else beyond.response - responses[part].limit
    )
    chosen = int(np.argmin(far))
    return space.branch(beyond.inputs[chosen], beyond.streams[chosen]), float(beyond.response[chosen])


def _facts(response: Response, found: Found, flights: int) -> dict[str, Any]:
    """One part of the event."""
    numbers = {"probability": found.probability, "low": found.low, "high": found.high, "cv": finite_or_none(found.cv)}
    levels = [{"level": finite_or_none(level), "share": finite_or_none(share)} for level, share in found.levels]
    return {"part": response.name, "response": response.words, **numbers, "flights": flights, "levels": levels}
