"""Units: pieces of a kernel that are compiled and cached by themselves and called through their addresses."""

import ast
import ctypes
import inspect
import linecache
import textwrap
import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from flownav.core.compiling.cache import file_name
from flownav.core.compiling.engine import compiler
from flownav.core.compiling.loaded import c_function
from flownav.core.compiling.words import words_of_letters

LETTERS: dict[str, tuple[Any, Any]] = {  # as C takes them, and as arrays have them
    "p": (ctypes.c_void_p, np.float64),
    "q": (ctypes.c_void_p, np.int64),
    "d": (ctypes.c_double, None),
    "i": (ctypes.c_int64, None),
}


class Unit:
    """A function with a C interface, compiled apart from its callers; kernels call it by `invoke(address, ...)`."""

    def __init__(self, function: Callable[..., Any], signature: str, constants: dict[str, Any]) -> None:
        unknown = sorted(set(signature.split()) - set(LETTERS))
        if unknown:
            raise ValueError(f"a unit's signature is made of {', '.join(LETTERS)}, not {', '.join(unknown)}")
        self.function = function
        self.letters = signature.split()
        self.constants = constants
        self.__name__ = function.__name__
        self.__doc__ = function.__doc__
        self._lock = threading.RLock()
        self._entry: Any = None

    def python(self, *arguments: Any) -> None:
        """The plain Python function on these arguments, its constants bound."""
        names = [name for name in inspect.signature(self.function).parameters if name not in self.constants]
        self.function(**dict(zip(names, arguments, strict=True)), **self.constants)

    @property
    def is_ready(self) -> bool:
        """Whether it is compiled or loaded already."""
        return self._entry is not None

    def file_name(self) -> str | None:
        """The name of its file in the cache; None where it cannot be kept."""
        return file_name(self.function, self.constants, words_of_letters(self.letters))

    @property
    def address(self) -> int:
        """The address of the compiled function, which is compiled or loaded at the first use."""
        return int(self._compiled[0])

    def __call__(self, *arguments: Any) -> None:
        """Run the compiled code from Python; a pointer may be given as an array, an address or a ctypes pointer."""
        if len(arguments) != len(self.letters):
            raise TypeError(f"{self.__name__} takes {len(self.letters)} arguments, not {len(arguments)}")
        self._compiled[1](
            *(_passed(letter, argument) for letter, argument in zip(self.letters, arguments, strict=True))
        )

    @property
    def _compiled(self) -> tuple[int, Any]:
        """The address, and what Python calls; the third keeps the machine code alive."""
        with self._lock:
            if self._entry is None:
                library, address = self._compile()
                kinds = [LETTERS[letter][0] for letter in self.letters]
                self._entry = address, ctypes.CFUNCTYPE(None, *kinds)(address), library
            return self._entry[0], self._entry[1]

    def _compile(self) -> tuple[Any, int]:
        """The library and the address of its C function, from the cache where it is there."""
        address = c_function(self.file_name())
        if address is not None:
            return None, address
        made: tuple[Any, int] = compiler().compile_unit(
            self.function, lambda: bind_constants(self.function, self.constants), self.constants, self.letters
        )
        return made


def unit(function: Callable[..., Any], signature: str, **constants: Any) -> Unit:
    """A kernel with a C interface, compiled and cached by itself and called through its address.

    `signature` names its arguments: `p` float64*, `q` int64*, `d` a float64, `i` an int64, for example "p p q d i".
    `constants` are the function's other parameters, fixed when it is compiled: `lanes=LANES` makes `len(lanes)` a
    constant. It returns nothing and holds or releases no lock: its callers do.
    """
    return Unit(function, signature, constants)


def _passed(letter: str, argument: Any) -> Any:
    """An argument as ctypes takes it; an array must be of the letter's type."""
    dtype = LETTERS[letter][1]
    if dtype is not None and isinstance(argument, np.ndarray):
        if argument.dtype != dtype or not argument.flags.c_contiguous:
            raise TypeError(f"'{letter}' takes a contiguous array of {np.dtype(dtype)}, not of {argument.dtype}")
        return argument.ctypes.data
    return argument


def bind_constants(function: Callable[..., Any], constants: dict[str, Any]) -> Callable[..., Any]:
    """The function without the parameters `constants`, which become globals and so constants of the compiler."""
    if not constants:
        return function
    source, first_line = inspect.getsource(function), function.__code__.co_firstlineno
    tree = ast.parse(textwrap.dedent(source))
    definition = tree.body[0]
    assert isinstance(definition, ast.FunctionDef)
    missing = sorted(set(constants) - {argument.arg for argument in _parameters(definition)})
    if missing:
        raise TypeError(f"{function.__name__} has no parameter {', '.join(missing)}")
    _remove_parameters(definition, constants)
    ast.increment_lineno(tree, first_line - 1)
    linecache.checkcache(function.__code__.co_filename)
    names = inspect.getclosurevars(function)
    scope = {**function.__globals__, **names.nonlocals, **constants}
    exec(compile(tree, function.__code__.co_filename, "exec", dont_inherit=True), scope)
    bound: Callable[..., Any] = scope[function.__name__]
    bound.__qualname__ = function.__qualname__
    return bound


def _parameters(definition: ast.FunctionDef) -> list[ast.arg]:
    return [*definition.args.posonlyargs, *definition.args.args, *definition.args.kwonlyargs]


def _remove_parameters(definition: ast.FunctionDef, constants: dict[str, Any]) -> None:
    """Take out the parameters of these names, all defaults (a C function has none), annotations and decorators."""
    kept = [argument for argument in _parameters(definition) if argument.arg not in constants]
    for argument in kept:
        argument.annotation = None
    definition.args = ast.arguments(posonlyargs=[], args=kept, kwonlyargs=[], kw_defaults=[], defaults=[])
    definition.decorator_list, definition.returns = [], None
