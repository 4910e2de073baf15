"""`flownav certify`: a requirement in the words of a test plan, flown, judged, and written as a page to be signed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.campaigns.engines.named import engine_named, require_engine
from flownav.cli import options
from flownav.cli.options import KEPT, REQUIREMENTS, argument, option, out_option
from flownav.cli.output import emit
from flownav.core.errors import InputError

if TYPE_CHECKING:
    from flownav.campaigns.engines.engine import Engine
    from flownav.campaigns.plan import Plan
    from flownav.campaigns.requirement import Requirement


RequirementArgument = Annotated[
    str, argument("REQUIREMENT", "What to show", *REQUIREMENTS, beside="a requirement's FILE.toml")
]
RankingOption = Annotated[
    int, option("N", "Rows of the ranking of inputs, a power of 2, for each input; 0: none.", "--ranking")
]


def command(
    requirement: RequirementArgument,
    plan_only: Annotated[bool, typer.Option("--plan", help="Only say how many flights are needed.")] = False,
    flights: Annotated[int | None, option("N", "How many flights.", unset="as many as the requirement needs")] = None,
    ranking: RankingOption = 64,
    records: options.Records = 3,
    vehicle: options.Vehicle = None,
    engine: options.Engine = "local",
    out: Annotated[Path | None, out_option(f"The folder; {KEPT}", "out/NAME_certificate")] = None,
    as_json: options.Json = False,
) -> None:
    """Fly what a requirement asks for: pass, fail or not shown, with its risk; exit status 1 unless it passes."""
    from flownav.campaigns.certification.cells import plan_of
    from flownav.campaigns.certification.certify import TOLD
    from flownav.campaigns.ranking import LEAST
    from flownav.campaigns.requirement import load_requirement
    from flownav.cli.output import require_between
    from flownav.core.errors import VerdictError

    if flights is not None:
        require_between("--flights", flights, 1, 100_000_000)
    if ranking and (ranking & (ranking - 1) or not LEAST <= ranking <= 65_536):
        raise InputError(f"--ranking {ranking}: must be 0 or a power of 2 from {LEAST} to 65536")
    require_between("--records", records, 0, TOLD)
    require_engine(engine)
    asked = load_requirement(requirement)
    if plan_only:
        _say_plan(asked, as_json)
        return
    plan = plan_of(asked, flights, vehicle)
    folder = out or Path("out") / f"{asked.name}_certificate"
    facts = _fly(asked, plan, engine_named(engine), requirement, folder, ranking, records)
    if as_json:
        emit(facts)
    else:
        from flownav.cli.certify_table import show

        show(facts)
    if facts["verdict"] != "pass":
        worst = [one for one in facts["requirement"]["requirements"] if one["verdict"] != "pass"]
        raise VerdictError(f"{asked.name}: " + "; ".join(f"{one['verdict']}: {one['sentence']}" for one in worst))


def _fly(
    asked: Requirement, plan: Plan, engine: Engine, name: str, folder: Path, ranking: int, records: int
) -> dict[str, Any]:  # fmt: skip
    """Fly what the folder lacks, rank, write."""
    from flownav.campaigns.certification.cells import require_planned
    from flownav.campaigns.certification.certify import certify, with_ranking
    from flownav.campaigns.certification.written import write_certificate
    from flownav.campaigns.ranking import flights_of
    from flownav.campaigns.store import Store
    from flownav.cli.campaign_progress import watching
    from flownav.cli.output import progress

    inputs = max(len(cell.setup.ensemble().entries) for cell in plan.cells)
    require_planned(plan, folder)
    with Store(folder).opened(plan) as store:
        with watching(plan) as watch:
            certificate = certify(asked, plan, engine, store, watch)
        if ranking:
            with progress(f"Ranking {inputs} inputs", flights_of(inputs, ranking)) as advance:
                certificate = with_ranking(certificate, engine, store, ranking, advance)
        with progress("Writing the worst flights", records) as advance:
            return write_certificate(certificate, store, name, records, advance)


def _say_plan(asked: Requirement, as_json: bool) -> None:
    """How many flights each requirement needs, by the failures that it may have, and how many the file asks for."""
    from flownav.campaigns.certification.judgement import PLANS
    from flownav.campaigns.requirement import needed_by

    rows = [
        {
            "requirement": table.sentence(),
            "needed": {str(failures): needed_by(table, failures) for failures in PLANS},
            "allowed_failures": table.allowed_failures,
            "flights": needed_by(table),
        }
        for table in asked.requirement
    ]
    if as_json:
        emit({"requirement": asked.name, "flights": asked.flights(), "requirements": rows})
        return
    from flownav.cli.certify_table import show_plan

    show_plan(asked.name, rows, asked.flights())
