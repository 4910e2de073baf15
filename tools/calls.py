"""How the loops over lanes are called, a line for each: `python tools/calls.py` writes flownav/*/calls.py anew.

A function decorated with `on_lanes` is written for one lane's records; its loop is called with the buffer, the lanes
and what its layout needs. Those arguments are read here from the generated loops, with the types of the function's
keyword-only parameters, and of what layouts need by its name (NEEDED). An argument that could be taken for the one
before it, since it is of the same type, must be passed by its name.
"""

import importlib
import inspect
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType, ModuleType, NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

PROJECT = Path(__file__).resolve().parents[1]
PACKAGES = ("flownav.navigation", "flownav.simulation")
WORK, LANES = ("flownav.core.compile", "Work"), ("flownav.core.compile", "Lanes")
OUTPUT = ("flownav.navigation.tape", "Output")
# what a loop is given beside its function's own parameters: an index, another buffer, where a sink writes
NEEDED: dict[str, str | tuple[str, str]] = {
    "work": WORK, "lanes": LANES, "nav": WORK, "p": WORK, "o": OUTPUT, "t_s": "float", "axis": "int", "place": "int",
    "component": "int", "slot": "int", "truth_row": "int", "inertial_row": "int",
}  # fmt: skip
TRUTH = "any0"  # of a loop that returns whether a truth holds in any lane, as core/compiling/records.py names it
HEAD = '''"""How the loops over lanes of this package are called; tools/calls.py writes it, a test holds it.

Each stands for the function of its name, which is decorated with it; nobody calls these.
"""
'''


class _Lenient(ModuleType):
    """A module `calls` in which everything is: the one that is there may be of yesterday."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda: None


def imported(package: str) -> list[ModuleType]:
    """Every module of a package."""
    found = importlib.import_module(package)
    return [importlib.import_module(f"{package}.{each.name}") for each in pkgutil.iter_modules(found.__path__)]


def loops_of(modules: list[ModuleType]) -> dict[str, FunctionType]:
    """The loops over lanes that these modules define, by their names. TypeError where two have one name."""
    found: dict[str, FunctionType] = {}
    for module in modules:
        for name, value in vars(module).items():
            law = getattr(value, "law", None)
            if inspect.isfunction(value) and inspect.isfunction(law) and value.__module__ == module.__name__:
                if name in found:
                    raise TypeError(f"{name}: a loop of {found[name].__module__} and one of {module.__name__}")
                found[name] = value
    return dict(sorted(found.items()))


class Texts:
    """Types in words, and the imports that these need."""

    def __init__(self) -> None:
        self.imports: dict[str, str] = {}

    def named(self, module: str, name: str) -> str:
        """A class under its name; of two classes of one name, the second under its module's and its own."""
        if self.imports.setdefault(name, module) == module:
            return name
        other = f"{module.rpartition('.')[2].title().replace('_', '')}{name}"
        self.imports[f"{name} as {other}"] = module
        return other

    def of(self, kind: Any) -> str:
        """A type as it is written."""
        if isinstance(kind, str):
            return kind
        if isinstance(kind, tuple):
            return self.named(*kind)
        if kind is NoneType:
            return "None"
        if kind is Ellipsis:
            return "..."
        if get_origin(kind) in (Union, UnionType):
            return " | ".join(map(self.of, get_args(kind)))
        if get_origin(kind):
            return f"{self.of(get_origin(kind))}[{', '.join(map(self.of, get_args(kind)))}]"
        return str(kind.__name__) if kind.__module__ == "builtins" else self.named(kind.__module__, kind.__name__)


def lines_of(loops: dict[str, FunctionType], texts: Texts) -> Iterator[str]:
    """One function for each loop, as it is called."""
    for name, loop in loops.items():
        law: Any = vars(loop)["law"]
        kinds = get_type_hints(law)
        own = {p.name for p in inspect.signature(law).parameters.values() if p.kind is p.KEYWORD_ONLY}
        names = list(inspect.signature(loop).parameters)
        types = [texts.of(kinds[each] if each in own else NEEDED[each]) for each in names]
        written = [f"{each}: {kind}" for each, kind in zip(names, types, strict=True)]
        if (first := first_by_name(types[2:])) is not None:
            written.insert(2 + first, "*")
        result, body = ("bool", "return False") if TRUTH in loop.__code__.co_varnames else ("None", "...")
        yield f"def {name}({', '.join(written)}) -> {result}: {body}\n"


def first_by_name(kinds: list[str]) -> int | None:
    """The place of the first argument that one before it could be taken for; None where there is none."""
    for place, kind in enumerate(kinds):
        if kind in kinds[:place] or (place > 0 and "Work" in (kind, *kinds[:place])):
            return place
    return None


def written(package: str) -> str:
    """The text of a package's module `calls`, as ruff formats it."""
    texts = Texts()
    body = "".join(lines_of(loops_of(imported(package)), texts))
    by_module: dict[str, list[str]] = {}
    for name, module in texts.imports.items():
        by_module.setdefault(module, []).append(name)
    lines = [f"    from {module} import {', '.join(sorted(names))}\n" for module, names in sorted(by_module.items())]
    text = f"{HEAD}\nfrom __future__ import annotations\n\nfrom typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n"
    return formatted(text + "".join(lines) + "\n\n" + body, file_of(package))


def formatted(text: str, file: Path) -> str:
    """The text as `make lint` asks for it."""
    for command in (["check", "--quiet", "--select", "I", "--fix"], ["format", "--quiet"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, "--stdin-filename", str(file), "-"],
            input=text, capture_output=True, text=True, check=True, cwd=PROJECT,
        )  # fmt: skip
        text = done.stdout
    return text


def file_of(package: str) -> Path:
    """Where a package's module `calls` lies."""
    return PROJECT / "src" / Path(*package.split(".")) / "calls.py"


def main() -> None:
    """Write every module `calls` anew."""
    for package in PACKAGES:
        sys.modules[f"{package}.calls"] = _Lenient("calls")
    for package in PACKAGES:
        file_of(package).write_text(written(package), encoding="utf-8")


if __name__ == "__main__":
    main()
