"""A WebAssembly object file made a module that runs by itself: with memory of its own, and its functions exported.

LLVM's object of code that names nothing outside itself imports a memory, a stack pointer and an empty table, and its
relocations are against places that the file itself lays out. So nothing need be linked: the imports become definitions,
the functions are exported by name, data moves behind the stack. Core specification 2.0, chapter 5; tool conventions,
Linking.md.
"""

from collections.abc import Iterator
from typing import NamedTuple

MAGIC = b"\0asm\1\0\0\0"
CUSTOM, TYPES, IMPORTS, FUNCTIONS, MEMORY, GLOBALS, EXPORTS, CODE, DATA = 0, 1, 2, 3, 5, 6, 7, 10, 11
PAGE = 65536
I32, MUTABLE, I32_CONST, END = 0x7F, 1, 0x41, 0x0B
STACK_BYTES = PAGE  # below it lie constants, above it the caller's memory


class Section(NamedTuple):
    """A section of a module."""

    kind: int
    content: bytes


def module(content: bytes, exported: tuple[str, ...]) -> bytes:
    """A module of an object file, which exports these functions, `memory` and `heap`, where the caller's memory begins.

    ValueError where the object names something outside itself.
    """
    sections = list(_sections(content))
    by_kind = {section.kind: section.content for section in sections if section.kind != CUSTOM}
    _check_imports(by_kind.get(IMPORTS, b"\0"))
    places = _function_symbols(next(s.content for s in sections if s.kind == CUSTOM and _name(s.content) == "linking"))
    if missing := set(exported) - set(places):
        raise ValueError(f"the object has no {', '.join(sorted(missing))}")
    data_end = _data_end(by_kind.get(DATA, b"\0"))
    top = (data_end + 15) // 16 * 16 + STACK_BYTES
    stack = bytes([I32, MUTABLE, I32_CONST]) + signed(top) + bytes([END])
    heap = bytes([I32, 0, I32_CONST]) + signed(top) + bytes([END])
    listed = [(name, 0, places[name]) for name in exported] + [("memory", 2, 0), ("heap", 3, 1)]
    exports = unsigned(len(listed)) + b"".join(
        unsigned(len(name)) + name.encode() + bytes([kind]) + unsigned(at) for name, kind, at in listed
    )
    parts = [
        (TYPES, by_kind[TYPES]), (FUNCTIONS, by_kind[FUNCTIONS]),
        (MEMORY, b"\1\0" + unsigned((top + PAGE - 1) // PAGE + 2)), (GLOBALS, b"\2" + stack + heap),
        (EXPORTS, exports), (CODE, by_kind[CODE]), (DATA, by_kind.get(DATA, b"\0")),
    ]  # fmt: skip
    return MAGIC + b"".join(bytes([kind]) + unsigned(len(part)) + part for kind, part in parts)


# -- reading ------------------------------------------------------------------------------------------------
def _number(content: bytes, at: int) -> tuple[int, int]:
    """An unsigned LEB128 and where it ends."""
    value = shift = 0
    while True:
        byte = content[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at


def _text(content: bytes, at: int) -> tuple[str, int]:
    size, at = _number(content, at)
    return content[at : at + size].decode(), at + size


def _name(content: bytes) -> str:
    return _text(content, 0)[0]


def _sections(content: bytes) -> Iterator[Section]:
    if not content.startswith(MAGIC):
        raise ValueError("not a WebAssembly file")
    at = len(MAGIC)
    while at < len(content):
        kind = content[at]
        size, at = _number(content, at + 1)
        yield Section(kind, content[at : at + size])
        at += size


def _check_imports(content: bytes) -> None:
    """A memory and a stack pointer may be imported, and a table that nothing is in."""
    count, at = _number(content, 0)
    for _ in range(count):
        _, at = _text(content, at)
        name, at = _text(content, at)
        kind, at = content[at], at + 1
        if kind == 0:
            raise ValueError(f"the code names {name}, which it does not hold")
        if kind == 3:
            if name != "__stack_pointer":
                raise ValueError(f"the code names {name}, which it does not hold")
            at += 2
            continue
        at += kind == 1  # a table says of what
        flags, at = _number(content, at)
        _, at = _number(content, at)
        if flags & 1:
            _, at = _number(content, at)


def _function_symbols(content: bytes) -> dict[str, int]:
    """Functions that are seen from outside: their places by name."""
    _, at = _text(content, 0)
    _, at = _number(content, at)
    found: dict[str, int] = {}
    while at < len(content):
        kind = content[at]
        size, at = _number(content, at + 1)
        end = at + size
        if kind == 8:
            count, at = _number(content, at)
            for _ in range(count):
                what, at = content[at], at + 1
                flags, at = _number(content, at)
                if what == 0:
                    place, at = _number(content, at)
                    name, at = _text(content, at)
                    found[name] = place
                elif what == 1:
                    name, at = _text(content, at)
                    if not flags & 0x10:
                        for _ in range(3):
                            _, at = _number(content, at)
                elif what == 3:
                    _, at = _number(content, at)
                else:
                    _, at = _number(content, at)
                    if not flags & 0x10 or flags & 0x40:
                        _, at = _text(content, at)
        at = end
    return found


def _data_end(content: bytes) -> int:
    """Where the last constant ends."""
    count, at = _number(content, 0)
    end = 0
    for _ in range(count):
        flags, at = _number(content, at)
        if flags or content[at] != I32_CONST:
            raise ValueError("constants must lie at addresses that are known")
        begin, at = _number(content, at + 1)
        size, at = _number(content, at + 1)  # after END
        at, end = at + size, max(end, begin + size)
    return end


# -- writing ------------------------------------------------------------------------------------------------
def unsigned(value: int) -> bytes:
    """LEB128."""
    out = bytearray()
    while True:
        byte, value = value & 0x7F, value >> 7
        out.append(byte | (0x80 if value else 0))
        if not value:
            return bytes(out)


def signed(value: int) -> bytes:
    """Signed LEB128 of a number of 0 or more."""
    out = bytearray()
    while True:
        byte, value = value & 0x7F, value >> 7
        last = value == 0 and not byte & 0x40
        out.append(byte | (0 if last else 0x80))
        if last:
            return bytes(out)
