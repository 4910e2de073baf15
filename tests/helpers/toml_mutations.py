"""Damage to parameter files that leaves them TOML, more or less: other values, other keys, other shapes."""

from __future__ import annotations

import re
from random import Random

from log_mutations import mutate

VALUES = (
    "0", "-0.0", "-1", "1", "2", "0.5", "1e-320", "1e-12", "1e6", "1e308", "-1e308", "1e999", "nan", "inf", "-inf",
    "1_000", "9" * 400, "9" * 5000, "0x" + "f" * 4000, "0b1", "true", "false", '""', '"a"', '"..."', '"/dev/zero"',
    '"\\n"', '"maxi-joker-3"', '"absent.toml"', "[]", "[[]]", "[1, 2]", "[" * 3000 + "]" * 3000, "{}",
    "{ value = 1 }", "{ value = 1e400 }", '{ value = "1" }', "{ value = {} }",
    "{ value = 0.5, uncertainty = -1 }", "{ value = 1, source = 1 }", "{ uncertainty = 1 }",
    "1979-05-27T07:32:00Z", "07:32:00", "1979-05-27", "[{}]", "[{ t_s = 0 }]",
)  # fmt: skip
NUMBER = re.compile(rb"(?<![\w\"'.])[-+]?\d[\d_.]*(?:e[-+]?\d+)?(?![\w\"'])")
VALUE = re.compile(rb"=\s*([^\n#]+)")
KEY = re.compile(rb"^[\w.\"]+(?=\s*=)", re.M)
TABLE = re.compile(rb"^\[+[\w.]+\]+\s*$", re.M)
KEYS = (
    b"x",
    b'"a\\nb"',
    b'"\\u0000"',
    b"a.b.c",
    b'""',
    b"value",
    b"schema_version",
    b"name",
    ".".join("k" * 1500).encode(),
)


def mutate_toml(content: bytes, other: bytes, seed: int) -> bytes:
    """One to three changes; every fourth file is damaged as bytes, as a log is."""
    random = Random(seed)
    if seed % 4 == 3:
        return mutate(content, other, seed)
    for _ in range(random.choice((1, 1, 2, 3))):
        content = random.choice((_number, _number, _value, _key, _line, _tables))(content, random)
    return content


def _number(content: bytes, random: Random) -> bytes:
    """A number becomes another: scaled, or one that breaks sums."""
    found = list(NUMBER.finditer(content))
    if not found:
        return content
    at = random.choice(found)
    try:
        scaled = repr(float(at[0]) * random.choice((-1.0, 0.0, 1e-9, 1e-3, 0.1, 10.0, 57.3, 1e3, 1e9))).encode()
    except ValueError:
        scaled = b"0"
    return content[: at.start()] + random.choice((scaled, random.choice(VALUES).encode())) + content[at.end() :]


def _value(content: bytes, random: Random) -> bytes:
    found = list(VALUE.finditer(content))
    if not found:
        return content
    at = random.choice(found)
    return content[: at.start(1)] + random.choice(VALUES).encode() + b"\n" + content[at.end(1) :]


def _key(content: bytes, random: Random) -> bytes:
    found = list(KEY.finditer(content))
    if not found:
        return content
    at = random.choice(found)
    name = random.choice((*KEYS, random.choice(found)[0], at[0] + b"_x", at[0].upper()))
    return content[: at.start()] + name + content[at.end() :]


def _line(content: bytes, random: Random) -> bytes:
    """A line goes, or stands twice, or elsewhere."""
    lines = content.splitlines(keepends=True)
    if not lines:
        return content
    at, to = random.randrange(len(lines)), random.randrange(len(lines))
    line = lines[at]
    kind = random.randrange(3)
    if kind != 1:
        del lines[at]
    if kind:
        lines.insert(to, line)
    return b"".join(lines)


def _tables(content: bytes, random: Random) -> bytes:
    """A heading goes, becomes a list's, or another one's."""
    found = list(TABLE.finditer(content))
    if not found:
        return content
    at = random.choice(found)
    name = at[0].strip().strip(b"[]")
    new = random.choice((b"", b"[[" + name + b"]]", b"[" + name + b".x]", random.choice(found)[0], b"[x]"))
    return content[: at.start()] + new + content[at.end() :]
