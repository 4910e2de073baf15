"""A campaign's progress on standard error: flights, rate, time left, and the figure that is followed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flownav.campaigns.plan import Plan
    from flownav.campaigns.run import Progress


class Shown:
    """What a campaign is watched by. flown: flights that this process has flown."""

    def __init__(self, bar: Any, task: Any) -> None:
        self._bar, self._task = bar, task
        self.flown = 0

    def __call__(self, progress: Progress) -> None:
        """Show how far the campaign is."""
        self.flown = progress.flown
        self._bar.update(
            self._task, completed=progress.have, total=progress.most, cell=progress.cell, figure=figure_words(progress)
        )


def figure_words(progress: Progress) -> str:
    """The figure that is followed, with its interval."""
    from flownav.campaigns.measures import FIGURES

    if progress.interval is None:
        return ""
    unit = FIGURES[progress.figure].unit
    value, low, high = (f"{end:.3f}" if abs(end) < 1e9 else "-" for end in progress.interval)
    return f"{progress.figure} {value} ({low} to {high}) {unit}".rstrip()


@contextmanager
def watching(plan: Plan) -> Iterator[Shown]:
    """A bar on standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
    from rich.text import Text

    class Rate(ProgressColumn):
        """Flights a second."""

        def render(self, task: Any) -> Text:
            """Of the last half minute."""
            return Text(f"{task.speed:.0f}/s" if task.speed else "")

    columns = (
        TextColumn("{task.fields[cell]}"), BarColumn(bar_width=20), MofNCompleteColumn(), Rate(), TimeRemainingColumn(),
        TextColumn("{task.fields[figure]}"),
    )  # fmt: skip
    total = plan.flights * len(plan.cells)
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=total, cell=plan.cells[0].label, figure="")
        yield Shown(bar, task)
