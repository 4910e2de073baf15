"""Machine code placed into this process without LLVM: the sections of an object file, its symbols, its relocations.

LLVM makes code for a process in its *large* model, in which every address is written out whole, so that two kinds of
relocation are all there is (System V ABI for AMD64, 1.0, table 4.10: R_X86_64_64 and, in what only unwinds exceptions,
which compiled kernels do not throw, R_X86_64_PC64). Code lies in pages that are never writable and executable at once.
Other processors' object files, and any that holds something else, are refused: `loaded` leaves them to LLVM.
"""

import ctypes
import mmap
import struct
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

HEADER = b"\x7fELF\x02\x01"  # 64 bits, little-endian
RELOCATABLE, X86_64 = 1, 62
NO_DATA, RELOCATIONS, SYMBOLS = 8, 4, 2  # types of sections
IN_MEMORY, EXECUTABLE = 2, 4  # their flags
OF_UNWINDING = b".eh_frame"
ABSOLUTE = 1  # R_X86_64_64
UNDEFINED = 0  # index of a section
SECTION, SYMBOL = struct.Struct("<IIQQQQIIQQ"), struct.Struct("<IBBHQQ")
RELOCATION = np.dtype([("at", "<u8"), ("kind", "<u4"), ("symbol", "<u4"), ("plus", "<i8")])


class Section(NamedTuple):
    """A part of an object file, as its table of sections has it."""

    name: int
    kind: int
    flags: int
    address: int
    at: int
    size: int
    link: int
    info: int
    align: int
    each: int

    def of(self, image: bytes) -> bytes:
        """Its bytes."""
        return image[self.at : self.at + self.size]


class Placed(NamedTuple):
    """An object file in memory: the address of every symbol that it defines, and the pages, to be kept."""

    addresses: dict[str, int]
    pages: mmap.mmap


def place(image: bytes, known: Mapping[str, int]) -> Placed:
    """Place an object file for this processor. known: the addresses of symbols that others define.

    Those in neither are looked for in the process, as C does. ValueError where it is not of the kind that this module
    knows, KeyError where nobody defines a symbol.
    """
    sections = _sections(image)
    places, code_bytes, total = _places(sections, _unwinding(sections, image))
    pages = mmap.mmap(-1, total, prot=mmap.PROT_READ | mmap.PROT_WRITE)
    memory = np.frombuffer(pages, np.uint8)
    start = memory.ctypes.data
    for i, at in places.items():
        if sections[i].kind != NO_DATA:
            pages[at : at + sections[i].size] = sections[i].of(image)
    addresses, named = _addresses(image, sections, {i: start + at for i, at in places.items()}, known)
    for section in sections:
        if section.kind == RELOCATIONS and section.info in places:
            _relocate(memory[places[section.info] :], np.frombuffer(section.of(image), RELOCATION), addresses)
    _make_executable(start, code_bytes)
    return Placed(named, pages)


def _sections(image: bytes) -> list[Section]:
    if not image.startswith(HEADER) or struct.unpack_from("<HH", image, 16) != (RELOCATABLE, X86_64):
        raise ValueError("not an object file for x86-64")
    first, count = *struct.unpack_from("<Q", image, 40), *struct.unpack_from("<H", image, 60)
    return [Section(*SECTION.unpack_from(image, first + SECTION.size * i)) for i in range(count)]


def _unwinding(sections: list[Section], image: bytes) -> int:
    """Index of the section that only unwinds exceptions, -1 where there is none."""
    words = sections[struct.unpack_from("<H", image, 62)[0]].of(image)
    names = (words[each.name : words.index(b"\0", each.name)] for each in sections)
    return next((i for i, name in enumerate(names) if name == OF_UNWINDING), -1)


def _places(sections: list[Section], left_out: int) -> tuple[dict[int, int], int, int]:
    """Where each section that is needed lies from the start, by its index; the bytes of the whole pages of code, which
    comes first; the bytes of all.
    """
    places: dict[int, int] = {}
    end = code_bytes = 0
    for executable in (EXECUTABLE, 0):
        for i, section in enumerate(sections):
            if section.flags & IN_MEMORY and section.flags & EXECUTABLE == executable and i != left_out:
                places[i] = -(-end // max(section.align, 1)) * max(section.align, 1)
                end = places[i] + section.size
        end = -(-max(end, 1) // mmap.PAGESIZE) * mmap.PAGESIZE
        code_bytes = code_bytes or end
    return places, code_bytes, end


def _addresses(
    image: bytes, sections: list[Section], starts: dict[int, int], known: Mapping[str, int]
) -> tuple[NDArray[np.uint64], dict[str, int]]:
    """The address of each symbol by its number, and of those that are defined here by their names."""
    (table,) = (section for section in sections if section.kind == SYMBOLS)
    words = sections[table.link].of(image)
    process = ctypes.CDLL(None)
    addresses, named = [], {}
    for at, _, _, section, value, _ in SYMBOL.iter_unpack(table.of(image)):
        name = words[at : words.index(b"\0", at)].decode()
        if section in starts:
            named[name] = starts[section] + value
            addresses.append(named[name])
        elif section == UNDEFINED and name:
            addresses.append(known.get(name) or _in_process(process, name))
        else:
            addresses.append(0)  # the file's own name, or a section that is not needed
    return np.array(addresses, np.uint64), named


def _in_process(process: ctypes.CDLL, name: str) -> int:
    try:
        return ctypes.cast(getattr(process, name), ctypes.c_void_p).value or 0
    except AttributeError:
        raise KeyError(name) from None


def _relocate(memory: NDArray[np.uint8], relocations: Any, addresses: NDArray[np.uint64]) -> None:
    """Write the addresses of a section's symbols into it."""
    if (relocations["kind"] != ABSOLUTE).any():
        raise ValueError("a relocation of another code model")
    values = addresses[relocations["symbol"]] + relocations["plus"].astype(np.uint64)
    memory[relocations["at"][:, None] + np.arange(8, dtype=np.uint64)] = values[:, None].view(np.uint8)


def _make_executable(start: int, size: int) -> None:
    change = ctypes.CDLL(None, use_errno=True).mprotect
    change.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
    if change(start, size, mmap.PROT_READ | mmap.PROT_EXEC):
        raise OSError(ctypes.get_errno(), "memory of compiled code cannot be made executable")
