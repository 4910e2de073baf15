"""Where the project's own pages lie, and the data and the paper's tables that do not ship with it."""

from __future__ import annotations

import os
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
DOCS = PROJECT / "docs"
SHARED = PROJECT.parent / "shared"


def data_root() -> Path:
    """Where the recorded logs would be."""
    return Path(os.environ.get("FLOWNAV_DATA") or SHARED / "data")
