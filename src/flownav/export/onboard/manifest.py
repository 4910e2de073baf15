"""The manifest of a folder of `flownav build`, read as somebody else's: its entries are checked before use."""

import hashlib
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from flownav.core.errors import InputError
from flownav.core.guard import an_input, object_in
from flownav.export.onboard.interface import Rates

MANIFEST = "manifest.json"
MOST_HZ, MOST_S = 40_000.0, 10.0  # of a sensor; of a horizon or an exposure: rings of some megabytes
CODE = {".c", ".h", ".a", ".so", ".o", ".js", ".html", ".wasm"}  # what a verification compiles, loads or opens
DIGEST = re.compile(r"[0-9a-f]{16}")


def manifest_of(folder: Path) -> dict[str, Any]:
    """A folder's manifest. InputError where it is none of `flownav build`."""
    found = object_in(folder / MANIFEST, f"{folder} is not a folder of `flownav build`")
    wrong = next((name for name, holds in ENTRIES.items() if name not in found or not holds(found[name])), None)
    if wrong is not None:
        why = "is missing" if wrong not in found else "is not as it is written"
        raise InputError(f"{folder}: not a folder of `flownav build` ({MANIFEST}: {wrong} {why})")
    return found


def require_own(folder: Path) -> None:
    """InputError where a folder holds what `flownav build` did not write."""
    own = {MANIFEST, *manifest_of(folder)["files"]}
    if strange := sorted({path.name for path in folder.iterdir()} - own):
        raise InputError(f"{folder}: {strange[0]} is not of `flownav build`; give another name, or move it away")


def changed_files(folder: Path, manifest: dict[str, Any]) -> Iterator[str]:
    """Files that are not as they were written, and code that the manifest does not name."""
    for name, digest in manifest["files"].items():
        file = an_input(folder / Path(name).name)
        if not file.is_file():
            yield name
            continue
        with file.open("rb") as content:
            if hashlib.file_digest(content, "sha256").hexdigest() != digest:
                yield name
    yield from sorted(
        path.name for path in folder.iterdir() if path.suffix in CODE and path.name not in manifest["files"]
    )


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_text, value))


def _are_files(value: Any) -> bool:
    return isinstance(value, dict) and all(map(_is_text, value.values()))


def _are_rates(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and value.keys() == set(Rates._fields)
        and all(isinstance(rate, int | float) for rate in value.values())
        and all(0.0 <= rate <= (MOST_HZ if name.endswith("_hz") else MOST_S) for name, rate in value.items())
    )


def _are_digests(value: Any) -> bool:
    return _are_texts(value) and bool(value) and all(map(DIGEST.fullmatch, value))


# the entries that are read, and whether a value can be one
ENTRIES: dict[str, Callable[[Any], bool]] = {
    "files": _are_files,
    "build": _is_text,
    "target": _is_text,
    "rates": _are_rates,
    "without": _are_texts,
    "lag": lambda value: isinstance(value, bool),
    "digests": _are_digests,
}
