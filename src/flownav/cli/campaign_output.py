"""The output of a campaign: its progress on standard error, a row a cell, the worst flights, and a rare event."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from flownav.cli.output import Column, answer, folder_place, progress, say, table_of, with_ends

if TYPE_CHECKING:
    from flownav.campaigns.plan import Plan
    from flownav.campaigns.run import Progress as CampaignProgress

LANDED = {
    "r50_m": "R50 [m]", "r95_m": "R95 at contact [m]", "r997_m": "R99.7 [m]", "rest_r95_m": "R95 at rest [m]",
}  # fmt: skip
ALOFT = {"p95_axis_m": "p95 of one axis [m]", "p95_horizontal_m": "p95 horizontal [m]"}
COUNTS = (Column("cell", "label"), Column("flights", "flights"))
ENDS = (
    Column("landed [%]", lambda cell: _landed(cell)),
    Column("crashed", lambda cell: str(cell["verdicts"]["crashed"])),
    Column("went around", lambda cell: str(cell["verdicts"]["went_around"])),
)


def figure_words(progress: CampaignProgress) -> str:
    """The figure that is followed, with its interval."""
    from flownav.campaigns.measures import FIGURES

    if progress.interval is None:
        return ""
    unit = FIGURES[progress.figure].unit
    value, low, high = (f"{end:.3f}" if abs(end) < 1e9 else "-" for end in progress.interval)
    return f"{progress.figure} {value} ({low} to {high}) {unit}".rstrip()


@contextmanager
def watching(plan: Plan) -> Iterator[Callable[[CampaignProgress], None]]:
    """A bar on standard error, which the value moves on; above it a line for every damaged file that is flown again."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
    from rich.text import Text

    class Rate(ProgressColumn):
        """Flights a second."""

        def render(self, task: Any) -> Text:
            """Flights a second over the last half minute."""
            return Text(f"{task.speed:.0f}/s" if task.speed else "")

    columns = (
        TextColumn("{task.fields[cell]}"), BarColumn(bar_width=20), MofNCompleteColumn(), Rate(), TimeRemainingColumn(),
        TextColumn("{task.fields[figure]}"),
    )  # fmt: skip
    total = plan.flights * len(plan.cells)
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task, shown = bar.add_task("", total=total, cell=plan.cells[0].label, figure=""), set[str]()

        def show_progress(how_far: CampaignProgress) -> None:
            for line in how_far.damaged:
                if line not in shown:
                    shown.add(line)
                    bar.console.print(f"flownav: {line}; its flights are flown again", markup=False, soft_wrap=True)
            words = figure_words(how_far)
            bar.update(task, completed=how_far.have, total=how_far.most, cell=how_far.cell, figure=words)

        yield show_progress


def show(summary: dict[str, Any], folder: Path, rate: float | None, records: list[str]) -> None:
    """The table, the worst flights, and where everything lies."""
    from flownav.campaigns.run import place_of

    cells = summary["cells"]
    lands = any("r95_m" in cell["figures"] for cell in cells)
    figures = [_of_figure(title, name) for name, title in (LANDED if lands else ALOFT).items()]
    wide = 72 + max(len(cell["label"]) for cell in cells) + 22 * len(figures)
    say(table_of((*COUNTS, *figures, *ENDS), cells, left=1), wide=wide)
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


def _of_figure(title: str, name: str) -> Column:
    def cell(row: dict[str, Any]) -> str:
        found = row["figures"].get(name)
        few = found is not None and row["flights"] < found["flights_needed"]
        return f"needs {found['flights_needed']} flights" if few else _interval(found)

    return Column(title, cell)


def _landed(cell: dict[str, Any]) -> str:
    landed = cell["figures"].get("landed")
    if not landed:
        return "-"
    value, low, high = (100 * landed[end] for end in ("value", "low", "high"))
    return with_ends(value, (low, high), form=".1f")


def _interval(figure: dict[str, float | None] | None) -> str:
    return "-" if figure is None else with_ends(figure["value"], (figure["low"], figure["high"]))


def fly_rare(plan: Plan, event: str, folder: Path, as_json: bool) -> None:
    """Estimate the probability of a very rare event, write it with the most likely flight, and print it."""
    from flownav.api.campaigning import estimate_event, rare_event_of

    chosen = rare_event_of(plan, event)
    folder = folder_place(folder)
    with progress(f"{chosen}, at most", plan.flights) as advance:
        found = estimate_event(plan, chosen, folder, advance)
    facts = found.facts | {"rate_per_s": found.rate_per_s, **found.where}
    answer(facts, as_json, lambda: show_rare(found.facts, found.rate_per_s, found.where))


def fly_again(plan: Plan, path: Path, as_json: bool) -> None:
    """The flight of such a file, flown again; its record lies beside it."""
    from flownav.api.campaigning import fly_branch

    record, where = fly_branch(plan, path)
    say_flight({"cell": plan.cells[0].label, **record.scores, **where}, str(path), as_json)


def say_flight(facts: dict[str, Any], which: str, as_json: bool) -> None:
    """A flight that was flown again, and where it lies."""
    message = f"{facts['cell']}, {which}\nrecord  {facts['record']}\nreport  {facts['report']}"
    answer(facts, as_json, lambda: typer.echo(message))


def show_rare(facts: dict[str, Any], rate: float, where: dict[str, str]) -> None:
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
