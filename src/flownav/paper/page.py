"""The reproduction as tables for people and as one self-contained HTML page, in the report's looks."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from flownav.core import guard
from flownav.core.provenance import command_line, provenance
from flownav.paper import figures_rig, figures_tables, published, rows, words
from flownav.paper.findings import FIT_TOLERANCE, LARGEST_TOLERANCE, SAME_SPREAD, Finding
from flownav.paper.published import HEIGHTS_M, RELATION_FITS
from flownav.paper.reproduction import Reproduction
from flownav.paper.words import Spread
from flownav.report import html as report
from flownav.report import tables
from flownav.report.panels import Panel, Section

HERE = Path(__file__).parent


def write_page(reproduction: Reproduction, path: Path) -> None:
    """Write the page, whole or not at all. OSError where it cannot be written."""
    guard.write_page(render(reproduction), path)


def figures(of: Reproduction) -> dict[str, Section]:
    """The page's figures, section by section."""
    found: dict[str, list[Panel]] = {}
    laboratory = of.laboratory
    if laboratory is not None and 1 in of.tables:
        found["models"] = [figures_tables.fit_by_height(laboratory), figures_tables.gain_and_delay(laboratory)]
        found["orders"] = figures_tables.orders(laboratory)
        found["sensor"] = [
            *figures_rig.depth(),
            *figures_rig.rotation(),
            figures_rig.light(laboratory.lights),
            *figures_rig.heights(laboratory),
        ]
    if laboratory is not None and 2 in of.tables:
        found["validation"] = [figures_tables.error_by_height(of.table_2), figures_rig.validation(laboratory)]
    for flown in of.flights:
        found[flown.scenario] = figures_tables.panels(flown)
    return {key: Section(key, "", tuple(report.widened(panels))) for key, panels in found.items()}


def render(of: Reproduction) -> str:
    """The page as text."""
    from markupsafe import Markup

    drawn = figures(of)
    given = report.drawn_with(list(drawn.values()))
    style = given.pop("style") + Markup((HERE / "page.css").read_text(encoding="utf-8"))
    del given["sections"]
    page: str = report.template("page.html.j2", HERE).render(
        facts=words.facts(of),
        summary=words.summary(of),
        tiles=words.tiles(of),
        findings=[_worded(finding) for finding in of.findings],
        limits={"fit": f"{FIT_TOLERANCE:g}", "spread": f"{SAME_SPREAD:g}", "largest": f"{100 * LARGEST_TOLERANCE:g}"},
        signal=words.signal(of),
        model_groups=rows.model_groups(of),
        identifiable=rows.identifiable(of.laboratory) if of.laboratory else "",
        configurations=rows.configurations(of),
        instrument_rows=rows.instrument_rows(of),
        rotation_leak=rows.leak_sentences(of.laboratory),
        set_up=rows.set_up(of),
        order_rows=rows.order_rows(of),
        error_groups=rows.error_groups(of),
        selected_rows=rows.selected_rows(of),
        flight_tables=words.flight_tables(of),
        systems=published.landing_systems() if of.flights else [],
        own_systems=words.own_systems(of),
        inconsistencies=published.inconsistencies() if len(of.tables) > 1 else [],
        figures=drawn,
        provenance=tables.groups(provenance()),
        command=command_line(),
        style=style,
        **given,
    )
    return page


def _worded(finding: Finding) -> Finding:
    return finding._replace(paper=rows.kept_together(finding.paper), here=rows.kept_together(finding.here))


LEAST_WIDTH = 118
MINUS = "\N{MINUS SIGN}"


def show(of: Reproduction, page: str) -> None:
    """Every table that was reproduced, the claims and their verdicts, and where the page lies."""
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, LEAST_WIDTH)
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
