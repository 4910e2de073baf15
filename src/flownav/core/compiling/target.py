"""Target of machine code: a processor level, and one optimisation instead of one per function.

Numba optimises every function it compiles and emits machine code for it, and does both again in each caller. For the
functions that only kernels call this is waste. Inside `lean()`

- a function without a loop is left as it is until a caller with a loop, or the entry, has inlined it;
- a function with a loop is optimised by itself, with all it calls inlined, because LLVM vectorises a loop over lanes
  reliably only while it stands alone;
- a function that only looks as if it had a loop (it has branches, which Numba writes in any order) is optimised by
  itself for callers on sixteen lanes, which vectorise better then, and not for those on one lane: that is two of three;
- only an entry (what Python or C calls) is turned into machine code, by one pipeline: Numba's first one gathers
  reference counts, which kernels do not have.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from typing import Any

import numba
from llvmlite import binding as llvm
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.environment import lookup_environment
from numba.core.registry import cpu_target
from numba.core.runtime.nrt import rtsys

from flownav.core.compiling.level import LLVM_OPTIONS, Leanness, level
from flownav.core.compiling.loops import has_loop, jumps_back
from flownav.core.compiling.memo import memoising

COLLECT_AFTER = 50_000  # objects; Python's own 700 costs a tenth of the time of a compilation
ENVIRONMENT_SYMBOL = "_ZN08NumbaEnv"
ONE_LANE_MARKS = "UniTupleIxLi1EE", "UniTuple_28int64_20x_201_29"  # `ONE_LANE` in a function's name, in a record's

for _option in LLVM_OPTIONS:
    llvm.set_option("flownav", _option)


class LeanLibrary(JITCodeLibrary):
    """One compiled function: its own code, and the libraries of what it calls, linked when they are needed."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self._has_loop = False
        self._jumps_back = False
        self._names_one_lane = False
        self._whole = False  # linked with all that it calls, and optimised
        self._in_engine = False
        self._bitcode = b""

    def add_ir_module(self, ir_module: Any) -> None:
        """Take the code of this function, or that of its entry for Python or C."""
        self._has_loop |= any(map(has_loop, ir_module.functions))
        self._jumps_back |= any(map(jumps_back, ir_module.functions))
        self._names_one_lane |= any(f.blocks and any(m in f.name for m in ONE_LANE_MARKS) for f in ir_module.functions)
        module = llvm.parse_assembly(cgutils.normalize_ir_text(str(ir_module)))
        module.name = ir_module.name
        self.add_llvm_module(module)

    def _optimize_functions(self, module: Any) -> None:
        """Make a function small for its callers; one with a loop is optimised whole, soon."""
        if self._has_loop:
            module.data_layout = self._codegen._data_layout
        else:
            super()._optimize_functions(module)

    def finalize(self) -> None:
        """Link and optimise a function with a loop; leave another to its callers."""
        self._raise_if_finalized()
        if self._has_loop:
            self._make_whole()
        self._finalized = True

    def _make_whole(self) -> None:
        self._link_into(self._final_module)
        for variable in self._final_module.global_variables:
            if variable.name.startswith(ENVIRONMENT_SYMBOL) and not variable.is_declaration:
                variable.linkage = "linkonce_odr"  # else "common", which is kept even where nothing uses it
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)
        self._whole = True

    @cached_property
    def is_of_one_lane(self) -> bool:
        """Whether it, or something that it calls, is a function on one lane; asked when it is finished."""
        return self._names_one_lane or any(getattr(lib, "is_of_one_lane", False) for lib in self._linking_libraries)

    def make_ready_for_lanes(self) -> None:
        """Optimise by itself what only looks as if it had a loop."""
        if self._jumps_back and not self._whole:
            self._make_whole()
            self._shared_module = None  # what callers on one lane were given

    def _link_into(self, module: Any) -> None:
        """Put the code of everything that this function calls into a module."""
        for library in _called(self):
            self._reload_init.update(library._reload_init)
            linked = library.own_module() if isinstance(library, LeanLibrary) else library._get_module_for_linking()
            module.link_in(linked, preserve=True)

    def own_module(self) -> Any:
        """This function's code for its callers, with that of what it calls only if it is whole."""
        if self._bitcode:
            self._shared_module, self._bitcode = llvm.parse_bitcode(self._bitcode), b""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        """The code of this function and of everything it calls, for a library of plain Numba."""
        module = self.own_module()
        if not self._whole:
            module = module.clone()
            self._link_into(module)
        return module

    def get_pointer_to_function(self, name: str) -> int:
        """The address of one of this library's functions, which makes its machine code; 0 where it has none such."""
        self._ensure_finalized()
        if not self._in_engine:
            if not any(function.name == name for function in self.get_defined_functions()):
                return 0
            self._enter_engine()
        return int(super().get_pointer_to_function(name))

    def _enter_engine(self) -> None:
        """Make the machine code."""
        if not self._whole:
            self._make_whole()
        self._final_module.verify()
        self._in_engine = True
        self._finalize_final_module()
        for variable in self._final_module.global_variables:
            environment = lookup_environment(variable.name)
            if environment is not None:
                self._codegen.set_env(variable.name, environment)  # type: ignore[attr-defined]

    def get_llvm_str(self) -> str:
        """The optimised code, also of what came from the cache."""
        return str(self.own_module())

    def get_asm_str(self) -> str:
        """The machine code in words, also of what came from the cache."""
        return str(self._codegen._tm.emit_assembly(self.own_module()))

    def serialize_using_object_code(self) -> Any:
        """The machine code and its symbols, and the code for callers that are kernels themselves."""
        self._ensure_finalized()
        symbols = [function.name for function in self.get_defined_functions()]
        symbols += [variable.name for variable in self._final_module.global_variables if not variable.is_declaration]
        return self.name, symbols, self._get_compiled_object(), self._get_module_for_linking().as_bitcode()

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> LeanLibrary:
        name, symbols, machine_code, bitcode = state
        library: LeanLibrary = codegen.create_library(name)
        library.enable_object_caching()
        library._set_compiled_object(machine_code)
        library._bitcode, library._whole, library._in_engine = bitcode, True, True
        library._finalize_final_module()
        codegen._engine._defined_symbols.update(symbols)
        return library


