"""The most likely way there, and how near a flight comes to an event, as a number that grows towards it.

Of each number that was drawn: its mean in standard deviations over all flights, the standard deviation about that,
and the information of the two in nats: the Kullback-Leibler divergence of N(mean, spread^2) from N(0, 1). A pad can
be missed to the north and to the south: then the mean stays where it was and the spread grows.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.measures import CRASH, MEASURES, NOT_LANDED, Event, measured
from flownav.campaigns.rare.walk import States
from flownav.core.measurement import Array
from flownav.scoring.errors import SCORE_COLUMNS, touchdown_rows
from flownav.scoring.landings import column_of
from flownav.scoring.touchdown import Limits
from flownav.simulation.block import KEYED_EPOCHS
from flownav.simulation.onboard import EPOCH_S
from flownav.simulation.plan import Flight
from flownav.simulation.sources import Source, normals_of, sources_of

# a touchdown's figures, and what of the vehicle's limits each is held against
HELD = {
    ("contact", "sink_rate_m_s"): "max_sink_rate_m_s",
    ("contact", "lateral_speed_m_s"): "max_lateral_speed_m_s",
    ("contact", "tilt_deg"): "max_tilt_deg",
    ("contact", "yaw_rate_deg_s"): "max_yaw_rate_deg_s",
    ("rest", "slide_m"): "max_slide_m",
}


class Response(NamedTuple):
    """A part of an event. of: the response of rows of scores, (flights,), beyond `limit` where the part has happened.

    name: of the part; words: what the response is.
    """

    name: str
    of: Callable[[Array], Array]
    limit: float
    words: str


HARD = "the touchdown's hardest figure, of the way from its median to its limit: sink rate, lateral speed, tilt, yaw " \
    "rate or slide"  # fmt: skip
NEAREST_SHARE = 0.9  # of a limit: where the median is beyond it, the event is not rare


def responses_to(event: Event, limits: Limits, usual: Array) -> list[Response]:
    """The parts of an event, which exclude each other, each with a response that grows towards it.

    A crash, or a landing that failed, is yes or no: there the response is how hard the touchdown was, against `usual`
    rows of the same scenario. And it makes a measure of the touchdown infinite, with nothing before that grows towards
    it: such an event has two parts.
    """
    held = figures(usual, limits)
    typical = np.nan_to_num(np.nanmedian(held, axis=0)) if np.isfinite(held).any(axis=0).all() else np.zeros(len(HELD))
    if event.measure in (CRASH, NOT_LANDED) and event.above and 0.0 <= event.limit < 1.0:
        return [Response(event.measure, lambda rows: severity(rows, limits, typical, _failed(event, rows)), 1.0, HARD)]
    sign = 1.0 if event.above else -1.0
    whole = Response(str(event), lambda rows: sign * measured(event.measure, rows), sign * event.limit, event.measure)
    if not MEASURES[event.measure].of_touchdown:
        return [whole]
    return [
        whole._replace(of=lambda rows: _finite(sign * measured(event.measure, rows))),
        Response("no touchdown", lambda rows: severity(rows, limits, typical, _missing(event, rows)), 1.0, HARD),
    ]


def _failed(event: Event, rows: Array) -> NDArray[np.bool_]:
    return measured(event.measure, rows) > 0.0


def _missing(event: Event, rows: Array) -> NDArray[np.bool_]:
    return np.isposinf(measured(event.measure, rows))


def _finite(values: Array) -> Array:
    """Values with -inf for those that are infinite: these are farthest from this part of the event and belong to the
    other part.
    """
    return np.where(np.isfinite(values), values, -np.inf)


def figures(rows: Array, limits: Limits) -> Array:
    """A touchdown's figures over the vehicle's limits, (flights, len(HELD)); NaN where nothing was touched."""
    landings = touchdown_rows(rows[:, : len(SCORE_COLUMNS)])
    return np.column_stack([landings[:, column_of(*name)] / getattr(limits, limit) for name, limit in HELD.items()])


def severity(rows: Array, limits: Limits, typical: Array, failed: NDArray[np.bool_]) -> Array:
    """How hard a touchdown was, (flights,): how far the hardest figure is on its way from what is typical to its limit.

    Above 1 exactly where it `failed`, infinite where no limit on the touchdown is the reason. A figure that is large in
    every flight, as the tilt in trim is, thereby has no weight until it grows. 0 where nothing was touched.
    """
    begins = np.minimum(typical, NEAREST_SHARE)
    on_the_way = (figures(rows, limits) - begins) / (1.0 - begins)
    worst = np.where(np.isfinite(on_the_way), on_the_way, 0.0).max(axis=1)
    return np.where(failed, np.where(worst > 1.0, worst, np.inf), np.minimum(worst, 1.0))


# -- how its flights differ from all flights ---------------------------------------------------------------------
WINDOW_S = 0.5
NORMALS_READ = 20_000_000  # of the noise that is looked at
MOST_NAMED = 10
CHANCE_NATS = 10.0  # over the number of flights: what chance alone hardly ever makes of one number


def moments(values: Array, weights: Array) -> tuple[Array, Array]:
    """Weighted mean and standard deviation over the first axis."""
    share = (weights / weights.sum()).reshape(-1, *[1] * (values.ndim - 1))
    mean = (share * values).sum(axis=0)
    return mean, np.sqrt((share * (values - mean) ** 2).sum(axis=0))


def nats(mean: Array, spread: Array) -> Array:
    """The divergence of N(mean, spread^2) from N(0, 1)."""
    square = np.maximum(spread, 1e-3) ** 2
    return np.asarray(0.5 * (mean**2 + square - 1.0 - np.log(square)))


def effective(weights: Array) -> float:
    """The number of equally weighted flights of the same information."""
    return float(weights.sum() ** 2 / (weights**2).sum())


def rank_inputs(names: list[str], inputs: Array, weights: Array, independent: float) -> list[dict[str, Any]]:
    """The inputs that differ by more than chance, the most informative first. independent: approximate number of
    independent flights.
    """
    mean, spread = moments(inputs, weights)
    information = nats(mean, spread)
    order = [k for k in np.argsort(-information) if information[k] > CHANCE_NATS / independent][:MOST_NAMED]
    return [
        {
            "input": names[k],
            "mean_sigma": float(mean[k]),
            "spread_sigma": float(spread[k]),
            "nats": float(information[k]),
        }
        for k in order
    ]


def rank_noise(flight: Flight, seed: int, states: States, weights: Array, independent: float) -> list[dict[str, Any]]:
    """The window of each source whose sum of noise differs most, where it does by more than chance.

    Of many flights the noise of only every n-th is read, NORMALS_READ normals at most.

    A window's sum is over the readings in WINDOW_S, in standard deviations of such a sum: slow noise shows, fast does
    not.
    """
    rows: list[dict[str, Any]] = []
    sources = sources_of(flight)
    every = len(weights) * flight.plan.epochs * len(sources) // NORMALS_READ + 1
    read = np.argsort(-weights, kind="stable")[::every]
    streams, weights, independent = states.streams[read], weights[read], independent / every
    for source in sources:
        sums, ends_s = window_sums(source, flight.plan.epochs, seed, streams)
        mean, spread = moments(sums, weights)
        information = nats(mean, spread)
        k = int(np.argmax(information))
        if information[k] > CHANCE_NATS / independent:
            rows.append(
                {
                    "source": source.name,
                    "from_s": max(float(ends_s[k]) - WINDOW_S, 0.0),
                    "to_s": float(ends_s[k]),
                    "mean_sigma": float(mean[k]),
                    "spread_sigma": float(spread[k]),
                    "nats": float(information[k]),
                }
            )
    return sorted(rows, key=lambda row: -row["nats"])[:MOST_NAMED]


def window_sums(source: Source, epochs: int, seed: int, streams: NDArray[np.int64]) -> tuple[Array, Array]:
    """Sums of a source's normals over each window, of variance 1, (flights, windows), and where the windows end [s]."""
    steps = np.arange(source.clock.first, epochs, source.clock.every, dtype=np.int64)
    keyed = streams[:, np.minimum(steps // KEYED_EPOCHS, streams.shape[1] - 1)].astype(np.uint64)
    counter = np.broadcast_to(steps.astype(np.uint64), keyed.shape)
    normals = normals_of(seed, keyed, np.ascontiguousarray(counter), source.channel)[source.half]
    window = (steps * EPOCH_S / WINDOW_S).astype(int)
    begins = np.flatnonzero(np.diff(window, prepend=-1))
    sums = np.add.reduceat(normals, begins, axis=1) / np.sqrt(np.diff([*begins, len(steps)]))
    return sums, (window[begins] + 1) * WINDOW_S
