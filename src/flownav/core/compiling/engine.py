"""Equations, procedures and kernels: what is compiled, how, and where it is kept."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core.dispatcher import _FunctionCompiler  # type: ignore[attr-defined]
from numba.core.errors import NumbaError
from numba.core.registry import CPUDispatcher
from numba.extending import overload, register_jitable

from flownav.core.compiling import target
from flownav.core.compiling.cache import STORE, KernelCache
from flownav.core.compiling.handed import hand_over_whole
from flownav.core.compiling.pipeline import LeanCompiler
from flownav.core.compiling.progress import compiling

Function = TypeVar("Function", bound=Callable[..., Any])

hand_over_whole()

LANES_WIDE = 16
MOST_SPARED = 8  # calls of a kernel that are left to Python, together about as long as compiling it
FEW_STEPS = 5000  # a tenth of a second in Python: a flight, not a block of them

EQUATIONS: dict[Callable[..., Any], bool] = {}  # every equation (True) and procedure (False): another target's compiler

# what only kernels call needs no entry for Python and for C, which would take as long to compile as a short law
UNWRAPPED: dict[str, Any] = {
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": LeanCompiler,
}
ENTRY = {"nopython": True, "nogil": True, "error_model": "numpy", "boundscheck": None, "no_cfunc_wrapper": True}


def equation(function: Function) -> Function:
    """A scalar law: plain Python where Python calls it, compiled and inlined where a kernel does."""
    EQUATIONS[function] = True
    return register_jitable(forceinline=True, **UNWRAPPED)(function)


def stands_for(law: Callable[..., Any], function: Function) -> Function:
    """A function that Python calls as it is, where kernels inline the law (what it wraps)."""
    EQUATIONS[function] = True
    options: Any = {"forceinline": True, **UNWRAPPED}
    overload(function, jit_options=options, strict=False)(lambda *_: law)
    return function


def procedure(function: Function) -> Function:
    """An equation too long to be inlined: kernels call it, and it is compiled once for each type of its arguments."""
    EQUATIONS[function] = False
    return register_jitable(**UNWRAPPED)(function)


def kernel(function: Function) -> Function:
    """An entry point built from equations: releases the lock, cached on disk."""
    return function if getattr(numba.config, "DISABLE_JIT", False) else cast(Function, Kernel(function))


class Kernel(CPUDispatcher):
    """Numba's dispatcher with our target and our cache, which says what it compiles."""

    def __init__(self, py_func: Callable[..., Any]) -> None:
        super().__init__(py_func, targetoptions=dict(ENTRY))
        self._compiler = _KernelCompiler(py_func, self.targetdescr, self.targetoptions, {}, LeanCompiler)
        self._cache = KernelCache(py_func, {})
        self._spared = 0

    def compile(self, sig: Any) -> Any:
        """The entry for arguments of these types: known, loaded or compiled."""
        return without_surprises(lambda: super(Kernel, self).compile(sig))

    def prepare(self, *arguments: Any) -> None:
        """Load or compile the entry for such arguments, and do not run it."""
        self.compile(self._kinds(arguments))

    def is_ready(self, *arguments: Any) -> bool:
        """Whether the entry for such arguments is compiled or loaded already."""
        return self._kinds(arguments) in self.overloads

    def file_name(self, *arguments: Any) -> str | None:
        """The name of that entry's file in the cache; None where it cannot be kept."""
        return self._cache.file_name(self._kinds(arguments))

    def spare(self, *arguments: Any) -> bool:
        """Whether to do without the entry for such arguments: it is neither at hand nor has been spared often."""
        if self._spared >= MOST_SPARED or self.is_ready(*arguments):
            return False
        file = self.file_name(*arguments)
        self._spared += 1
        return file is None or not STORE.holds(file)

    def _kinds(self, arguments: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(map(self.typeof_pyval, arguments))


def sparingly(kernel: Callable[..., Any], steps: int, *arguments: Any) -> Any:
    """What a kernel returns; a few times from Python, the same bytes, where it would be compiled for few steps."""
    if steps > FEW_STEPS or not isinstance(kernel, Kernel) or not kernel.spare(*arguments):
        return kernel(*arguments)
    with np.errstate(all="ignore"):
        return kernel.py_func(*arguments)


class _KernelCompiler(_FunctionCompiler):  # type: ignore[misc]
    """Numba's compiler of one function, which says that it is at work."""

    def _compile_core(self, args: Any, return_type: Any) -> Any:
        with compiling(self.py_func.__name__):
            return super()._compile_core(args, return_type)


def without_surprises(compile_it: Callable[[], Any]) -> Any:
    """Compile the lean way; where Numba's inside is not what that needs, the plain way, from then on.

    What fails either way is the fault of what was to be compiled, and changes nothing.
    """
    try:
        with target.lean():
            return compile_it()
    except (AttributeError, TypeError, AssertionError, KeyError, ImportError) as error:
        if isinstance(error, NumbaError) or not target.is_lean():
            raise
        with target.plainly(error), target.lean():
            return compile_it()
