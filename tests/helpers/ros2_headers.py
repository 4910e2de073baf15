"""C++ headers of ROS 2 messages, from the definitions that rosbags has, and a stand-in for rclcpp: without ROS 2."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from ros_bags import typestore

STAND_IN = Path(__file__).parent / "ros2" / "rclcpp.hpp"
BASES = {
    "float64": "double", "float32": "float", "string": "std::string", "bool": "bool", "byte": "uint8_t",
    **{f"{sign}int{bits}": f"{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}  # fmt: skip
BASE, NAME, ARRAY = 1, 2, 3
COMMON = """#pragma once
#include <array>
#include <cstdint>
#include <iomanip>
#include <iostream>
#include <string>
#include <vector>
namespace stand_in {
template <typename T> void read(std::istream &in, T &v) { in >> v; }
inline void read(std::istream &in, uint8_t &v) { int n; in >> n; v = static_cast<uint8_t>(n); }
inline void read(std::istream &in, int8_t &v) { int n; in >> n; v = static_cast<int8_t>(n); }
inline void read(std::istream &in, std::string &v) { in >> std::quoted(v); }
template <typename T> void write(std::ostream &out, const T &v) { out << ' ' << +v; }
inline void write(std::ostream &out, const std::string &v) { out << ' ' << std::quoted(v); }
%s
template <typename T, size_t N>
void read(std::istream &in, std::array<T, N> &v) { for (auto &each : v) read(in, each); }
template <typename T, size_t N>
void write(std::ostream &out, const std::array<T, N> &v) { for (auto &each : v) write(out, each); }
template <typename T>
void read(std::istream &in, std::vector<T> &v) { size_t n; in >> n; v.resize(n); for (auto &each : v) read(in, each); }
template <typename T>
void write(std::ostream &out, const std::vector<T> &v) {
  out << ' ' << v.size();
  for (auto &each : v) write(out, each);
}
%s
}
"""


def write_headers(folder: Path, kinds: list[str]) -> None:
    """Headers of these messages and of what they hold, each where ROS 2 has it, and the stand-in for rclcpp."""
    store, done = typestore(), list[str]()
    for kind in kinds:
        _gather(store, kind, done)
    structs = "\n".join(_struct(store, kind) for kind in done)
    declared = "\n".join(
        f"void read(std::istream &, {_cpp(kind)} &);\nvoid write(std::ostream &, const {_cpp(kind)} &);"
        for kind in done
    )
    head, _, rest = COMMON.partition("namespace stand_in {")
    bodies = "\n".join(_streams(store, kind) for kind in done)
    (folder / "stand_in.hpp").write_text(f"{head}{structs}\nnamespace stand_in {{{rest}" % (declared, bodies))
    for kind in done:
        package, _, name = kind.split("/")
        place = folder / package / "msg" / f"{_snake(name)}.hpp"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text("#pragma once\n#include <stand_in.hpp>\n")
    (folder / "rclcpp").mkdir()
    (folder / "rclcpp" / "rclcpp.hpp").write_text(
        f"#include <stdexcept>\n#include <stand_in.hpp>\n{STAND_IN.read_text()}"
    )


def _gather(store: Any, kind: str, done: list[str]) -> None:
    for _, field in store.fielddefs[kind][1]:
        inner = field if int(field[0]) < ARRAY else field[1][0]
        if int(inner[0]) == NAME:
            _gather(store, inner[1], done)
    if kind not in done:
        done.append(kind)


def _cpp(kind: str) -> str:
    return kind.replace("/", "::")


def _snake(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()


def _type(field: Any) -> str:
    what, told = int(field[0]), field[1]
    if what == BASE:
        return BASES[told[0]]
    if what == NAME:
        return _cpp(told)
    inner, size = told
    return f"std::array<{_type(inner)}, {size}>" if what == ARRAY else f"std::vector<{_type(inner)}>"


def _struct(store: Any, kind: str) -> str:
    package, _, name = kind.split("/")
    constants, fields = store.fielddefs[kind]
    rows = [f"  static constexpr {BASES[base]} {called} = {value};" for called, base, value in constants]
    rows += [f"  {_type(field)} {called}{{}};" for called, field in fields]
    return f"namespace {package}::msg {{\nstruct {name} {{\n" + "\n".join(rows) + "\n};\n}"


def _streams(store: Any, kind: str) -> str:
    names = [called for called, _ in store.fielddefs[kind][1]]
    reads = " ".join(f"read(in, m.{name});" for name in names)
    writes = " ".join(f"write(out, m.{name});" for name in names)
    return (
        f"inline void read(std::istream &in, {_cpp(kind)} &m) {{ {reads} }}\n"
        f"inline void write(std::ostream &out, const {_cpp(kind)} &m) {{ {writes} }}"
    )
