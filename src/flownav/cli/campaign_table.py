"""What a campaign says on the terminal: a row a cell, what became of its flights, the worst ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from flownav.campaigns.run import place_of


def show(summary: dict[str, Any], folder: Path, rate: float | None, records: list[str]) -> None:
    """The table, the worst flights, and where everything lies."""
    from rich.console import Console
    from rich.table import Table

    cells = summary["cells"]
    lands = any("r95_m" in cell["figures"] for cell in cells)
    figures = ("r50_m", "r95_m", "r997_m", "rest_r95_m") if lands else ("p95_axis_m", "p95_horizontal_m")
    titles = {
        "r50_m": "R50 [m]", "r95_m": "R95 at contact [m]", "r997_m": "R99.7 [m]", "rest_r95_m": "R95 at rest [m]",
        "p95_axis_m": "p95 of one axis [m]", "p95_horizontal_m": "p95 horizontal [m]",
    }  # fmt: skip
    table = Table()
    table.add_column("cell")
    table.add_column("flights", justify="right")
    for name in figures:
        table.add_column(titles[name], justify="right")
    for title in ("landed [%]", "crashed", "went around"):
        table.add_column(title, justify="right")
    for cell in cells:
        landed = cell["figures"].get("landed")
        table.add_row(
            cell["label"], str(cell["flights"]), *(_interval(cell["figures"].get(name)) for name in figures),
            f"{100 * landed['value']:.1f} ({100 * landed['low']:.1f}-{100 * landed['high']:.1f})" if landed else "-",
            str(cell["verdicts"]["crashed"]), str(cell["verdicts"]["went_around"]),
        )  # fmt: skip
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, 72 + max(len(cell["label"]) for cell in cells) + 22 * len(figures))
    console.print(table, highlight=False)
    typer.echo("worst flights (CELL:FLIGHT):")
    for one in summary["worst"][:5]:
        value = "-" if one["value"] is None else f"{one['value']:.3f} m"
        typer.echo(f"  {place_of(one['cell'], one['flight']):10s} {value:>9s}  {one['verdict']}, {one['limited_by']}")
    for cell in cells:
        if cell["stopped"] is False:
            typer.echo(f"{cell['label']}: {cell['flights']} flights were not enough for --until {summary['until']}")
    speed = "nothing was missing" if rate is None else f"{rate:.0f} flights/s"
    typer.echo(f"{summary['flights']} flights ({speed}), in brackets 95 % intervals")
    typer.echo(f"folder  {folder}   page  {folder / 'report.html'}")
    for path in records:
        typer.echo(f"record  {path}")


def _interval(figure: dict[str, float | None] | None) -> str:
    if figure is None or figure["value"] is None:
        return "-"
    low, high = ("?" if end is None else f"{end:.3f}" for end in (figure["low"], figure["high"]))
    return f"{figure['value']:.3f} ({low}-{high})"
