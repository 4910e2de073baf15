"""Damage to records: to the zip's bytes, the manifest's text, the tables' bytes and their columns."""

from __future__ import annotations

import io
import zipfile
from random import Random

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from log_mutations import mutate

TEXTS = (
    b"null", b"true", b"[]", b"{}", b'""', b'"x"', b"-1", b"0", b"1e308", b"1e999", b"NaN", b"Infinity", b"[[[]]]",
    b'{"a": {}}', b"9" * 400, b'"\\ud800"', b'"a\\nb"',
)  # fmt: skip
NUMBERS = (0.0, -1.0, 1.0, 255.0, 1e5, 1e13, 1e300, -1e300, 5e-324, float("nan"), float("inf"), float("-inf"))


def mutate_record(content: bytes, other: bytes, seed: int) -> bytes:
    """One kind of damage, or two."""
    random = Random(seed)
    for _ in range(random.choice((1, 1, 2))):
        kind = random.choice((_bytes, _manifest, _parquet, _table, _table, _table, _entries))
        try:
            content = kind(content, other, random)
        except (zipfile.BadZipFile, LookupError, pa.ArrowException, OSError, ValueError, EOFError, NotImplementedError):
            return content  # so much is broken already
    return content


def entries_of(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as bundle:
        return {name: bundle.read(name) for name in bundle.namelist()}


def zipped(entries: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression) as bundle:
        for name, held in entries.items():
            bundle.writestr(name, held)
    return out.getvalue()


def _bytes(content: bytes, other: bytes, random: Random) -> bytes:
    return mutate(content, other, random.randrange(1 << 30))


def _manifest(content: bytes, other: bytes, random: Random) -> bytes:
    """A value of the manifest becomes another, or its text is damaged."""
    entries = entries_of(content)
    text = entries["manifest.json"]
    if random.random() < 0.3:
        entries["manifest.json"] = mutate(text, text, random.randrange(1 << 30))
        return zipped(entries)
    lines = text.split(b"\n")
    at = random.randrange(len(lines))
    key, colon, value = lines[at].partition(b": ")
    put = random.choice(TEXTS)
    if colon:
        lines[at] = key + colon + put + (b"," if value.rstrip().endswith(b",") else b"")
    else:
        lines[at] = random.choice((b"", put + b","))
    entries["manifest.json"] = b"\n".join(lines)
    return zipped(entries)


def _parquet(content: bytes, other: bytes, random: Random) -> bytes:
    """The bytes of a table, within a sound zip."""
    entries = entries_of(content)
    name = random.choice(sorted(entries))
    entries[name] = mutate(entries[name], content, random.randrange(1 << 30))
    return zipped(entries)


def _entries(content: bytes, other: bytes, random: Random) -> bytes:
    """An entry goes, has another name, or stands for another; the zip is packed or not."""
    entries = entries_of(content)
    name, second = random.choice(sorted(entries)), random.choice(sorted(entries))
    held = entries.pop(name)
    kind = random.randrange(5)
    if kind == 1:
        entries[random.choice(("../x.parquet", "/etc/x.parquet", "x/fed.parquet", "fed.parquet", "\n.parquet"))] = held
    elif kind == 2:
        entries[second] = held
    elif kind == 3:
        entries[name] = b""
    elif kind == 4:
        entries[name] = held
    return zipped(entries, random.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA)))


def _table(content: bytes, other: bytes, random: Random) -> bytes:
    """The columns of a table: other values, kinds, lengths, orders and names."""
    entries = entries_of(content)
    name = random.choice(sorted(each for each in entries if each.endswith(".parquet")))
    table = pq.read_table(io.BytesIO(entries[name]))
    columns = {key: table[key].to_numpy(zero_copy_only=False) for key in table.column_names}
    changed = _columns(columns, random)
    out = io.BytesIO()
    pq.write_table(pa.table(changed), out, compression=random.choice(("zstd", "none", "gzip")))
    entries[name] = out.getvalue()
    return zipped(entries)


def _columns(columns: dict[str, np.ndarray], random: Random) -> dict[str, object]:
    key = random.choice(sorted(columns))
    column, count = columns[key], len(columns[key])
    draws = np.random.default_rng(random.randrange(1 << 30))
    kind = random.randrange(9)
    some = draws.random(count) < random.choice((0.01, 0.5, 1.0))
    if kind <= 2 and column.dtype.kind == "f":
        put = random.choice(NUMBERS)
        with np.errstate(all="ignore"):
            return {**columns, key: np.where(some, column * put if random.random() < 0.3 else put, column)}
    if kind == 3:
        return {name: each for name, each in columns.items() if name != key}
    if kind == 4:
        order = draws.permutation(count)
        whole = random.random() < 0.5
        return {name: each[order] if whole or name == key else each for name, each in columns.items()}
    if kind == 5:
        length = random.choice((0, 1, 2, count // 2))
        return {name: each[:length] for name, each in columns.items()}
    if kind == 6:
        others: tuple[object, ...] = (
            ["x"] * count, [None] * count, [[1.0]] * count, draws.integers(-(2**62), 2**62, count), some,
            [b"\xff"] * count, [{"a": 1}] * count, draws.random(count).astype(np.float16),
            np.arange(count).astype("datetime64[s]"),
        )  # fmt: skip
        return {**columns, key: random.choice(others)}
    if kind == 7:
        return {**columns, random.choice(("x", "t_s", "\n", "pos_n_m", "a.b")): column}
    return {name: np.concatenate([each, each]) for name, each in columns.items()}
