"""An explanation as JSON, as lines of a table, and as one HTML page with the evidence as pictures."""

from pathlib import Path
from typing import Any

from flownav.core import guard
from flownav.core.text import finite
from flownav.core.version import __version__
from flownav.report.chart import Stack
from flownav.report.html import linked_with, template
from flownav.report.panels import Panel, Section, listed
from flownav.report.series import Moment
from flownav.studies.explain.astray import Astray
from flownav.studies.explain.hypothesis import words
from flownav.studies.explain.judge import Checked, Explanation, Finding
from flownav.studies.explain.sign import Picture, Window

HEADINGS = ("Cause", "Sign", "Probability", "Explained", "Seconds", "Tried")
DASH = "\N{EN DASH}"
LEAST_SHOWN = 0.02
SLACK_S = 2.0


def facts(explained: Explanation) -> dict[str, Any]:
    """The output of `flownav explain --json`, except the files that it wrote."""
    facts_found: dict[str, Any] = finite(
        {
            "log": explained.log,
            "verdict": explained.verdict,
            "first": None if explained.first is None else explained.first.name,
            "autopilot": explained.dialect or None,
            "causes": [_cause(one) for one in explained.findings],
            "checked": [_checked(one) for one in explained.checked],
            "missing": [{"cause": name, "what": what} for name, what in explained.missing],
        }
    )
    return facts_found


def _cause(one: Finding) -> dict[str, Any]:
    return {
        "cause": one.name,
        "title": one.title,
        "sentence": one.sentence,
        "t0_s": one.window_s[0],
        "t1_s": one.window_s[1],
        "probability": one.probability,
        "explained": one.explained,
        **_astray(one.astray),
        "beside_replay": one.beside_replay or None,
        "figures": dict(one.figures),
        "cure": {
            "parameters": [{"name": p.name, "value": p.value, "reason": p.reason} for p in one.cure.settings],
            "by_hand": one.cure.by_hand,
            "holds": one.cure.holds,
        },
    }


def _checked(one: Checked) -> dict[str, Any]:
    trial = one.trial
    return {
        "cause": one.hypothesis.name,
        "title": one.hypothesis.words["title"],
        "strength": float(one.sign.strength),
        "probability": one.probability,
        "t0_s": float(one.sign.window_s[0]),
        "t1_s": float(one.sign.window_s[1]),
        "consequence_of": one.consequence_of or None,
        "tried": None if trial is None else trial.words,
        "explained": None if trial is None else trial.explained,
        **_astray(None if trial is None else trial.astray),
    }


def _astray(found: Astray | None) -> dict[str, Any]:
    """How far the autopilot's own estimate was off meanwhile, and against what."""
    if found is None:
        return {"drift_m": None, "drift_max_m": None, "drift_against": None}
    return {"drift_m": found.rms_m, "drift_max_m": found.most_m, "drift_against": found.against}


def inside(title: str) -> str:
    """A title within a sentence: its first word in small letters, but for names such as GPS."""
    first, *rest = title.split(" ")
    return " ".join([first if first.isupper() and len(first) > 1 else first[0].lower() + first[1:], *rest])


def lines(explained: Explanation) -> list[tuple[str, ...]]:
    """The table of hypotheses, the likely ones first: cells under HEADINGS."""
    order = sorted(explained.checked, key=lambda one: (bool(one.consequence_of), -one.probability, -one.sign.strength))
    found: list[tuple[str, ...]] = []
    for one in order:
        share = one.trial.explained if one.trial is not None else None
        t0, t1 = one.sign.window_s
        trial_words = one.trial.words if one.trial is not None else DASH
        if one.consequence_of:
            trial_words = f"follows from: {inside(words()[one.consequence_of]['title'])}"
        likely = one.probability >= LEAST_SHOWN
        found.append(
            (
                one.hypothesis.words["title"],
                f"{one.sign.strength:.2f}",
                f"{100.0 * one.probability:.0f} %" if likely else "below 2 %",
                DASH if share is None else f"{100.0 * share:.0f} %",
                f"{t0:.0f} to {t1:.0f}" if likely else DASH,
                trial_words,
            )
        )
    return found


# -- the page ----------------------------------------------------------------------------------------------------
def write_explanation(explained: Explanation, span_s: Window, path: Path) -> None:
    """Write the page, whole or not at all. OSError where the file cannot be written."""
    guard.write_page(render(explained, span_s), path)


def render(explained: Explanation, span_s: Window) -> str:
    """The page as text; span_s: of the log."""
    sections = [_section(number, one, span_s) for number, one in enumerate(explained.findings)]
    shared = {
        "name": explained.log,
        "t0": span_s[0],
        "t1": span_s[1],
        "step": 0.1,
        "start": _begin(explained, span_s),
        "phases": [],
        "moments": [],
        "outages": [],
    }
    page: str = template("explanation.html.j2").render(
        log=explained.log,
        verdict=explained.verdict,
        found=bool(explained.findings),
        causes=explained.findings,
        headings=HEADINGS,
        lines=lines(explained),
        missing=[(words()[name]["title"], what) for name, what in explained.missing],
        autopilot={"px4": "PX4", "ardupilot": "ArduPilot", "inav": "INAV"}.get(explained.dialect, ""),
        version=__version__,
        whys=[words()[one.name] for one in explained.findings],
        **linked_with(sections, shared, None, span_s),
    )
    return page


def _begin(explained: Explanation, span_s: Window) -> float:
    at_s = explained.first.window_s[0] if explained.first is not None else span_s[1]
    return float(min(max(at_s, span_s[0]), span_s[1]))


def _section(number: int, one: Finding, span_s: Window) -> Section:
    rank = "First cause" if number == 0 else "Another cause"
    panels = tuple(panel(one, place, picture, span_s) for place, picture in enumerate(one.pictures))
    none = (Panel(f"{one.name}-none", one.title, absent="There is nothing to draw: the parameters show it."),)
    return Section(one.name, f"{rank}: {one.title}", panels or none)


def panel(one: Finding, place: int, picture: Picture, span_s: Window) -> Panel:
    """A picture of the evidence, with the seconds of the cause marked."""
    stack = Stack((picture.label,), row_height_px=260)
    for trace in picture.traces:
        if len(trace.t_s):
            (stack.dots if trace.dots else stack.line)(1, trace.role, trace.name, trace.t_s, trace.value)
    t0, t1 = _shown(picture, span_s)
    moments = [Moment(at_s, name) for at_s, name in zip(one.window_s, ("from", "to"), strict=True)]
    caption = f"{one.sentence} {picture.words}".strip()
    alt = f"{picture.label} over time: {listed([trace.name for trace in picture.traces])}. {caption}"
    return Panel(f"{one.name}-{place}", one.title, caption, alt, stack.chart((t0, t1), moments), wide=True)


def _shown(picture: Picture, span_s: Window) -> Window:
    """The time span that the traces cover, within the log."""
    starts = [float(trace.t_s[0]) for trace in picture.traces if len(trace.t_s)]
    ends = [float(trace.t_s[-1]) for trace in picture.traces if len(trace.t_s)]
    if not starts:
        return span_s
    return max(min(starts), span_s[0]), min(max(ends), span_s[1] + SLACK_S)
