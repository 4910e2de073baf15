"""Object files of ELF: their sections in one piece of memory with all addresses filled in, and a shared object of that.

The objects that are read here are our own (`core.compiling.portable`): one file that names nothing outside itself, for
x86-64, AArch64 or 32-bit ARM. ELF: System V Application Binary Interface, edition 4.1, chapters 4 and 5, and the
processors' supplements.
"""

import struct
from collections.abc import Sequence
from typing import NamedTuple

PAGE = 0x10000  # the largest that kernels of AArch64 have
ALLOCATED, EXECUTED = 0x2, 0x4  # section flags
PROGBITS, SYMBOLS, RELA, NOBITS, REL = 1, 2, 4, 8, 9
ARM, X86_64, AARCH64 = 40, 62, 183
UNWINDING = ".ARM.exidx"  # for exceptions of C++, of which there are none


class Section(NamedTuple):
    """A section: its name, type, flags, bytes, alignment, and which sections it is about."""

    name: str
    kind: int
    flags: int
    content: bytes
    align: int
    link: int
    info: int


class Symbol(NamedTuple):
    """A symbol: its name, binding (1: seen from outside), type (2: a function), section, value and size."""

    name: str
    binding: int
    kind: int
    section: int
    value: int
    size: int


class Relocation(NamedTuple):
    """A place in a section that needs an address: by which rule, of which symbol, plus what."""

    section: int
    offset: int
    rule: int
    symbol: int
    addend: int | None


class Object(NamedTuple):
    """An object file."""

    machine: int
    wide: bool
    sections: list[Section]
    symbols: list[Symbol]
    relocations: list[Relocation]

    @property
    def exported(self) -> list[Symbol]:
        """Symbols that callers see."""
        return [symbol for symbol in self.symbols if symbol.binding == 1 and symbol.section]

    @property
    def missing(self) -> list[str]:
        """Names of symbols that it uses and does not contain."""
        return [symbol.name for symbol in self.symbols if symbol.name and not symbol.section]

    @property
    def loaded(self) -> list[int]:
        """The sections that belong into memory, code first."""
        every = [i for i, s in enumerate(self.sections) if s.flags & ALLOCATED and not s.name.startswith(UNWINDING)]
        return sorted(every, key=lambda i: not self.sections[i].flags & EXECUTED)


class Image(NamedTuple):
    """Code and constants as they lie in memory from `base` on: how much of it is code, and addresses by symbol."""

    base: int
    content: bytes
    code_bytes: int
    addresses: dict[str, int]


def read_object(content: bytes) -> Object:
    """An object file's parts. ValueError where it is none."""
    if content[:4] != b"\x7fELF" or content[5] != 1:
        raise ValueError("not a little-endian ELF file")
    wide = content[4] == 2
    machine = struct.unpack_from("<H", content, 18)[0]
    begin = struct.unpack_from("<Q" if wide else "<I", content, 40 if wide else 32)[0]
    size, count, names_at = struct.unpack_from("<3H", content, 58 if wide else 46)
    heads = [
        struct.unpack_from("<2I4Q2I2Q" if wide else "<10I", content, begin + size * i) for i in range(count)
    ]  # name, type, flags, address, offset, size, link, info, align, entry
    names = content[heads[names_at][4] :][: heads[names_at][5]]
    sections = [
        Section(
            _text(names, h[0]), h[1], h[2], b"" if h[1] == NOBITS else content[h[4] : h[4] + h[5]], h[8], h[6], h[7]
        )
        for h in heads
    ]
    table = next(i for i, section in enumerate(sections) if section.kind == SYMBOLS)
    symbols = _symbols(sections[table].content, sections[sections[table].link].content, wide)
    relocations = [r for section in sections for r in _relocations(section, wide)]
    return Object(machine, wide, sections, symbols, relocations)


def _text(names: bytes, at: int) -> str:
    return names[at : names.index(b"\0", at)].decode()


def _symbols(content: bytes, names: bytes, wide: bool) -> list[Symbol]:
    found = []
    for at in range(0, len(content), 24 if wide else 16):
        if wide:
            name, info, _, section, value, size = struct.unpack_from("<I2BH2Q", content, at)
        else:
            name, value, size, info, _, section = struct.unpack_from("<3I2BH", content, at)
        found.append(Symbol(_text(names, name), info >> 4, info & 15, section, value, size))
    return found


