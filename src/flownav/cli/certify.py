"""`flownav certify`: a requirement in the words of a test plan, flown, judged, and written as a page to be signed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from flownav.cli import options
from flownav.cli.options import argument, option, out_option, switch
from flownav.cli.output import Column, answer, figure, progress, require_between, say, table_of
from flownav.core.errors import InputError, VerdictError
from flownav.core.guard import an_output_folder, require_may_be_made
from flownav.core.text import key_words

if TYPE_CHECKING:
    from flownav.campaigns.engines import Engine
    from flownav.campaigns.plan import Plan
    from flownav.campaigns.requirement import Requirement

MOST_FLIGHTS = 100_000_000
WIDE = 150  # columns of the tables
FILE = "a requirement's FILE.toml"
RANKING = "Rows of the ranking of inputs, a power of 2, for each input; 0: none."
FLIGHTS = "as many as the requirement needs"
AGAIN = "Fly this number of flights again, drawn at random; they must be the same to the bit."
SIGN = "Sign the certificate with this Ed25519 key (PEM or OpenSSH); extra `sign`."
VERIFY = "Look a certificate's folder through: files, rows, figures, flights."
KEY = "With --verify: the signer's public key."
PLAN = (
    Column("requirement", "requirement"),
    Column("flights with 0 failures", lambda row: str(row["needed"]["0"])),
    Column("with 1", lambda row: str(row["needed"]["1"])),
    Column("with 2", lambda row: str(row["needed"]["2"])),
    Column("failures allowed", "allowed_failures"),
    Column("flights", "flights"),
)
CHECKED = (Column("looked at", "what"), Column("found", "found"), Column("", "said"))
JUDGED = (
    Column("requirement", "sentence"),
    Column("failed", lambda one: f"{one['failures']} of {one['flights']} ({_allowed(one)})"),
    Column("probability shown [%]", "low", ".3f", 100.0),
    Column("tolerance bound", lambda one: f"{figure(one['tolerance_bound'], '.3f')} {_unit(one)}".rstrip()),
    Column("risk [%]", "risk", ".1f", 100.0),
    Column("verdict", "verdict"),
)

Requirements = Annotated[
    str | None,
    argument("REQUIREMENT", "The requirement", *options.REQUIREMENTS, beside=FILE, default="none with --verify"),
]


def command(
    requirement: Requirements = None,
    plan_only: Annotated[bool, switch("Only say how many flights are needed.", "--plan")] = False,
    flights: Annotated[int | None, option("N", "How many flights.", unset=FLIGHTS)] = None,
    ranking: Annotated[int, option("N", RANKING)] = 64,
    records: options.Records = 3,
    vehicle: options.Vehicle = None,
    engine: options.Engine = "local",
    again: Annotated[int, option("N", AGAIN)] = 64,
    sign: Annotated[Path | None, option("KEY", SIGN)] = None,
    verify: Annotated[Path | None, option("DIR", VERIFY)] = None,
    key: Annotated[Path | None, option("KEY", KEY)] = None,
    out: Annotated[Path | None, out_option(f"The folder; {options.KEPT}", "out/NAME_certificate")] = None,
    as_json: options.Json = False,
) -> None:
    """Fly what a requirement asks for: pass, fail or not shown, with its risk; exit status 1 unless it passes.

    With --verify a certificate is held against its folder instead, and exit status 1 says that it does not hold, or
    that its flights could not be flown again.
    """
    from flownav.campaigns.certification.cells import plan_of
    from flownav.campaigns.certification.certify import FLIGHTS_NAMED
    from flownav.campaigns.certification.signing import private_key
    from flownav.campaigns.ranking import LEAST_ROWS, MOST_ROWS
    from flownav.campaigns.requirement import load_requirement
    from flownav.campaigns.run import engine_named, require_engine
    from flownav.campaigns.store import Store

    require_between("--again", again, 1, MOST_FLIGHTS)
    if verify is not None:
        _verify(verify, requirement, again, key, as_json)
        return
    if key is not None:
        raise InputError("--key: is held against a certificate with --verify; give --sign to sign one")
    if requirement is None:
        raise InputError(f"REQUIREMENT: give one of {', '.join(options.REQUIREMENTS)}, or {FILE}")
    if flights is not None:
        require_between("--flights", flights, 1, MOST_FLIGHTS)
    if ranking and (ranking & (ranking - 1) or not LEAST_ROWS <= ranking <= MOST_ROWS):
        raise InputError(f"--ranking {ranking}: must be 0 or a power of 2 from {LEAST_ROWS} to {MOST_ROWS}")
    require_between("--records", records, 0, FLIGHTS_NAMED)
    require_engine(engine)
    asked = load_requirement(requirement)
    plan = plan_of(asked, flights, vehicle)
    signer = None if sign is None else private_key(sign)
    if plan_only:  # what cannot be flown, signed or written is refused here, as it is without --plan
        for cell in range(len(plan.cells)):
            plan.ready(cell)
        engine_named(engine)
        if out is not None:
            Store(an_output_folder(out)).check(plan.as_json)
            require_may_be_made(out)
        _say_plan(asked, as_json)
        return
    folder = out or Path("out") / f"{asked.name}_certificate"
    how = How(engine_named(engine), ranking, records, again, signer)
    facts = _fly(asked, plan, how, requirement, folder)
    answer(facts, as_json, lambda: show(facts))
    if facts["verdict"] != "pass":
        worst = [one for one in facts["requirement"]["requirements"] if one["verdict"] != "pass"]
        raise VerdictError(f"{asked.name}: " + "; ".join(f"{one['verdict']}: {one['sentence']}" for one in worst))


class How(NamedTuple):
    """The engine; rows of the ranking; records; flights that are flown again; the key that signs."""

    engine: Engine
    ranking: int
    records: int
    again: int
    signer: Any


def _fly(asked: Requirement, plan: Plan, how: How, name: str, folder: Path) -> dict[str, Any]:
    """Fly what the folder lacks, and some of it again, rank, write, sign."""
    from flownav.campaigns.certification.cells import require_planned
    from flownav.campaigns.certification.certify import certify, checked, with_ranking
    from flownav.campaigns.certification.signing import SIGNATURE, sign
    from flownav.campaigns.certification.written import FACTS, write_certificate
    from flownav.campaigns.engines import Local
    from flownav.campaigns.ranking import flights_of
    from flownav.campaigns.store import Dataset, Store
    from flownav.cli.campaign_output import watching

    inputs = max(len(cell.setup.ensemble().entries) for cell in plan.cells)
    require_planned(plan, folder)
    with Store(folder).opened(plan) as store:
        with watching(plan) as watch:
            certificate = certify(asked, plan, how.engine, store, watch)
        with progress("Flying some again", how.again) as advance:
            certificate = checked(certificate, Dataset(folder), Local(), how.again, advance)
        if how.ranking:
            with progress(f"Ranking {inputs} inputs", flights_of(inputs, how.ranking)) as advance:
                certificate = with_ranking(certificate, how.engine, store.folder, how.ranking, advance)
        with progress("Writing the worst flights", how.records) as advance:
            facts = write_certificate(certificate, store, name, how.records, advance)
        if how.signer is not None:
            sign(folder / FACTS, how.signer)
        else:
            (folder / SIGNATURE).unlink(missing_ok=True)
        return facts


def _verify(folder: Path, requirement: str | None, again: int, key: Path | None, as_json: bool) -> None:
    """Check a certificate's folder, and print what holds. VerdictError where something does not."""
    from flownav.campaigns.certification.verify import verify
    from flownav.campaigns.engines import Local

    with progress("Flying some again", again) as advance:
        found = verify(folder, Local(), requirement=requirement, sample=again, key=key, on_progress=advance)
    facts = found.as_json()
    words = f"{facts['verification'].upper()}  {facts['requirement']}, certified as: {facts['verdict']}"
    answer(facts, as_json, lambda: say(words, table_of(CHECKED, facts["checks"], left=3), wide=WIDE))
    if found.wrong:
        raise VerdictError(f"{folder}: {'; '.join(found.wrong)}")


