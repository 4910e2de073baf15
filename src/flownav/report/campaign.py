"""A campaign as one HTML page that needs nothing but a browser, and a certificate, which prints on A4 to be signed."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from flownav.core import guard
from flownav.core.text import interval_words, key_words
from flownav.core.version import __version__
from flownav.report import campaign_figures as figures
from flownav.report import certificate_figures, tables
from flownav.report.campaign_figures import Touchdowns
from flownav.report.cloud_picture import cloud_picture
from flownav.report.content import in_words
from flownav.report.html import HERE, drawn_with, page_of, template, widened
from flownav.report.panels import NONE, Panel, Section, number

MOST_CELLS = 8  # whose touchdowns are drawn
FIGURES = {
    "r50_m": "R50 at contact (m)",
    "r95_m": "R95 at contact (m)",
    "r997_m": "R99.7 at contact (m)",
    "rest_r95_m": "R95 at rest (m)",
    "p95_axis_m": "p95 of the largest error of one axis (m)",
    "p95_horizontal_m": "p95 of the largest horizontal error (m)",
}

RADII = ("r50_m", "r95_m", "r997_m", "rest_r95_m")


def write_campaign(summary: dict[str, Any], touchdowns: Sequence[Touchdowns], kept: Sequence[str], path: Path) -> None:
    """Write the page, whole or not at all. OSError where the file cannot be written.

    summary: as `summary.json` has it; touchdowns: of each cell; kept: pages of flights, relative to this one.
    """
    guard.write_page(render(summary, touchdowns, kept), path)


def render(summary: dict[str, Any], touchdowns: Sequence[Touchdowns], kept: Sequence[str] = ()) -> str:
    """The page as text."""
    from markupsafe import Markup

    shown = sections(summary, touchdowns)
    picture = cloud_picture(summary["cells"][0], touchdowns[0]) if touchdowns else None
    page: str = template("campaign.html.j2").render(
        picture=picture and Markup(picture.svg),
        picture_words=picture.words if picture else "",
        title=", ".join(in_words(name) for name in summary["scenarios"]),
        facts=facts(summary),
        sentence=sentence(summary["cells"][0]),
        headings=headings(summary),
        rows=[cell_row(cell, summary) for cell in summary["cells"]],
        worst=[worst_row(one, summary, kept) for one in summary["worst"]],
        limits=limits(summary),
        version=__version__,
        **drawn_with(shown),
    )
    return page


def sections(summary: dict[str, Any], touchdowns: Sequence[Touchdowns]) -> list[Section]:
    """The figures, in the order of the page."""
    cells = summary["cells"]
    lands = [k for k, cell in enumerate(cells) if "r95_m" in cell["figures"]][:MOST_CELLS]
    reach_m = figures.common_reach_m([cells[k] for k in lands], [touchdowns[k] for k in lands])
    pads = [figures.over_the_pad(f"pad-{k}", cells[k], touchdowns[k], reach_m) for k in lands]
    swept = [figures.over_a_sweep(cells, name) for name in figures.swept_numbers(cells)]
    tails = figures.tails([cells[k] for k in lands], [touchdowns[k] for k in lands]) if lands else None
    winds = [*figures.swept_envelopes(cells), *(figures.envelope(f"wind-{k}", cells[k]) for k in lands)]
    inputs = [figures.sensitivity(f"inputs-{k}", cell) for k, cell in enumerate(cells[:MOST_CELLS])]
    parts: list[tuple[str, str, Sequence[Panel | None]]] = [
        ("touchdowns", "Touchdowns over the pad", pads),
        ("sweep", "Over what is swept", swept),
        ("spread", "How far off, and how sure", [tails, figures.convergence(cells[:MOST_CELLS])]),
        ("wind", "The wind that they landed in", winds),
        ("inputs", "Inputs that matter", inputs),
    ]
    drawn = [(key, title, tuple(panel for panel in panels if panel is not None)) for key, title, panels in parts]
    return [Section(key, title, panels) for key, title, panels in drawn if panels]


def facts(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """The campaign's facts as (name, value) rows."""
    models = dict.fromkeys(cell["truth_model"] for cell in summary["cells"])
    found = {"flights": f"{summary['flights']:,}", "cells": str(len(summary["cells"])), "seed": str(summary["seed"])}
    found |= {"truth": " and ".join(models), "sampling": summary["sampling"]}
    return list((found | ({"until": summary["until"]} if summary["until"] else {})).items())


