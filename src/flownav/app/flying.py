"""A flight as its picture, and a campaign as its cloud of touchdowns while it flies."""

from pathlib import Path
from typing import Any

import numpy as np

from flownav.campaigns import measures
from flownav.campaigns.measures import ROW_COLUMNS, measured
from flownav.campaigns.store import Dataset, Store, plan_in
from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.core.record import Record
from flownav.report.campaign_figures import CIRCLES, Touchdowns
from flownav.report.cloud_picture import cloud_picture
from flownav.report.landing import landing_picture
from flownav.report.path_picture import path_picture
from flownav.scoring.errors import SCORE_COLUMNS, touchdown_rows
from flownav.scoring.landings import verdict_of

FIRST_CELL = 0


def picture_of(record: Record, facts: dict[str, Any]) -> dict[str, Any]:
    """The picture of a flight's landing, or of its path where it does not land, and what it came to."""
    picture = landing_picture(record) or path_picture(record)
    touched = facts.get("touchdown") or {}
    return {
        "svg": picture.svg if picture else "",
        "words": picture.words if picture else "this flight has nothing to draw",
        "verdict": touched.get("verdict") or "",
        "reason": touched.get("reason") or "",
        "crashed": bool(facts.get("crashed")),
    }


def cloud_of(folder: str) -> dict[str, Any]:
    """The touchdowns of a campaign's first cell as far as it has flown, with its rings.

    Gives flights, planned, landed and r95_m (None of fewer than 20 flights); svg and words. InputError where the
    folder holds no campaign.
    """
    place = Path(folder)
    plan = plan_in(place)
    rows = _rows(place)
    planned = int(plan["flights"])
    found: dict[str, Any] = {
        "flights": len(rows),
        "planned": planned,
        "r95_m": None,
        "svg": "",
        "words": "",
        "landed": 0,
    }
    if not len(rows):
        return found
    north, east, distance = (measured(f"touchdown.{name}_m", rows) for name in ("north", "east", "horizontal"))
    figures = {name: {"value": _radius(name, rows)} for name, *_ in CIRCLES}
    picture = cloud_picture({"label": place.name, "figures": figures}, Touchdowns(north, east, distance, _pad_m(plan)))
    touched = touchdown_rows(rows[:, : len(SCORE_COLUMNS)])
    return found | {
        "r95_m": figures["r95_m"]["value"],
        "landed": sum(verdict_of(row) == "landed" for row in touched),
        "svg": picture.svg if picture else "",
        "words": picture.words if picture else "no flight has touched down yet",
    }


def _rows(folder: Path) -> Array:
    """The flights that are kept, those of a part that is being flown as well."""
    store, data = Store(folder), Dataset(folder)
    parts = data.parts(FIRST_CELL)
    rows = [data.rows(FIRST_CELL)] if parts else []
    for path in sorted((folder / "flights" / f"cell-{FIRST_CELL:03d}").glob("begun-*.parquet")):
        begun = store.begun(FIRST_CELL, int(path.stem.removeprefix("begun-")))
        rows += [] if begun is None else [begun.rows]
    return np.concatenate(rows) if rows else np.zeros((0, len(ROW_COLUMNS)))


def _radius(name: str, rows: Array) -> float | None:
    """A radius about the pad's centre [m]; None of too few flights, or where too many did not touch."""
    if len(rows) < measures.flights_needed(name):
        return None
    value = measures.figure_of(name, measures.values_of(name, rows)).finite()["value"]
    return None if value is None else float(value)


def _pad_m(plan: dict[str, Any]) -> float:
    """A side of the pad [m]. InputError where the plan does not state it."""
    try:
        return float(plan["cells"][FIRST_CELL]["scenario"]["pad"]["size_m"])
    except (KeyError, IndexError, TypeError, ValueError):
        raise InputError("the campaign's plan does not state the size of its pad") from None
