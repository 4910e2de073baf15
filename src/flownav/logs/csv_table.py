"""One CSV file of a log as columns of numbers, its rows checked: finite, inside limits, in time order.

Bad rows are thrown away and counted by reason. Where too many are bad for the file to be what its column names state (a
wrong unit, two logs in one file), that is an InputError of one line.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.arrow_columns import as_numpy
from flownav.core.errors import InputError
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.text import number
from flownav.logs.assembly import LATE_SHARE, Rows, content_of, drop_duplicates, drop_strays, longest_ordered, sha256_of

WRONG_UNIT_SHARE = 0.1  # more rows than this outside the limits: the column is in another unit
LONGEST_MEDIAN_STEP_S = 10.0
MOST_COLUMNS = 1000
MOST_HEADER_BYTES = 1 << 18


@dataclass(frozen=True)
class Column:
    """A column that a file must hold: its allowed values and what a value outside them suggests."""

    name: str
    low: float
    high: float
    hint: str = ""
    required: bool = True
    may_be_empty: bool = False  # NaN means that the sensor has no such figure


@dataclass
class CsvTable(Rows):
    """A file's good rows in time order."""

    path: Path = Path()
    sha256: str = ""
    notes: list[str] = field(default_factory=list)

    def stream(self, sensor: Sensor, *names: str, quality: str = "") -> Stream:
        """Columns as a sensor's stream; quality: its column, if any."""
        level = self.columns[quality] if quality else None
        return Stream.of(sensor, self.t_s, self.matrix(*names), quality=level, rejected=self.rejected)


def read_csv_table(path: Path, columns: Sequence[Column], *, seldom: bool = False) -> CsvTable:
    """Read and check one file. InputError where it cannot be read, lacks a column or cannot be in the units.

    seldom: rows stand where something happened, however far apart.
    """
    content = content_of(path, "a folder of CSV files")
    malformed: list[int] = []
    raw = columns_of(path, content, ["t_s", *(column.name for column in columns)], malformed)
    lacking = [c.name for c in columns if c.required and c.name not in raw] + ([] if "t_s" in raw else ["t_s"])
    if lacking:
        needs = ", ".join(["t_s", *(c.name for c in columns if c.required)])
        raise InputError(f"{path}: no column {', '.join(lacking)}; a {path.name} needs {needs}")
    table = CsvTable(raw.pop("t_s"), raw, path=path, sha256=sha256_of(content))
    if malformed:
        table.rejected["malformed_row"] = len(malformed)
    check_finite(table, columns)
    _check_limits(table, columns)
    check_clock(table)
    if not seldom:
        _check_step(table)
    if not len(table.t_s):
        reasons = ", ".join(f"{count} {reason}" for reason, count in table.rejected.items()) or "it is empty"
        raise InputError(f"{path}: no usable row ({reasons})")
    return table


def columns_of(path: Path, content: bytes, wanted: Sequence[str], malformed: list[int]) -> dict[str, Array]:
    """The wanted columns as floats (n,); text that is no number is NaN, rows of another length are left out.

    malformed: becomes one entry longer for each row that is left out. InputError where it is no CSV table.
    """
    import pyarrow as pa
    from pyarrow import csv

    def skip(row: Any) -> str:
        malformed.append(1)
        return "skip"

    def parse(kind: pa.DataType) -> pa.Table:
        malformed.clear()
        return csv.read_csv(
            pa.BufferReader(readable),
            read_options=csv.ReadOptions(column_names=header, skip_rows=1, use_threads=False),
            parse_options=csv.ParseOptions(invalid_row_handler=skip),
            convert_options=csv.ConvertOptions(
                column_types=dict.fromkeys(names, kind),
                include_columns=names,
                null_values=["", "nan", "NaN", "NAN", "null", "None"],
                strings_can_be_null=True,
            ),
        )

    header = header_of(path, content)
    readable = content if content.isascii() else content.decode("utf-8", errors="replace").encode()
    names = [name for name in dict.fromkeys(wanted) if name in header]
    if not names:
        return {}
    try:
        try:
            table = parse(pa.float64())
            return {name: as_numpy(table[name]) for name in names}
        except pa.ArrowInvalid:
            table = parse(pa.string())
            return {name: np.array([_number(text) for text in table[name].to_pylist()]) for name in names}
    except pa.ArrowInvalid as error:
        if "Empty CSV" in str(error):
            return {name: np.zeros(0) for name in names}
        raise InputError(f"{path}: not a CSV table ({str(error).splitlines()[0]})") from None


