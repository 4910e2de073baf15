"""The generated pages (reference and gallery): where each lies in the site, and what writes it."""

from __future__ import annotations

from collections.abc import Callable

import pictures
import reference_api
import reference_causes
import reference_commands
import reference_keys
import reference_tables

PAGES: dict[str, Callable[[], str]] = {
    "explanation/gallery.md": pictures.gallery,
    **reference_causes.pages(),
    "reference/api.md": reference_api.page,
    "reference/commands.md": reference_commands.page,
    "reference/keys.md": reference_keys.page,
    "reference/tables.md": reference_tables.page,
}
