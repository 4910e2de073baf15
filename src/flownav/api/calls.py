"""Helpers that calls of the API share: a call in Python's notation, parts of one's own, entries of files and their
changes.
"""

import atexit
import hashlib
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from numbers import Integral
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

from flownav.core.errors import InputError, arg
from flownav.core.guard import write_text
from flownav.core.text import meant, to_toml

if TYPE_CHECKING:  # a replay, a report or a table needs neither parts of one's own nor the simulator that flies them
    from flownav.parts.protocols import Parts

LONGEST_ARGUMENT = 200  # characters of one argument


def call_of(name: str, *arguments: Any, **options: Any) -> str:
    """A call as Python writes it, for the record's "how to reproduce"; what is None or empty is left out.

    Options with the function's default value are left out by `changed`.
    """
    given = [_shown(argument) for argument in arguments]
    empty = {key for key, value in options.items() if isinstance(value, tuple | list | dict) and not value}
    passed = {key: value for key, value in options.items() if value is not None and key not in empty}
    given += [f"{key}={_shown(value)}" for key, value in passed.items() if key.isidentifier()]
    dotted = {key: value for key, value in passed.items() if not key.isidentifier()}
    given += [f"**{_shown(dotted)}"] if dotted else []
    return f"flownav.{name}({', '.join(given)})"


def changed(function: Callable[..., Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """The options that differ from the function's defaults."""
    defaults = {name: parameter.default for name, parameter in inspect.signature(function).parameters.items()}
    shown = {name: (type(value), repr(value)) for name, value in defaults.items()}
    return {name: value for name, value in options.items() if (type(value), repr(value)) != shown.get(name)}


def _shown(value: Any) -> str:
    text = repr(str(value)) if hasattr(value, "__fspath__") else repr(value)
    return text if len(text) <= LONGEST_ARGUMENT else f"{text[:LONGEST_ARGUMENT]}..."


def require_from(name: str, value: int, low: int, high: int) -> None:
    """InputError where an argument is no whole number, or is out of its range."""
    if isinstance(value, bool) or not isinstance(value, Integral) or not low <= value <= high:
        raise InputError(f"{name} = {value!r}: must be a whole number from {low} to {high}")


def split(filter: Any, sensors: Sequence[Any], vehicle: Any, controller: Any) -> tuple["Parts", str | None, Any]:
    """The parts that are not flownav's, and the names of filter and vehicle that are the scenario's (None where they
    are not).

    A filter by another name than ours is an entry point's or a file's. InputError where an object is no such part.
    """
    from flownav.parts.naming import OURS
    from flownav.parts.protocols import Parts

    own_filter, own_vehicle = None, None
    if filter is not None and not (isinstance(filter, str) and filter in OURS["filter"]):
        own_filter, filter = _part("filter", filter), None
    if vehicle is not None and (hasattr(vehicle, "derivative") or (isinstance(vehicle, str) and ":" in vehicle)):
        own_vehicle, vehicle = _part("vehicle", vehicle), None
    own_sensors = tuple(_part("sensor", sensor) for sensor in sensors)
    own_controller = None if controller is None else _part("controller", controller)
    return Parts(own_filter, own_sensors, own_vehicle, own_controller), filter, vehicle


def own_filter(filter: Any) -> Any:
    """The filter of a replay that is not ours; None where ours is meant."""
    if isinstance(filter, str) and filter == "paper":
        raise InputError(
            f"{arg('filter')} paper: the paper's filter flies in simulation only, where it is fed as it was"
        )
    return None if filter is None or (isinstance(filter, str) and filter == "landing") else _part("filter", filter)


def _part(kind: str, part: Any) -> Any:
    """A part by its name, or the one that is given."""
    from flownav.parts.calling import name_of
    from flownav.parts.naming import part_of, require

    if isinstance(part, str):
        return part_of(kind, part)
    require(kind, part, name_of(part))
    return part


Entries = dict[str, Any]


def require_known(changes: Mapping[str, Any], keys: Iterable[str], function: Callable[..., Any]) -> None:
    """InputError where a change is no key, but near the name of one of the function's own arguments."""
    own = [name for name in inspect.signature(function).parameters if name != "changes"]
    for name in changes:
        if "." not in name and name not in keys and (near := meant(name, own)):
            raise InputError(f"{name}: neither an argument nor a key of a scenario{near}")


def merged(entries: Mapping[str, Any], changes: Mapping[str, Any], where: str) -> Entries:
    """A copy of the entries with these changes. InputError where a dotted name leads into no table.

    A mapping is merged into the table that is there; anything else replaces it. A number that replaces one with its
    provenance ({ value, uncertainty, source }) keeps the uncertainty.
    """
    found = dict(entries)
    for name, value in changes.items():
        if not isinstance(name, str):
            raise InputError(f"{where}: {name!r} is no name of a value; give text")
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
    with writing(path):
        write_text(to_toml(entries), path)
    return path


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """InputError where what is done within it cannot be written at a path."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another path") from error
