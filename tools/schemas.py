"""Writes the schemas of files anew from the models that read them: `make schemas`."""

from __future__ import annotations

import json
from pathlib import Path

from file_schemas import generated

FOLDER = Path(__file__).resolve().parents[1] / "src" / "flownav" / "schemas"

for name, schema in generated().items():
    (FOLDER / f"{name}.json").write_text(json.dumps(schema, indent=1) + "\n", encoding="utf-8")
    print(f"{name}.json")
