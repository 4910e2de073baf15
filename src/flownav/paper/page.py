"""The reproduction as tables for people and as one self-contained HTML page, in the report's looks.

First its pictures: Tables 1 and 2, and figures 17 to 31, the report's own panels of the median take-off and landing.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from flownav.core import guard
from flownav.core.provenance import command_line, provenance
from flownav.paper import figures_rig, published, rows, words
from flownav.paper.figures_rig import HERE, PAPER
from flownav.paper.findings import FIT_TOLERANCE, LARGEST_TOLERANCE, SAME_SPREAD, Finding
from flownav.paper.flights import Flights, LiftOff
from flownav.paper.laboratory import Laboratory, delay_s
from flownav.paper.published import HEIGHTS_M, RELATION_FITS, ErrorRow
from flownav.paper.reproduction import Reproduction
from flownav.paper.words import Spread
from flownav.report import figures_errors, figures_filter, figures_states, tables
from flownav.report import html as report
from flownav.report.figures_states import View
from flownav.report.panels import Panel, Section
from flownav.report.series import moments
from flownav.scoring.percentiles import spread

APART_M = 0.008  # the paper's dots to the left, ours to the right
RING: dict[str, Any] = {"size": 8, "symbol": "circle-open", "line": {"width": 1.6}}
LAW = "2px,3px"
ORDER_NAMES = ("gain, delay", "1", "2", "3", "4")


def fit_by_height(laboratory: Laboratory) -> Panel:
    """Fits of the paper and of the rig, the other configurations, and the paper's law."""
    fine = np.linspace(0.52, 1.58, 60)
    table, runs = published.table_1(), laboratory.runs
    traces = [
        figures_rig.line("0.90 √(0.6/h)", "muted", fine, [published.accuracy_law(h) for h in fine], dash=LAW),
        *(
            figures_rig.line(other.name, colour, list(fits), list(fits.values()), dash="7px,4px", width=1.2)
            for (other, fits), colour in zip(laboratory.others, ("flow", "pad", "autopilot"), strict=False)
        ),
        figures_rig.dots("paper", PAPER, [m.height_m - APART_M for m in table], [m.fit_percent for m in table], **RING),
        figures_rig.dots("here", HERE, [r.height_m + APART_M for r in runs], [r.fits[2].fit_percent for r in runs]),
    ]
    caption = "28 models each. Dashed: other configurations of the rig, one run a height; dotted: the paper's own rule."
    figure = figures_rig.figure(traces, "height (m)", "fit (%)", xaxis=figures_rig.heights_axis())
    return Panel("fit-height", "Fit against height", caption, caption, figure)


def gain_and_delay(laboratory: Laboratory) -> Panel:
    """a/c against b/c of every model, published and reproduced."""
    traces, symbols = [], figures_rig.HEIGHT_SYMBOLS
    for height in HEIGHTS_M:
        rows = [model for model in published.table_1() if model.height_m == height]
        x, y = [1e3 * m.delay_s for m in rows], [m.gain for m in rows]
        ring: dict[str, Any] = {"symbol": f"{symbols[height]}-open", "size": 9, "line": {"width": 1.6}}
        traces.append(figures_rig.dots(f"paper, {height:.1f} m", PAPER, x, y, **ring))
    for height in HEIGHTS_M:
        runs = laboratory.at(height)
        x, y = [1e3 * delay_s(r) for r in runs], [r.fits[2].point.gain for r in runs]
        traces.append(figures_rig.dots(f"here, {height:.1f} m", HERE, x, y, symbol=symbols[height], size=8))
    caption = "Effect on a slow velocity: gain a/c and delay b/c, the two numbers that a swing can identify."
    figure = figures_rig.figure(traces, "delay b/c (ms)", "gain a/c", 400)
    return Panel("gain-delay", "Gain and delay of every model", caption, caption, figure)


def orders(laboratory: Laboratory) -> list[Panel]:
    """Fit against order, for the paper's swing and for a chirp."""
    panels = []
    axes: dict[str, dict[str, Any]] = {
        "xaxis": {"tickvals": list(range(5)), "ticktext": list(ORDER_NAMES), "range": [-0.3, 4.3]},
        "yaxis": {"range": [50, 95]},
    }
    for kind, about in (
        ("swing", "Seven runs a height, mean. A swing is one tone: every order fits it alike."),
        ("chirp", "One run a height, 0.3 to 4 Hz: here orders differ."),
    ):
        title, traces = f"Fit against order: {kind}", []
        for t in (test for test in laboratory.orders if test.kind == kind):
            name, colour = f"{t.height_m:.1f} m", figures_rig.HEIGHT_COLOURS[t.height_m]
            traces.append(figures_rig.line(name, colour, list(t.fits), list(t.fits.values()), markers=True))
        figure = figures_rig.figure(traces, "order of the model", "fit (%)", 340, **axes)
        panels.append(Panel(f"orders-{kind}", title, about, f"{title}. {about}", figure))
    return panels


