"""Code for a CUDA device, run on the CPU: what numba-cuda hands to NVVM, compiled for this processor instead.

The same functions, types and lowering as on a device, thread by thread; NVVM, the assembler and the launch are left
out. Of the device's math library only exact functions are asked for, which are this processor's instructions.
"""

from __future__ import annotations

import ctypes
import re
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from flownav.core.compiling.device import call_instead, lowered
from flownav.core.compiling.launch import argument_names, argument_type, flattened, per_thread, with_arrays

CAPABILITY = (9, 0)
INTRINSICS = {name: name for name in ("sqrt", "fabs", "floor", "ceil", "rint", "trunc")} | {
    "fmax": "maxnum",
    "fmin": "minnum",
}
THREAD = "flownav_thread"


class HostedDevice:
    """Runs threads one after the other. instead: as `launch.Gpu` has it."""

    in_python = False

    def __init__(self, instead: Any) -> None:
        call_instead(instead)
        self._kept: list[Any] = []
        self._entries: dict[str, Any] = {}

    def free_bytes(self) -> int:
        """More than any test takes."""
        return 1 << 40

    def put(self, value: Any) -> Any:
        """A copy of an array, or of the arrays in a tuple."""
        return with_arrays(value, np.copy)

    def new(self, shape: Any, dtype: Any) -> Any:
        """A new array, filled with poison values."""
        return np.full(shape, np.nan if np.issubdtype(dtype, np.floating) else 77, dtype)

    def fetch(self, array: Any) -> Any:
        """A copy of the array."""
        return array.copy()

    def run(self, function: Any, threads: int, told: dict[str, Any], constants: dict[str, Any]) -> None:
        """`function(thread, threads, **told, **constants)` for each thread."""
        arguments = (threads, *(told[name] for name in argument_names(function, constants)))
        passed = list(flattened(arguments, lambda array: array.ctypes.data))
        entry, thread = self._entry(function, constants, arguments, passed)
        for k in range(threads):
            thread.value = k
            entry(*passed)

    def _entry(self, function: Any, constants: Any, arguments: Any, passed: Any) -> Any:
        kinds = tuple(map(argument_type, arguments))
        key = f"{function.__name__} {constants} {kinds}"
        if key not in self._entries:
            library = lowered(per_thread(function, constants), kinds, CAPABILITY)
            engine = host_engine(library.llvm_strs)
            self._kept.append(engine)
            kinds_c = [{bool: ctypes.c_bool, int: ctypes.c_int64, float: ctypes.c_double}[type(p)] for p in passed]
            address = engine.get_function_address(library._entry_name)
            thread = ctypes.c_int32.from_address(engine.get_global_value_address(THREAD))
            self._entries[key] = ctypes.CFUNCTYPE(None, *kinds_c)(address), thread
        return self._entries[key]


def host_engine(modules: list[str]) -> Any:
    """An engine with the code of these modules for this processor."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(opt=2)
    whole = llvm.parse_assembly(_stand_ins(modules))
    for text in modules:
        module = llvm.parse_assembly(_for_host(text))
        whole.link_in(module)
    whole.triple, whole.data_layout = machine.triple, str(machine.target_data)
    whole.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(whole, builder)
    engine = llvm.create_mcjit_compiler(whole, machine, use_lmm=True)
    engine.finalize_object()
    return engine


def _for_host(text: str) -> str:
    """A module without its target, its kernel's marks and the device's registers."""
    text = re.sub(r"^target (triple|datalayout) = .*$", "", text, flags=re.M)
    text = re.sub(r"^!nvvm.*$", "", text, flags=re.M)
    text = re.sub(r"^@llvm\.used = .*$", "", text, flags=re.M)
    return re.sub(r'@"?llvm\.nvvm\.read\.ptx\.sreg\.(\w+)\.x"?', r"@flownav_\1", text)


def _stand_ins(modules: list[str]) -> str:
    """The thread's number, and the device's math functions by this processor's instructions."""
    lines = [
        f"@{THREAD} = global i32 0",
        f"define i32 @flownav_tid() {{\n %t = load i32, i32* @{THREAD}\n ret i32 %t\n}}",
        "define i32 @flownav_ctaid() {\n ret i32 0\n}",
        "define i32 @flownav_ntid() {\n ret i32 1\n}",
    ]
    declared = {}
    for text in modules:
        for name, told in re.findall(r'^declare double @"?__nv_(\w+)"?\((.*?)\)', text, flags=re.M):
            declared[name] = told.count("double")
    for name, count in sorted(declared.items()):
        taken = ", ".join(f"double %x{i}" for i in range(count))
        assert name in INTRINSICS, f"the device's library computes {name}"
        there = f"llvm.{INTRINSICS[name]}.f64"
        lines.append(f"declare double @{there}({', '.join(['double'] * count)})")
        lines.append(f"define double @__nv_{name}({taken}) {{\n %y = call double @{there}({taken})\n ret double %y\n}}")
    return "\n".join(lines) + "\n"
