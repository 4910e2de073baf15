"""Machine code that was kept, run without the compiler: placed into memory beside Numba's runtime, three small C
libraries.

`import numba` takes a third of a second, and declaring all equations to it as long again; this takes a twentieth of
one. The C libraries (what takes an array out of a Python object, what raises an error) are those that a wheel with
kernels carries, or those of Numba's folder; they are loaded under Numba's own names, so that Numba finds them should
something be compiled after all. On x86-64 nothing of LLVM is loaded (45 MB; `linker`); elsewhere it links. Whatever is
not as this supposes (another version, another system) is left to Numba, which loads the same machine code.
"""

import builtins
import importlib.util
import pickle
import sys
import threading
from collections.abc import Callable
from ctypes import PYFUNCTYPE, c_int, c_void_p, cast, py_object, string_at
from functools import cache
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, FileFinder
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from flownav.core.compiling import linker
from flownav.core.compiling.cache import SHIPPED, STORE

RUNTIME_FOLDER = "runtime"
RUNTIME = "numba.core.runtime._nrt_python"
LIBRARIES = ("numba._helperlib", "numba._dynfunc", RUNTIME)
_lock = threading.RLock()


class Environment(NamedTuple):
    """The Python objects that code needs: the symbol that points to it, the module whose names it knows, and
    constants.
    """

    symbol: str
    module: str
    constants: tuple[Any, ...]


class MachineCode(NamedTuple):
    """One compiled function, as it is kept. entry: the symbol of what Python or C calls; environments: its own first.

    compiled: all that Numba knows of it, pickled, for kernels that call it. code: empty where Numba alone can load it.
    """

    code: bytes
    entry: str
    module: str
    name: str
    environments: tuple[Environment, ...]
    compiled: bytes

    def unpickled(self) -> Any:
        """Numba's view of it: its library without the machine code, its description, and so on."""
        return pickle.loads(self.compiled)


class _Runtime(NamedTuple):
    """Numba's C library that makes functions, and the symbols that code may ask for."""

    functions: Any
    symbols: dict[str, int]


_unpickled: dict[bytes, Any] = {}


def _unpickle(place: int, size: int, _: int) -> Any:
    """An object that code names, such as NumPy's array type; Numba's own would import Numba for it."""
    content = string_at(place, size)
    if content not in _unpickled:
        _unpickled[content] = pickle.loads(content)
    return _unpickled[content]


_UNPICKLE = PYFUNCTYPE(py_object, c_void_p, c_int, c_void_p)(_unpickle)  # as C calls it


_alive: list[Any] = []  # linked code, and what it points to


def kept(name: str | None) -> MachineCode | None:
    """The machine code cached under a name, None where there is nothing sound."""
    payload = STORE.load(name) if name is not None else None
    if name is None or payload is None:
        return None
    try:
        return MachineCode(*pickle.loads(payload))
    except Exception as error:
        STORE.damaged(name, type(error).__name__)
        return None


def python_function(name: str | None) -> Callable[..., Any] | None:
    """The function of that name in the cache, for Python to call; None where Numba must compile or load it."""
    code = kept(name)
    return _or_none(lambda: _function(code)) if code is not None and code.code else None


def c_function(name: str | None) -> int | None:
    """The address of the C function of that name in the cache; None likewise."""
    code = kept(name)
    return _or_none(lambda: _linked(code)[0]) if code is not None and code.code else None


def _or_none(load: Callable[[], Any]) -> Any:
    """The result of `load`; None where the runtime is not the one that this module supposes."""
    with _lock:
        try:
            return load() if sys.platform == "linux" else None
        except (ImportError, AttributeError, KeyError, TypeError, RuntimeError, OSError):
            return None


def _function(code: MachineCode) -> Callable[..., Any]:
    address, environments = _linked(code)
    made: Callable[..., Any] = runtime().functions.make_function(
        import_module(code.module), code.name, f"compiled {code.name}", address, environments[0], ()
    )
    return made


def _linked(code: MachineCode) -> tuple[int, list[Any]]:
    """The address of the entry, and the environments that it points to."""
    try:
        placed: Any = linker.place(code.code, runtime().symbols)
        addresses = placed.addresses
    except ValueError:
        placed = addresses = _linked_by_llvm(code)
    environments = [_environment(environment) for environment in code.environments]
    for described, made in zip(code.environments, environments, strict=True):
        c_void_p.from_address(addresses[described.symbol]).value = id(made)
    _alive.append((placed, environments))
    return int(addresses[code.entry]), environments


def _linked_by_llvm(code: MachineCode) -> Any:
    """The same code on a processor whose relocations `linker` does not know."""
    from llvmlite import binding as llvm

    library = llvm.JITLibraryBuilder().add_object_img(code.code).add_current_process().export_symbol(code.entry)
    for symbol, address in runtime().symbols.items():
        library.import_symbol(symbol, address)
    for environment in code.environments:
        library.export_symbol(environment.symbol)
    return library.link(_lljit(), f"flownav {len(_alive)}")


@cache
def _lljit() -> Any:
    """LLVM's linker, once in a process."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.create_lljit_compiler()


def _environment(described: Environment) -> Any:
    made = runtime().functions.Environment(vars(import_module(described.module)))
    made.consts[:] = described.constants
    return made


@cache
def runtime() -> _Runtime:
    """Numba's runtime, once in a process."""
    helpers, functions, memory = map(_library, LIBRARIES)
    memory.memsys_use_cpython_allocator()
    symbols = {"_Py_NoneStruct": id(None)}
    for library in (helpers, functions):
        symbols |= {f"numba_{name}": address for name, address in library.c_helpers.items()}
    symbols |= {name if name.startswith("_") else f"NRT_{name}": address for name, address in memory.c_helpers.items()}
    symbols["numba_unpickle"] = cast(_UNPICKLE, c_void_p).value or 0
    errors = (kind for kind in vars(builtins).values() if isinstance(kind, type) and issubclass(kind, BaseException))
    symbols |= {f"PyExc_{kind.__name__}": id(kind) for kind in errors}
    return _Runtime(functions, symbols)


def _library(name: str) -> ModuleType:
    """One of Numba's C libraries, without the packages that it lies in."""
    if name in sys.modules:
        return sys.modules[name]
    if "numba" in sys.modules:
        return import_module(name)
    found = next(filter(None, (_found_in(folder, name) for folder in _folders(name))), None)
    if found is None or found.loader is None:
        raise ImportError(f"{name} is not there")
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    sys.modules[name] = module
    return module


def _folders(name: str) -> list[Path]:
    """Where a C library of Numba's may lie: in Numba's package, or in a wheel of ours with kernels."""
    package = importlib.util.find_spec("numba")
    of_numba = Path(package.origin).parent.joinpath(*name.split(".")[1:-1]) if package and package.origin else None
    return [folder for folder in (of_numba, SHIPPED / RUNTIME_FOLDER) if folder is not None]


def _found_in(folder: Path, name: str) -> Any:
    return FileFinder(str(folder), (ExtensionFileLoader, EXTENSION_SUFFIXES)).find_spec(name)