def _say_plan(asked: Requirement, as_json: bool) -> None:
    """How many flights each requirement needs, by the failures that it may have, and how many the file asks for."""
    from flownav.campaigns.certification.envelope import PLAN_FAILURES
    from flownav.campaigns.measures import MEASURES
    from flownav.campaigns.requirement import needed_by
    from flownav.campaigns.tolerance import allowed

    flights = asked.flights()
    rows = [
        {
            "requirement": table.sentence(),
            "words": MEASURES[table.measure].words,
            "needed": {str(failures): needed_by(table, failures) for failures in PLAN_FAILURES},
            "allowed_failures": table.allowed_failures,
            "flights": needed_by(table),
            "allowed_of_all": allowed(flights, table.probability, table.confidence),
        }
        for table in asked.requirement
    ]
    plan = {"requirement": asked.name, "flights": flights, "requirements": rows}
    words = f"{asked.name}: {flights} flights"
    answer(plan, as_json, lambda: say(words, table_of(PLAN, rows, left=1), *_more_allowed(flights, rows), wide=WIDE))


def _more_allowed(flights: int, rows: list[dict[str, Any]]) -> list[str]:
    """How many failures the requirements may have that need fewer flights than all, of which each is judged."""
    return [
        f"{row['requirement']}: of all {flights} flights {row['allowed_of_all']} may fail"
        for row in rows
        if row["flights"] < flights
    ]


