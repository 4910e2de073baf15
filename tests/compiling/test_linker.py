"""Machine code placed into memory without LLVM: the same results as LLVM links, pages nobody may write, refusals."""

from __future__ import annotations

import ctypes
import re
import struct
import sysconfig
from pathlib import Path

import numpy as np
import pytest

from flownav.core.compile import kernel
from flownav.core.compiling import linker, loaded
from flownav.core.compiling.engine import file_name
from flownav.core.compiling.words import words_of

pytestmark = pytest.mark.skipif(sysconfig.get_platform() != "linux-x86_64", reason="elsewhere LLVM links")
TABLE = np.array([3.0, 1.0, 4.0, 1.0, 5.0])


@kernel
def looked_up(values, out):
    for i in range(len(values)):
        if values[i] < 0.0:
            raise ValueError("a value is negative")
        out[i] = np.sqrt(values[i]) + TABLE[i % 5]


@pytest.fixture(scope="module")
def code():
    out = np.zeros(7)
    looked_up(np.arange(7.0), out)
    found = loaded.kept(file_name(looked_up.py_func, {}, words_of((np.arange(7.0), out))))
    assert found is not None
    return found


def expected() -> np.ndarray:
    return np.sqrt(np.arange(7.0)) + TABLE[np.arange(7) % 5]


@pytest.mark.parametrize("way", ["linker", "llvm"])
def test_code_gives_the_same_either_way(code, way, monkeypatch):
    if way == "llvm":
        monkeypatch.setattr(linker, "X86_64", 183)  # as on a processor that it does not know
    function, out = loaded._function(code), np.zeros(7)
    function(np.arange(7.0), out)
    np.testing.assert_array_equal(out, expected())
    with pytest.raises(ValueError, match="a value is negative"):
        function(-np.arange(7.0), out)


def test_no_page_of_code_can_be_written(code):
    placed = linker.place(code.code, loaded.runtime().symbols)
    entry = placed.addresses[code.entry]
    for line in Path("/proc/self/maps").read_text().splitlines():
        first, last, rights = re.match(r"(\w+)-(\w+) (\S+)", line).groups()
        if int(first, 16) <= entry < int(last, 16):
            assert rights.startswith("r-x")
            break
    else:
        raise AssertionError("the entry is in no page")
    assert all(environment.symbol in placed.addresses for environment in code.environments)


def test_a_symbol_that_nobody_defines_is_named(code):
    names = {name: 1 for name in loaded.runtime().symbols}
    del names["NRT_adapt_ndarray_from_python"]
    with pytest.raises(KeyError, match="NRT_adapt_ndarray_from_python"):
        linker.place(code.code, names)


@pytest.mark.parametrize("spoil", ["no object", "machine", "kind", "empty"])
def test_what_is_no_object_file_of_this_processor_is_refused(code, spoil):
    image = bytearray(code.code)
    if spoil == "machine":
        struct.pack_into("<H", image, 18, 183)
    elif spoil == "kind":
        struct.pack_into("<H", image, 16, 3)
    wrong = {"no object": b"MZ" + bytes(image[2:]), "empty": b""}.get(spoil, bytes(image))
    with pytest.raises(ValueError, match="not an object file for x86-64"):
        linker.place(wrong, {})


def test_another_relocation_is_refused(code):
    image = bytearray(code.code)
    sections = linker._sections(code.code)
    section = next(each for each in sections if each.kind == linker.RELOCATIONS and sections[each.info].flags & 4)
    struct.pack_into("<I", image, section.at + 8, 2)  # R_X86_64_PC32
    with pytest.raises(ValueError, match="another code model"):
        linker.place(bytes(image), loaded.runtime().symbols)


def test_the_c_library_serves_what_the_runtime_does_not():
    process = ctypes.CDLL(None)
    address = ctypes.cast(process.memset, ctypes.c_void_p).value
    assert linker._in_process(process, "memset") == address
