"""A record as a file: one zip of Parquet tables and `manifest.json`, written whole, and read within limits only.

Nothing is unpacked before it is known how large it becomes: what a record says of itself (the zip's directory, the
Parquet footers, the pages' headers) is checked first. A flight of two hours with an IMU of 1 kHz passes (2.5 GB in
memory, a file of some 0.8 GB).
"""

import io
import json
import re
import zipfile
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from flownav.core.arrow_columns import as_numpy, places, table_of
from flownav.core.errors import InputError
from flownav.core.guard import an_input, written_whole
from flownav.core.measurement import COLUMNS, Sensor
from flownav.core.parquet_pages import check_pages, read_footer

Column = NDArray[Any]
Tables = dict[str, dict[str, Column]]

MANIFEST = "manifest.json"
MEMBER = re.compile(r"[A-Za-z0-9_-]{1,64}\.parquet")
MOST_MEMBERS = 100
MOST_DIRECTORY = 1 << 18  # bytes of the zip's directory
MOST_MANIFEST = 4 << 20
MOST_DIGITS = 40  # of an integer
MOST_COLUMNS = 1000
MOST_BYTES = 8 << 30  # of all tables in memory
ALWAYS_BYTES = 64 << 20  # whatever the file's size
MOST_GROWTH = 32  # times the file's size; records of flights grow two- to threefold
TEXTS = {"innovation": ("sensor", "component", "reason"), "events": ("source", "kind", "detail")}
NUMBERED = {"innovation": ("component",)}  # texts that the paper's filter, whose components have no names, numbers
WRONG = (
    zipfile.BadZipFile, zlib.error, KeyError, ValueError, TypeError, OSError, EOFError, MemoryError, RuntimeError,
    ArithmeticError, AttributeError, IndexError,
)  # fmt: skip


class Manifest(BaseModel):
    """Keys of a manifest, where it has them; further keys are kept as they are."""

    model_config = ConfigDict(extra="allow", strict=True)

    version: int = Field(alias="schema", ge=0)
    kind: str | None = None
    scenario: str | None = None
    description: str | None = None
    filter: str | None = None
    gps: str | None = None
    log: str | None = None
    truth_name: str | None = None
    truth_model: str | None = None
    known_exactly: str | None = None
    command: str | list[str] | None = None
    duration_s: float | None = Field(default=None, allow_inf_nan=False)
    pad_size_m: float | None = Field(default=None, allow_inf_nan=False)
    delays_s: dict[str, float] | None = None
    parameters: dict[str, Any] | None = None
    provenance: dict[str, Any] | None = None
    scores: dict[str, Any] | None = None
    paper: dict[str, Any] | None = None
    live: dict[str, Any] | None = None
    segments: list[dict[str, float | bool]] | None = None


