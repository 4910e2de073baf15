"""Parts by name: entry points of installed packages, and classes in files.

A package offers a filter as `[project.entry-points."flownav.filters"] mine = "package.module:Class"`; a file's class is
named `path/to/file.py:Class`, and a module's `package.module:Class`.
"""

import importlib
import importlib.util
import sys
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from flownav.core.errors import InputError

GROUPS = {"filter": "flownav.filters", "sensor": "flownav.sensors", "vehicle": "flownav.vehicles",
          "controller": "flownav.controllers"}  # fmt: skip
OURS = {"filter": ("landing", "paper")}  # of a scenario's own
METHODS = {"filter": ("start", "predict", "update", "estimate"), "sensor": ("sensor", "start", "read"),
           "vehicle": ("start", "derivative", "outputs"), "controller": ("start", "command")}  # fmt: skip


def names(kind: str) -> list[str]:
    """The names that installed packages offer for a kind of part."""
    return sorted({entry.name for entry in entry_points(group=GROUPS[kind])})


def part_of(kind: str, name: str) -> Any:
    """The class or object of that name. InputError where there is none, it cannot be loaded, or it is no such part."""
    found = _from_entry_point(kind, name) if ":" not in name else _from_file(kind, name)
    require(kind, found, name)
    return found


def require(kind: str, part: Any, name: str) -> None:
    """InputError where an object lacks what a part of its kind must have."""
    lacking = [method for method in METHODS[kind] if not hasattr(part, method)]
    made_later = callable(part) and not isinstance(part, type) and len(lacking) == len(METHODS[kind])
    if lacking and not made_later:
        raise InputError(f"{kind} {name}: has no {', '.join(lacking)}; docs/how-to/own-parts.md says what it must have")


def _from_entry_point(kind: str, name: str) -> Any:
    for entry in entry_points(group=GROUPS[kind]):
        if entry.name == name:
            return _loaded(kind, name, entry.load)
    offered = ", ".join([*OURS.get(kind, ()), *names(kind)]) or "none is installed"
    raise InputError(f"--{kind} {name}: no such {kind}; by name: {offered}; of a file: path/to/file.py:Class")


def _from_file(kind: str, name: str) -> Any:
    where, _, attribute = name.rpartition(":")
    if where.endswith(".py"):
        module = _loaded(kind, name, lambda: _module(Path(where)))
    else:
        module = _loaded(kind, name, lambda: importlib.import_module(where))
    if not hasattr(module, attribute):
        raise InputError(f"{kind} {name}: {where} has no {attribute}")
    return getattr(module, attribute)


def _module(path: Path) -> Any:
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    spec = importlib.util.spec_from_file_location(f"flownav_part_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _loaded(kind: str, name: str, load: Any) -> Any:
    try:
        return load()
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{kind} {name}: cannot be loaded: {type(error).__name__}: {error}") from error
