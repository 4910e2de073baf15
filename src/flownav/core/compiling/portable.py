"""Units for other processors: their code as it is before any processor is thought of, and machine code made of that.

A unit's code is compiled by Numba for this process; here it is taken as LLVM has it before it is optimised, linked with
all that it calls, and optimised and emitted for another processor. Everything but the entries is internal, so that a
caller can only pass pointers, which every calling convention does alike. The code calls nothing outside itself. What
Numba makes in a process is optimised once and for all, so the unoptimised code is made in another one; it is kept where
kernels are (`cache`).
"""

import ctypes
import hashlib
import importlib
import inspect
import json
import os
import re
import subprocess
import sys
import zlib
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from llvmlite import binding as llvm
from numba.core import compiler
from numba.core.compiler import Flags
from numba.core.registry import cpu_target

from flownav.core.compiling import target
from flownav.core.compiling.cache import STORE, VERSIONS
from flownav.core.compiling.compiler import signature_of
from flownav.core.compiling.declared import begin_compiling
from flownav.core.compiling.pipeline import LeanCompiler
from flownav.core.compiling.progress import compiling
from flownav.core.compiling.units import Unit, bind_constants

INLINING = 50  # LLVM's threshold: at 225, its own, code is a twentieth larger and no faster on a Cortex-M7
LONGEST_S = 1800.0  # for the other process


class Entry(NamedTuple):
    """A unit that is to be called from outside: its module, its name there, and the symbol that callers see.

    counts: what stands in each of its arrays of whole numbers when it is called; callers do not see these.
    """

    module: str
    name: str
    symbol: str
    counts: tuple[tuple[int, ...], ...] = ()

    @property
    def unit(self) -> Unit:
        """The unit itself."""
        found: Unit = getattr(importlib.import_module(self.module), self.name)
        return found


class Processor(NamedTuple):
    """A processor as LLVM knows it. relocation: static, pic or default. narrow: it counts in 32 bits."""

    triple: str
    cpu: str = ""
    features: str = ""
    relocation: str = "pic"
    narrow: bool = False


def process_triple() -> str:
    """The triple of this process."""
    return str(llvm.get_process_triple())


class NoProcessorError(Exception):
    """LLVM knows no such processor; the message is LLVM's own."""


# -- the code before any processor ----------------------------------------------------------------------------
class _RawLibrary(target.LeanLibrary):
    """A function's code, and nothing done to it."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        """Leave it as it is."""
        self._raise_if_finalized()
        self._finalized = True

    def make_ready_for_lanes(self) -> None:
        """Not for lanes."""


class _RawCodegen(target.LeanCodegen):
    _library_class = _RawLibrary


def raw_code(entries: Sequence[Entry]) -> str:
    """The code of units and of all that they call, as LLVM's text; from the cache where it is there."""
    name = _file_name(entries)
    kept = STORE.load(name) if name is not None else None
    if kept is None:
        with compiling("the navigator for other processors"):
            kept = _made_elsewhere(entries)
        if name is not None:
            STORE.save(name, kept)
    return zlib.decompress(kept).decode()


def _file_name(entries: Sequence[Entry]) -> str | None:
    """The name of its file: everything that it depends on, hashed; None where that is not known."""
    stamp = STORE.sources.stamp({"flownav.core.compile", *(entry.module for entry in entries)})
    if stamp is None:
        return None
    everything = "\n".join([stamp, VERSIONS, *(repr((*entry, entry.unit.letters)) for entry in entries)])
    return f"portable-{hashlib.sha256(everything.encode()).hexdigest()[:24]}.kernel"


def _made_elsewhere(entries: Sequence[Entry]) -> bytes:
    """The code, made in a process that has compiled nothing else."""
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
    made = subprocess.run(
        [sys.executable, "-P", "-m", __name__, json.dumps(list(entries))],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        timeout=LONGEST_S,
        check=False,
    )
    if made.returncode:
        raise RuntimeError(f"the code was not made: {made.stderr.decode(errors='replace')[-2000:]}")
    return made.stdout


