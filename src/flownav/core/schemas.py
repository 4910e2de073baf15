"""JSON schemas that ship: of commands' `--json` objects, of files (TOML), and of a record's manifest.

`$id` has a schema's name and number; the number stands in every object as `schema`. `flownav schema NAME` prints one.
"""

import json
from importlib import resources
from typing import Any

from flownav.core.errors import InputError

FOLDER = resources.files("flownav") / "data" / "schemas"
DRAFT = "https://json-schema.org/draft/2020-12/schema"


def names() -> list[str]:
    """The schemas that ship."""
    return sorted(path.name.removesuffix(".json") for path in FOLDER.iterdir() if path.name.endswith(".json"))


def schema_of(name: str) -> dict[str, Any]:
    """A schema by its name. InputError where there is none."""
    if name not in names():
        raise InputError(f"{name}: no such schema; choose from {', '.join(names())}")
    found = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return found
