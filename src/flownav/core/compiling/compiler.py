"""The compiler of equations, kernels and units: Numba, with our target, our passes and our cache."""

from collections.abc import Callable
from typing import Any, cast

from numba import types
from numba.core.caching import _Cache
from numba.core.ccallback import _CFuncCompiler  # type: ignore[attr-defined]
from numba.core.compiler import CompileResult
from numba.core.dispatcher import _FunctionCompiler  # type: ignore[attr-defined]
from numba.core.errors import NumbaError
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.serialize import dumps
from numba.core.typing.templates import Signature
from numba.extending import overload, register_jitable

from flownav.core.compiling import target
from flownav.core.compiling.cache import STORE, file_name
from flownav.core.compiling.loaded import Environment, MachineCode, kept
from flownav.core.compiling.pipeline import LeanCompiler
from flownav.core.compiling.progress import compiling

# what only kernels call needs no entry for Python and for C, which would take as long to compile as a short law
UNWRAPPED: dict[str, Any] = {
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": LeanCompiler,
}
INLINED: dict[str, Any] = {"forceinline": True, **UNWRAPPED}
ENTRY = {"nopython": True, "nogil": True, "error_model": "numpy", "boundscheck": None, "no_cfunc_wrapper": True}
OF_UNIT = {"error_model": "numpy"}
LETTERS = {
    "p": types.CPointer(types.float64),
    "q": types.CPointer(types.int64),
    "d": types.float64,
    "i": types.int64,
}


def inlined(function: Callable[..., Any]) -> None:
    """Kernels inline this function."""
    register_jitable(**INLINED)(function)


def inlined_for(law: Callable[..., Any], function: Callable[..., Any]) -> None:
    """Kernels inline the law where this function is called."""
    options: Any = INLINED
    overload(function, jit_options=options, strict=False)(lambda *_: law)


def called(function: Callable[..., Any]) -> None:
    """Kernels call this function."""
    register_jitable(**UNWRAPPED)(function)


class Dispatcher(CPUDispatcher):
    """Numba's dispatcher with our target and our cache, which reports the function that it compiles."""

    def __init__(self, py_func: Callable[..., Any]) -> None:
        super().__init__(py_func, targetoptions=dict(ENTRY))
        self._compiler = _KernelCompiler(py_func, self.targetdescr, self.targetoptions, {}, LeanCompiler)
        self._cache = KernelCache(py_func, {})

    def compile(self, sig: Any) -> Any:
        """The entry for arguments of these types: known, loaded or compiled."""
        return without_surprises(lambda: super(Dispatcher, self).compile(sig))

    def prepare(self, *arguments: Any) -> None:
        """Load or compile the entry for such arguments, and do not run it."""
        self.compile(tuple(map(self.typeof_pyval, arguments)))


class _KernelCompiler(_FunctionCompiler):  # type: ignore[misc]
    """Numba's compiler of one function, which reports that it is at work."""

    def _compile_core(self, args: Any, return_type: Any) -> Any:
        with compiling(self.py_func.__name__):
            return super()._compile_core(args, return_type)


class KernelCache(_Cache):
    """Numba's interface to the store, for one function with these constants."""

    def __init__(self, function: Callable[..., Any], constants: dict[str, Any]) -> None:
        self._function = function
        self._constants = constants

    @property
    def cache_path(self) -> str:
        """The folder, as Numba's statistics show it."""
        return str(STORE.own)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function of this signature, or None: it must be compiled."""
        name = self.file_name(sig)
        code = kept(name)
        if name is None or code is None:
            return None
        try:
            library, *rest = code.unpickled()
            if code.code:
                library = *library[:2], code.code, library[2]
            return CompileResult._rebuild(target_context, library, *rest)
        except Exception as error:
            STORE.damaged(name, type(error).__name__)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled function, unless it holds addresses of this process."""
        name = self.file_name(sig)
        if name is None or data.lifted or data.library.has_dynamic_globals:
            return
        data = data._replace(type_annotation="")  # a listing of the whole function, of no use to anybody
        STORE.save(name, dumps(tuple(machine_code(data))))

    def file_name(self, sig: Any) -> str | None:
        """The name of this function's file for such types."""
        return file_name(self._function, self._constants, described(sig))

    def enable(self) -> None:
        """Numba's switch; this cache is always on."""

    def disable(self) -> None:
        """Numba's switch; this cache is always on."""

    def flush(self) -> None:
        """Numba's broom; nothing here goes stale."""


def machine_code(data: Any) -> MachineCode:
    """A compiled function as it is kept; what was compiled plainly (`target.plainly`) is for Numba alone to load."""
    library, fndesc, own, *rest = data._reduce()
    named = fndesc.modname, fndesc.qualname.split(".")[-1]
    if not isinstance(data.library, target.LeanLibrary):
        return MachineCode(b"", "", *named, (), dumps((library, fndesc, own, *rest)))
    name, symbols, code, bitcode = library
    environments = {each.env_name: each for each in (own, *rest[-1])} if own is not None else {}
    entry = next(each for each in (fndesc.llvm_cpython_wrapper_name, fndesc.llvm_cfunc_wrapper_name) if each in symbols)
    needed = tuple(
        Environment(symbol, each.globals["__name__"], tuple(each.consts))
        for symbol, each in environments.items() if symbol in symbols
    )  # fmt: skip
    return MachineCode(code, entry, *named, needed, dumps(((name, symbols, bitcode), fndesc, own, *rest)))


def described(kind: Any) -> str:
    """A Numba type, or a tuple of them, in words that are the same in every process; classes by module and fields."""
    if isinstance(kind, tuple):
        return "(" + ", ".join(map(described, kind)) + ")"
    if isinstance(kind, types.BaseTuple):
        parts = ", ".join(described(part) for part in cast(Any, kind))
        cls = getattr(kind, "instance_class", tuple)
        return f"{cls.__module__}.{cls.__qualname__}[{', '.join(getattr(cls, '_fields', ()))}: {parts}]"
    if isinstance(kind, Signature):
        return f"{described(kind.args)} -> {described(kind.return_type)}"
    return str(kind)


def signature_of(letters: list[str]) -> Any:
    """Numba's signature of a unit."""
    return types.void(*(LETTERS[letter] for letter in letters))


def compile_unit(
    function: Callable[..., Any], bound: Callable[[], Any], constants: dict[str, Any], letters: list[str]
) -> tuple[Any, int]:
    """The library and the address of a unit's C function, from the cache where it is there."""
    return cast(tuple[Any, int], without_surprises(lambda: _compile_unit(function, bound, constants, letters)))


def _compile_unit(
    function: Callable[..., Any], bound: Callable[[], Any], constants: dict[str, Any], letters: list[str]
) -> tuple[Any, int]:
    signature = signature_of(letters)
    keeper = KernelCache(function, constants)
    result = keeper.load_overload(signature, cpu_target.target_context)
    if result is None:
        with compiling(function.__name__):
            compiler = _CFuncCompiler(bound(), cpu_target, OF_UNIT, {}, LeanCompiler)
            result = compiler.compile(signature.args, signature.return_type)
            address = _address(result)
        keeper.save_overload(signature, result)
        return result.library, address
    return result.library, _address(result)


def _address(result: Any) -> int:
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_cfunc_wrapper_name))


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
