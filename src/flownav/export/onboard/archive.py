"""A static library of one object file, as every linker reads it: the common archive format with a symbol table."""

import struct

from flownav.export.onboard.elf import read_object

MAGIC = b"!<arch>\n"


def archive(content: bytes, name: str) -> bytes:
    """The archive of an object file. It holds no time and no user, so that the same code gives the same bytes."""
    symbols = [symbol.name for symbol in read_object(content).exported]
    names = b"".join(symbol.encode() + b"\0" for symbol in symbols)
    table_bytes = 4 + 4 * len(symbols) + len(names)
    first = len(MAGIC) + 60 + table_bytes + table_bytes % 2
    table = struct.pack(f">{1 + len(symbols)}I", len(symbols), *[first] * len(symbols)) + names
    return MAGIC + _member("/", table) + _member(f"{name}/", content)


def _member(name: str, content: bytes) -> bytes:
    head = f"{name:<16}{0:<12}{0:<6}{0:<6}{'644':<8}{len(content):<10}`\n".encode()
    return head + content + b"\n" * (len(content) % 2)
