"""The probability of a rare event, how well it is known, and what it most likely looks like."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flownav.campaigns.measures import Event
from flownav.campaigns.rare.branches import Branch, Space
from flownav.campaigns.rare.chains import Array, Streams, Walker, together
from flownav.campaigns.rare.finding import CONFIDENCE, LARGEST_CV, Found, find, together_with
from flownav.campaigns.rare.likely import effective, rank_inputs, rank_noise
from flownav.campaigns.rare.response import Response, responses_to
from flownav.campaigns.rare.subset import WALK
from flownav.core.errors import InputError
from flownav.core.text import finite_or_none
from flownav.scoring.touchdown import Limits
from flownav.simulation.assemble import Setup

FEWEST_FLIGHTS, MOST_FLIGHTS = 2000, 100_000
USUAL_FLIGHTS = 512  # that say what a usual touchdown is


@dataclass(frozen=True)
class Rare:
    """What was found. cv None: nothing happened, and the interval is all that is known.

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
        """All of it but the flight, which is a file of its own."""
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
        raise InputError(f"--flights {flights}: a rare event needs {FEWEST_FLIGHTS} or more")
    space = Space(setup, seed, dispersed=dispersed)
    responses = responses_to(event, Limits(**setup.flight.limits._asdict()), space.usual(USUAL_FLIGHTS, threads))
    on_progress(USUAL_FLIGHTS)
    found: list[Found] = []
    left, flown = flights - USUAL_FLIGHTS, []
    for part, response in enumerate(responses):
        walker = Walker(_respond(space, response, threads, on_progress), len(space.names), space.spans, seed, part)
        beside = sum(one.probability for one in found)
        found.append(find(walker, response.limit, left // (len(responses) - part), beside))
        flown.append(walker.flown)
        left -= walker.flown
    probability, low, high, cv = together_with(found)
    said = [_said(*each) for each in zip(responses, found, flown, strict=True)]
    inputs, noise = ([], []) if probability == 0.0 else differences(space, found)
    branch, at = (None, None) if probability == 0.0 else most_likely(space, responses, found, inputs)
    flights, spread = USUAL_FLIGHTS + sum(flown), finite_or_none(cv)
    return Rare(str(event), probability, low, high, spread, flights, said, inputs, noise, branch, at)


def _respond(
    space: Space, response: Response, threads: int | None, on_progress: Callable[[int], object]
) -> Callable[[Array, Streams], Array]:
    """Flights to their response."""

    def respond(inputs: Array, streams: Streams) -> Array:
        rows = space.fly(inputs, streams, threads)
        on_progress(len(rows))
        return response.of(rows)

    return respond


def differences(space: Space, found: list[Found]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """How the inputs and the noise of the event's flights differ from those of all flights."""
    beyond, weights = together([part.beyond for part in found]), np.concatenate([part.weights for part in found])
    independent = effective(weights) / WALK
    inputs = rank_inputs(space.names, beyond.inputs, weights, independent)
    noise = rank_noise(space.flight, space.seed, beyond, weights, independent)
    return inputs, noise


def most_likely(
    space: Space, responses: list[Response], found: list[Found], inputs: list[dict[str, Any]]
) -> tuple[Branch, float]:
    """The flight to look at, and its response: of the event's likelier part.

    It is the one whose telling inputs are the most probable together; where no input tells anything, the one that the
    event befell least.
    """
    part = int(np.argmax([one.probability for one in found]))
    beyond = found[part].beyond
    telling = [space.names.index(row["input"]) for row in inputs]
    far = (beyond.inputs[:, telling] ** 2).sum(axis=1) if telling else beyond.response - responses[part].limit
    chosen = int(np.argmin(far))
    return space.branch(beyond.inputs[chosen], beyond.streams[chosen]), float(beyond.response[chosen])


def _said(response: Response, found: Found, flights: int) -> dict[str, Any]:
    """One part of the event."""
    numbers = {"probability": found.probability, "low": found.low, "high": found.high, "cv": finite_or_none(found.cv)}
    levels = [{"level": finite_or_none(level), "share": finite_or_none(share)} for level, share in found.levels]
    return {"part": response.name, "response": response.words, **numbers, "flights": flights, "levels": levels}
