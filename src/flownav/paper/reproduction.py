"""The whole reproduction, or one table of it: the computed results, as JSON, and their findings on the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from flownav.paper import findings, laboratory, published
from flownav.paper.findings import Finding
from flownav.paper.flights import Flights, fly_table
from flownav.paper.laboratory import Laboratory
from flownav.paper.published import ErrorRow

TABLES = (1, 2, 3, 5, 6)
RIG_TABLES = (1, 2, 3)
FLIGHT_TABLES = (5, 6)


@dataclass(frozen=True)
class Reproduction:
    """Results of the reproduction; a table that was not asked for is None or empty."""

    tables: tuple[int, ...]
    seed: int
    laboratory: Laboratory | None = None
    table_2: list[ErrorRow] = field(default_factory=list)
    table_2_published_models: list[ErrorRow] = field(default_factory=list)
    table_3: list[ErrorRow] = field(default_factory=list)
    table_3_published_model: list[ErrorRow] = field(default_factory=list)
    flights: tuple[Flights, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def broken(self) -> list[Finding]:
        """The findings for which the command exits with status 1."""
        return findings.broken(list(self.findings))

    def with_flights(self, other: Reproduction) -> Reproduction:
        """This one with the flights of another."""
        tables, sentences = (*self.tables, *other.tables), (*self.findings, *other.findings)
        return replace(self, tables=tables, flights=other.flights, findings=sentences)

    def as_json(self) -> dict[str, Any]:
        """The command's JSON: table1 to table6 as far as asked for, and more beside them."""
        facts: dict[str, Any] = {}
        if self.laboratory is not None and 1 in self.tables:
            facts["table1"] = _table_1_rows(self.laboratory)
        if 2 in self.tables:
            every = zip(published.table_2(), self.table_2, self.table_2_published_models, strict=True)
            facts["table2"] = [_error_row(*rows, model=rows[0].model) for rows in every]
        if 3 in self.tables:
            every = zip(published.table_3(), self.table_3, self.table_3_published_model, strict=True)
            facts["table3"] = [_error_row(*rows) for rows in every]
        facts |= {f"table{flown.table}": flown.as_json() for flown in self.flights}
        if self.laboratory is not None and self.laboratory.orders:
            fixed = {height: self.laboratory.mean_fit(height) for height in published.HEIGHTS_M}
            set_ups = [(self.laboratory.fixed, fixed), *self.laboratory.others]
            facts["orders"] = [
                {"excitation": test.kind, "height_m": test.height_m, "fit_by_order": _keyed(test.fits)}
                for test in self.laboratory.orders
            ]
            facts["configurations"] = [
                {"name": other.name, "description": other.words, "fit_by_height": _keyed(fits)}
                for other, fits in set_ups
            ]
        if self.laboratory is not None and self.laboratory.instruments:
            facts["instruments"] = [
                {
                    "name": other.name,
                    "description": other.words,
                    "by_height": {f"{height:g}": found._asdict() for height, found in by_height.items()},
                }
                for other, by_height in self.laboratory.instruments
            ]
        facts["findings"] = [finding.as_json() for finding in self.findings]
        facts["seed"] = self.seed
        return facts


def _keyed(fits: Mapping[int, float] | Mapping[float, float]) -> dict[str, float]:
    """With keys that JSON takes."""
    return {f"{key:g}": fit for key, fit in fits.items()}


def _table_1_rows(of: Laboratory) -> list[dict[str, Any]]:
    rows = []
    for model in published.table_1():
        run = of.at(model.height_m)[model.model - 1]
        shown = run.excitation
        rows.append(
            {
                "height_m": model.height_m,
                "model": model.model,
                "fit_published": model.fit_percent,
                "fit_reproduced": run.fits[2].fit_percent,
                "gain": model.gain,
                "delay_s": model.delay_s,
                "gain_reproduced": run.fits[2].point.gain,
                "delay_reproduced_s": laboratory.delay_s(run),
                "identifiable_reproduced": shown.identifiable,
                "excitation_reproduced": shown.verdict,
            }
            | {f"{name}_published": float(getattr(model, name)) for name in ("a_1_s2", "b_1_s", "c_1_s2")}
            | {f"{name}_reproduced": float(getattr(run.dynamics, name)) for name in ("a_1_s2", "b_1_s", "c_1_s2")}
        )
    return rows


def _error_row(printed: ErrorRow, ours: ErrorRow, theirs: ErrorRow, **more: Any) -> dict[str, Any]:
    """Published, reproduced, and the published model on our runs."""
    pairs = {
        f"{error}_{whose}": getattr(row, error)
        for error in ("mean_error", "std_error")
        for whose, row in (("published", printed), ("reproduced", ours))
    }
    own = {"mean_error_of_published_model": theirs.mean_error, "std_error_of_published_model": theirs.std_error}
    return {"height_m": printed.height_m, **pairs, **more, **own}


def reproduce(
    tables: tuple[int, ...],
    seed: int,
    flights: int,
    on_run: Callable[[int], object] = lambda done: None,
    on_flight: Callable[[int], object] = lambda flown: None,
) -> Reproduction:
    """Run the rig, identify, fly and judge, as far as these tables need it."""
    of, sentences = None, []
    more: dict[str, list[ErrorRow]] = {}
    if set(tables) & set(RIG_TABLES):
        of = laboratory.swing(seed, 1 in tables, on_run)
        sentences += findings.of_laboratory(of) if 1 in tables else []
        validation = laboratory.table_2(of, lambda run, _: run.dynamics)
        if 2 in tables:
            printed = {(row.height_m, row.model): row for row in published.table_1()}
            more["table_2"] = validation
            more["table_2_published_models"] = laboratory.table_2(of, lambda run, model: printed[run.height_m, model])
            sentences += findings.of_table_2(validation)
        if 3 in tables:
            more["table_3"] = laboratory.table_3(of)
            more["table_3_published_model"] = laboratory.table_3(of, published.selected_model())
            sentences += findings.of_table_3(more["table_3"], validation)
    flown = tuple(fly_table(table, seed, flights, on_flight) for table in FLIGHT_TABLES if table in tables)
    for of_table in flown:
        sentences += findings.of_flights(of_table)
    return Reproduction(tables, seed, of, flights=flown, findings=tuple(sentences), **more)
