"""Changes of a file's entries: nested mappings merge, dotted names reach inside, what is written down beside stays."""

from __future__ import annotations

import atexit
import hashlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any

from flownav.core.errors import InputError
from flownav.core.guard import written_whole
from flownav.core.text import to_toml

Entries = dict[str, Any]


def merged(entries: Mapping[str, Any], changes: Mapping[str, Any], where: str) -> Entries:
    """A copy of the entries with these changes. InputError where a dotted name leads into no table.

    A mapping is merged into the table that is there; anything else replaces it. A number that replaces one with its
    provenance ({ value, uncertainty, source }) keeps the uncertainty.
    """
    found = dict(entries)
    for name, value in changes.items():
        key, dot, rest = name.partition(".")
        if dot:
            value = {rest: value}
        old = found.get(key)
        if isinstance(value, Mapping) and "value" not in value:
            if old is not None and not isinstance(old, Mapping):
                raise InputError(f"{where}: {key} is no table; give a value")
            found[key] = merged(old or {}, value, where)
        elif isinstance(old, Mapping) and "value" in old and not isinstance(value, Mapping):
            found[key] = {**old, "value": value, "source": "changed from Python"}
        else:
            found[key] = value
    return found


def plain_entries(entries: Any) -> Any:
    """Entries as TOML has them: tuples as lists, without what is None."""
    if isinstance(entries, Mapping):
        return {key: plain_entries(value) for key, value in entries.items() if value is not None}
    if isinstance(entries, list | tuple):
        return [plain_entries(value) for value in entries]
    return str(entries) if isinstance(entries, Path) else entries


def kept_file(name: str, entries: Mapping[str, Any]) -> Path:
    """A file with these entries for as long as this process lives, under a name that their content gives.

    A scenario names its vehicle and its flow sensor by files: this is that of one which was made in Python.
    """
    text = to_toml(entries)
    safe = "".join(letter if letter.isalnum() else "-" for letter in name)[:40] or "part"
    path = _folder() / f"{safe}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.toml"
    if not path.exists():
        path.write_text(text, encoding="utf-8")
    return path


@cache
def _folder() -> Path:
    """Removed when the process ends."""
    folder = Path(mkdtemp(prefix="flownav-"))
    atexit.register(rmtree, folder, ignore_errors=True)
    return folder


def saved(entries: Mapping[str, Any], path: Path) -> Path:
    """Write nested dictionaries as a TOML file, whole or not at all. InputError where it cannot be written there."""
    try:
        with written_whole(path) as temporary:
            temporary.write_text(f"# written by flownav\n{to_toml(entries)}", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another path") from error
    return path
