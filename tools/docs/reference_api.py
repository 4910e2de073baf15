"""The reference of the Python API: every public name of `flownav`, from its signature and its docstring."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Iterator
from typing import Any

import flownav

INTRODUCTION = """# Python API

Everything that `import flownav` offers, with flownav {version}. Names that are not listed here are internal and may
change; [for developers of other tools](for-developers.md) says what is promised. Each name is loaded when it is first
asked for, so the import itself is quick.

| name | what it is |
|---|---|
"""
LONGEST = 88  # characters of a signature in one line


def names() -> list[str]:
    """The public names: functions first, then classes, then errors."""
    public = [name for name in flownav.__all__ if not name.startswith("__")]
    return sorted(public, key=lambda name: (_rank(getattr(flownav, name)), name))


def page() -> str:
    """The page. TypeError where a public name has no docstring."""
    rows = [f"| [`flownav.{name}`](#{name}) | {_first_line(getattr(flownav, name))} |" for name in names()]
    sections = [part for name in names() for part in _section(name, getattr(flownav, name))]
    return INTRODUCTION.format(version=flownav.__version__) + "\n".join(rows) + "\n\n" + "\n\n".join(sections) + "\n"


def members(found: type) -> Iterator[tuple[str, Any]]:
    """The public methods and properties of a class and of its bases here, by the order of their definition."""
    seen: set[str] = set()
    for owner in found.__mro__:
        if not owner.__module__.startswith("flownav"):
            continue
        for name, member in vars(owner).items():
            plain = member.__func__ if isinstance(member, classmethod | staticmethod) else member
            if not name.startswith("_") and name not in seen and (callable(plain) or isinstance(plain, property)):
                seen.add(name)
                yield name, member


def _rank(found: Any) -> int:
    if not inspect.isclass(found):
        return 0
    return 2 if issubclass(found, Exception) else 1


def _section(name: str, found: Any) -> Iterator[str]:
    """A name's heading, signature and words; of a class also those of its members."""
    yield f"## flownav.{name} {{ #{name} }}"
    if not (inspect.isclass(found) and issubclass(found, Exception)):
        yield _signature(f"flownav.{name}", found)
    yield _words(found)
    if inspect.isclass(found) and not issubclass(found, Exception):
        for member_name, member in members(found):
            yield f"### {name}.{member_name} {{ #{name}.{member_name} }}"
            if isinstance(member, property):
                kind = inspect.get_annotations(member.fget).get("return", "") if member.fget else ""
                yield f"```python\n{name.lower()}.{member_name}: {kind}\n```"
                yield _words(member)
            else:
                plain = member.__func__ if isinstance(member, classmethod | staticmethod) else member
                yield _signature(f"{name if plain is not member else name.lower()}.{member_name}", plain, bound=True)
                yield _words(plain)


def _signature(name: str, found: Any, *, bound: bool = False) -> str:
    """A call as Python code; one parameter a line where it is long. bound: its first parameter is not written."""
    signature = inspect.signature(found)
    if bound:
        signature = signature.replace(parameters=list(signature.parameters.values())[1:])
    given = signature.return_annotation
    arrow = "" if given is signature.empty else f" -> {given}"
    parts, stars = [], False
    for parameter in signature.parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and not stars:
            parts.append("*")
        stars = stars or parameter.kind in (parameter.KEYWORD_ONLY, parameter.VAR_POSITIONAL)
        parts.append(_parameter(parameter))
    line = f"{name}({', '.join(parts)}){arrow}"
    if len(line) <= LONGEST:
        return f"```python\n{line}\n```"
    return f"```python\n{name}(\n" + "".join(f"    {part},\n" for part in parts) + f"){arrow}\n```"


def _parameter(parameter: inspect.Parameter) -> str:
    """One parameter as it stands in the code."""
    star = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
    kind = "" if parameter.annotation is parameter.empty else f": {parameter.annotation}"
    default = "" if parameter.default is parameter.empty else f" = {parameter.default!r}"
    return f"{star}{parameter.name}{kind}{default}"


def _first_line(found: Any) -> str:
    return _docstring(found).split("\n", 1)[0]


def _docstring(found: Any) -> str:
    text = inspect.getdoc(found)
    if not text:
        raise TypeError(f"{found!r} has no docstring")
    return text


def _words(found: Any) -> str:
    """A docstring as Markdown; the part under `Example:` as code."""
    text, _, example = _docstring(found).partition("\nExample:\n")
    known = [] if inspect.isclass(found) or isinstance(found, property) else list(inspect.signature(found).parameters)
    parts = [_listed(part, known) for part in text.strip().split("\n\n")]
    if example:
        parts.append(f"```python\n{textwrap.dedent(example).strip()}\n```")
    return "\n\n".join(parts)


def _listed(paragraph: str, known: list[str]) -> str:
    """A paragraph that says `parameter: what it is. other: what that is.` as a list, any other as it is."""
    name = "|".join(map(re.escape, sorted(known, key=len, reverse=True)))
    if not known or not re.match(rf"(?:{name})(?:, (?:{name}))*: ", paragraph):
        return paragraph
    text, _, errors = " ".join(paragraph.split()).partition(" InputError")
    starts = [found.start(1) for found in re.finditer(rf"(?:^|[.;] )((?:{name})(?:, (?:{name}))*: )", text)]
    items = [text[start:end].strip() for start, end in zip(starts, [*starts[1:], len(text)], strict=True)]
    rows = [
        f"- `{item.split(': ', 1)[0].replace(', ', '`, `')}`: {item.split(': ', 1)[1].rstrip(';')}" for item in items
    ]
    return "\n".join(rows) + (f"\n\nInputError{errors}" if errors else "")
