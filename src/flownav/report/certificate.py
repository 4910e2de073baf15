"""The certificate as one HTML page that needs nothing but a browser, and prints on A4 to be signed."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

from flownav.report import certificate_figures as figures
from flownav.report import tables
from flownav.report.html import HERE, drawn_with, template, widened
from flownav.report.panels import NONE, Section, number

HEADLINES = {"pass": "Pass", "fail": "Fail", "not shown": "Not shown"}
SENTENCES = {
    "pass": "The flights show every requirement below.",
    "fail": "The flights show that a requirement below is not met.",
    "not shown": "The flights show neither that every requirement below is met nor that one is not.",
}
MOST_NAMED = 6  # files of a folder that are hashed one by one on the page
SIGNERS = ("Prepared by", "Checked by", "Approved by")


def render(facts: Mapping[str, Any], shown: Mapping[str, Any]) -> str:
    """The page as text. facts: as certificate.json has them; shown: what the figures show of each flight."""
    from markupsafe import Markup

    sections = sections_of(facts, shown)
    style = "".join((HERE / name).read_text(encoding="utf-8") for name in ("page.css", "certificate.css"))
    page: str = template("certificate.html.j2").render(
        facts=facts,
        own=facts["requirement"],
        headline=HEADLINES[facts["verdict"]],
        sentence=SENTENCES[facts["verdict"]],
        together=together(facts),
        conditions=conditions(facts),
        worst=[worst_row(facts, told) for told in facts["worst"]],
        measures=[one["measure"] for one in facts["requirement"]["requirements"]],
        axes=[figures.INPUT_WORDS.get(name, name) for name in facts["envelope"]["axes"]],
        known=figures.KNOWN_WORDS,
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
    tails = [figures.tail(one, shown["figures"][one["measure"]]) for one in facts["requirement"]["requirements"]]
    distribution = [figures.touchdowns(facts, shown), *(panel for panel in tails if panel.figure)]
    return [
        Section("distribution", "What the flights did", tuple(widened(distribution))),
        Section("envelope-map", "Under which conditions", (figures.envelope(facts),)),
        Section("sensitivity", "What decides the outcome", tuple(figures.ranking(facts))),
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


def conditions(facts: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Under what the statement holds: settings, ranges, lists."""
    own = facts["requirement"]
    rows = [("scenario", own["scenario"])]
    rows += [(name, value) for _, group in tables.groups({"set": own["set"]}) for name, value in group]
    given = dict(own["conditions"])
    for name, entry in given.pop("ranges", {}).items():
        low, high = entry.get("loc", 0.0), entry.get("loc", 0.0) + entry.get("scale", 1.0)
        even = entry["distribution"] == "uniform"
        said = f"{low:g} to {high:g}, evenly" if even else tables.text(entry)
        rows.append((figures.INPUT_WORDS.get(name, name), said))
    for name, value in given.items():
        if value == []:
            continue
        many = value if isinstance(value, list) else [value]
        words = " to ".join(map(str, many)) if name == "height_m" else ", ".join(map(str, many))
        rows.append((name, words))
    return rows


def worst_row(facts: Mapping[str, Any], told: Mapping[str, Any]) -> dict[str, Any]:
    """One of the worst flights as text."""
    of = {one["measure"]: one for one in facts["requirement"]["requirements"]}
    said = [
        number(value, 3 if of[name]["unit"] else 0) if value is not None else "none"
        for name, value in told["figures"].items()
    ]
    inputs = [number(told["inputs"][name], 1) for name in facts["envelope"]["axes"]]
    return dict(told) | {"said": said, "where": inputs, "report": told.get("report")}


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
