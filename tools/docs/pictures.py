"""Every picture of the documentation, and the gallery that shows them. As a script it draws them into docs/pictures.

`pictures.py [NAME...]` draws the named ones, or all. The pictures are committed, so that the pages show them where they
are read as files; the build draws them anew in its copy, so that the site shows what the code does today.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import pictures_campaigns as campaigns
import pictures_flights as flights
import pictures_models as models
from drawing import Picture, save

FOLDER = Path(__file__).parents[2] / "docs" / "pictures"
_DRAWN = (
    ("explanation/vehicle", models.ground_effect), ("explanation/control", models.margins),
    ("explanation/control", campaigns.envelope),
    ("explanation/sensors", models.gps_errors), ("explanation/sensors", models.flow_noise),
    ("explanation/optics", models.pads), ("explanation/pad-target", models.pad_target), ("how-to/rig", models.rig),
    ("reference/scenarios", flights.paths), ("explanation/paper", flights.white_and_real_gps),
    ("explanation/landing-filter", flights.error_and_band), ("explanation/landing-filter", flights.biases_learnt),
    ("explanation/navigator", flights.horizon), ("explanation/accuracy", flights.pad_seen),
    ("explanation/integrity", flights.protection_level), ("explanation/smoother", flights.smoothed_outage),
    ("explanation/faults", flights.gps_drifts_off), ("how-to/campaign", campaigns.touchdowns),
    ("how-to/certify", campaigns.flights_needed), ("explanation/rare-events", campaigns.tail),
)  # fmt: skip
PICTURES = tuple(
    Picture(draw.__name__.replace("_", "-"), page, (draw.__doc__ or "").strip(), draw) for page, draw in _DRAWN
)
INTRODUCTION = """# Gallery

Every picture of these pages, with the page that explains it and the function that draws it. `make pictures` draws them
anew from the code.
"""
LANDING = (
    "- [![The landing of a whole mission from the side, from above and close up](../pictures/landing.svg)]"
    "(../tutorials/first-landing.md)\n  The landing of a whole mission, with the touchdowns of 48 flights. "
    "[Your first landing](../tutorials/first-landing.md). Drawn by tools/docs/readme_picture.py."
)


def gallery() -> str:
    """The page of thumbnails, the landing first, each a link to the page that explains it."""
    parts = [
        f"- [![{picture.shows}](../pictures/{picture.name}.png)](../{picture.page}.md)\n  {picture.shows} "
        f"[{_title(picture.page)}](../{picture.page}.md). Drawn by {picture.made_by}."
        for picture in PICTURES
    ]
    return f'{INTRODUCTION}\n<div class="flownav-gallery" markdown>\n\n' + "\n".join([LANDING, *parts]) + "\n\n</div>\n"


def draw_all(folder: Path, names: list[str]) -> None:
    """Draw the named pictures, or all of them, into a folder; two at a time."""
    chosen = [picture for picture in PICTURES if not names or picture.name in names]
    with ProcessPoolExecutor(max_workers=2) as pool:
        for path in pool.map(partial(save, folder=folder), chosen):
            print(path.name)


def _title(page: str) -> str:
    """A page's name as words."""
    return page.rsplit("/", 1)[1].replace("-", " ").capitalize()


if __name__ == "__main__":
    draw_all(FOLDER, sys.argv[1:])
