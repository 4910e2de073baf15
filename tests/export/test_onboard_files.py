"""Files written for other tools: objects, archives, shared objects, modules, the header and constants of C."""

from __future__ import annotations

import ctypes
import io
import re
import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
from elftools.elf.elffile import ELFFile

from flownav.core.compiling.portable import NoProcessorError, Processor, target_machine
from flownav.core.errors import InputError
from flownav.export.onboard import elf, wasm
from flownav.export.onboard.archive import archive
from flownav.export.onboard.constants import number, settings_file
from flownav.export.onboard.interface import SYMBOLS, Rates, header
from flownav.export.onboard.package import Asked, code_of
from flownav.navigation import progress, waiting
from flownav.navigation.packed import PARTS, START_SIGMA
from navigation_streams import circle, fly
from onboard_readings import RATES, flight_of, settings_of

OBJECTS = ("linux-x86_64", "linux-aarch64", "cortex-m7")
NAMES = set(SYMBOLS.values())
SETTINGS, _ = settings_of(flight_of(fly(circle, 3.0)))
needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler `cc` here: Debian's gcc")


# -- object files ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("target", OBJECTS)
def test_objects_are_read_as_pyelftools_reads_them(target):
    content = code_of(Asked(target), False).content
    found, expected = elf.read_object(content), ELFFile(io.BytesIO(content))
    sections = list(expected.iter_sections())
    assert [s.name for s in found.sections] == [s.name for s in sections]
    assert [s.content for s in found.sections if s.kind != elf.NOBITS] == [
        s.data() for s in sections if s["sh_type"] != "SHT_NOBITS"
    ]
    table = expected.get_section_by_name(".symtab")
    assert [(s.name, s.value, s.size) for s in found.symbols] == [
        (s.name, s["st_value"], s["st_size"]) for s in table.iter_symbols()
    ]
    relocations = [r for s in sections if s["sh_type"] in ("SHT_REL", "SHT_RELA") for r in s.iter_relocations()]
    assert [(r.offset, r.rule, r.symbol) for r in found.relocations] == [
        (r["r_offset"], r["r_info_type"], r["r_info_sym"]) for r in relocations
    ]
    assert {symbol.name for symbol in found.exported} == NAMES
    assert found.missing == []


def test_code_that_names_something_outside_is_not_laid_out():
    found = elf.read_object(code_of(Asked("linux-x86_64"), False).content)
    asks = found._replace(symbols=[*found.symbols, elf.Symbol("sin", 1, 0, 0, 0, 0)])
    with pytest.raises(ValueError, match="the code names sin, which it does not hold"):
        elf.image_of(asks)


def test_a_rule_for_addresses_that_is_not_known():
    found = elf.read_object(code_of(Asked("linux-x86_64"), False).content)
    first = next(r for r in found.relocations if r.section in found.loaded)
    with pytest.raises(ValueError, match="relocation 77 of machine 62 is not known here"):
        elf.image_of(found._replace(relocations=[first._replace(rule=77)]))


def test_what_is_no_object_file():
    with pytest.raises(ValueError, match="not a little-endian ELF file"):
        elf.read_object(b"\x7fELF\x02\x02" + bytes(100))


# -- archives and shared objects ---------------------------------------------------------------------------------
def test_an_archive_holds_the_object_and_says_where_each_symbol_lies():
    content = code_of(Asked("cortex-m7"), False).content
    made = archive(content, "flownav.o")
    assert made.startswith(b"!<arch>\n/ ")
    size = int(made[8 + 48 : 8 + 58])
    table = made[68 : 68 + size]
    count = struct.unpack(">I", table[:4])[0]
    places = struct.unpack(f">{count}I", table[4 : 4 + 4 * count])
    assert set(table[4 + 4 * count :].rstrip(b"\0").decode().split("\0")) == NAMES
    for place in places:
        assert made[place : place + 10] == b"flownav.o/"
        assert made[place + 60 : place + 60 + len(content)] == content
    assert archive(content, "flownav.o") == made


@pytest.mark.skipif(shutil.which("nm") is None, reason="no `nm` here: Debian's binutils")
def test_binutils_read_the_archive(tmp_path):
    (tmp_path / "lib.a").write_bytes(archive(code_of(Asked("linux-x86_64"), False).content, "flownav.o"))
    said = subprocess.run(["nm", "-s", str(tmp_path / "lib.a")], capture_output=True, text=True, check=True).stdout
    assert {f"{name} in flownav.o" for name in NAMES} <= set(said.splitlines())


@pytest.mark.parametrize("target", ["linux-x86_64", "linux-aarch64"])
def test_a_shared_object_is_one_to_pyelftools(target):
    found = elf.read_object(code_of(Asked(target), False).content)
    made = ELFFile(io.BytesIO(elf.shared_object(found, "libflownav.so")))
    assert made.header.e_type == "ET_DYN"
    dynamic = {tag.entry.d_tag: tag for tag in made.get_section_by_name(".dynamic").iter_tags()}
    assert dynamic["DT_SONAME"].soname == "libflownav.so"
    assert "DT_NEEDED" not in dynamic
    table = made.get_section_by_name(".dynsym")
    assert {s.name for s in table.iter_symbols() if s.name} == NAMES
    for name in NAMES:
        assert table.get_symbol_by_name(name)
    loads = [s for s in made.iter_segments() if s["p_type"] == "PT_LOAD"]
    assert not [s for s in loads if s["p_flags"] & 1 and s["p_flags"] & 2]  # nothing is both run and written
    text = made.get_section_by_name(".text")
    for symbol in table.iter_symbols():
        assert not symbol.name or text["sh_addr"] <= symbol["st_value"] < text["sh_addr"] + text["sh_size"]


