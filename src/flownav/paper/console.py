"""The tables that `flownav paper` prints for people."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from flownav.paper import rows, words
from flownav.paper.published import HEIGHTS_M, RELATION_FITS
from flownav.paper.reproduction import Reproduction
from flownav.paper.words import Spread

WIDEST = 118
MINUS = "\N{MINUS SIGN}"


def show(of: Reproduction, page: str) -> None:
    """Every table that was reproduced, the claims and their verdicts, and where the page lies."""
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, WIDEST)
    for table in _tables(of):
        console.print(table)
    for flown in of.flights:
        console.print(f"{flown.scenario}: {words.leaking(flown)}")
    claims = Table("claim", "the paper", "here", "verdict", title="Claims put to the test", title_justify="left")
    for finding in of.findings:
        style = "" if finding.agrees else "bold"
        claims.add_row(finding.topic, finding.paper, finding.here, finding.verdict, style=style)
    console.print(claims)
    console.print(f"page  {page}", soft_wrap=True)


def _tables(of: Reproduction) -> list[Table]:
    found = []
    groups = rows.model_groups(of)
    if groups:
        names = [name for what in ("fit %", "gain", "delay ms", "√c rad/s", "damping") for name in (what, "here")]
        side_by_side = [
            rows.Group(g.title, [row._replace(cells=[text for pair in row.cells for text in pair]) for row in g.rows])
            for g in groups
        ]
        found.append(_grouped("Table 1: paper, here", "model", names, side_by_side))
        paper = rows.TableRow("the paper's relations", [f"{fit:.0f}" for fit in RELATION_FITS.values()])
        set_ups = [
            rows.TableRow(f"{name}: {what}", [fit if within else f"{fit} !" for fit, within in fits])
            for name, what, fits in rows.configurations(of)
        ]
        at = [f"{height:.1f} m" for height in HEIGHTS_M]
        found.append(_grouped("Rig set up otherwise: fit %", "configuration", at, [rows.Group("", [paper, *set_ups])]))
        instruments = [rows.TableRow(f"{name}: {what}", cells) for name, what, cells in rows.instrument_rows(of)]
        title = "Gyro and sonar otherwise: gain, delay, fit"
        found.append(_grouped(title, "one run a height", at, [rows.Group("", instruments)]))
        orders = ["gain, delay", "1", "2", "3", "4"]
        found.append(_grouped("Order of the model: fit %", "runs", orders, [rows.Group("", rows.order_rows(of))]))
    six = ["mean m/s", "here", "paper's here", "std m/s", "here", "paper's here"]
    errors, selected = rows.error_groups(of), rows.selected_rows(of)
    if errors:
        found.append(_grouped("Table 2: paper, here, the paper's model here", "model", six, errors))
    if selected:
        one = [rows.Group("", selected)]
        found.append(_grouped("Table 3: paper, here, the paper's model here", "height", six, one))
    for flown in words.flight_tables(of):
        names = ["mean", "here", "percentile", "std", "here", "percentile", "largest, here"]
        title = f"{flown.title}, {flown.flights} flights: median over 5 to 95 %"
        found.append(_grouped(title, "state", names, [rows.Group("", flown.rows)]))
    return found


def _grouped(title: str, head: str, names: list[str], groups: list[rows.Group]) -> Table:
    """A table with a line between groups."""
    table = Table(title=title, title_justify="left")
    table.add_column(head)
    for name in names:
        table.add_column(name, justify="right")
    for group in groups:
        for row in group.rows:
            table.add_row(f"{group.title} {row.head}".strip(), *(_text(cell) for cell in row.cells))
        table.add_section()
    return table


def _text(cell: str | Spread) -> str:
    """A cell; of a spread the median above its range."""
    text = cell if isinstance(cell, str) else f"{cell.median}\n{cell.between}"
    return text.replace(MINUS, "-")