def sentence(cell: dict[str, Any]) -> str:
    """The first cell's result in one sentence."""
    figure = cell["figures"].get("r95_m")
    if figure is None:
        axis = cell["figures"]["p95_axis_m"]
        if _is_few(axis, cell):
            return f"{cell['flights']} flights; the error that 95 % stay within needs {axis['flights_needed']}."
        return f"In 95 % of {cell['flights']} flights no axis was more than {_with_interval(axis)} m off."
    landed = cell["figures"]["landed"]
    share = f"{100 * landed['value']:.2f} % ({100 * landed['low']:.2f} to {100 * landed['high']:.2f} %)"
    how = f"Of {cell['flights']} flights of {cell['label']} {share} landed"
    if _is_few(figure, cell):
        return f"{how}; the radius that 95 % touch within needs {figure['flights_needed']} flights."
    if figure["value"] is None:
        return f"{how}; fewer than 95 % touched without a crash, so that no radius about the pad's centre holds 95 %."
    within = f"95 % of all first touched within {_with_interval(figure)} m of the pad's centre"
    return f"{how}; {within}. In brackets: 95 % confidence intervals."


def _is_few(figure: Mapping[str, Any], cell: Mapping[str, Any]) -> bool:
    return bool(cell["flights"] < figure.get("flights_needed", 1))


def headings(summary: dict[str, Any]) -> list[str]:
    """Headings of the table of cells."""
    return ["cell", "flights", *(FIGURES[name] for name in columns(summary)), "landed (%)", "crashed", "went around"]


def columns(summary: dict[str, Any]) -> list[str]:
    """The figures of the table: radii of touchdown where any cell lands, errors of the estimate where none does."""
    there = [name for name in FIGURES if any(name in cell["figures"] for cell in summary["cells"])]
    return [name for name in there if name in RADII] or there


def cell_row(cell: dict[str, Any], summary: dict[str, Any]) -> list[str]:
    """A cell in the table."""
    names = columns(summary)
    landed = cell["figures"].get("landed")
    share = "-" if "r95_m" not in cell["figures"] or landed is None else _percent(landed)
    counts = cell["verdicts"]
    shown = [_of_cell(cell["figures"].get(name), cell) for name in names]
    return [cell["label"], f"{cell['flights']:,}", *shown, share, str(counts["crashed"]), str(counts["went_around"])]


def worst_row(one: dict[str, Any], summary: dict[str, Any], kept: Sequence[str]) -> dict[str, str]:
    """A flight in the table of the worst."""
    page = next((page for page in kept if page.endswith(f"cell-{one['cell']:03d}-flight-{one['flight']:06d}.html")), "")
    return {
        "place": f"{one['cell']}:{one['flight']}",
        "cell": summary["cells"][one["cell"]]["label"],
        "value": "-" if one["value"] is None else number(one["value"], 3),
        "verdict": one["verdict"],
        "limited_by": one["limited_by"],
        "page": page,
    }