# -- modules ------------------------------------------------------------------------------------------------------
def test_a_module_imports_nothing_and_exports_its_functions():
    import wasmtime

    module = wasmtime.Module(wasmtime.Engine(), code_of(Asked("wasm32"), False).content)
    assert list(module.imports) == []
    assert {export.name for export in module.exports} == NAMES | {"memory", "heap"}


@pytest.mark.parametrize(("content", "said"), [(b"\x7fELF", "not a WebAssembly file"), (b"\0asm\2\0\0\0", "not a Web")])
def test_what_is_no_module(content, said):
    with pytest.raises(ValueError, match=said):
        wasm.module(content, ())


def test_a_module_without_the_function_that_is_asked_for():
    from flownav.export.onboard.code import machine_code
    from flownav.export.onboard.targets import TARGETS

    content = machine_code(TARGETS["wasm32"].processor, False)
    with pytest.raises(ValueError, match="the object has no flownav_land"):
        wasm.module(content, ("flownav_land",))


@pytest.mark.parametrize("value", [0, 1, 63, 64, 127, 128, 8191, 8192, 70000])
def test_numbers_of_a_module(value):
    unsigned, signed = wasm.unsigned(value), wasm.signed(value)
    assert sum((byte & 0x7F) << (7 * i) for i, byte in enumerate(unsigned)) == value
    assert sum((byte & 0x7F) << (7 * i) for i, byte in enumerate(signed)) == value
    assert not signed[-1] & 0x40  # it is not below 0


# -- other processors ---------------------------------------------------------------------------------------------
def test_a_processor_that_llvm_does_not_know():
    with pytest.raises(NoProcessorError, match="pdp11"):
        target_machine(Processor("pdp11-dec-none"))
    with pytest.raises(InputError, match=r"target pdp11: .*choose from linux-x86_64, .*or an LLVM triple"):
        code_of(Asked("pdp11"), False)


# -- constants ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("value", [0.1, -1e300, 5e-324, 1.0, 1e22, np.nan, np.inf, -np.inf])
def test_a_number_of_c_is_the_same_to_the_last_bit(value):
    text = number(value)
    back = {"NAN": np.nan, "INFINITY": np.inf, "-INFINITY": -np.inf}.get(text)
    assert np.array_equal(float(text) if back is None else back, value, equal_nan=True)


def test_the_settings_name_every_number():
    text = settings_file(SETTINGS)
    assert all(f".{part} = " in text for part in PARTS)
    values = re.findall(r"= \{?(-?[0-9.e+-]+|NAN|-?INFINITY)", text)
    assert len(values) >= START_SIGMA - 36
    assert ".protects = 1.0" in text


# -- the header -----------------------------------------------------------------------------------------------------
def test_the_header_states_sizes_as_they_are():
    text = header(RATES.sizes)
    assert f"double work[{progress.BOARD_ROWS}];" in text
    assert f"double rings[{waiting.rows_of(RATES.sizes)}];" in text
    assert f"sizeof(flownav_settings) == {8 * len(SETTINGS)}" in text
    assert not re.search(r"\bself\b|\bNone\b|NamedTuple", text)  # nothing of Python's


C_USES = """
#include "flownav.h"
static flownav_nav nav;
static flownav_outcome outcome;
static flownav_state state;
int use(const flownav_settings *settings);
int use(const flownav_settings *settings) {
  const flownav_reading reading = flownav_blank();
  int said = flownav_begin(&nav, settings);
  said += flownav_take(&nav, settings, 0.0, FLOWNAV_IMU, &reading, &outcome);
  said += flownav_work(&nav, settings, &outcome) + flownav_now(&nav, settings, 0.1, &state);
  return said + (int)flownav_digest(&nav) + (int)sizeof(flownav_state) + FLOWNAV_REASON_FUSED + FLOWNAV_ABI;
}
"""


@needs_compiler
@pytest.mark.parametrize("language", ["c99", "c11", "c++11", "c++20"])
def test_every_compiler_takes_the_header_without_a_warning(language, tmp_path):
    (tmp_path / "flownav.h").write_text(header(Rates(attitude_hz=50.0).sizes, "0123456789abcdef"))
    kind = "c++" if "+" in language else "c"
    (tmp_path / f"use.{kind}").write_text(C_USES)
    strict = ["-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wstrict-prototypes" if kind == "c" else "-Wshadow"]
    pedantic = [] if language in ("c99", "c++11") else ["-pedantic"]
    done = subprocess.run(
        ["cc", "-x", kind, f"-std={language}", *strict, *pedantic, "-c", f"use.{kind}", "-o", "use.o"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_a_shared_object_is_loaded_by_this_process(tmp_path: Path):
    import platform

    if platform.machine() != "x86_64":
        pytest.skip("this process runs no code of x86-64")
    found = elf.read_object(code_of(Asked("linux-x86_64"), False).content)
    (tmp_path / "libflownav.so").write_bytes(elf.shared_object(found, "libflownav.so"))
    library = ctypes.CDLL(str(tmp_path / "libflownav.so"))
    assert all(getattr(library, name) for name in NAMES)
