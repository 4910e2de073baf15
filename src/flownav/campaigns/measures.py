"""What is measured of a flight, by the names that requirements, events and stops use.

A touchdown that did not happen is infinitely bad: of a flight that crashed, never touched or never came to rest a
measure of its touchdown is infinite, as R95 has it.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.scoring.errors import SCORE_COLUMNS, touchdown_rows
from flownav.scoring.landings import EXPECTED, crashed, succeeded

Array = NDArray[np.float64]

CRASH, NOT_LANDED = "crash", "not_landed"
LARGEST_HORIZONTAL = "largest_horizontal_m"
EVENT = re.compile(r"\s*([\w.]+)\s*(?:(>|<)\s*(\S+))?\s*")
# a row of a campaign: the scores, and what a flight's history told beside them
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
        """Whether it says something only of flights that were to land."""
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
    Measure("estimate.axis_m", "m", "largest error of one axis of the estimate that is flown on",
            "max_position_error_m", of_touchdown=False),
    Measure("estimate.horizontal_m", "m", "largest horizontal error of the estimate that is flown on",
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
