"""`flownav accuracy`: what the navigator promises, case by case, and what each piece of it is worth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import REQUIREMENTS, one_of, out_option
from flownav.cli.output import emit

if TYPE_CHECKING:
    from flownav.campaigns.accuracy import Case

STATES = ("x", "y", "z", "u", "v", "w")
TRUTH_MODELS = ("matched", "ensemble")
BOUND = "RMSE over the bound of the filter's own model"


def command(
    flights: Annotated[int, typer.Option(metavar="N", help="Flights of each case.")] = 1000,
    cases: Annotated[
        list[str] | None,
        typer.Option("--cases", help="Which cases, repeated or with commas.", **one_of(*REQUIREMENTS, "all")),
    ] = None,
    ablations: Annotated[
        int, typer.Option(metavar="N", help="Flights of each variant that lacks a piece of the navigator; 0 for none.")
    ] = 100,
    vehicle: options.Vehicle = None,
    seed: options.Seed = 1,
    out: Annotated[Path | None, out_option("The tables as Markdown")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Hold the navigator against its targets, matched and as an ensemble; what its pieces are worth, matched."""
    from flownav.campaigns.accuracy import CASES, flights_of, run_case
    from flownav.cli.options import words
    from flownav.cli.output import place, progress, require_between
    from flownav.core.errors import VerdictError

    require_between("--flights", flights, 1, 1_000_000)
    require_between("--ablations", ablations, 0, 1_000_000)
    asked = words("--cases", cases) if cases else ["all"]
    chosen = CASES if "all" in asked else tuple(asked)
    path = None if out is None else place(out, vehicle, force=force)
    with progress("Flying", flights_of(chosen, flights, ablations, vehicle)) as advance:
        made = [run_case(name, seed, flights, ablations, advance, vehicle) for name in chosen]
    text = markdown(made)
    if path is not None:
        from flownav.core.guard import written_whole

        with written_whole(path) as temporary:
            temporary.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
    if as_json:
        facts: dict[str, Any] = {"flights": flights, "ablation_flights": ablations, "seed": seed}
        facts |= {"cases": [case.as_json() for case in made]} | ({"out": str(path)} if path else {})
        emit(facts)
    else:
        typer.echo(text)
    missed = [f"{case.name}: {target.sentence()}" for case in made for target in case.targets if not target.kept]
    if missed:
        raise VerdictError("; ".join(missed))


def markdown(made: list[Case]) -> str:
    """The tables as they are printed and as docs/explanation/accuracy.md has them."""
    parts = [_targets(made), _known(made)]
    parts += [table(made, model) for table in (_accuracy, _touchdowns, _consistency) for model in TRUTH_MODELS]
    parts += [_over_stated(made), _by_height(made)]
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
    return _table(("case", "what the vehicle knows exactly"), [(case.name, case.known) for case in made])


def _consistency(made: list[Case], truth_model: str) -> str:
    from flownav.scoring.consistency import GROUP_FLIGHTS

    rows = []
    for case in made:
        facts = getattr(case, truth_model)
        ratios = (_ratio(facts["rmse_over_bound"][state]) for state in STATES)
        shares = (facts["anees"], facts["anees_inside_fraction"], facts["anees_inside_fraction_of_all_flights"])
        rows.append((case.name, *ratios, *(f"{share:.3f}" for share in shares)))
    heading = (
        f"{truth_model}: {BOUND}, at the horizon",
        *STATES,
        "ANEES",
        f"steps with the ANEES of {min(made[0].flights, GROUP_FLIGHTS)} flights in its band",
        "of all flights",
    )
    return _table(heading, rows)


def _accuracy(made: list[Case], truth_model: str) -> str:
    rows = []
    for case in made:
        facts = getattr(case, truth_model)
        errors = (_length(rms) for rms in facts["rms_error"])
        axis = _length(facts["p95_largest_axis_m"])
        rows.append((case.name, *errors, axis, _interval(facts, "p95_largest_horizontal"), str(facts["crashed"])))
    heading = (
        f"{truth_model}: RMSE of what was flown on, in flight [m, m/s]",
        *STATES,
        "p95 of largest error of one axis [m]",
        "p95 of largest horizontal error [m] (95 % interval)",
        "crashed",
    )
    return _table(heading, rows)


