"""One requirement held against the flights: verdict, bounds, risk, and what more flights would show."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.measures import MEASURES, measured
from flownav.campaigns.requirement import RequirementTable, needed_by
from flownav.campaigns.tolerance import (
    Interval,
    Verdict,
    allowed,
    flights_to_show,
    interval,
    risk,
    tolerance_bound,
    verdict,
)
from flownav.core.text import finite_or_none

Array = NDArray[np.float64]
PLANS = (0, 1, 2)  # failures of the plans that are told


class Judgement(NamedTuple):
    """A requirement's outcome.

    most: failures with which these flights would still pass, -1: none. share: one-sided bounds of the share that
    succeeds. risk: how likely these flights pass when the requirement is only just not met. bound: the tolerance bound
    of the measure, infinite where the flights give none, None of a measure that says yes or no. needs: flights by
    failures, for PLANS.
    """

    table: RequirementTable
    verdict: Verdict
    flights: int
    failures: int
    most: int
    share: Interval
    risk: float
    bound: float | None
    needs: tuple[int, ...]

    def as_json(self) -> dict[str, Any]:
        """As the certificate has it; null for a figure that is infinite."""
        table = self.table
        return {
            "measure": table.measure,
            "words": MEASURES[table.measure].words,
            "unit": MEASURES[table.measure].unit,
            "at_most" if table.upper else "at_least": table.limit,
            "probability": table.probability,
            "confidence": table.confidence,
            "sentence": table.sentence(),
            "verdict": self.verdict,
            "flights": self.flights,
            "failures": self.failures,
            "failures_allowed": self.most,
            "share": (self.flights - self.failures) / self.flights,
            "low": self.share.low,
            "high": self.share.high,
            "risk": self.risk,
            "tolerance_bound": finite_or_none(self.bound),
            "yes_or_no": table.yes_or_no,
            "needed": {str(failures): count for failures, count in zip(PLANS, self.needs, strict=True)},
            "more": self.more(),
        }

    def more(self) -> str:
        """What more flights would be needed, in words; "" where the requirement is shown."""
        table, rate = self.table, self.failures / self.flights
        if self.verdict == "pass":
            return ""
        if self.verdict == "fail":
            return "No number of flights shows it: its opposite is shown."
        enough = needed_by(table, self.failures)
        said = (
            f"{self.failures} failures in {self.flights} flights show neither. A plan that allows {self.failures} "
            f"failures needs {enough} flights"
        )
        serves = flights_to_show(rate, table.probability, table.confidence)
        if serves is None:
            return f"{said}; at the share of failures found, {100.0 * rate:.3g} %, no plan is likely to pass."
        return f"{said}; at the share of failures found, {100.0 * rate:.3g} %, one of {serves} passes 9 times in 10."


def judged(table: RequirementTable, rows: Array) -> Judgement:
    """A requirement over flights, rows (flights, len(ROW_COLUMNS))."""
    figures = measured(table.measure, rows)
    flights, failures = len(figures), int(failed(table, figures).sum())
    most = allowed(flights, table.probability, table.confidence)
    bound = None
    if not table.yes_or_no:
        bound = tolerance_bound(bad_first(table, figures), table.probability, table.confidence, upper=table.upper)
    return Judgement(
        table=table,
        verdict=verdict(flights, failures, table.probability, table.confidence),
        flights=flights,
        failures=failures,
        most=most,
        share=interval(flights, failures, table.confidence),
        risk=risk(flights, most, table.probability),
        bound=bound,
        needs=tuple(needed_by(table, count) for count in PLANS),
    )


def failed(table: RequirementTable, figures: Array) -> NDArray[np.bool_]:
    """Which flights do not meet a limit; a touchdown that was none meets none."""
    bad = figures > table.limit if table.upper else (figures < table.limit) | np.isposinf(figures)
    return np.asarray(bad)


def bad_first(table: RequirementTable, figures: Array) -> Array:
    """The figures with a touchdown that was none as the worst on the requirement's side."""
    return figures if table.upper else np.where(np.isposinf(figures), -np.inf, figures)
