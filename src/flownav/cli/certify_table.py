"""A certificate and its plan as `flownav certify` prints them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

RANKED = 5  # inputs that are printed


def show_plan(name: str, rows: Sequence[dict[str, Any]], flights: int) -> None:
    """How many flights are needed, by failures."""
    console, table = _table("requirement", "flights with 0 failures", "with 1", "with 2", "failures allowed", "flights")
    for row in rows:
        needed = [str(row["needed"][str(failures)]) for failures in (0, 1, 2)]
        table.add_row(row["requirement"], *needed, str(row["allowed_failures"]), str(row["flights"]))
    console.print(f"{name}: {flights} flights", highlight=False, markup=False)
    console.print(table)


def show(facts: dict[str, Any]) -> None:
    """Verdict, figures, envelope in a line, ranking, files."""
    console, table = _table("requirement", "failed", "probability shown [%]", "tolerance bound", "risk [%]", "verdict")
    for one in facts["requirement"]["requirements"]:
        bound, unit = one["tolerance_bound"], one["unit"]
        allowed = "too few flights to pass" if one["failures_allowed"] < 0 else f"at most {one['failures_allowed']}"
        table.add_row(
            one["sentence"], f"{one['failures']} of {one['flights']} ({allowed})", f"{100.0 * one['low']:.3f}",
            "-" if bound is None else f"{bound:.3f} {unit}".rstrip(), f"{100.0 * one['risk']:.1f}", one["verdict"],
        )  # fmt: skip
    console.print(f"{facts['verdict'].upper()}  {facts['requirement']['name']}", highlight=False, markup=False)
    console.print(table)
    lines = [one["more"] for one in facts["requirement"]["requirements"] if one["more"]]
    fields = facts["envelope"]["bins"]
    if fields:
        counts = {
            verdict: sum(field["verdict"] == verdict for field in fields) for verdict in ("pass", "not shown", "fail")
        }
        said = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
        lines.append(f"envelope  {len(fields)} fields over {' and '.join(facts['envelope']['axes'])}: {said}")
    for cell in facts["envelope"]["cells"] if len(facts["envelope"]["cells"]) > 1 else ():
        lines.append(f"cell      {cell['cell']}: {cell['failures']} of {cell['flights']} failed, {cell['verdict']}")
    if facts["ranking"] and facts["ranking_of"] == "nothing":
        lines.append(f"rank      nothing: all {facts['ranking_flights']} flights of the ranking have the same outcome")
    elif facts["ranking"]:
        lines += [f"rank      {_index(row, 'input')}" for row in facts["ranking"][:RANKED]]
        lines += [f"known     {_index(row, 'known')}" for row in facts["split"]]
    lines.append(f"page      {facts['out']}")
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _index(row: dict[str, Any], name: str) -> str:
    first, total = (
        f"{which} {row[which]:.2f} ({row[f'{which}_interval'][0]:.2f} to {row[f'{which}_interval'][1]:.2f})"
        for which in ("first", "total")
    )
    return f"{row[name]}: {first}, {total}"


def _table(first: str, *others: str) -> tuple[Any, Any]:
    from rich.console import Console
    from rich.table import Table

    console, table = Console(markup=False, highlight=False), Table()
    console.width = max(console.width, 150)
    table.add_column(first)
    for name in others:
        table.add_column(name, justify="right")
    return console, table