def _relocations(section: Section, wide: bool) -> list[Relocation]:
    if section.kind not in (REL, RELA):
        return []
    found = []
    size = {(RELA, True): 24, (REL, True): 16, (RELA, False): 12, (REL, False): 8}[section.kind, wide]
    for at in range(0, len(section.content), size):
        offset, info = struct.unpack_from("<2Q" if wide else "<2I", section.content, at)
        addend = None
        if section.kind == RELA:
            addend = struct.unpack_from("<q" if wide else "<i", section.content, at + (16 if wide else 8))[0]
        rule, symbol = (info & 0xFFFFFFFF, info >> 32) if wide else (info & 0xFF, info >> 8)
        found.append(Relocation(section.info, offset, rule, symbol, addend))
    return found


# -- in memory ----------------------------------------------------------------------------------------------
def image_of(found: Object, base: int = 0) -> Image:
    """The sections of an object in memory. ValueError where it names something outside, or by a rule not known here."""
    if found.missing:
        raise ValueError(f"the code names {', '.join(found.missing)}, which it does not hold")
    places: dict[int, int] = {}
    content = bytearray()
    code_bytes = 0
    for i in found.loaded:
        section = found.sections[i]
        content += bytes(-len(content) % max(section.align, 1))
        places[i] = base + len(content)
        content += section.content
        if section.flags & EXECUTED:
            code_bytes = len(content)
    for relocation in found.relocations:
        if relocation.section in places:
            symbol = found.symbols[relocation.symbol]
            target = places[symbol.section] + symbol.value
            _fill_in(
                content, places[relocation.section] + relocation.offset - base, base, found.machine, relocation, target
            )
    addresses = {symbol.name: places[symbol.section] + symbol.value for symbol in found.exported}
    return Image(base, bytes(content), code_bytes, addresses)


def _fill_in(content: bytearray, at: int, base: int, machine: int, relocation: Relocation, target: int) -> None:
    """One address. at: where, from the image's begin on."""
    place, rule, addend = base + at, (machine, relocation.rule), relocation.addend
    word = struct.unpack_from("<I", content, at)[0]
    if rule in ((X86_64, 2), (X86_64, 4)):  # PC32, PLT32
        assert addend is not None
        struct.pack_into("<i", content, at, target + addend - place)
    elif rule == (AARCH64, 275):  # ADR_PREL_PG_HI21
        assert addend is not None
        pages = ((target + addend & ~0xFFF) - (place & ~0xFFF)) >> 12
        word = word & 0x9F00001F | (pages & 3) << 29 | (pages >> 2 & 0x7FFFF) << 5
        struct.pack_into("<I", content, at, word)
    elif rule in LOW_12:
        assert addend is not None
        low = (target + addend & 0xFFF) >> LOW_12[rule]
        struct.pack_into("<I", content, at, word & ~(0xFFF << 10) | low << 10)
    elif rule in ((ARM, 47), (ARM, 48)):  # THM_MOVW_ABS_NC, THM_MOVT_ABS
        _fill_in_thumb_move(content, at, target, high=rule == (ARM, 48))
    elif rule == (ARM, 2):  # ABS32
        struct.pack_into("<I", content, at, word + target & 0xFFFFFFFF)
    else:
        raise ValueError(f"relocation {relocation.rule} of machine {machine} is not known here")


LOW_12 = {
    (AARCH64, 277): 0,
    (AARCH64, 278): 0,
    (AARCH64, 284): 1,
    (AARCH64, 285): 2,
    (AARCH64, 286): 3,
    (AARCH64, 299): 4,
}


