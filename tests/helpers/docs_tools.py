"""The tools that make the documentation (`tools/docs`), importable by name: `from docs_tools import reference`."""

from __future__ import annotations

import sys

from places import PROJECT

TOOLS = PROJECT / "tools" / "docs"
if str(TOOLS) not in sys.path:
    sys.path.insert(0, str(TOOLS))

import app_pictures  # noqa: E402
import cells  # noqa: E402
import figures  # noqa: E402
import figures_book  # noqa: E402
import figures_history  # noqa: E402
import figures_pages  # noqa: E402
import figures_table  # noqa: E402
import mathematics  # noqa: E402
import notebooks  # noqa: E402
import pictures  # noqa: E402
import readme_picture  # noqa: E402
import reference  # noqa: E402
import reference_api  # noqa: E402
import reference_commands  # noqa: E402
import reference_keys  # noqa: E402
import reference_tables  # noqa: E402
import units  # noqa: E402

__all__ = [
    "app_pictures",
    "cells", "figures", "figures_book", "figures_history", "figures_pages", "figures_table", "mathematics",
    "notebooks", "pictures", "readme_picture", "reference", "reference_api", "reference_commands", "reference_keys",
    "reference_tables", "units",
]  # fmt: skip
