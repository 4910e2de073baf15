"""The measures of a flight, by the names that requirements, events and stops use; figures of many flights.

A touchdown that did not happen is infinitely bad: of a flight that crashed, never touched or never came to rest a
measure of its touchdown is infinite, as R95 has it.

Stopping when an interval is narrow looks at the flights again and again, and an interval of 95 % looked at twenty times
misses more often than one time in twenty. So the looks are planned, and each of K gets 1/K of the allowed error: by
Bonferroni's inequality the interval at which a campaign stops holds with its confidence, whenever that is.
"""

import math
import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array
from flownav.core.text import finite_or_none
from flownav.scoring.errors import SCORE_COLUMNS, touchdown_rows
from flownav.scoring.landings import EXPECTED, crashed, succeeded
from flownav.scoring.percentiles import percentile_with_interval, share_with_interval

CRASH, NOT_LANDED = "crash", "not_landed"
LARGEST_HORIZONTAL = "largest_horizontal_m"
EVENT = re.compile(r"\s*([\w.]+)\s*(?:(>|<)\s*(\S+))?\s*")
# a row of a campaign: the scores, and the largest error taken from a flight's history
ROW_COLUMNS = (*SCORE_COLUMNS, LARGEST_HORIZONTAL)


class Measure(NamedTuple):
    """A figure of one flight; column: of ROW_COLUMNS; of_touchdown: infinite where there is none."""

    name: str
    unit: str
    words: str
    column: str
    of_touchdown: bool = True

    @property
    def of_landing(self) -> bool:
        """Whether it applies only to flights that were to land."""
        return self.of_touchdown or self.name == NOT_LANDED


_MEASURES = (
    Measure("touchdown.horizontal_m", "m", "distance of the first contact from the pad's centre",
            "touchdown.contact.distance_m"),
    Measure("touchdown.rest_m", "m", "distance from the pad's centre at rest", "touchdown.rest.distance_m"),
    Measure("touchdown.north_m", "m", "first contact, north of the pad's centre", "touchdown.contact.north_m"),
    Measure("touchdown.east_m", "m", "first contact, east of the pad's centre", "touchdown.contact.east_m"),
    Measure("touchdown.sink_rate_m_s", "m/s", "sink rate at first contact", "touchdown.contact.sink_rate_m_s"),
    Measure("touchdown.lateral_speed_m_s", "m/s", "speed over the ground at first contact",
            "touchdown.contact.lateral_speed_m_s"),
    Measure("touchdown.tilt_deg", "deg", "tilt at first contact", "touchdown.contact.tilt_deg"),
    Measure("touchdown.slide_m", "m", "way slid on the skids", "touchdown.rest.slide_m"),
    Measure("touchdown.estimate_m", "m", "what the estimate has drifted since the pad was last seen",
            "touchdown.limited_by.estimate_m"),
    Measure("touchdown.guidance_m", "m", "how far off the vehicle believed itself to touch",
            "touchdown.limited_by.guidance_m"),
    Measure("touchdown.pad_m", "m", "how wrong the pad's place was when it was last seen",
            "touchdown.limited_by.pad_m"),
    Measure("estimate.axis_m", "m", "largest error of one axis of the estimate used by the autopilot",
            "max_position_error_m", of_touchdown=False),
    Measure("estimate.horizontal_m", "m", "largest horizontal error of the estimate used by the autopilot",
            LARGEST_HORIZONTAL, of_touchdown=False),
    Measure(CRASH, "", "1 where the flight crashed, else 0", "touchdown.broken", of_touchdown=False),
    Measure(NOT_LANDED, "", "1 where the flight was to land and did not, else 0", "touchdown.broken",
            of_touchdown=False),
)  # fmt: skip
MEASURES = {measure.name: measure for measure in _MEASURES}


class Event(NamedTuple):
    """That a measure is above a limit (or, above False, below it)."""

    measure: str
    above: bool
    limit: float

    def __str__(self) -> str:
        return f"{self.measure} {'>' if self.above else '<'} {self.limit:g}"


