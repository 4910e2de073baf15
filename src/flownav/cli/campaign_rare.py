"""`flownav campaign --rare`: how probable an event is that hardly ever happens, and how it most likely does."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from flownav.errors import InputError

if TYPE_CHECKING:
    from flownav.campaigns.plan import Plan
    from flownav.campaigns.rare.estimate import Rare

FLIGHT, FOUND = "rare_flight.json", "rare.json"


def fly_rare(plan: Plan, event: str, folder: Path, as_json: bool) -> None:
    """Estimate, write what was found and the most likely flight, and say it."""
    from flownav.campaigns.measures import MEASURES, event_of
    from flownav.campaigns.plan import lands
    from flownav.campaigns.rare.estimate import estimate_rare
    from flownav.cli.output import progress, require_writable
    from flownav.files import written_whole

    _require_one(plan, "--rare")
    if plan.sampling != "plain" or plan.until is not None:
        raise InputError("--rare: has samples and a stop of its own; leave out --sampling and --until")
    chosen = event_of(event)
    if MEASURES[chosen.measure].of_landing and not lands(plan.cells[0].scenario):
        raise InputError(f"--rare {chosen}: the scenario {plan.cells[0].scenario.name} never lands")
    for name in (FLIGHT, FOUND):
        require_writable(folder / name)
    folder.mkdir(parents=True, exist_ok=True)
    setup, dispersed = plan.cells[0].setup, plan.cells[0].truth_model == "ensemble"
    began_s = time.monotonic()
    with progress(f"{chosen}, at most", plan.flights) as advance:
        found = estimate_rare(
            setup, chosen, seed=plan.seed, flights=plan.flights, dispersed=dispersed, on_progress=advance
        )
    rate = found.flights / (time.monotonic() - began_s)
    facts: dict[str, Any] = found.as_json() | {"cell": plan.cells[0].label, "seed": plan.seed, "known": found.known}
    with written_whole(folder / FOUND) as whole:
        whole.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    where = _keep(plan, found, folder)
    if as_json:
        typer.echo(json.dumps(facts | {"rate_per_s": rate, **where}))
    else:
        _show(facts, rate, where)


def _require_one(plan: Plan, option: str) -> None:
    """InputError where there is more than one cell."""
    if len(plan.cells) != 1:
        raise InputError(f"{option}: needs one scenario, one --truth-model and no --sweep, not {len(plan.cells)} cells")


def _keep(plan: Plan, found: Rare, folder: Path) -> dict[str, str]:
    """The most likely flight as a file, as a record and as a report; where they lie."""
    from flownav.campaigns.rare.replay import replayed, write_branch
    from flownav.cli.output import save

    if found.branch is None:
        return {}
    setup = plan.cells[0].setup
    write_branch(folder / FLIGHT, setup, found.branch, found.event, found.branch_response)
    record = folder / Path(FLIGHT).with_suffix(".fnr")
    return {"flight": str(folder / FLIGHT), **save(replayed(setup, found.branch), record, report=True)}


def fly_again(plan: Plan, path: Path, as_json: bool) -> None:
    """The flight of such a file, flown again; its record lies beside it."""
    from flownav.campaigns.rare.replay import read_branch, replayed
    from flownav.cli.output import save

    _require_one(plan, "--flight")
    setup = plan.cells[0].setup
    record = replayed(setup, read_branch(path, setup))
    where = save(record, path.with_suffix(".fnr"), report=True)
    if as_json:
        typer.echo(json.dumps({"cell": plan.cells[0].label, **record.manifest["scores"], **where}))
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
