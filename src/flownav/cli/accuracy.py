"""`flownav accuracy`: what the navigator promises, case by case, and what each piece of it is worth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import chosen, option, out_option, words
from flownav.cli.output import Column, answer, figure, place, progress, require_between, with_ends
from flownav.core.errors import VerdictError

if TYPE_CHECKING:
    from flownav.campaigns.accuracy import Case

CASES = "Which cases, repeated or with commas."
LACKING = "Flights of each variant that lacks a piece of the navigator; 0 for none."
STATES = ("x", "y", "z", "u", "v", "w")
ATTITUDE = ("roll", "pitch", "yaw")
TRUTH_MODELS = ("matched", "ensemble")
BOUND = "RMSE over the bound of the filter's own model"


def command(
    flights: Annotated[int, option("N", "Flights of each case.")] = 1000,
    cases: Annotated[list[str] | None, chosen(CASES, *options.REQUIREMENTS, "all", flag="--cases")] = None,
    ablations: Annotated[int, option("N", LACKING)] = 100,
    vehicle: options.Vehicle = None,
    seed: options.Seed = 1,
    out: Annotated[Path | None, out_option("The tables as Markdown")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Hold the navigator against its targets, matched and as an ensemble; what its pieces are worth, matched."""
    from flownav.campaigns.accuracy import CASES as EVERY
    from flownav.campaigns.accuracy import flights_of, run_case
    from flownav.core.guard import write_text
    from flownav.core.marks import XML

    require_between("--flights", flights, 1, 1_000_000)
    require_between("--ablations", ablations, 0, 1_000_000)
    asked = words("--cases", cases) if cases else ["all"]
    named = EVERY if "all" in asked else tuple(asked)
    path = None if out is None else place(out, vehicle, force=force)
    with progress("Flying", flights_of(named, flights, ablations, vehicle)) as advance:
        made = [run_case(name, seed, flights, ablations, advance, vehicle) for name in named]
    text = markdown(made)
    if path is not None:
        write_text(text, path, XML)
    facts: dict[str, Any] = {"flights": flights, "ablation_flights": ablations, "seed": seed}
    facts |= {"cases": [case.as_json() for case in made]} | ({"out": str(path)} if path else {})
    answer(facts, as_json, lambda: typer.echo(text))
    missed = [f"{case.name}: {target.sentence()}" for case in made for target in case.targets if not target.kept]
    if missed:
        raise VerdictError("; ".join(missed))


def markdown(made: list[Case]) -> str:
    """The tables as they are printed and as docs/explanation/accuracy.md has them."""
    parts = [_targets(made), _known(made)]
    parts += [table(made, model) for table in (_accuracy, _touchdowns, _consistency) for model in TRUTH_MODELS]
    parts += [_over_stated(made), _could_be(made), _by_height(made)]
    parts += [_ablations(case) for case in made if case.ablations]
    return "\n\n".join(parts) + "\n"


def _targets(made: list[Case]) -> str:
    rows = [
        (case.name, target.truth_model, target.what, f"{target.value:.3f}",
         f"{'>=' if target.at_least else '<='} {target.limit:g}", "kept" if target.kept else "MISSED")
        for case in made for target in case.targets
    ]  # fmt: skip
    return _table(("case", "truth", "figure", "measured", "target", ""), rows)


def _known(made: list[Case]) -> str:
    return _table(("case", "known to the vehicle without error"), [(case.name, case.known) for case in made])


def _consistency(made: list[Case], truth_model: str) -> str:
    from flownav.scoring.consistency import GROUP_FLIGHTS

    together = f"steps with the ANEES of {min(made[0].flights, GROUP_FLIGHTS)} flights in its band"
    heading = (f"{truth_model}: {BOUND}, at the horizon", *STATES, "ANEES", together, "of all flights")
    rows = []
    for case in made:
        facts = getattr(case, truth_model)
        shares = (facts["anees"], facts["anees_inside_fraction"], facts["anees_inside_fraction_of_all_flights"])
        rows.append((case.name, *_ratios(facts["rmse_over_bound"]), *(f"{share:.3f}" for share in shares)))
    return _table(heading, rows)


