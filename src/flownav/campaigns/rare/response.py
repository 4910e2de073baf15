"""How near a flight comes to an event, as a number that grows towards it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.measures import CRASH, MEASURES, NOT_LANDED, Event, measured
from flownav.scoring.errors import SCORE_COLUMNS, touchdown_rows
from flownav.scoring.landings import column_of
from flownav.scoring.touchdown import Limits

Array = NDArray[np.float64]

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
NEAREST = 0.9  # of a limit: where the median is beyond it, the event is not rare


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
    """What is infinite is farthest from this part of the event: it is the other part's."""
    return np.where(np.isfinite(values), values, -np.inf)


def figures(rows: Array, limits: Limits) -> Array:
    """A touchdown's figures over the vehicle's limits, (flights, len(HELD)); NaN where nothing was touched."""
    landings = touchdown_rows(rows[:, : len(SCORE_COLUMNS)])
    return np.column_stack([landings[:, column_of(*name)] / getattr(limits, limit) for name, limit in HELD.items()])


def severity(rows: Array, limits: Limits, typical: Array, failed: NDArray[np.bool_]) -> Array:
    """How hard a touchdown was, (flights,): how far the hardest figure is on its way from what is typical to its limit.

    Above 1 exactly where it `failed`, infinite where no limit on the touchdown says why. A figure that is large in
    every flight, as the tilt in trim is, thereby says nothing until it grows. 0 where nothing was touched.
    """
    begins = np.minimum(typical, NEAREST)
    on_the_way = (figures(rows, limits) - begins) / (1.0 - begins)
    worst = np.where(np.isfinite(on_the_way), on_the_way, 0.0).max(axis=1)
    return np.where(failed, np.where(worst > 1.0, worst, np.inf), np.minimum(worst, 1.0))
