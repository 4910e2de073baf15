"""A build of the navigator run on an emulated processor (unicorn): results, instructions, stack."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import unicorn
from unicorn import arm64_const, arm_const, x86_const

from flownav.core.measurement import Array
from flownav.export.onboard.board import UNTOUCHED
from flownav.export.onboard.elf import AARCH64, ARM, X86_64, Object, image_of

CODE, RAM, RAM_BYTES, STACK_BYTES, STOP = 0x0800_0000, 0x2000_0000, 1 << 20, 1 << 16, 0x0900_0000
PAGE = 0x1000


class Convention(NamedTuple):
    """How a processor calls: its registers for pointers, for the stack and for what is returned; bytes of a pointer."""

    arguments: tuple[int, ...]
    stack: int
    result: int
    link: int | None
    pointer: int


_UNICORN: Any = unicorn  # it names what it exports by a star
_ARM = arm_const
_A64 = arm64_const
_X86 = x86_const
CONVENTIONS = {
    ARM: Convention(
        (_ARM.UC_ARM_REG_R0, _ARM.UC_ARM_REG_R1, _ARM.UC_ARM_REG_R2, _ARM.UC_ARM_REG_R3),
        _ARM.UC_ARM_REG_SP, _ARM.UC_ARM_REG_R0, _ARM.UC_ARM_REG_LR, 4,
    ),
    AARCH64: Convention(
        tuple(_A64.UC_ARM64_REG_X0 + i for i in range(8)),
        _A64.UC_ARM64_REG_SP, _A64.UC_ARM64_REG_X0, _A64.UC_ARM64_REG_X30, 8,
    ),
    X86_64: Convention(
        (_X86.UC_X86_REG_RDI, _X86.UC_X86_REG_RSI, _X86.UC_X86_REG_RDX, _X86.UC_X86_REG_RCX, _X86.UC_X86_REG_R8,
         _X86.UC_X86_REG_R9),
        _X86.UC_X86_REG_RSP, _X86.UC_X86_REG_RAX, None, 8,
    ),
}  # fmt: skip


class Processor:
    """One processor with an image of the library; `call` runs a function on pointers into its memory."""

    def __init__(self, found: Object) -> None:
        self.machine, self.by = found.machine, CONVENTIONS[found.machine]
        self.image = image_of(found, CODE)
        self.engine = _engine(self.machine)
        size = (len(self.image.content) + PAGE - 1) // PAGE * PAGE
        self.engine.mem_map(CODE, size, unicorn.UC_PROT_READ | unicorn.UC_PROT_EXEC)
        self.engine.mem_write(CODE, self.image.content)
        self.engine.mem_map(RAM, RAM_BYTES, unicorn.UC_PROT_READ | unicorn.UC_PROT_WRITE)
        self.engine.mem_map(STOP, PAGE)
        self._free = RAM
        self.instructions = 0
        self._lengths: dict[tuple[int, int], int] = {}

    def count(self) -> None:
        """Count instructions from now on."""
        self.engine.hook_add(unicorn.UC_HOOK_BLOCK, self._block)

    def _block(self, engine: Any, address: int, size: int, user: Any) -> None:
        key = address, size
        found = self._lengths.get(key)
        if found is None:
            found = self._lengths[key] = self._instructions_in(address, size)
        self.instructions += found

    def _instructions_in(self, address: int, size: int) -> int:
        if self.machine == AARCH64:
            return size // 4
        code, at, count = self.image.content[address - CODE : address - CODE + size], 0, 0
        if self.machine == X86_64:
            import capstone

            disassembler = capstone.Cs(capstone.CS_ARCH_X86, capstone.CS_MODE_64)
            return sum(1 for _ in disassembler.disasm_lite(code, address))
        while at < len(code):
            at += 4 if code[at + 1] >> 3 in (0b11101, 0b11110, 0b11111) else 2
            count += 1
        return count

    def room(self, numbers: int) -> int:
        """The address of memory for this number of float64s."""
        at = self._free
        self._free += (8 * numbers + 15) // 16 * 16
        assert self._free < RAM + RAM_BYTES - STACK_BYTES
        return at

    def put(self, at: int, values: Sequence[float] | Array) -> None:
        """Write float64s."""
        self.engine.mem_write(at, np.ascontiguousarray(values, np.float64).tobytes())

    def get(self, at: int, numbers: int) -> Array:
        """Read float64s."""
        return np.frombuffer(bytes(self.engine.mem_read(at, 8 * numbers)), np.float64) if numbers else np.zeros(0)

    def paint_stack(self) -> None:
        """So that it shows how much of it is used."""
        self.engine.mem_write(RAM + RAM_BYTES - STACK_BYTES, bytes([UNTOUCHED]) * STACK_BYTES)

    def stack_used(self) -> int:
        """Bytes of the stack that were written since it was painted."""
        stack = bytes(self.engine.mem_read(RAM + RAM_BYTES - STACK_BYTES, STACK_BYTES))
        return STACK_BYTES - next((i for i, byte in enumerate(stack) if byte != UNTOUCHED), STACK_BYTES)

    def call(self, symbol: str, *pointers: int) -> int:
        """Run a function; what it returns."""
        engine, by = self.engine, self.by
        spare = pointers[len(by.arguments) :]
        top = RAM + RAM_BYTES - by.pointer * (len(spare) + len(spare) % 2)
        engine.mem_write(top, b"".join(value.to_bytes(by.pointer, "little") for value in spare))
        for register, value in zip(by.arguments, pointers, strict=False):
            engine.reg_write(register, value)
        address = self.image.addresses[symbol]
        if by.link is None:
            top -= by.pointer
            engine.mem_write(top, STOP.to_bytes(by.pointer, "little"))
        else:
            engine.reg_write(by.link, STOP | (address & 1))
        engine.reg_write(by.stack, top)
        engine.emu_start(address, STOP)
        return int(np.uint32(engine.reg_read(by.result) & 0xFFFFFFFF).astype(np.int32))


def _engine(machine: int) -> Any:
    """An emulator with its floating-point unit switched on."""
    if machine == ARM:
        engine = _UNICORN.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB)
        engine.ctl_set_cpu_model(_ARM.UC_CPU_ARM_MAX)  # with the model of an M7 its FPU stays off
        engine.reg_write(_ARM.UC_ARM_REG_C1_C0_2, 0xF << 20)
        engine.reg_write(_ARM.UC_ARM_REG_FPEXC, 0x4000_0000)
    elif machine == AARCH64:
        engine = _UNICORN.Uc(unicorn.UC_ARCH_ARM64, unicorn.UC_MODE_ARM)
        engine.reg_write(_A64.UC_ARM64_REG_CPACR_EL1, 3 << 20)
    else:
        engine = _UNICORN.Uc(unicorn.UC_ARCH_X86, unicorn.UC_MODE_64)
    return engine