def _called(library: Any) -> list[Any]:
    """The libraries that a function needs: those it calls, and for what is not linked yet those in turn.

    Who calls comes before what is called: the linker takes from a library only what somebody has asked for by then.
    """
    found: dict[int, Any] = {}
    done: list[Any] = []

    def visit(caller: Any) -> None:
        for called in caller._linking_libraries:
            if id(called) not in found:
                found[id(called)] = called
                if isinstance(called, LeanLibrary) and not library.is_of_one_lane:
                    called.make_ready_for_lanes()
                if isinstance(called, LeanLibrary) and not called._whole:
                    visit(called)
                done.append(called)

    visit(library)
    return done[::-1]


class LeanCodegen(JITCPUCodegen):
    """Numba's code generator for the processor level."""

    _library_class = LeanLibrary

    def _get_host_cpu_name(self) -> str:
        return level().cpu

    def _get_host_cpu_features(self) -> str:
        return level().features

    def set_env(self, env_name: str, env: Any) -> None:
        """Give an entry its environment; what only kernels call has none of its own."""
        if self._engine.is_symbol_defined(env_name):
            super().set_env(env_name, env)


def is_lean() -> bool:
    """Whether this version of Numba is built as `LeanLibrary` supposes; False with `FLOWNAV_PLAIN=1`."""
    parts = ("_finalize_final_module", "_raise_if_finalized", "_get_module_for_linking", "_optimize_functions")
    return Leanness.wanted and all(hasattr(JITCodeLibrary, part) for part in parts)


@contextmanager
def plainly(error: Exception) -> Iterator[None]:
    """Compile as Numba does by itself inside the block, and from then on if that succeeds where the lean way failed."""
    Leanness.wanted = False
    try:
        yield
    except BaseException:
        Leanness.wanted = True
        raise
    why = f"{type(error).__name__}: {error}".splitlines()[0]
    print(f"flownav: Numba {numba.__version__} compiles the slow way here ({why})", file=sys.stderr, flush=True)


@cache
def _codegen() -> LeanCodegen:
    return LeanCodegen("flownav.exec")


@contextmanager
def rarely_collecting() -> Iterator[None]:
    """Python's search for unreachable cycles, which finds few among a compiler's many objects, more rarely."""
    before = gc.get_threshold()
    gc.set_threshold(max(before[0], COLLECT_AFTER), *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextmanager
def lean() -> Iterator[None]:
    """Compile, load and link in this way inside the block, alone among threads.

    Numba's registries of what it can compile (15 MB) are left to its compiler: what is loaded needs its runtime alone.
    """
    with global_compiler_lock:
        context = cpu_target.target_context
        rtsys.initialize(context)
        before = context._internal_codegen
        context._internal_codegen = _codegen() if is_lean() else before
        try:
            with memoising(), rarely_collecting():
                yield
        finally:
            context._internal_codegen = before
