"""What many flights show: radii of touchdown, shares, percentiles, each with its interval; and when they are enough.

Stopping when an interval is narrow looks at the flights again and again, and an interval of 95 % looked at twenty times
misses more often than one time in twenty. So the looks are planned, and each of K gets 1/K of the allowed error: by
Bonferroni's inequality the interval at which a campaign stops holds with its confidence, whenever that is.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.measures import CRASH, NOT_LANDED, measured
from flownav.core.errors import InputError
from flownav.core.text import finite_or_none
from flownav.scoring.percentiles import percentile_with_interval, share_with_interval

Array = NDArray[np.float64]

CONFIDENCE = 0.95
FIRST_LOOK, GROWTH = 512, 1.5  # flights at the first look, and how many times as many at each further one
TOGETHER = 256  # flights are looked at in whole files
STOP = re.compile(r"\s*(\w+)\s+width\s*<=?\s*(\S+)\s*")


class Figure(NamedTuple):
    """A figure of many flights: a percentile of a measure, or (share None) the share of the flights that it is 0 of."""

    measure: str
    share: float | None
    unit: str
    words: str


FIGURES = {
    "r50_m": Figure("touchdown.horizontal_m", 0.5, "m", "R50 at contact"),
    "r95_m": Figure("touchdown.horizontal_m", 0.95, "m", "R95 at contact"),
    "r997_m": Figure("touchdown.horizontal_m", 0.997, "m", "R99.7 at contact"),
    "rest_r95_m": Figure("touchdown.rest_m", 0.95, "m", "R95 at rest"),
    "p95_axis_m": Figure("estimate.axis_m", 0.95, "m", "95th percentile of the largest error of one axis"),
    "p95_horizontal_m": Figure("estimate.horizontal_m", 0.95, "m", "95th percentile of the largest horizontal error"),
    "landed": Figure(NOT_LANDED, None, "", "share that landed"),
    "not_crashed": Figure(CRASH, None, "", "share that did not crash"),
}


class Interval(NamedTuple):
    """A figure and its confidence interval; infinite where there are too few flights for an end."""

    value: float
    low: float
    high: float

    @property
    def width(self) -> float:
        """From one end to the other; infinite where an end is."""
        return self.high - self.low if np.isfinite([self.low, self.high]).all() else np.inf

    def finite(self) -> dict[str, float | None]:
        """As JSON has it; what is infinite is null."""
        return {"value": finite_or_none(self.value), "low": finite_or_none(self.low), "high": finite_or_none(self.high)}


def figure_of(name: str, values: Array, confidence: float = CONFIDENCE) -> Interval:
    """A figure of FIGURES from the values of its measure, (flights,). ValueError without a flight."""
    share = FIGURES[name].share
    if share is not None:
        return Interval(*percentile_with_interval(values, share, confidence))
    return Interval(*share_with_interval(int((values == 0.0).sum()), len(values), confidence))


def values_of(name: str, rows: Array) -> Array:
    """What a figure is taken from, (flights,); rows (flights, len(ROW_COLUMNS))."""
    return measured(FIGURES[name].measure, rows)


class Stop(NamedTuple):
    """When a campaign has flown enough: a figure's interval is at most so wide."""

    figure: str
    width: float


def stop_of(text: str) -> Stop:
    """A stop from its words, such as "r95_m width <= 0.005". InputError where they are none."""
    found = STOP.fullmatch(text)
    try:
        width = float(found[2]) if found else np.nan
    except ValueError:
        width = np.nan
    if not found or not width > 0.0 or not np.isfinite(width):
        raise InputError(f'--until {text!r}: a figure and a width are needed, such as "r95_m width <= 0.005"')
    if found[1] not in FIGURES:
        raise InputError(f"--until {text!r}: no such figure; known: {', '.join(FIGURES)}")
    return Stop(found[1], width)


def looks(most: int) -> list[int]:
    """After how many flights a stop is looked at, at most `most`; the last is `most`."""
    found, flights = [], float(FIRST_LOOK)
    while flights < most:
        found.append(int(flights) // TOGETHER * TOGETHER)
        flights *= GROWTH
    return [*found, most]


def confidence_of_a_look(most: int) -> float:
    """The confidence of each look's interval, so that with CONFIDENCE all of them hold."""
    return 1.0 - (1.0 - CONFIDENCE) / len(looks(most))


def enough(stop: Stop, values: Array, most: int) -> Interval | None:
    """The figure's interval at this look where it is narrow enough to stop, else None."""
    interval = figure_of(stop.figure, values, confidence_of_a_look(most))
    return interval if interval.width <= stop.width else None


def spread_of(values: Array) -> dict[str, Any]:
    """Median and 95th percentile of a measure with the latter's 95 % interval; null where infinite."""
    p95 = Interval(*percentile_with_interval(values, 0.95)).finite()
    p50 = float(percentile_with_interval(values, 0.5)[0])
    return {"p50": finite_or_none(p50), "p95": p95["value"], "low": p95["low"], "high": p95["high"]}
