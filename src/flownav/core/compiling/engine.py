"""Equations, procedures and kernels: what is compiled, and when. Numba is imported to compile, and not before."""

import inspect
import os
from collections.abc import Callable
from functools import update_wrapper
from importlib import import_module
from typing import Any, TypeVar, cast

import numpy as np

from flownav.core.compiling.cache import STORE, file_name
from flownav.core.compiling.declared import begin_compiling, when_compiling
from flownav.core.compiling.level import Leanness
from flownav.core.compiling.loaded import python_function
from flownav.core.compiling.words import words_of

Function = TypeVar("Function", bound=Callable[..., Any])

LANES_WIDE = 16
MOST_SPARED = 8  # calls of a kernel that are left to Python, together about as long as compiling it
FEW_STEPS = 5000  # a tenth of a second in Python: a flight, not a block of them

EQUATIONS: dict[Callable[..., Any], bool] = {}  # every equation (True) and procedure (False): another target's compiler


def equation(function: Function) -> Function:
    """A scalar law: plain Python where Python calls it, compiled and inlined where a kernel does."""
    EQUATIONS[function] = True
    _defer("compiler", "inlined", function)
    return function


def stands_for(law: Callable[..., Any], function: Function) -> Function:
    """A function that Python calls as it is, where kernels inline the law (what it wraps)."""
    EQUATIONS[function] = True
    _defer("compiler", "inlined_for", law, function)
    return function


def intrinsic(function: Function, how: str, *details: Any) -> Function:
    """A function that kernels get as instructions, which `how` of the module `intrinsics` writes, called with `told`.

    With `FLOWNAV_PLAIN=1` it is an equation as any other, as it is for another target's compiler.
    """
    EQUATIONS[function] = True
    if Leanness.wanted:
        _defer("intrinsics", how, function, *details)
    else:
        _defer("compiler", "inlined", function)
    return function


def procedure(function: Function) -> Function:
    """An equation too long to be inlined: kernels call it, and it is compiled once for each type of its arguments."""
    EQUATIONS[function] = False
    _defer("compiler", "called", function)
    return function


def kernel(function: Function) -> Function:
    """An entry point built from equations: releases the lock, cached on disk."""
    return function if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0" else cast(Function, Kernel(function))


def _defer(module: str, how: str, *details: Any) -> None:
    """Declare to Numba, before anything is compiled, by a function of one of the modules that have it."""
    when_compiling(lambda: getattr(import_module(f"flownav.core.compiling.{module}"), how)(*details))


def compiler() -> Any:
    """The module that has Numba, with every equation declared. InputError where Numba is not installed."""
    begin_compiling()
    return import_module("flownav.core.compiling.compiler")


class Kernel:
    """A function and, for each type of its arguments, what was compiled of it: loaded where it was kept.

    py_func: the function in Python. dispatcher: Numba's, made at the first compilation; it also serves kernels that
    call this one.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._signature = inspect.signature(function)
        self._count = len(self._signature.parameters)
        self._entries: dict[str, Callable[..., Any]] = {}
        self._dispatcher: Any = None
        self._spared = 0

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Run the compiled code, which is loaded or compiled for such arguments at the first call."""
        if named or len(arguments) != self._count:
            arguments = self._in_order(arguments, named)
        kinds = words_of(arguments)
        if kinds is None:
            return self.dispatcher(*arguments)
        entry = self._entries.get(kinds) or self._entry(kinds, arguments)
        return entry(*arguments)

    @property
    def dispatcher(self) -> Any:
        """Numba's dispatcher of this function."""
        if self._dispatcher is None:
            self._dispatcher = compiler().Dispatcher(self.py_func)
        return self._dispatcher

    def _in_order(self, arguments: tuple[Any, ...], named: dict[str, Any]) -> tuple[Any, ...]:
        """All arguments by place, with defaults. TypeError where they do not fit the function."""
        bound = self._signature.bind(*arguments, **named)
        bound.apply_defaults()
        return bound.args

    def prepare(self, *arguments: Any) -> None:
        """Load or compile the entry for such arguments, and do not run it."""
        kinds = words_of(arguments)
        if kinds is None:
            self.dispatcher.prepare(*arguments)
        elif kinds not in self._entries:
            self._entry(kinds, arguments)

    def is_ready(self, *arguments: Any) -> bool:
        """Whether the entry for such arguments is compiled or loaded already."""
        return words_of(arguments) in self._entries

    def file_name(self, *arguments: Any) -> str | None:
        """The name of that entry's file in the cache; None where it cannot be kept."""
        kinds = words_of(arguments)
        return None if kinds is None else file_name(self.py_func, {}, kinds)

    def files(self) -> list[str | None]:
        """The names of the files of all entries that are ready."""
        return [file_name(self.py_func, {}, kinds) for kinds in self._entries]

    def spare(self, *arguments: Any) -> bool:
        """Whether to do without the entry for such arguments: it is neither at hand nor has been spared often."""
        if self._spared >= MOST_SPARED or self.is_ready(*arguments):
            return False
        file = self.file_name(*arguments)
        self._spared += 1
        return file is None or not STORE.holds(file)

    def _entry(self, kinds: str, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        """Entry for such arguments: cached machine code, or Numba's dispatcher once it has compiled the function."""
        entry: Callable[..., Any] | None = python_function(file_name(self.py_func, {}, kinds))
        if entry is None:
            self.dispatcher.prepare(*arguments)
            entry = self.dispatcher
        self._entries[kinds] = entry
        return entry


def sparingly(kernel: Callable[..., Any], steps: int, *arguments: Any) -> Any:
    """Result of a kernel; for few steps from Python, the same bytes, where it would have to be compiled."""
    if steps > FEW_STEPS or not isinstance(kernel, Kernel) or not kernel.spare(*arguments):
        return kernel(*arguments)
    with np.errstate(all="ignore"):
        return kernel.py_func(*arguments)