def limits(summary: dict[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """By cell, what limited its flights, in how many percent."""
    return [
        (
            cell["label"],
            [(name, f"{count} ({100 * count / cell['flights']:.1f} %)") for name, count in cell["limited_by"].items()],
        )
        for cell in summary["cells"][:MOST_CELLS]
    ]


def _of_cell(figure: dict[str, Any] | None, cell: Mapping[str, Any]) -> str:
    if figure is None:
        return "-"
    return f"needs {figure['flights_needed']} flights" if _is_few(figure, cell) else _with_interval(figure)


def _with_interval(figure: dict[str, float | None]) -> str:
    value, low, high = (figure[name] for name in ("value", "low", "high"))
    if value is None:
        return "-"
    return f"{value:.3f} ({interval_words(low, high)})"


def _percent(figure: dict[str, float]) -> str:
    return f"{100 * figure['value']:.2f} ({100 * figure['low']:.2f} to {100 * figure['high']:.2f})"


HEADLINES = {"pass": "Pass", "fail": "Fail", "not shown": "Not shown"}
SENTENCES = {
    "pass": "The flights show every requirement below.",
    "fail": "The flights show that a requirement below is not met.",
    "not shown": "These flights are too few, or too near a limit, to decide every requirement below.",
}
MOST_NAMED = 6  # files of a folder that are hashed one by one on the page
SIGNERS = ("Prepared by", "Checked by", "Approved by")


def render_certificate(facts: Mapping[str, Any], shown: Mapping[str, Any]) -> str:
    """The page as text. facts: as certificate.json has them; shown: what the figures show of each flight."""
    from markupsafe import Markup

    sections = sections_of(facts, shown)
    style = "".join((HERE / name).read_text(encoding="utf-8") for name in ("page.css", "certificate.css"))
    page: str = template("certificate.html.j2").render(
        facts=facts,
        own=facts["requirement"],
        title=in_words(facts["requirement"]["name"]),
        headline=HEADLINES[facts["verdict"]],
        sentence=SENTENCES[facts["verdict"]],
        together=together(facts),
        chosen=chosen(facts),
        conditions=conditions(facts),
        worst=[worst_of(facts, flight) for flight in facts["worst"]],
        axes=[key_words(name) for name in facts["envelope"]["axes"]],
        known=certificate_figures.KNOWN_WORDS,
        groups=tables.groups,
        files=[
            ("SHA-256 of what went in", facts["files"]["in"]),
            ("SHA-256 of what came out", by_folder(facts["files"]["out"])),
        ],
        signers=SIGNERS,
        dash=NONE,
        **drawn_with(sections) | {"style": Markup(style)},
        number=number,
        percent=percent,
    )
    return page


def sections_of(facts: Mapping[str, Any], shown: Mapping[str, Any]) -> list[Section]:
    """The figures in the order of the page."""
    tails = [
        certificate_figures.tail(one, shown["figures"][one["measure"]]) for one in facts["requirement"]["requirements"]
    ]
    distribution = [certificate_figures.touchdowns(facts, shown), *(panel for panel in tails if panel.drawing)]
    return [
        Section("distribution", "Figures of the flights", tuple(widened(distribution))),
        Section("envelope-map", "Under which conditions", (certificate_figures.envelope(facts),)),
        Section("sensitivity", "Inputs that decide the outcome", tuple(certificate_figures.ranking(facts))),
    ]


def together(facts: Mapping[str, Any]) -> str:
    """Whose the risk is, in words."""
    all_of_them = facts["requirement"]["requirements"]
    risk = percent(facts["risk"], 1)
    if len(all_of_them) == 1:
        return f"Consumer's risk {risk}: so likely do these flights pass when the requirement is only just not met."
    return (
        f"Each requirement is judged by itself at its own confidence, and all must pass. The consumer's risk is {risk},"
        " the largest of any one: to pass together while some requirement is not met, that one must pass by luck. It "
        "does not grow with their number. The risk of a wrong fail is of each requirement, and adds up over them."
    )


CHOSEN = {
    "seed": "The seed {} was chosen; left alone, it comes of what is asked. Who tries seeds until one passes takes "
    "more risk than is stated.",
    "flights": "The number of flights, {}, was chosen; left alone, it is what the plan needs. Other numbers are other "
    "flights: who tries them until they pass takes more risk than is stated.",
}


def chosen(facts: Mapping[str, Any]) -> list[str]:
    """The choices by hand that a certificate does not need, in sentences."""
    given = {name: facts["chosen"][name] for name in CHOSEN}
    return [CHOSEN[name].format(value) for name, value in given.items() if value is not None]


def conditions(facts: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Under what the statement holds: settings, ranges, lists."""
    own = facts["requirement"]
    rows = [("scenario", own["scenario"])]
    rows += [(name, value) for _, group in tables.groups({"set": own["set"]}) for name, value in group]
    given = dict(own["conditions"])
    for name, entry in given.pop("ranges", {}).items():
        low, high = entry.get("loc", 0.0), entry.get("loc", 0.0) + entry.get("scale", 1.0)
        even = entry["distribution"] == "uniform"
        range_words = f"{low:.15g} to {high:.15g}, evenly" if even else tables.text(entry)
        rows.append((key_words(name), range_words))
    for name, value in given.items():
        if value == []:
            continue
        many = value if isinstance(value, list) else [value]
        words = " to ".join(map(str, many)) if name == "height_m" else ", ".join(map(str, many))
        rows.append((name, words))
    return rows


def worst_of(facts: Mapping[str, Any], flight: Mapping[str, Any]) -> dict[str, Any]:
    """One of the worst flights as text."""
    of = {one["measure"]: one for one in facts["requirement"]["requirements"]}
    inputs_words = [
        number(value, 3 if of[name]["unit"] else 0) if value is not None else "none"
        for name, value in flight["figures"].items()
    ]
    inputs = [number(flight["inputs"][name], 1) for name in facts["envelope"]["axes"]]
    return dict(flight) | {"said": inputs_words, "where": inputs, "report": flight.get("report")}


def by_folder(digests: Mapping[str, str]) -> dict[str, str]:
    """Hashes of files by name, those of a folder with many as one: SHA-256 of its lines "name SHA-256"."""
    folders: dict[str, dict[str, str]] = {}
    for name, digest in digests.items():
        top, slash, _ = name.partition("/")
        folders.setdefault(top + slash, {})[name] = digest
    found: dict[str, str] = {}
    for folder, inside in folders.items():
        if len(inside) <= MOST_NAMED:
            found |= inside
        else:
            lines = "".join(f"{name} {digest}\n" for name, digest in sorted(inside.items()))
            found[f"{folder} ({len(inside)} files)"] = hashlib.sha256(lines.encode()).hexdigest()
    return found


def percent(share: float | None, digits: int = 2) -> str:
    """A share in per cent, rounded towards what it does not reach: never 100 % of what is less."""
    if share is None:
        return NONE
    text = f"{100.0 * share:.{digits}f}"
    if share < 1.0 and float(text) >= 100.0:
        text = f"{100.0 - 10.0**-digits:.{digits}f}"
    return f"{text} %"


def write_envelope(title: str, rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Write the page, whole or not at all; rows as `flownav envelope --json` has them. OSError where it cannot be."""
    guard.write_page(page_of(title, figures.envelope_figure(title, rows)), path)
