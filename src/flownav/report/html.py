"""Write a record's report: one HTML file that needs nothing but a browser."""

import base64
import gzip
import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from flownav.core import guard
from flownav.core.errors import InputError
from flownav.core.record import Record, mapping
from flownav.report import (
    content,
    figures_errors,
    figures_filter,
    figures_innovation,
    figures_states,
    tables,
)
from flownav.report.chart import DOT_POINTS, LINE_POINTS
from flownav.report.figures_states import Paths, paths_of
from flownav.report.headline import flown_with, headline
from flownav.report.landing import landing_picture
from flownav.report.page_data import Columns, paths_data, sections_data
from flownav.report.panels import Panel, Section
from flownav.report.path_picture import path_picture
from flownav.report.series import Window, first_pad_fix_s, has, is_north_known, moments, outages, start_end_s
from flownav.report.spectrum import spectrum
from flownav.report.style import FONT, LIGHT_TO_DARK, PALETTE, Drawing
from flownav.scoring.phases import Phase, phases_of
from flownav.scoring.sensor_verdict import meanings

HERE = Path(__file__).parent
PLOTLY = "plotly.min.js"
PICTURE_STYLES = ("picture.css", "landing.css")  # of the picture on top of a page
RECORD_STYLES = ("vendor/uPlot.min.css", "page.css", "record.css", *PICTURE_STYLES)
RECORD_SCRIPTS = (
    "vendor/uPlot.iife.min.js",
    "record_data.js",
    "record_axes.js",
    "record_panels.js",
    "record_canvas.js",
    "record_paths.js",
    "record_page.js",
)


def write_report(record: Record, path: Path) -> None:
    """Write the report of a record as one HTML file, whole or not at all (temporary name, then rename).

    The page loads nothing: scripts, styles, figures and data are inside, and its content security policy
    lets only its own scripts run. Text from the record is escaped. OSError where the file cannot be written.
    """
    page = render(record)
    guard.write_page(page, path)


def sections(record: Record) -> list[Section]:
    """The figures of a record, in the order of the page; one that would stand alone in its row is made wide."""
    return [Section(key, title, tuple(widened(panels))) for key, title, panels in _sections(record)]


def widened(panels: list[Panel]) -> Iterator[Panel]:
    """Panels stand in pairs; a narrow one without a narrow neighbour takes the row."""
    narrow = [not (panel.wide or panel.absent) for panel in panels]
    paired = False  # the panel before this one awaits a neighbour
    for here, following, panel in zip(narrow, [*narrow[1:], False], panels, strict=True):
        if here and not paired and not following:
            yield replace(panel, wide=True)
        else:
            yield panel
        paired = here and not paired


def _sections(record: Record) -> list[tuple[str, str, list[Panel]]]:
    known = has(record, "truth")
    whole = [figures_errors.position_error(record), figures_errors.velocity_error(record)] if known else []
    against_gps = [] if known else [*figures_errors.residuals(record), figures_errors.error_against_gps(record)]
    filtered = [
        *figures_filter.normalised_innovations(record),
        *figures_filter.consistency(record),
        *figures_innovation.innovations(record),
    ]
    errors = [*figures_errors.from_first_fix(record), *figures_errors.flown_errors(record), *whole, *against_gps]
    uncertainty = [figures_filter.radius_of_uncertainty(record), *figures_filter.protection(record)]
    inner = figures_innovation.inner_states(record)
    vehicle = [figures_states.attitude(record), figures_states.controls(record), *figures_states.vibration(record)]
    vehicle += [*spectrum(record), *figures_states.battery(record)]
    return [
        ("path", "Flight path", [figures_states.path_over_pad(record), figures_states.ground_track(record)]),
        ("close-ups", "Take-off, touchdown and outages", figures_errors.close_ups(record)),
        ("errors", "Errors", errors),
        ("uncertainty", "Uncertainty", uncertainty),
        ("filter", "Innovations", filtered),
        *([("inner", "Biases and errors of sensors", inner)] if inner else []),
        ("states", "Position and velocity", [figures_states.position(record), figures_states.velocity(record)]),
        ("vehicle", "Vehicle", vehicle),
    ]


def render(record: Record) -> str:
    """The page as text."""
    shown = sections(record)
    from markupsafe import Markup

    found, judged = phases_of(record), tables.sensor_rows(record)
    picture = landing_picture(record) or path_picture(record)
    page: str = template("page.html.j2").render(
        title=content.title(record),
        kind=str(record.manifest.get("kind") or "flight"),
        description=str(record.manifest.get("description") or ""),
        has_truth=has(record, "truth"),
        headline=headline(record),
        flown_with=flown_with(record),
        summary=content.summary(record),
        landing=picture and Markup(picture.svg),
        landing_words=picture.words if picture else "",
        many=bool(record.manifest.get("many")),
        tiles=content.tiles(record),
        lacking=content.lacking(record),
        explained=content.explained(record),
        paper=mapping(record.manifest.get("paper")),
        scores=tables.score_rows(record),
        flown=has(record, "flown"),
        phases=tables.phase_rows(record, found),
        outages=tables.outage_rows(record, found),
        sensors=judged,
        meanings=meanings(row[-1] for row in judged),
        rejected=tables.rejected_rows(record, found),
        thinned=any(len(table["t_s"]) > DOT_POINTS for table in record.tables.values()),
        line_points=LINE_POINTS,
        dot_points=DOT_POINTS,
        told=tables.autopilot_rows(record, found),
        events=tables.events(record, found),
        parameters=tables.groups(record.manifest.get("parameters")),
        provenance=tables.groups(record.manifest.get("provenance")),
        command=tables.command(record),
        **linked_with(shown, flight_facts(record, found), paths_of(record), start_end_s(record)),
    )
    return page