def save(manifest: dict[str, Any], tables: Tables, path: Path, *, replacing: bool = False) -> None:
    """Write a record as one file, whole or not at all; as in `Record.save`. The same record is the same bytes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with (
        written_whole(path, replacing=replacing) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as bundle,
    ):
        bundle.writestr(zipfile.ZipInfo(MANIFEST), json.dumps(manifest, indent=1, default=str))
        for name, table in tables.items():
            columns, entry = table_of(table), zipfile.ZipInfo(f"{name}.parquet")
            with bundle.open(entry, "w", force_zip64=columns.nbytes >= zipfile.ZIP64_LIMIT) as stream:
                words = [one.name for one in columns.schema if not pa.types.is_primitive(one.type)]  # each kept once
                pq.write_table(columns, pa.PythonFile(_Counted(stream), "w"), compression="zstd", use_dictionary=words)
            del columns
            pa.default_memory_pool().release_unused()


def load_libraries() -> None:
    """Load what `save` needs."""
    import pyarrow.parquet  # noqa: F401


def load(
    path: Path, newest: int, known: Mapping[str, tuple[str, ...]], in_order: Collection[str], latest_s: float,
    longest_s: float,
) -> tuple[dict[str, Any], Tables]:  # fmt: skip
    """A record's manifest and tables. newest: the schema that is understood. known: columns by table.

    in_order: tables whose rows follow each other in time. latest_s, longest_s: what an instant is, and a record spans.
    InputError where the file is missing, no record, of a newer schema, or would become too large.
    """
    if not an_input(path).is_file():
        raise InputError(f"{path}: no such record; `flownav fly landing` writes one")
    try:
        with _Bounded(path) as file, zipfile.ZipFile(file) as bundle:
            file.most = -1
            names = _checked_members(bundle, path.stat().st_size)
            manifest = _manifest(bundle.read(MANIFEST), path, newest)
            _check_tables(bundle, names, path.stat().st_size, known)
            tables, left = {}, _allowed(path.stat().st_size)
            for name in names:
                tables[Path(name).stem], words = _table(bundle.read(name), left)
                left -= words
            check_times(tables, in_order, latest_s, longest_s)
            return manifest, tables
    except WRONG as error:
        what = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path}: not a flownav record ({what}); write it again with fly or replay") from error


class _Bounded(io.FileIO):
    """A file of which nothing larger than `most` bytes is read at once, where that is not negative."""

    most = MOST_DIRECTORY

    def read(self, size: int | None = -1, /) -> bytes:
        """Bytes, as a file gives them; ValueError where they are too many."""
        whole = size is None or size < 0
        if self.most < 0:
            return super().read(-1 if whole else size) or b""
        found = super().read(self.most + 1 if whole else min(size or 0, self.most + 1)) or b""
        if len(found) > self.most:
            raise ValueError("the zip's directory is too long")
        return found


def _allowed(size: int) -> int:
    """Bytes in memory that a file of this size may become."""
    return min(MOST_BYTES, max(ALWAYS_BYTES, MOST_GROWTH * size))


def _checked_members(bundle: zipfile.ZipFile, size: int) -> list[str]:
    """The names of the tables. ValueError where there is anything that no record has."""
    found = bundle.infolist()
    names = [member.filename for member in found]
    wrong = [name for name in names if name != MANIFEST and not MEMBER.fullmatch(name)]
    if wrong or len(set(names)) < len(names) or len(names) > MOST_MEMBERS:
        raise ValueError(f"it holds {wrong[0]!r}" if wrong else "its parts are too many, or two have one name")
    for member in found:
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{member.filename} is packed in a way that no record is")
        if member.file_size > (MOST_MANIFEST if member.filename == MANIFEST else _allowed(size)):
            raise ValueError(f"{member.filename} would be {member.file_size} bytes")
    if sum(member.file_size for member in found) > _allowed(size):
        raise ValueError("its parts would be too large together")
    return [name for name in names if name != MANIFEST]


def _manifest(text: bytes, path: Path, newest: int) -> dict[str, Any]:
    """The manifest as it stands, its keys checked."""
    try:
        content = json.loads(text, parse_int=_whole_number)
    except RecursionError as error:
        raise ValueError(f"{MANIFEST} is nested too deep") from error
    if not isinstance(content, dict):
        raise ValueError(f"{MANIFEST} is no object")
    if isinstance(content.get("schema"), int) and content["schema"] > newest:
        raise InputError(f"{path}: record schema {content['schema']} is newer than this flownav; update flownav")
    check_manifest(content)
    return content


def _whole_number(text: str) -> int:
    """An integer of a manifest. ValueError where it is more than any count or seed."""
    if len(text) > MOST_DIGITS:
        raise ValueError(f"{MANIFEST}: an integer of {len(text)} digits")
    return int(text)


def check_manifest(content: Mapping[str, Any]) -> None:
    """ValueError where a key of a manifest, as JSON has it, is of another kind than records have."""
    try:
        Manifest.model_validate({"schema": 0, **content})
    except ValidationError as error:
        first = error.errors()[0]
        raise ValueError(f"{MANIFEST}: {'.'.join(map(str, first['loc'][:2]))}: {first['msg']}") from error


def _check_tables(bundle: zipfile.ZipFile, names: list[str], size: int, known: Mapping[str, tuple[str, ...]]) -> None:
    """Check the tables' own statements before any is read: columns, types, and how large they become."""
    import pyarrow.parquet as pq

    left = _allowed(size)
    for name in names:
        data = bundle.read(name)
        footer = read_footer(data)
        schema = pq.ParquetFile(io.BytesIO(data)).schema_arrow
        if len(schema) > MOST_COLUMNS or any(len(group) != len(schema) for group in footer.groups):
            raise ValueError(f"{name}: {len(schema)} columns")
        texts = _check_columns(Path(name).stem, schema, known)
        rows = sum(footer.rows)
        left -= 8 * rows * len(schema) + sum(group[place].grown for group in footer.groups for place in texts)
        if left < 0:
            raise ValueError(f"{name}: {rows} rows of {len(schema)} columns are too many")
        if rows:
            check_pages(data, footer)


