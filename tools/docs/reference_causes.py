"""The pages of causes: what `flownav explain` knows by name, from its own table and words."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from flownav.core.version import __version__
from flownav.logs.log import Log
from flownav.studies.explain.case import Case
from flownav.studies.explain.cure import Cure
from flownav.studies.explain.hypothesis import Hypothesis
from flownav.studies.explain.sign import Sign
from flownav.studies.explain.table import BY_NAME, HYPOTHESES

MEASURED = Path(__file__).parents[2] / "docs" / "explanation" / "explained.md"
NAMES = {"px4": "PX4", "ardupilot": "ArduPilot", "inav": "INAV"}
# figures as a sign has them, from which the pages' parameters follow
EXAMPLE = {
    "turn_deg": -90.0, "mirrored": "", "axes": "", "gain": 0.8, "x": 0.8, "y": 0.8, "read": "0.80 of what it should",
    "sigma": 0.03, "lag_ms": 130.0, "told": "60 ms",
    "quality": 40.0, "height_m": 0.3, "which": "quality", "why": "", "ceiling_m": 5.0, "metres": 1.5, "x_mgauss": 60.0,
    "y_mgauss": -80.0, "z_mgauss": 30.0, "share": 40.0, "noise_m": 60.0, "flow_set": 2.0,
    "noise_rad_s": 0.6, "in_flight": 0.0,
}  # fmt: skip


def pages() -> dict[str, Callable[[], str]]:
    """The index, and a page for each cause."""
    found: dict[str, Callable[[], str]] = {"explanation/causes.md": index}
    return found | {f"explanation/causes/{one.name}.md": partial(page, one) for one in HYPOTHESES}


def index() -> str:
    """All causes, and what each needs of a log."""
    text = f"# Causes of drift\n\n`flownav explain` of flownav {__version__} knows these by name; "
    text += "[how often it is right](explained.md) is measured.\n\n"
    text += "| cause | what it needs of the log | parameters that it reads |\n|---|---|---|\n"
    for one in HYPOTHESES:
        read = ", ".join(f"`{name}`" for name in one.parameters) or "none"
        text += f"| [{one.words['title']}](causes/{one.name}.md) | {one.needs} | {read} |\n"
    return text


def page(one: Hypothesis) -> str:
    """The page of one cause: its look, its reason, the cure on each autopilot, and how to prevent it."""
    told = one.words
    text = f"# {told['title']}\n\n`{one.name}`. {measured(one.name)}\n\n"
    text += f"**What it looks like.** {told['looks']}\n\n**Why.** {told['why']}\n\n"
    text += f"**What is needed of the log:** {one.needs}. **How it is tried:** {tried(one)}.\n\n## The cure\n\n"
    by_hand = ""
    for dialect, name in NAMES.items():
        cure = example(one, dialect)
        by_hand = cure.by_hand or by_hand
        if cure.settings:
            text += f"On {name}, by an example's figures:\n\n| parameter | value | because |\n|---|---|---|\n"
            text += "".join(f"| `{p.name}` | {p.text} | {p.reason} |\n" for p in cure.settings) + "\n"
        elif dialect in told:
            text += f"On {name}: {told[dialect]}\n\n"
        else:
            text += f"On {name} no parameter cures it.\n\n"
    text += f"{by_hand}\n\n## How to prevent it\n\n{told['prevent']}\n"
    others = [BY_NAME[name].words["title"].lower() for name in one.explains if name != one.name]
    return text + (f"\nWhat else such a log shows, as a consequence: {'; '.join(others)}.\n" if others else "")


def example(one: Hypothesis, dialect: str) -> Cure:
    """The cure for an example's figures, of a vehicle that takes the range for its height."""
    parameters = {"px4": {"EKF2_OF_CTRL": 1.0, "EKF2_GPS_CTRL": 7.0, "EKF2_HGT_REF": 2.0},
                  "ardupilot": {"EK3_SRC1_VELXY": 5.0, "EK3_SRC1_POSZ": 2.0}, "inav": {}}[dialect]  # fmt: skip
    figures = dict(EXAMPLE)
    if one.name == "compass_wrong":
        figures["turn_deg"] = 90.0
    return one.cure(Case(Log(Path("example"), {}, parameters=parameters)), Sign(3.0, (20.0, 60.0), figures), dialect)


def tried(one: Hypothesis) -> str:
    """In words."""
    if one.repair is None:
        return "it is not: what the parameters and the readings say decides"
    return " ".join((one.repair.__doc__ or "").split()).rstrip(".").lower()


def measured(name: str) -> str:
    """How often it was named first where it was planted, from the committed table."""
    row = re.search(rf"^\| `{name}` \| (\d+) \| (\d+) \| (\d+) \|$", MEASURED.read_text(encoding="utf-8"), re.MULTILINE)
    if row is None:
        return "It is none of the faults that were planted."
    times = f"Planted {row[1]} times it was named first {row[2]} times, and {row[3]} times where it was not planted"
    return f"{times} ([table](../explained.md))."
