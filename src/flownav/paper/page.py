"""The reproduction as one self-contained HTML page, in the report's looks."""

from __future__ import annotations

import json
from pathlib import Path

from flownav.core import guard
from flownav.core.provenance import command_line, provenance
from flownav.paper import figures_flight, figures_rig, figures_tables, leaks, published, rows, words
from flownav.paper.findings import FIT_TOLERANCE, LARGEST_TOLERANCE, SAME_SPREAD, Finding
from flownav.paper.reproduction import Reproduction
from flownav.report import content
from flownav.report import html as report
from flownav.report.panels import Panel, Section
from flownav.report.style import FONT, LIGHT_TO_DARK, PALETTE

HERE = Path(__file__).parent


def write_page(reproduction: Reproduction, path: Path) -> None:
    """Write the page, whole or not at all. OSError where it cannot be written."""
    text = render(reproduction)
    guard.write_page(text, path)


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
        found[flown.scenario] = figures_flight.panels(flown)
    return {key: Section(key, "", tuple(report.widened(panels))) for key, panels in found.items()}


def render(of: Reproduction) -> str:
    """The page as text."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    drawn = figures(of)
    scripts = [get_plotlyjs().replace("\r", ""), (report.HERE / "page.js").read_text(encoding="utf-8")]
    environment = Environment(
        loader=FileSystemLoader(HERE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    panels = [panel for section in drawn.values() for panel in section.panels if panel.figure]
    return environment.get_template("page.html.j2").render(
        facts=words.facts(of),
        summary=words.summary(of),
        tiles=words.tiles(of),
        findings=[_worded(finding) for finding in of.findings],
        limits={
            "fit": f"{FIT_TOLERANCE:g}",
            "spread": f"{SAME_SPREAD:g}",
            "largest": f"{100 * LARGEST_TOLERANCE:g}",
        },
        signal=words.signal(of),
        model_groups=rows.model_groups(of),
        identifiable=rows.identifiable(of.laboratory) if of.laboratory else "",
        configurations=rows.configurations(of),
        instrument_rows=rows.instrument_rows(of),
        rotation_leak=leaks.leak_sentences(of.laboratory),
        set_up=rows.set_up(of),
        order_rows=rows.order_rows(of),
        error_groups=rows.error_groups(of),
        selected_rows=rows.selected_rows(of),
        flight_tables=words.flight_tables(of),
        systems=published.landing_systems() if of.flights else [],
        own_systems=words.own_systems(of),
        inconsistencies=published.inconsistencies() if len(of.tables) > 1 else [],
        figures=drawn,
        provenance=content.groups(provenance()),
        command=command_line(),
        palette=PALETTE,
        font=Markup(FONT),
        data={panel.key: Markup(report.figure_json(panel)) for panel in panels},
        dark=Markup(report.inside_script(json.dumps(LIGHT_TO_DARK))),
        style=Markup(
            (report.HERE / "page.css").read_text(encoding="utf-8") + (HERE / "page.css").read_text(encoding="utf-8")
        ),
        scripts=[Markup(script) for script in scripts],
        policy=report.content_policy(scripts),
    )


def _worded(finding: Finding) -> Finding:
    return finding._replace(paper=words.kept_together(finding.paper), here=words.kept_together(finding.here))
