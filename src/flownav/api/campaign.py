"""Campaign: what many flights showed: figures with intervals, a table of flights, a page, flights flown again."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flownav.api.arguments import checked
from flownav.api.calls import writing
from flownav.api.record import Record
from flownav.api.table import library
from flownav.campaigns.engines import Engine
from flownav.campaigns.measures import measured
from flownav.campaigns.plan import Plan
from flownav.campaigns.run import record_again
from flownav.campaigns.store import RECORDS, REPORT, Dataset
from flownav.core.errors import InputError
from flownav.core.text import finite_or_none, interval_words
from flownav.parts.flying import recording_of

if TYPE_CHECKING:
    import pandas

    from flownav.report.campaign_figures import Touchdowns

SHOWN = ("r95_m", "landed", "p95_axis_m")


class Campaign:
    """Many flights of one scenario or more, cell by cell: a cell is a scenario at one combination of swept values.

    plan: the request. folder: where the flights lie. summary: every figure with its interval, as summary.json has it.
    rate_per_s: flights a second, None where none was missing. records: of flights that were kept.

    Example:
        >>> import flownav
        >>> result = flownav.campaign("landing", flights=16)
        >>> result.summary["flights"]
        16
    """

    def __init__(
        self, plan: Plan, folder: Path, summary: dict[str, Any], rate_per_s: float | None = None,
        engine: Engine | None = None,
    ) -> None:  # fmt: skip
        self.plan, self.folder, self.summary, self.rate_per_s = plan, folder, summary, rate_per_s
        self.records: list[Path] = []
        self._engine = engine

    @property
    def cells(self) -> list[dict[str, Any]]:
        """Each cell's label, swept values, figures with intervals, verdicts and worst flights.

        Example:
            >>> flownav.campaign("landing", flights=16).cells[0]["label"]
            'landing ensemble'
        """
        found: list[dict[str, Any]] = self.summary["cells"]
        return found

    @property
    def worst(self) -> list[dict[str, Any]]:
        """The worst flights of all cells, the worst first: cell, flight, value, verdict, limited_by.

        Example:
            >>> sorted(flownav.campaign("landing", flights=16).worst[0])
            ['cell', 'flight', 'limited_by', 'value', 'verdict']
        """
        found: list[dict[str, Any]] = self.summary["worst"]
        return found

    @checked
    def figure(self, name: str, cell: int = 0) -> dict[str, float | None]:
        """One figure of a cell: value, low and high (its 95 % interval). InputError names those that there are.

        All three are None where there are fewer flights than `flights_needed`.

        Example:
            >>> figure = flownav.campaign("landing", flights=20).figure("p95_axis_m")
            >>> figure["value"] > 0.0
            True
        """
        figures = self.cells[cell]["figures"]
        if name not in figures:
            raise InputError(f"{name}: no such figure of {self.cells[cell]['label']}; there are {', '.join(figures)}")
        found: dict[str, float | None] = figures[name]
        return found

    def to_pandas(self) -> pandas.DataFrame:
        """Every flight as a row: cell, flight, what is swept (set.*), verdict, scores, what was drawn for it (input.*).

        InputError where pandas is not installed.

        Example:
            >>> len(flownav.campaign("landing", flights=16).to_pandas())
            16
        """
        frames_of, data = library("pandas"), Dataset(self.folder)
        frames = [data.table(cell).to_pandas() for cell in range(len(self.plan.cells))]
        found: pandas.DataFrame = frames_of.concat(frames, ignore_index=True)
        return found

    @checked
    def record(self, flight: int, *, cell: int = 0) -> Record:
        """One flight of the campaign flown again, to the bit, as a record. InputError where there is no such flight.

        Example:
            >>> result = flownav.campaign("landing", flights=16)
            >>> result.record(result.worst[0]["flight"]).manifest["kind"]
            'fly'
        """
        if not 0 <= cell < len(self.plan.cells):
            raise InputError(f"cell {cell}: there are cells 0 to {len(self.plan.cells) - 1}")
        if not 0 <= flight < self.plan.flights:
            raise InputError(f"flight {flight}: there are flights 0 to {self.plan.flights - 1} of each cell")
        return Record.of(record_again(self.plan, cell, flight, recording_of(self._engine)))

    @checked
    def plot(self, cell: int = 0) -> Any:
        """Where the flights of a cell first touched the pad, with their radii, as a Plotly figure.

        InputError where they were not to land.

        Example:
            >>> figure = flownav.campaign("landing", flights=16).plot()
            >>> len(figure.data) > 0
            True
        """
        from flownav.report.campaign_figures import common_reach_m, over_the_pad

        own, touched = self.cells[cell], self._touchdowns(cell)
        if "r95_m" not in own["figures"]:
            raise InputError(f"{own['label']}: its flights were not to land; plot needs a scenario that lands")
        return over_the_pad("pad", own, touched, common_reach_m([own], [touched])).figure

    @checked
    def report(self, path: str | Path | None = None) -> Path:
        """Write the campaign as one HTML page; where it lies, which is in its folder unless a path is given.

        InputError where nothing can be written there.

        Example:
            >>> flownav.campaign("landing", flights=16).report(folder / "campaign.html").name
            'campaign.html'
        """
        from flownav.report.campaign import write_campaign

        page = self.folder / REPORT if path is None else Path(path)
        kept = [f"{RECORDS}/{record.with_suffix('.html').name}" for record in self.records]
        with writing(page):
            write_campaign(self.summary, [self._touchdowns(cell) for cell in range(len(self.cells))], kept, page)
        return page

    def _touchdowns(self, cell: int) -> Touchdowns:
        """Where a cell's flights touched."""
        from flownav.report.campaign_figures import Touchdowns

        rows = Dataset(self.folder).rows(cell)
        north, east, distance = (measured(f"touchdown.{name}_m", rows) for name in ("north", "east", "horizontal"))
        return Touchdowns(north, east, distance, float(self.plan.cells[cell].scenario.pad.size_m))

    def __repr__(self) -> str:
        lines = [f"<Campaign {', '.join(self.summary['scenarios'])}: {self.summary['flights']} flights>"]
        for cell in self.cells:
            words = ", ".join(_words(name, cell["figures"][name]) for name in SHOWN if name in cell["figures"])
            lines.append(f"  {cell['label']}: {words}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        names = [name for name in SHOWN if any(name in cell["figures"] for cell in self.cells)]
        head = "".join(f"<th>{escape(title)}</th>" for title in ("cell", "flights", *names))
        rows = "".join(
            f"<tr><td>{escape(cell['label'])}</td><td>{cell['flights']}</td>"
            + "".join(f"<td>{escape(_number(cell['figures'].get(name)))}</td>" for name in names)
            + "</tr>"
            for cell in self.cells
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _words(name: str, figure: dict[str, float | None]) -> str:
    return f"{name} {_number(figure)}"


def _number(figure: dict[str, float | None] | None) -> str:
    """A figure with its interval."""
    if figure is None or figure["value"] is None:
        return "-"
    low, high = map(finite_or_none, (figure["low"], figure["high"]))
    return f"{figure['value']:.3f} [{interval_words(low, high, join=', ')}]"
