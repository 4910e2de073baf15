"""Arguments of the public calls held against their annotations, so that a wrong one is one line and no traceback."""

import functools
import inspect
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, Union, get_args, get_origin

from flownav.core.errors import InputError
from flownav.core.text import meant

P = ParamSpec("P")
R = TypeVar("R")

MOST_LETTERS = 40  # of a wrong value
WORDS = {str: "text", Path: "a path", int: "a whole number", float: "a number", bool: "True or False"}


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The function, whose arguments are checked against its annotations first. InputError says what is needed.

    Numbers, texts, paths, lists, mappings, functions and classes are judged; what else an annotation names, a protocol
    of a part of one's own for one, is the function's to judge.
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def judged(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError:
            require_known(function.__name__, kwargs, signature)
            return function(*args, **kwargs)  # Python says it
        for name, value in bound.arguments.items():
            parameter = signature.parameters[name]
            many = parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
            if not many and parameter.annotation is not parameter.empty:
                bound.arguments[name] = _plain(value)
                require_kind(name, value, _annotation(function, name))
        return function(*bound.args, **bound.kwargs)

    return judged


def require_known(call: str, given: Mapping[str, Any], signature: inspect.Signature) -> None:
    """InputError for a keyword that a call does not have where it is like one that it has, which is named."""
    known = [name for name, one in signature.parameters.items() if one.kind is not one.POSITIONAL_ONLY]
    for name in given:
        near = "" if name in known else meant(name, known)
        if near:
            raise InputError(f"{name}: no argument of {call}{near}")


def _plain(value: Any) -> Any:
    """Python's number of NumPy's, which no JSON takes."""
    return value.item() if isinstance(value, Real) and hasattr(value, "item") else value


def require_kind(name: str, value: Any, annotation: Any) -> None:
    """InputError where a value is nothing that an annotation allows."""
    if _fits_any(value, annotation):
        return
    kinds = list(_alternatives(annotation))
    words = [_words(kind) for kind in kinds if kind is not type(None) and not (kind is str and Path in kinds)]
    needed = " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
    raise InputError(f"{name}: {_given(value)} is given; {needed} is needed")


def _given(value: Any) -> str:
    """A number or a text as it is, anything else by its type."""
    if isinstance(value, int) and not abs(value) < 10**20:
        return "a number beyond all bounds"
    text = repr(value) if isinstance(value, str | float | int | None) else type(value).__name__
    return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]}..."


@functools.cache
def _annotation(function: Callable[..., Any], name: str) -> Any:
    """A parameter's annotation; Any where it names what is not loaded."""
    found = inspect.signature(function).parameters[name].annotation
    if not isinstance(found, str):
        return found
    try:
        return eval(found, function.__globals__)  # of our own source
    except NameError:
        return Any


def _alternatives(annotation: Any) -> Iterator[Any]:
    if get_origin(annotation) in (Union, types.UnionType):
        for kind in get_args(annotation):
            yield from _alternatives(kind)
    else:
        yield annotation


def _fits_any(value: Any, annotation: Any) -> bool:
    return any(_fits(value, kind) for kind in _alternatives(annotation))


def _fits(value: Any, kind: Any) -> bool:
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return True
    if kind is None or kind is type(None):
        return value is None
    if kind is bool:
        return isinstance(value, bool) or type(value).__name__ == "bool"  # NumPy's
    if kind in (int, float):
        return _is_number(value, whole=kind is int)
    if kind in (str, Path):
        return isinstance(value, kind)
    if origin is tuple:
        return _is_list(value) and len(value) == len(inner) and all(map(_fits, value, inner))
    if origin is Sequence:
        return _is_list(value) and (get_origin(inner[0]) is tuple or all(_fits_any(one, inner[0]) for one in value))
    if origin in (Mapping, dict):
        return isinstance(value, Mapping) and all(isinstance(key, str) for key in value)
    if origin is Callable:
        return callable(value)
    if inspect.isclass(kind) and not getattr(kind, "_is_protocol", False):
        return isinstance(value, kind)
    return True


def _is_number(value: Any, *, whole: bool) -> bool:
    if isinstance(value, bool) or not isinstance(value, Integral if whole else Real):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _is_list(value: Any) -> bool:
    """Also an array; no text, which is a list of letters."""
    if isinstance(value, str | bytes | Mapping):
        return False
    return isinstance(value, Sequence) or getattr(value, "ndim", 0) == 1


def _words(kind: Any) -> str:
    origin, inner = get_origin(kind), get_args(kind)
    if kind in WORDS:
        return WORDS[kind]
    if origin is tuple:
        return f"{len(inner)} numbers"
    if origin is Sequence:
        return "a list"
    if origin in (Mapping, dict):
        return "a mapping by names"
    if origin is Callable:
        return "a function"
    return f"a {kind.__name__}" if inspect.isclass(kind) else "something else"