def measure_of(name: str) -> Measure:
    """A measure by its name. InputError where there is none such."""
    if name not in MEASURES:
        raise InputError(f"{name}: no such measure; known: {', '.join(MEASURES)}")
    return MEASURES[name]


def event_of(text: str) -> Event:
    """An event from its words, such as "touchdown.horizontal_m > 1", "crash". InputError where they are none."""
    found = EVENT.fullmatch(text)
    name, relation, limit = found.groups() if found else ("", "", "")
    if name in (CRASH, NOT_LANDED) and not relation:
        return Event(name, True, 0.5)
    try:
        number = float(limit or "nan")
    except ValueError:
        number = np.nan
    if not np.isfinite(number):
        raise InputError(
            f'{text!r}: an event is a measure and a limit, such as "touchdown.horizontal_m > 1", or "crash"'
        )
    if name in (CRASH, NOT_LANDED) and not 0.0 <= number < 1.0:
        raise InputError(f"{text!r}: {name} is 0 or 1; say {name}")
    return Event(measure_of(name).name, relation == ">", number)


def measured(name: str, rows: Array) -> Array:
    """The figure of each flight, (flights,); rows (flights, at least len(SCORE_COLUMNS)) in the order of ROW_COLUMNS.

    InputError as `measure_of`.
    """
    measure = measure_of(name)
    landings = touchdown_rows(rows[:, : len(SCORE_COLUMNS)])
    if name == CRASH:
        return crashed(landings).astype(float)
    if name == NOT_LANDED:
        return ((landings[:, EXPECTED] > 0.0) & ~succeeded(landings)).astype(float)
    values = rows[:, ROW_COLUMNS.index(measure.column)]
    if not measure.of_touchdown:
        return np.where(np.isfinite(values), values, np.inf)
    return np.where(np.isfinite(values) & ~crashed(landings), values, np.inf)


def happened(event: Event, rows: Array) -> NDArray[np.bool_]:
    """Which flights an event befell, (flights,); a touchdown that did not happen is beyond every limit."""
    values = measured(event.measure, rows)
    return np.asarray(values > event.limit if event.above else (values < event.limit) | np.isposinf(values))


# -- figures of many flights -------------------------------------------------------------------------------------
CONFIDENCE = 0.95
FIRST_LOOK, GROWTH = 512, 1.5  # flights at the first look, and how many times as many at each further one
FLIGHTS_TOGETHER = 256  # flights are looked at in whole files
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


def flights_needed(name: str) -> int:
    """Of how many flights a figure is more than the largest of them: 20 for 95 %, 334 for 99.7 %; 1 of a share."""
    share = FIGURES[name].share
    return 1 if share is None else math.ceil(round(1.0 / (1.0 - share), 6))


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
        """A value as JSON has it; what is infinite is null."""
        return {"value": finite_or_none(self.value), "low": finite_or_none(self.low), "high": finite_or_none(self.high)}


def figure_of(name: str, values: Array, confidence: float = CONFIDENCE) -> Interval:
    """A figure of FIGURES from the values of its measure, (flights,). ValueError without a flight."""
    share = FIGURES[name].share
    if share is not None:
        return Interval(*percentile_with_interval(values, share, confidence))
    return Interval(*share_with_interval(int((values == 0.0).sum()), len(values), confidence))


def values_of(name: str, rows: Array) -> Array:
    """The values from which a figure is taken, (flights,); rows (flights, len(ROW_COLUMNS))."""
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
        raise InputError(f'{arg("until")} {text!r}: a figure and a width are needed, such as "r95_m width <= 0.005"')
    if found[1] not in FIGURES:
        raise InputError(f"{arg('until')} {text!r}: no such figure; known: {', '.join(FIGURES)}")
    return Stop(found[1], width)


def looks(most: int) -> list[int]:
    """After how many flights a stop is looked at, at most `most`; the last is `most`."""
    found, flights = [], float(FIRST_LOOK)
    while flights < most:
        found.append(int(flights) // FLIGHTS_TOGETHER * FLIGHTS_TOGETHER)
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