def _make(entries: Iterable[Entry]) -> str:
    """The code of these units, made here, with an entry of C for each."""
    begin_compiling()
    raw = _RawCodegen("flownav.portable")
    whole, doors = None, []
    with target.lean():
        context, typing = cpu_target.target_context, cpu_target.typing_context
        context._internal_codegen = raw
        typing.refresh()
        context.refresh()
        for entry in entries:
            result = compiler.compile_extra(
                typing, context, bind_constants(entry.unit.function, entry.unit.constants),
                signature_of(entry.unit.letters).args, signature_of(entry.unit.letters).return_type, _flags(), {},
                pipeline_class=LeanCompiler,
            )  # fmt: skip
            module = result.library._final_module
            result.library._link_into(module)
            doors.append(_door(entry, result.fndesc.llvm_func_name))
            if whole is None:
                whole = module
            else:
                whole.link_in(module.clone())
    return f"{whole}\n" + "\n".join(doors)


def _flags() -> Flags:
    flags: Any = Flags()
    flags.error_model = "numpy"
    flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
    made: Flags = flags
    return made


def _door(entry: Entry, inner: str) -> str:
    """An entry as C calls it: every argument a pointer; 0, or -1 where the code within has failed."""
    letters, counts = entry.unit.letters, iter(entry.counts)
    outside = ", ".join(f"ptr %a{i}" for i, letter in enumerate(letters) if letter == "p")
    inside = ", ".join(f"ptr %a{i}" for i in range(len(letters)))
    lines = [line for i, letter in enumerate(letters) if letter == "q" for line in _laid_out(f"%a{i}", next(counts))]
    return "\n".join([
        f"define i32 @{entry.symbol}({outside}) {{",
        *lines,
        "  %result = alloca ptr",
        "  %error = alloca ptr",
        f"  %status = call i32 @{inner}(ptr %result, ptr %error, {inside})",
        "  %good = icmp eq i32 %status, 0",
        "  %returned = select i1 %good, i32 0, i32 -1",
        "  ret i32 %returned",
        "}\n",
    ])  # fmt: skip


def _laid_out(name: str, values: tuple[int, ...]) -> list[str]:
    """Whole numbers on the stack."""
    lines = [f"  {name} = alloca [{len(values)} x i64]"]
    for i, value in enumerate(values):
        lines += [f"  {name}.{i} = getelementptr i64, ptr {name}, i64 {i}", f"  store i64 {value}, ptr {name}.{i}"]
    return lines


# -- machine code -------------------------------------------------------------------------------------------
def machine_code(
    raw: str, processor: Processor, symbols: Iterable[str], without: Iterable[str] = (), apart: Iterable[str] = ()
) -> bytes:
    """An object file: the entries `symbols` to be seen, all else internal. without: procedures that then do nothing.
    apart: those that are called where they are used once, too, so that their part of the stack is free afterwards.

    NoProcessorError where LLVM knows no such processor.
    """
    machine = target_machine(processor)
    module = llvm.parse_assembly(prepared(raw, processor, without, apart))
    module.triple, module.data_layout = processor.triple, str(machine.target_data)
    seen = set(symbols)
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration:
            value.linkage = "external" if value.name in seen else "internal"
    tuning = llvm.create_pipeline_tuning_options(speed_level=2)
    tuning.inlining_threshold = INLINING
    tuning.loop_vectorization = tuning.slp_vectorization = tuning.loop_unrolling = False
    passes = llvm.create_pass_builder(machine, tuning)
    whole = passes.getModulePassManager()
    whole.add_merge_functions_pass()  # units that read one law have its code once
    whole.run(module, passes)
    return bytes(machine.emit_object(module))


def kept_code(
    entries: Sequence[Entry], processor: Processor, symbols: tuple[str, ...], without: tuple[str, ...],
    apart: tuple[str, ...],
) -> bytes:  # fmt: skip
    """`machine_code` of `raw_code`, kept beside it: the second time it takes no time."""
    raw = raw_code(entries)
    key = repr((hashlib.sha256(raw.encode()).hexdigest(), tuple(processor), symbols, without, apart, INLINING))
    source = hashlib.sha256(inspect.getsource(sys.modules[__name__]).encode()).hexdigest()
    name = f"onboard-{hashlib.sha256(f'{key} {source} {VERSIONS}'.encode()).hexdigest()[:24]}.kernel"
    kept = STORE.load(name)
    if kept is None:
        with compiling(f"the navigator for {processor.triple}"):
            kept = machine_code(raw, processor, symbols, without, apart)
        STORE.save(name, kept)
    return kept


