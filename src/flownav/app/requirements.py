"""A requirement of one's own from a form, as the file that `flownav certify` reads."""

import hashlib
from collections.abc import Mapping
from typing import Any

from flownav.app.shelf import Shelf
from flownav.app.tasks import number, word
from flownav.core.errors import InputError
from flownav.core.guard import write_text
from flownav.core.text import to_toml

MEASURES = ("touchdown.rest_m", "touchdown.horizontal_m", "touchdown.sink_rate_m_s")
MOST_WIND_M_S = 30.0


def kept_requirement(asked: Mapping[str, Any], shelf: Shelf) -> str:
    """Write a requirement into the folder, and give its file's name; the same one has the same name.

    asked: scenario, measure, at_most, probability and confidence (0 to 1), wind_m_s at 20 ft. InputError where one
    cannot be; the other limits are those of `flownav certify`.
    """
    if asked.get("measure") not in MEASURES:
        raise InputError(f"{str(asked.get('measure'))[:40]}: choose from {', '.join(MEASURES)}")
    table = {"measure": asked["measure"]}
    for name, most in (("at_most", 1000.0), ("probability", 1.0), ("confidence", 1.0)):
        table[name] = float(number(asked.get(name), 0.0, most))
    entries = {
        "schema_version": 1,
        "description": "A requirement of one's own, filled in on the page of flownav app",
        "scenario": word(asked.get("scenario", "approach")),
        "set": {"wind": {"speed_20ft_m_s": float(number(asked.get("wind_m_s", 0.0), 0.0, MOST_WIND_M_S))}},
        "requirement": [table],
    }
    name = f"requirement-{hashlib.sha256(to_toml(entries).encode()).hexdigest()[:8]}"
    path = shelf.path_of(f"{name}.toml")
    if not path.exists():
        write_text(to_toml({"name": name, **entries}), path)
    return path.name