INPUTS_RANKED = 5  # inputs that are printed
KNOWN = {
    "build": "all that is known once it is built",
    "day": "all that is known on the day",
    "never": "what nobody knows",
}


def show(facts: dict[str, Any]) -> None:
    """Verdict, figures, envelope in a line, ranking, files."""
    judged = facts["requirement"]["requirements"]
    say(f"{facts['verdict'].upper()}  {facts['requirement']['name']}", table_of(JUDGED, judged, left=1), wide=WIDE)
    lines = [f"{one['words']}: {one['more']}" for one in judged if one["more"]]
    fields, cells = facts["envelope"]["bins"], facts["envelope"]["cells"]
    if fields:
        counts = [(sum(field["verdict"] == name for field in fields), name) for name in ("pass", "not shown", "fail")]
        words = ", ".join(f"{count} {name}" for count, name in counts)
        lines.append(
            f"envelope  {len(fields)} fields over {' and '.join(map(key_words, facts['envelope']['axes']))}: {words}"
        )
    for cell in cells if len(cells) > 1 else ():
        lines.append(f"cell      {cell['cell']}: {cell['failures']} of {cell['flights']} failed, {cell['verdict']}")
    if facts["ranking"] and facts["ranking_of"] == "nothing":
        lines.append(f"rank      nothing: all {facts['ranking_flights']} flights of the ranking have the same outcome")
    elif facts["ranking"]:
        lines += _ranking(facts)
    again = facts["flown_again"]
    lines.append(
        f"again     {again['sample']} flights drawn at random and {again['margin']} at the margin, to the same bits"
    )
    lines += [f"chosen    {name} {value}" for name, value in facts["chosen"].items() if value is not None]
    say(*lines, wide=WIDE)
    say(f"page      {facts['out']}", soft=True)


def _allowed(one: dict[str, Any]) -> str:
    return "too few flights to pass" if one["failures_allowed"] < 0 else f"at most {one['failures_allowed']}"


def _unit(one: dict[str, Any]) -> str:
    return "" if one["tolerance_bound"] is None else str(one["unit"])


WIDEST_INDEX = 0.5  # an index whose interval is wider shows nothing
INDICES = ("first", "total")


def _ranking(facts: dict[str, Any]) -> list[str]:
    """The first inputs of the ranking and the split, a line each; one line where its rows are too few for any index."""
    rows = [("rank", key_words(row["input"]), row) for row in facts["ranking"][:INPUTS_RANKED]]
    rows += [("known", KNOWN[row["known"]], row) for row in facts["split"]]
    if not any(_is_known(row, which) for *_, row in rows for which in INDICES):
        return ["rank      too few rows to rank any input; give a larger --ranking"]
    return [f"{head:<10}{name}: {', '.join(_index(row, which) for which in INDICES)}" for head, name, row in rows]


def _is_known(row: dict[str, Any], which: str) -> bool:
    low, high = row[f"{which}_interval"]
    return bool(high - low <= WIDEST_INDEX)


def _index(row: dict[str, Any], which: str) -> str:
    """An index of an input; no figure of one that the rows of the ranking are too few for."""
    low, high = row[f"{which}_interval"]
    return f"{which} {row[which]:.2f} ({low:.2f} to {high:.2f})" if _is_known(row, which) else f"{which} unknown"