def header_of(path: Path, content: bytes) -> list[str]:
    """Column names of the first line. InputError where it is none, too long, or names one twice."""
    end = content.find(b"\n", 0, MOST_HEADER_BYTES)
    if end < 0 and len(content) > MOST_HEADER_BYTES:
        raise InputError(f"{path}: its first line has more than {MOST_HEADER_BYTES} bytes; a CSV table is needed")
    line = content[: end if end >= 0 else len(content)].decode("utf-8-sig", errors="replace")
    header = [name.strip().strip('"') for name in line.split(",")]
    if len(header) > MOST_COLUMNS:
        raise InputError(f"{path}: {len(header)} columns; at most {MOST_COLUMNS} are read")
    twice = sorted(name for name, count in Counter(header).items() if name and count > 1)
    if twice:
        raise InputError(f"{path}: column {', '.join(twice)} stands twice in the first line; keep one")
    return header


def _number(text: str | None) -> float:
    try:
        return number(text) if text is not None else np.nan
    except ValueError:
        return np.nan


def check_finite(table: CsvTable, columns: Sequence[Column]) -> None:
    """Throw away the rows without a number where one must be."""
    must = [c.name for c in columns if c.name in table.columns and not c.may_be_empty]
    finite = np.isfinite(table.t_s)
    for name in must:
        finite &= np.isfinite(table.columns[name])
    table.keep(finite, "not_finite")


def _check_limits(table: CsvTable, columns: Sequence[Column]) -> None:
    inside = np.ones(len(table.t_s), bool)
    for column in columns:
        values = table.columns.get(column.name)
        if values is None:
            continue
        outside = (values < column.low) | (values > column.high)
        share = int(np.count_nonzero(outside)) / max(1, int(np.count_nonzero(np.isfinite(values))))
        if share > WRONG_UNIT_SHARE:
            worst = float(values[outside][np.argmax(np.abs(values[outside]))])
            raise InputError(
                f"{table.path}: {column.name}: {share:.0%} of the rows lie outside {column.low:g} to {column.high:g} "
                f"(one is {worst:g}){'; ' + column.hint if column.hint else ''}"
            )
        inside &= ~outside
    table.keep(inside, "out_of_range")


def check_clock(table: CsvTable) -> None:
    """Put the rows in time order: late rows are thrown away, a file without any order is sorted."""
    t_s = table.t_s
    back = np.flatnonzero(np.diff(t_s) < 0)
    if len(back):
        ordered = longest_ordered(t_s)
        late = len(t_s) - int(np.count_nonzero(ordered))
        if late <= max(1, LATE_SHARE * len(t_s)):
            table.keep(ordered, "out_of_order")
        elif len(back) < LATE_SHARE * len(t_s):
            row = back[np.argmin(np.diff(t_s)[back])]
            raise InputError(
                f"{table.path}: the clock runs back from {t_s[row]:g} s to {t_s[row + 1]:g} s at row {row + 3}; "
                "split the log there, or sort it by t_s"
            )
        else:
            table.notes.append(f"{table.path.name}: rows in no time order ({len(back)} steps back); sorted by t_s")
            order = np.argsort(t_s, kind="stable")
            table.t_s = t_s[order]
            table.columns = {name: values[order] for name, values in table.columns.items()}
    drop_strays(table)
    drop_duplicates(table)


def _check_step(table: CsvTable) -> None:
    if len(table.t_s) > 2 and np.median(np.diff(table.t_s)) > LONGEST_MEDIAN_STEP_S:
        step = float(np.median(np.diff(table.t_s)))
        raise InputError(f"{table.path}: t_s steps by {step:g} a row; seconds are needed (milliseconds? microseconds?)")