def _check_columns(table: str, schema: Any, known: Mapping[str, tuple[str, ...]]) -> list[int]:
    """Places of the columns of text. ValueError where a column is of no type, or not of its own."""
    import pyarrow as pa

    if "t_s" not in schema.names or len(set(schema.names)) < len(schema.names):
        raise ValueError(f"table {table} has no t_s, or a column twice")
    columns = known.get(table) or (COLUMNS[Sensor[table.upper()]] if table.upper() in Sensor.__members__ else ())
    texts = []
    for place, field in enumerate(schema):
        kind = field.type
        text = pa.types.is_string(kind) or pa.types.is_large_string(kind)
        number = pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)
        stated = field.name == "t_s" or field.name in columns
        numbered = field.name in NUMBERED.get(table, ())  # by some writers
        wrong = stated and not numbered and text != (field.name in TEXTS.get(table, ()))
        if not (text or number) or wrong:
            raise ValueError(f"column {field.name} of table {table} is of type {kind}")
        if text:
            texts.append(place)
    return texts


def _table(data: bytes, most: int) -> tuple[dict[str, Column], int]:
    """A table's columns, texts once each, however often they stand there; and how long all of them are together.

    ValueError where that is more than `most`: whoever shows them writes each as often as it stands there.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pq.read_schema(io.BytesIO(data))
    texts = [field.name for field in schema if pa.types.is_string(field.type) or pa.types.is_large_string(field.type)]
    file = pq.ParquetFile(io.BytesIO(data), read_dictionary=texts)
    read = file.read() if file.metadata.num_rows else file.schema_arrow.empty_table()
    if read.num_rows != file.metadata.num_rows:
        raise ValueError(f"a table of {file.metadata.num_rows} rows has {read.num_rows}")
    length = sum(_length(read.column(name)) for name in texts)
    if length > most:
        raise ValueError(f"its texts are {length} characters")
    return {name: _column(name, one) for name, one in zip(read.column_names, read.columns, strict=True)}, length


def _length(column: Any) -> int:
    """How many characters all cells of a column of text have."""
    if not hasattr(column.type, "index_type"):
        return 0  # of no row
    found = 0
    for chunk in column.chunks:
        each = np.array([len(word or "") for word in chunk.dictionary.to_pylist()] + [0], np.int64)
        found += int(each[places(chunk)].sum())  # the last of those without
    return found


def check_times(tables: Tables, in_order: Collection[str], latest_s: float, longest_s: float) -> None:
    """ValueError where times are none that a flight can have: whoever lays a grid over them would fill the memory."""
    ends = []
    for name, table in tables.items():
        t_s = table["t_s"].astype(float)
        wrong = np.flatnonzero(~(np.abs(t_s) < latest_s))
        if len(wrong):
            raise ValueError(f"table {name}: row {wrong[0] + 1} has the time {t_s[wrong[0]]:g} s, which no clock shows")
        back = np.flatnonzero(np.diff(t_s) < 0.0) if name in in_order else wrong
        if len(back):
            raise ValueError(f"table {name}: row {back[0] + 2} is earlier than the row before it")
        ends += [float(t_s.min()), float(t_s.max())] if len(t_s) else []
    if ends and max(ends) - min(ends) > longest_s:
        raise ValueError(f"it covers {min(ends):g} to {max(ends):g} s, more than two days")


def _column(name: str, found: Any) -> Column:
    try:
        return as_numpy(found)
    except ValueError as error:
        raise ValueError(f"column {name} has {error}") from None


class _Counted:
    """A file within a zip as Arrow writes to it, which asks how far it has come."""

    closed = False

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream, self._written = stream, 0

    def write(self, data: Any) -> int:
        self._written += self._stream.write(data)
        return len(data)

    def tell(self) -> int:
        return self._written

    def flush(self) -> None:
        pass