def _accuracy(made: list[Case], truth_model: str) -> str:
    what = f"{truth_model}: RMSE of the autopilot's input, in flight [m, m/s, °]"
    largest = ("p95 of largest error of one axis [m]", "p95 of largest horizontal error [m] (95 % interval)")
    rows = []
    for case in made:
        facts = getattr(case, truth_model)
        errors, axis = (_length(rms) for rms in facts["rms_error"]), _length(facts["p95_largest_axis_m"])
        turned = (figure(rms, ".2f") for rms in facts["rms_attitude_deg"].values())
        rows.append(
            (case.name, *errors, *turned, axis, _interval(facts, "p95_largest_horizontal"), str(facts["crashed"]))
        )
    return _table((what, *STATES, *ATTITUDE, *largest, "crashed"), rows)


def _touchdowns(made: list[Case], truth_model: str) -> str:
    """Touchdowns of the cases that land."""
    ends = ("R95 at contact [m] (95 % interval)", "R95 at rest [m] (95 % interval)")
    parts = ("estimate, p95 [m]", "guidance, p95 [m]", "pad, p95 [m]")
    rows = []
    for case in made:
        landing = getattr(case, truth_model)["touchdown"]
        if landing is not None:
            rate, limited = landing["success"], landing["limited_by"]
            success = with_ends(100.0 * rate["rate"], (100.0 * rate["low"], 100.0 * rate["high"]), form=".1f")
            sizes = (_length(limited[name]) for name in ("estimate_m", "guidance_m", "pad_m"))
            aloft = {name: landing["verdicts"].get(name, 0) for name in ("went around", "beside the pad")}
            failed = {**landing["unfinished"], **aloft, **landing["broken"]}
            why = ", ".join(f"{what} {count}" for what, count in failed.items() if count) or "-"
            radii = (_interval(landing[end], "r95") for end in ("contact", "rest"))
            rows.append((case.name, *radii, *sizes, success, why))
    return _table((f"{truth_model}: touchdown", *ends, *parts, "landed [%] (95 % interval)", "not landed by"), rows)


def _over_stated(made: list[Case]) -> str:
    """The table of states whose error is larger or smaller than the navigator states."""
    rows = [
        (case.name, model, *_ratios(getattr(case, model)["error_over_stated"]))
        for case in made for model in TRUTH_MODELS
    ]  # fmt: skip
    return _table(("RMS of the error over what is stated of it, at the horizon", "truth", *STATES), rows)


def _could_be(made: list[Case]) -> str:
    """The shares of steps in the consistency band: as stated, and with the covariance scaled once or at each step."""
    shares = ("anees_inside_fraction", "anees_inside_fraction_sized", "anees_inside_fraction_sized_at_each_step")
    rows = [
        (case.name, model, f"{facts['anees']:.2f}", *(figure(facts[share], ".2f") for share in shares))
        for case in made for model in TRUTH_MODELS for facts in [getattr(case, model)]
    ]  # fmt: skip
    heading = ("share of the steps in flight in the band", "truth", "ANEES", "as stated")
    return _table((*heading, "were the case's size right", "were each step's size right"), rows)


def _by_height(made: list[Case]) -> str:
    bands = ((case.name, *band) for case in made for band in case.matched["rmse_over_bound_by_height"].items())
    rows = [(name, band, *_ratios(ratios)) for name, band, ratios in bands]
    return _table((f"matched: {BOUND}", "height of the skids", *STATES), rows)


def _ablations(case: Case) -> str:
    columns = (
        Column("p95 of largest horizontal error [m]", "p95_largest_horizontal_m", ".3f"),
        Column("horizontal RMSE ratio", "horizontal_rms_ratio", ".2f"),
        Column("vertical RMSE ratio", "vertical_rms_ratio", ".2f"),
        Column("horizontal speed RMSE ratio", "horizontal_speed_rms_ratio", ".2f"),
        Column("ANEES", "anees", ".3g"),
        Column("touchdown R95 at rest [m]", "rest_r95_m", ".3f"),
        Column("crashed", "crashed", ""),
    )
    rows = [(lacking, *(column.cell(row) for column in columns)) for lacking, row in case.ablations.items()]
    return _table((f"{case.name} without", *(column.title for column in columns)), rows)


def _ratios(by_state: dict[str, float]) -> Iterator[str]:
    return (f"{by_state[state]:.3f}" for state in STATES)


def _length(number: float | None) -> str:
    return figure(number, ".3f")


def _interval(facts: dict[str, Any], name: str) -> str:
    return with_ends(facts[f"{name}_m"], facts[f"{name}_interval_m"])


def _table(heading: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """A Markdown table whose columns stand under each other."""
    widths = [max(len(row[i]) for row in (heading, *rows)) for i in range(len(heading))]
    rule = tuple("-" * width for width in widths)
    lines = (heading, rule, *rows)
    return "\n".join(
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)) + " |" for line in lines
    )