class Loaded:
    """Machine code in this process: an address for each entry. The processor must be this one."""

    def __init__(self, content: bytes, processor: Processor) -> None:
        empty = llvm.parse_assembly(f'target triple = "{processor.triple}"')
        # LLVM's own manager may lay code and constants further apart than a small code model reaches, and aborts
        self._engine = llvm.create_mcjit_compiler(empty, target_machine(processor), use_lmm=True)
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(content))
        self._engine.finalize_object()

    def function(self, symbol: str, pointers: int) -> Any:
        """The function that Python calls, on addresses."""
        kind = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_void_p] * pointers)
        return kind(self._engine.get_function_address(symbol))


def target_machine(processor: Processor) -> Any:
    """LLVM's description of a processor. NoProcessorError where it has none."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    try:
        found = llvm.Target.from_triple(processor.triple)
    except RuntimeError as error:
        raise NoProcessorError(str(error).strip().splitlines()[0]) from error
    return found.create_target_machine(
        cpu=processor.cpu, features=processor.features, opt=2, reloc=processor.relocation, codemodel="small"
    )


def prepared(raw: str, processor: Processor, without: Iterable[str], apart: Iterable[str]) -> str:
    """The text for a processor: roots as instructions, equations inlined where that is worth it, parts left out."""
    text = raw.replace("declare double @sqrt(double)", "declare double @llvm.sqrt.f64(double)")
    text = text.replace("@sqrt(", "@llvm.sqrt.f64(")
    text = re.sub(r"^(define [^\n]*?)(?: #\d+)? \{$", r"\1 #777 {", text, flags=re.M)
    text = re.sub(r"^  store ptr @\.const\.picklebuf\S*, ptr %\S+.*\n", "", text, flags=re.M)  # unread errors
    text += '\nattributes #777 = { nounwind "no-builtins" }\n'
    for name in without:
        text = _changed(text, name, "\\1 #777 {\n  ret i32 0\n}")
    for name in apart:
        text = _changed(text, name, "\\1 noinline #777 {\\2")
    return _without_wide_numbers(text) if processor.narrow else text


def _changed(text: str, name: str, into: str) -> str:
    """The text with all functions of this name, of whatever types, changed: their head is group 1, their body 2."""
    found = re.compile(rf"^(define [^\n]*@[^\n(]*\d{name}B[^\n]*) #777 \{{(\n.*?^\}})", re.M | re.S)
    changed, times = found.subn(into, text)
    if not times:
        raise ValueError(f"the code has no procedure {name}")
    return changed


FUNCTION = re.compile(r"^define [^\n]*?@(\"[^\"]*\"|[^\s(]+)\(.*?^\}\n", re.M | re.S)
CALL = re.compile(r"call [^\n]*?@(\"[^\"]*\"|[^\s(]+)\(")


def _without_wide_numbers(text: str) -> str:
    """Whole numbers of 32 bits in place of 64: counts and places, of which none is larger.

    Functions that look at the bits of a float keep them, and so do those that pass such bits to each other.
    """
    bodies = {found.group(1): found.group(0) for found in FUNCTION.finditer(text)}
    handing = {name for name, body in bodies.items() if "i64" in body[: body.index("\n")]}
    calls = {name: handing.intersection(CALL.findall(body)) for name, body in bodies.items()}
    wide = {name for name, body in bodies.items() if re.search(r"bitcast (double|i64)", body)}
    while more := {name for name in bodies if calls[name] & wide} | {called for name in wide for called in calls[name]}:
        if more <= wide:
            break
        wide |= more
    parts, at = [], 0
    for found in FUNCTION.finditer(text):
        parts.append(_narrowed(text[at : found.start()]))
        parts.append(found.group(0) if found.group(1) in wide else _narrowed(found.group(0)))
        at = found.end()
    return "".join([*parts, _narrowed(text[at:])])


def _narrowed(text: str) -> str:
    """Text with numbers of 32 bits; what widened to 64, or narrowed to 32, then does nothing."""
    text = re.sub(r"= (?:s|z)ext (?:nneg )?i32 (\S+) to i64", r"= add i32 \1, 0", text)
    text = re.sub(r"= trunc (?:nuw |nsw )*i64 (\S+) to i32", r"= add i32 \1, 0", text)
    return re.sub(r"\bi64\b", "i32", text)


if __name__ == "__main__":
    asked = [Entry(module, name, symbol, tuple(map(tuple, c))) for module, name, symbol, c in json.loads(sys.argv[1])]
    sys.stdout.buffer.write(zlib.compress(_make(asked).encode(), 6))