def _touchdowns(made: list[Case], truth_model: str) -> str:
    """Of the cases that land."""
    rows = []
    for case in made:
        landing = getattr(case, truth_model)["touchdown"]
        if landing is not None:
            rate, limited = landing["success"], landing["limited_by"]
            success = f"{100.0 * rate['rate']:.1f} ({100.0 * rate['low']:.1f}-{100.0 * rate['high']:.1f})"
            parts = (_length(limited[name]) for name in ("estimate_m", "guidance_m", "pad_m"))
            ends = (_interval(landing[end], "r95") for end in ("contact", "rest"))
            aloft = {"went around": landing["verdicts"].get("went around", 0)}
            failed = {**landing["unfinished"], **aloft, **landing["broken"]}
            why = ", ".join(f"{what} {count}" for what, count in failed.items() if count) or "-"
            rows.append((case.name, *ends, *parts, success, why))
    heading = (
        f"{truth_model}: touchdown",
        "R95 at contact [m] (95 % interval)",
        "R95 at rest [m] (95 % interval)",
        "estimate, p95 [m]",
        "guidance, p95 [m]",
        "pad, p95 [m]",
        "landed [%] (95 % interval)",
        "not landed by",
    )
    return _table(heading, rows)


def _over_stated(made: list[Case]) -> str:
    """Which state's error is larger or smaller than the navigator says."""
    rows = [
        (case.name, model, *(_ratio(getattr(case, model)["error_over_stated"][state]) for state in STATES))
        for case in made for model in TRUTH_MODELS
    ]  # fmt: skip
    return _table(("RMS of the error over what is stated of it, at the horizon", "truth", *STATES), rows)


def _by_height(made: list[Case]) -> str:
    rows = [
        (case.name, band, *(_ratio(ratios[state]) for state in STATES))
        for case in made for band, ratios in case.matched["rmse_over_bound_by_height"].items()
    ]  # fmt: skip
    return _table((f"matched: {BOUND}", "height of the skids", *STATES), rows)


def _ablations(case: Case) -> str:
    def cells(row: dict[str, Any]) -> tuple[str, ...]:
        ratios = (row["horizontal_rms_ratio"], row["vertical_rms_ratio"], row["horizontal_speed_rms_ratio"])
        return (
            _length(row["p95_largest_horizontal_m"]), *(f"{ratio:.2f}" for ratio in ratios), f"{row['anees']:.3g}",
            _length(row["rest_r95_m"]), str(row["crashed"]),
        )  # fmt: skip

    rows = [(lacking, *cells(row)) for lacking, row in case.ablations.items()]
    heading = (
        f"{case.name} without",
        "p95 of largest horizontal error [m]",
        "horizontal RMSE ratio",
        "vertical RMSE ratio",
        "horizontal speed RMSE ratio",
        "ANEES",
        "touchdown R95 at rest [m]",
        "crashed",
    )
    return _table(heading, rows)


def _ratio(ratio: float) -> str:
    return f"{ratio:.3f}"


def _length(number: float | None) -> str:
    return "-" if number is None else f"{number:.3f}"


def _interval(facts: dict[str, Any], name: str) -> str:
    value, ends = facts[f"{name}_m"], facts[f"{name}_interval_m"]
    if value is None:
        return "-"
    return f"{value:.3f} ({'-'.join('?' if end is None else f'{end:.3f}' for end in ends)})"


def _table(heading: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """A Markdown table whose columns stand under each other."""
    widths = [max(len(row[i]) for row in (heading, *rows)) for i in range(len(heading))]
    rule = tuple("-" * width for width in widths)
    lines = (heading, rule, *rows)
    return "\n".join(
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)) + " |" for line in lines
    )
