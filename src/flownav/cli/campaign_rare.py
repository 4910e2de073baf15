"""`flownav campaign --rare`: how probable an event is that hardly ever happens, and how it most likely does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from flownav.cli.output import emit

if TYPE_CHECKING:
    from flownav.campaigns.plan import Plan


def fly_rare(plan: Plan, event: str, folder: Path, as_json: bool) -> None:
    """Estimate, write what was found and the most likely flight, and say it."""
    from flownav.api.campaigning import estimate_event, rare_event_of
    from flownav.cli.output import folder_place, progress

    chosen = rare_event_of(plan, event)
    folder = folder_place(folder)
    with progress(f"{chosen}, at most", plan.flights) as advance:
        found = estimate_event(plan, chosen, folder, advance)
    if as_json:
        emit(found.facts | {"rate_per_s": found.rate_per_s, **found.where})
    else:
        _show(found.facts, found.rate_per_s, found.where)


def fly_again(plan: Plan, path: Path, as_json: bool) -> None:
    """The flight of such a file, flown again; its record lies beside it."""
    from flownav.api.campaigning import fly_branch

    record, where = fly_branch(plan, path)
    if as_json:
        emit({"cell": plan.cells[0].label, **record.scores, **where})
    else:
        typer.echo(f"{plan.cells[0].label}, {path}\nrecord  {where['record']}\nreport  {where['report']}")


def _show(facts: dict[str, Any], rate: float, where: dict[str, str]) -> None:
    """For people."""
    cv = "nothing happened" if facts["cv"] is None else f"coefficient of variation {facts['cv']:.2f}"
    typer.echo(f"{facts['cell']}: {facts['event']}")
    typer.echo(
        f"probability {facts['probability']:.3g}, {facts['low']:.3g} to {facts['high']:.3g} with "
        f"{100 * facts['confidence']:.0f} % confidence; {cv}"
    )
    typer.echo(f"{facts['flights']} flights, {rate:.0f} a second")
    if not facts["known"] and facts["cv"] is not None:
        typer.echo("the coefficient of variation is above 0.3: fly it again with more --flights")
    if len(facts["parts"]) > 1:
        for part in facts["parts"]:
            typer.echo(f"  {part['part']}: {part['probability']:.3g}, at most {part['high']:.3g}")
    for title, rows, name in (
        ("inputs", facts["likely"]["inputs"], "input"), ("noise", facts["likely"]["noise"], "source"),
    ):  # fmt: skip
        if rows:
            typer.echo(f"{title} of these flights, in standard deviations of all flights")
        for row in rows:
            span = f" {row['from_s']:g} to {row['to_s']:g} s" if "from_s" in row else ""
            typer.echo(f"  {row[name]}{span}: mean {row['mean_sigma']:+.2f}, spread {row['spread_sigma']:.2f}")
    for name, path in where.items():
        typer.echo(f"{name}  {path}")