def _fill_in_thumb_move(content: bytearray, at: int, target: int, *, high: bool) -> None:
    """The 16 bits of MOVW or MOVT in their four pieces (ARMv7-M Architecture Reference Manual, A7.7.76), their addend
    in place."""
    first, second = struct.unpack_from("<2H", content, at)
    addend = (first & 15) << 12 | (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 255
    addend -= (addend & 0x8000) << 1
    value = target + addend
    value = value >> 16 & 0xFFFF if high else value & 0xFFFF
    first = first & 0xFBF0 | value >> 12 | (value >> 11 & 1) << 10
    second = second & 0x8F00 | (value >> 8 & 7) << 12 | value & 255
    struct.pack_into("<2H", content, at, first, second)


# -- a shared object ------------------------------------------------------------------------------------------
class _Part(NamedTuple):
    """A section of a shared object: name, type, flags, bytes, alignment, the section it is about, its info field (how
    many symbols are local), size of an entry.
    """

    name: str
    kind: int
    flags: int
    content: bytes
    align: int
    link: int = 0
    info: int = 0
    entry: int = 0


def shared_object(found: Object, name: str) -> bytes:
    """A shared library with the exported functions of a 64-bit object, whose code names addresses by their distance.

    Two segments: symbols, code and constants, which are read and run; and the list for the dynamic linker.
    """
    exported = found.exported
    strings = b"\0" + b"".join(symbol.name.encode() + b"\0" for symbol in exported) + name.encode() + b"\0"
    count = len(exported) + 1
    hashes = struct.pack(f"<{3 + count}I", 1, count, min(len(exported), 1), *_chain(count))
    first = 64 + 56 * SEGMENTS
    sizes = [len(hashes), 24 * count, len(strings)]
    places = _placed(first, sizes, (8, 8, 1))
    code_at = _rounded(places[-1] + sizes[-1], 64)
    image = image_of(found, code_at)
    table = bytes(24) + b"".join(
        struct.pack("<I2BH2Q", _place_in(strings, s.name), 0x12, 0, 4, image.addresses[s.name], s.size)
        for s in exported
    )
    dynamic_at = _rounded(code_at + len(image.content), PAGE)
    tags = [(14, _place_in(strings, name)), *zip((4, 6, 5), places, strict=True), (10, len(strings)), (11, 24), (0, 0)]
    parts = [
        _Part(".hash", 5, 2, hashes, 8, 2, 0, 4),
        _Part(".dynsym", 11, 2, table, 8, 3, 1, 24),
        _Part(".dynstr", 3, 2, strings, 1),
        _Part(".text", 1, 6, image.content, 64),
        _Part(".dynamic", 6, 3, b"".join(struct.pack("<qQ", *tag) for tag in tags), 8, 3, 0, 16),
    ]
    segments = [
        (1, 5, 0, code_at + len(image.content), PAGE),
        (1, 6, dynamic_at, len(parts[-1].content), PAGE),
        (2, 6, dynamic_at, len(parts[-1].content), 8),
        (0x6474E551, 6, 0, 0, 16),  # GNU_STACK: the stack is not run
    ]
    return _file(found.machine, segments, parts, [*places, code_at, dynamic_at])


SEGMENTS = 4


def _file(machine: int, segments: Sequence[tuple[int, ...]], parts: list[_Part], places: list[int]) -> bytes:
    """The file: header, segments, parts at their places, and the table of the parts."""
    names = _Part(".shstrtab", 3, 0, b"\0" + b"".join(p.name.encode() + b"\0" for p in parts) + b".shstrtab\0", 1)
    every, names_at = [*parts, names], places[-1] + len(parts[-1].content)
    table_at = _rounded(names_at + len(names.content), 8)
    out = bytearray(b"\x7fELF\x02\x01\x01" + bytes(9))
    heads = 64, 56, len(segments), 64, len(every) + 1, len(every)
    out += struct.pack("<2HI3QI6H", 3, machine, 1, 0, 64, table_at, 0, *heads)
    for kind, flags, at, size, align in segments:
        out += struct.pack("<2I6Q", kind, flags, at, at, at, size, size, align)
    for part, at in zip(every, [*places, names_at], strict=True):
        out += bytes(at - len(out)) + part.content
    out += bytes(table_at - len(out)) + bytes(64)
    for part, at in zip(every, [*places, names_at], strict=True):
        out += struct.pack(
            "<2I4Q2I2Q", _place_in(names.content, part.name), part.kind, part.flags, at if part.flags else 0, at,
            len(part.content), part.link, part.info, part.align, part.entry,
        )  # fmt: skip
    return bytes(out)


def _rounded(size: int, align: int) -> int:
    return (size + align - 1) // align * align


def _placed(first: int, sizes: list[int], aligns: tuple[int, ...]) -> list[int]:
    """Where pieces of these sizes lie one after the other."""
    places = []
    for size, align in zip(sizes, aligns, strict=True):
        places.append(_rounded(first, align))
        first = places[-1] + size
    return places


def _place_in(strings: bytes, name: str) -> int:
    return strings.index(b"\0" + name.encode() + b"\0") + 1


def _chain(count: int) -> list[int]:
    """One bucket: every symbol leads to the next."""
    return [i + 1 if 0 < i < count - 1 else 0 for i in range(count)]
