"""Processors that the library is built for: four by name, which tests run, and any that LLVM knows by its triple."""

from typing import NamedTuple

from flownav.core.compiling.portable import Processor, process_triple


class Target(NamedTuple):
    """A processor, what is written for it, and what it was tested on. files: how the code is packed."""

    processor: Processor
    files: tuple[str, ...]
    tested: str


LIBRARY, SHARED, MODULE = "libflownav.a", "libflownav.so", "flownav.wasm"
WASM_FEATURES = "+bulk-memory,+mutable-globals,+sign-ext,+nontrapping-fptoint"
TARGETS = {
    "linux-x86_64": Target(
        Processor("x86_64-unknown-linux-gnu", "x86-64-v2"), (LIBRARY, SHARED), "run on x86-64 in the tests"
    ),
    "linux-aarch64": Target(
        Processor("aarch64-unknown-linux-gnu", "generic"), (LIBRARY, SHARED), "run in the tests on an emulated Cortex-A"
    ),
    "cortex-m7": Target(
        Processor("thumbv7em-none-unknown-eabihf", "cortex-m7", "", "static", True), (LIBRARY,),
        "run in the tests on an emulated core, hard and soft float callers alike; never on a board",
    ),
    "wasm32": Target(
        Processor("wasm32-unknown-unknown", "generic", WASM_FEATURES, "static"), (MODULE,),
        "run in the tests in wasmtime and headless Chromium",
    ),
}  # fmt: skip
PROCESSES = {"x86_64": "linux-x86_64", "aarch64": "linux-aarch64"}  # whose code runs in a process, on any system of ELF
HEADER = "c-header"
NAMES = (*TARGETS, HEADER)


def target_of(name: str, cpu: str, features: str) -> Target:
    """A target by name, or the processor of a triple; its numbers are counted in 32 bits where LLVM's pointers are."""
    if name in TARGETS:
        return TARGETS[name]
    narrow = name.split("-")[0].startswith(("thumb", "arm", "riscv32", "xtensa", "mips"))
    static = "none" in name.split("-")
    processor = Processor(name, cpu, features, "static" if static else "pic", narrow)
    return Target(processor, (MODULE,) if name.startswith("wasm32") else (LIBRARY,), "not run by anybody")


def own_processor() -> Processor:
    """This process's: as a target has it where one is for it, so that it is the same code."""
    triple = process_triple()
    target = PROCESSES.get(triple.split("-")[0])
    return TARGETS[target].processor if target is not None and "linux" in triple else Processor(triple)