def error_by_height(ours: list[ErrorRow]) -> Panel:
    """Standard deviation of the validation error against height (Table 2)."""
    fine = np.linspace(0.55, 1.55, 40)
    table = published.table_2()
    traces = [
        figures_rig.line("0.035 (h/0.6)^2.06", "muted", fine, 0.0350 * (fine / 0.6) ** 2.06, dash=LAW),
        figures_rig.dots("paper", PAPER, [r.height_m - APART_M for r in table], [r.std_error for r in table], **RING),
        figures_rig.dots("here", HERE, [r.height_m + APART_M for r in ours], [r.std_error for r in ours]),
    ]
    caption = "Table 2. Dotted: the power law through the paper's means, which the shipped sensor file uses."
    up = {"type": "log", "tickvals": [0.02, 0.03, 0.05, 0.1, 0.2, 0.3]}
    across = figures_rig.heights_axis()
    figure = figures_rig.figure(traces, "height (m)", "standard deviation (m/s)", xaxis=across, yaxis=up)
    return Panel("error-height", "Validation error against height", caption, caption, figure)


ZOOM_S = (10.0, 20.0)
# of each table: figures of position, velocity, velocity zoomed, position error, velocity error
FIGURES = {5: ("17", "Figure 18: velocity", "19 to 21", "26", "27"), 6: ("22", "Velocity", "23 to 25", "29", "30")}


def panels(flights: Flights) -> list[Panel]:
    """Everything the paper draws of a flight."""
    record, name = flights.record, flights.scenario
    what = flights.what
    position, velocity, zoomed, position_error, velocity_error = FIGURES[flights.table]
    errors = (
        ("position", position_error, figures_errors.position_error(record)),
        ("velocity", velocity_error, figures_errors.velocity_error(record)),
    )
    found = [
        figures_states.position(record, View(f"{name}-position", f"Figure {position}: position, {what}")),
        figures_states.velocity(record, View(f"{name}-velocity", f"{velocity}, {what}")),
        figures_states.velocity(record, View(f"{name}-zoom", f"Figures {zoomed}: velocity from 10 to 20 s", ZOOM_S)),
        *(
            replace(panel, key=f"{name}-{quantity}-error", title=f"Figure {number}: {quantity} error, {what}")
            for quantity, number, panel in errors
        ),
    ]
    lift_off = next((moment for moment in moments(record) if moment.name == "lift-off"), None)
    if flights.table == 5 and lift_off is not None:
        transient = figures_errors.lift_off_transient(record, lift_off)
        title = "Figure 28: thrust and vertical velocity at lift-off"
        found.append(replace(transient, key="figure-28", title=title, caption=lift_off_caption(flights.lift_off)))
    if flights.table == 6:
        radius = figures_filter.radius_of_uncertainty(record)
        found.append(replace(radius, key="figure-31", title="Figure 31: reduction of the radius of uncertainty"))
    return found


def lift_off_caption(of: LiftOff | None) -> str:
    """Where the transient comes from: the paper names the sensor's shake."""
    if of is None:
        return "The error in w about lift-off."
    shaken, unshaken, share = (spread(of_all) for of_all in (of.shaken_m_s, of.unshaken_m_s, of.frozen_inflow_share))
    if shaken is None or unshaken is None or share is None:
        return "The error in w about lift-off."
    return (
        f"The largest error in w about lift-off is {shaken['median']:.3f} m/s, median of {len(of.shaken_m_s)} "
        f"take-offs, and {unshaken['median']:.3f} m/s in the same flights with a sensor that does not shake: "
        f"{100.0 * share['median']:.0f} % of the transient ({100.0 * share['p05']:.0f} to {100.0 * share['p95']:.0f} % "
        "from flight to flight) is the filter's own model, whose printed B_red keeps the inflow frozen, not the shake "
        "that the paper explains it by. Single flights differ, since the shake may add to the transient or take from "
        "it; the two sizes depend on how the collective moves at lift-off, so on the autopilot's gains and path."
    )


FOLDER = Path(__file__).parent


def write_page(reproduction: Reproduction, path: Path) -> None:
    """Write the page, whole or not at all. OSError where it cannot be written."""
    guard.write_page(render(reproduction), path)


def figures(of: Reproduction) -> dict[str, Section]:
    """The page's figures, section by section."""
    found: dict[str, list[Panel]] = {}
    laboratory = of.laboratory
    if laboratory is not None and 1 in of.tables:
        found["models"] = [fit_by_height(laboratory), gain_and_delay(laboratory)]
        found["orders"] = orders(laboratory)
        found["sensor"] = [
            *figures_rig.depth(),
            *figures_rig.rotation(),
            figures_rig.light(laboratory.lights),
            *figures_rig.heights(laboratory),
        ]
    if laboratory is not None and 2 in of.tables:
        found["validation"] = [error_by_height(of.table_2), figures_rig.validation(laboratory)]
    for flown in of.flights:
        found[flown.scenario] = panels(flown)
    return {key: Section(key, "", tuple(report.widened(panels))) for key, panels in found.items()}


def render(of: Reproduction) -> str:
    """The page as text."""
    from markupsafe import Markup

    drawn = figures(of)
    given = report.drawn_with(list(drawn.values()))
    style = given.pop("style") + Markup((FOLDER / "page.css").read_text(encoding="utf-8"))
    del given["sections"]
    page: str = report.template("page.html.j2", FOLDER).render(
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
