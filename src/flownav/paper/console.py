"""The tables that `flownav paper` prints for people."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from flownav.paper import words
from flownav.paper.reproduction import Reproduction

WIDEST = 118
MINUS = "\N{MINUS SIGN}"


def show(of: Reproduction, page: str) -> None:
    """Every table that was reproduced, the claims and their verdicts, and where the page lies."""
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, WIDEST)
    for table in _tables(of):
        console.print(table)
    claims = Table("claim", "the paper", "here", "verdict", title="Claims put to the test", title_justify="left")
    for finding in of.findings:
        style = "" if finding.agrees else "bold"
        claims.add_row(
            finding.topic, finding.paper, finding.here, "agrees" if finding.agrees else "differs", style=style
        )
    console.print(claims)
    console.print(f"page  {page}", soft_wrap=True)


def _tables(of: Reproduction) -> list[Table]:
    found = []
    groups = words.model_groups(of)
    if groups:
        names = ("fit %", "gain", "delay ms", "√c rad/s", "damping")
        found.append(_grouped("Table 1: paper, here", "model", [n for name in names for n in (name, "here")], [
            (group.title, [(row.head, [text for pair in row.cells for text in pair]) for row in group.rows])
            for group in groups
        ]))  # fmt: skip
        table = Table(title="Configurations of the rig: fit %", title_justify="left")
        for heading in ("configuration", "0.6 m", "0.8 m", "1.0 m", "1.5 m"):
            table.add_column(heading, justify="left" if heading == "configuration" else "right")
        table.add_row("the paper's relations", "87", "78", "72", "57")
        for name, what, fits in words.configurations(of):
            table.add_row(f"{name}: {what}", *(fit if within else f"{fit} !" for fit, within in fits))
        found.append(table)
        found.append(_grouped("Order of the model: fit %", "runs", ["gain, delay", "1", "2", "3", "4"],
                              [("", [(row.head, row.cells) for row in words.order_rows(of)])]))  # fmt: skip
    six = ["mean m/s", "here", "paper's here", "std m/s", "here", "paper's here"]
    errors = words.error_groups(of)
    if errors:
        found.append(_grouped("Table 2: paper, here, the paper's model here", "model", six,
                              [(group.title, list(group.rows)) for group in errors]))  # fmt: skip
    selected = words.selected_rows(of)
    if selected:
        found.append(_grouped("Table 3: paper, here, the paper's model here", "height", six, [("", selected)]))
    for flown in words.flight_tables(of):
        names = ["mean", "here", "percentile", "std", "here", "percentile", "largest, here"]
        found.append(_grouped(f"{flown.title}, {flown.flights} flights", "state", names, [("", flown.rows)]))
    return found


def _grouped(title: str, head: str, names: list[str], groups: list) -> Table:  # type: ignore[type-arg]
    """A table with a line between groups."""
    table = Table(title=title, title_justify="left")
    table.add_column(head)
    for name in names:
        table.add_column(name, justify="right")
    for group, rows in groups:
        for row in rows:
            name, cells = row[0], row[1]
            table.add_row(f"{group} {name}".strip(), *(cell.replace(MINUS, "-") for cell in cells))
        table.add_section()
    return table