def linked_with(shown: list[Section], facts: dict[str, Any], paths: Paths | None, window: Window) -> dict[str, Any]:
    """The context of a page whose panels share an instant: sections, data once, style, scripts, content policy."""
    from markupsafe import Markup

    scripts = [(HERE / name).read_text(encoding="utf-8") for name in RECORD_SCRIPTS]
    columns = Columns()
    charts = sections_data(shown, columns, window)
    views = paths_data(paths, columns)
    packed = {"steps": columns.steps, "counts": columns.counts}
    data = {"facts": facts, "charts": charts, "views": views, "columns": packed}
    return {
        "sections": shown,
        "heights": heights_px(charts),
        "facts_data": facts,
        "record_data": Markup(inside_script(json.dumps(data))),
        "record_columns": Markup(columns.text()),
        "palette": PALETTE,
        "font": Markup(FONT),
        "style": Markup("\n".join((HERE / name).read_text(encoding="utf-8") for name in RECORD_STYLES)),
        "scripts": [Markup(script) for script in scripts],
        "policy": content_policy(scripts),
    }


def flight_facts(record: Record, found: Sequence[Phase]) -> dict[str, Any]:
    """The data that all panels share: the window, phases, moments and outages, and the instant to begin with.

    That is the touchdown, or else the end.
    """
    t0, t1 = start_end_s(record)
    marked = moments(record)
    touch = next((moment.t_s for moment in marked if moment.name == "touchdown"), t1)
    fix_s = first_pad_fix_s(record)
    found_pad = [] if fix_s is None else [{"t": fix_s, "name": "first pad fix"}]
    return {
        "name": content.title(record),
        "t0": t0,
        "t1": t1,
        "step": 0.1 if t1 - t0 > 20.0 else 0.02,
        "start": min(max(touch, t0), t1),
        "north": is_north_known(record),
        "phases": [p._replace(t0=max(t0, p.t0), t1=min(t1, p.t1))._asdict() for p in found if p.t1 > t0 and p.t0 < t1],
        "moments": [*found_pad, *({"t": moment.t_s, "name": moment.name} for moment in marked)],
        "outages": [list(window) for window in outages(record)],
    }


def heights_px(charts: Mapping[str, Any]) -> dict[str, int]:
    """How high each chart will be, so that the page keeps its room before it is drawn."""
    return {key: int(len(chart["rows"]) * (chart["height"] + 6) + 20) for key, chart in charts.items()}


def drawn_with(shown: Sequence[Section]) -> dict[str, Any]:
    """The context of a page with figures: its sections, their data, colours, style, scripts and content policy."""
    from markupsafe import Markup

    plotly, own = plotly_script(), (HERE / "page.js").read_text(encoding="utf-8")
    return {
        "sections": shown,
        "palette": PALETTE,
        "font": Markup(FONT),
        "data": {one.key: Markup(figure_json(one)) for section in shown for one in section.panels if one.drawn},
        "dark": Markup(inside_script(json.dumps(LIGHT_TO_DARK))),
        "style": Markup("\n".join((HERE / name).read_text(encoding="utf-8") for name in ("page.css", *PICTURE_STYLES))),
        "plotly": Markup(base64.b64encode(gzip.compress(plotly.encode(), 9, mtime=0)).decode()),
        "scripts": [Markup(own)],
        "policy": content_policy([plotly, own]),
    }


def template(name: str, folder: Path = HERE) -> Any:
    """A page's template: what is put into it is escaped, and what it lacks is an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["coded"] = coded
    return environment.get_template(name)


def coded(text: str) -> Any:
    """Text for a page, in which what stands between backticks is code."""
    from markupsafe import Markup, escape

    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def plotly_script() -> str:
    """Plotly's script, which draws in the browser: the wheel brings it, a checkout has it from Plotly's own package.

    InputError where neither is there.
    """
    package = find_spec("plotly")
    folders = [
        HERE / "vendor",
        *(Path(place) / "package_data" for place in (package and package.submodule_search_locations) or ()),
    ]
    for folder in folders:
        if (folder / PLOTLY).is_file():
            return (folder / PLOTLY).read_text(encoding="utf-8").replace("\r", "")
    raise InputError("this page is drawn by Plotly's script, which a checkout has from: pip install 'flownav[plots]'")


def page_of(title: str, drawn: Drawing) -> str:
    """A page of one drawing that fills it, and of nothing else."""
    own = "Plotly.newPlot('drawing', ...JSON.parse(document.getElementById('figure').textContent), {responsive: true})"
    data = inside_script(json.dumps([json.loads(drawn.to_json())[part] for part in ("data", "layout")]))
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>\n'
        f'<style>html, body, #drawing {{ height: 100%; margin: 0 }}</style></head>\n<body><div id="drawing"></div>\n'
        f'<script type="application/json" id="figure">{data}</script>\n'
        f"<script>{plotly_script()}</script>\n<script>{own}</script></body></html>\n"
    )


def figure_json(panel: Panel) -> str:
    """A panel's figure as JSON for the page's script."""
    assert panel.drawn is not None
    return inside_script(panel.drawn.to_json())


def inside_script(text: str) -> str:
    """JSON that cannot end the script element that holds it."""
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def content_policy(scripts: list[str]) -> str:
    """A content security policy: nothing is loaded from anywhere, and only these scripts run."""
    digests = (base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts)
    rules: dict[str, Any] = {
        "default-src": "'none'",
        "script-src": " ".join(f"'sha256-{digest}'" for digest in digests),
        "style-src": "'unsafe-inline'",
        "img-src": "data: blob:",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    return "; ".join(f"{name} {value}" for name, value in rules.items())
