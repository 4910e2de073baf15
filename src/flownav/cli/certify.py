"""`flownav certify`: a requirement in the words of a test plan, flown, judged, and written as a page to be signed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import argument, option, out_option, switch
from flownav.cli.output import Column, answer, figure, progress, require_between, say, table_of
from flownav.core.errors import InputError, VerdictError

if TYPE_CHECKING:
    from flownav.campaigns.engines import Engine
    from flownav.campaigns.plan import Plan
    from flownav.campaigns.requirement import Requirement

WIDE = 150  # columns of the tables
FILE = "a requirement's FILE.toml"
RANKING = "Rows of the ranking of inputs, a power of 2, for each input; 0: none."
FLIGHTS = "as many as the requirement needs"
PLAN = (
    Column("requirement", "requirement"),
    Column("flights with 0 failures", lambda row: str(row["needed"]["0"])),
    Column("with 1", lambda row: str(row["needed"]["1"])),
    Column("with 2", lambda row: str(row["needed"]["2"])),
    Column("failures allowed", "allowed_failures"),
    Column("flights", "flights"),
)
JUDGED = (
    Column("requirement", "sentence"),
    Column("failed", lambda one: f"{one['failures']} of {one['flights']} ({_allowed(one)})"),
    Column("probability shown [%]", "low", ".3f", 100.0),
    Column("tolerance bound", lambda one: f"{figure(one['tolerance_bound'], '.3f')} {_unit(one)}".rstrip()),
    Column("risk [%]", "risk", ".1f", 100.0),
    Column("verdict", "verdict"),
)


def command(
    requirement: Annotated[str, argument("REQUIREMENT", "What to show", *options.REQUIREMENTS, beside=FILE)],
    plan_only: Annotated[bool, switch("Only say how many flights are needed.", "--plan")] = False,
    flights: Annotated[int | None, option("N", "How many flights.", unset=FLIGHTS)] = None,
    ranking: Annotated[int, option("N", RANKING)] = 64,
    records: options.Records = 3,
    vehicle: options.Vehicle = None,
    engine: options.Engine = "local",
    out: Annotated[Path | None, out_option(f"The folder; {options.KEPT}", "out/NAME_certificate")] = None,
    as_json: options.Json = False,
) -> None:
    """Fly what a requirement asks for: pass, fail or not shown, with its risk; exit status 1 unless it passes."""
    from flownav.campaigns.certification.cells import plan_of
    from flownav.campaigns.certification.certify import FLIGHTS_TOLD
    from flownav.campaigns.ranking import LEAST_ROWS
    from flownav.campaigns.requirement import load_requirement
    from flownav.campaigns.run import engine_named, require_engine

    if flights is not None:
        require_between("--flights", flights, 1, 100_000_000)
    if ranking and (ranking & (ranking - 1) or not LEAST_ROWS <= ranking <= 65_536):
        raise InputError(f"--ranking {ranking}: must be 0 or a power of 2 from {LEAST_ROWS} to 65536")
    require_between("--records", records, 0, FLIGHTS_TOLD)
    require_engine(engine)
    asked = load_requirement(requirement)
    if plan_only:
        _say_plan(asked, as_json)
        return
    plan = plan_of(asked, flights, vehicle)
    folder = out or Path("out") / f"{asked.name}_certificate"
    facts = _fly(asked, plan, engine_named(engine), requirement, folder, ranking, records)
    answer(facts, as_json, lambda: show(facts))
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
    from flownav.cli.campaign_said import watching

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
    from flownav.campaigns.certification.envelope import PLAN_FAILURES
    from flownav.campaigns.requirement import needed_by

    rows = [
        {
            "requirement": table.sentence(),
            "needed": {str(failures): needed_by(table, failures) for failures in PLAN_FAILURES},
            "allowed_failures": table.allowed_failures,
            "flights": needed_by(table),
        }
        for table in asked.requirement
    ]
    plan = {"requirement": asked.name, "flights": asked.flights(), "requirements": rows}
    said = f"{asked.name}: {asked.flights()} flights"
    answer(plan, as_json, lambda: say(said, table_of(PLAN, rows, left=1), wide=WIDE))


INPUTS_RANKED = 5  # inputs that are printed


def show(facts: dict[str, Any]) -> None:
    """Verdict, figures, envelope in a line, ranking, files."""
    judged = facts["requirement"]["requirements"]
    say(f"{facts['verdict'].upper()}  {facts['requirement']['name']}", table_of(JUDGED, judged, left=1), wide=WIDE)
    lines = [one["more"] for one in judged if one["more"]]
    fields, cells = facts["envelope"]["bins"], facts["envelope"]["cells"]
    if fields:
        counts = [(sum(field["verdict"] == name for field in fields), name) for name in ("pass", "not shown", "fail")]
        said = ", ".join(f"{count} {name}" for count, name in counts)
        lines.append(f"envelope  {len(fields)} fields over {' and '.join(facts['envelope']['axes'])}: {said}")
    for cell in cells if len(cells) > 1 else ():
        lines.append(f"cell      {cell['cell']}: {cell['failures']} of {cell['flights']} failed, {cell['verdict']}")
    if facts["ranking"] and facts["ranking_of"] == "nothing":
        lines.append(f"rank      nothing: all {facts['ranking_flights']} flights of the ranking have the same outcome")
    elif facts["ranking"]:
        lines += [f"rank      {_index(row, 'input')}" for row in facts["ranking"][:INPUTS_RANKED]]
        lines += [f"known     {_index(row, 'known')}" for row in facts["split"]]
    say(*lines, f"page      {facts['out']}", wide=WIDE, soft=True)


def _allowed(one: dict[str, Any]) -> str:
    return "too few flights to pass" if one["failures_allowed"] < 0 else f"at most {one['failures_allowed']}"


def _unit(one: dict[str, Any]) -> str:
    return "" if one["tolerance_bound"] is None else str(one["unit"])


def _index(row: dict[str, Any], name: str) -> str:
    first, total = (
        f"{which} {row[which]:.2f} ({row[f'{which}_interval'][0]:.2f} to {row[f'{which}_interval'][1]:.2f})"
        for which in ("first", "total")
    )
    return f"{row[name]}: {first}, {total}"
