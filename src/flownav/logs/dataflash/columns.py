"""A DataFlash file as columns: every kind of message a table, one array a field, straight from the file's bytes."""

import mmap
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.core.measurement import Array
from flownav.logs.assembly import checked_size
from flownav.logs.csv_table import Column, CsvTable, check_clock, check_finite
from flownav.logs.dataflash import formats
from flownav.logs.dataflash.text_form import LOOKED_AT_BYTES, binary_of, is_text

Columns = dict[str, NDArray[Any]]
DESCRIBING: tuple[str, ...] = ("UNIT", "MULT", "FMTU")


class DataFlash:
    """An open DataFlash file.

    formats: by name, of the kinds that the file describes. skipped_bytes, gaps: what belongs to no message.
    contradictions: FMT messages that contradict an earlier one and were passed over.
    """

    def __init__(self, path: Path) -> None:
        """Find every message. InputError where the file cannot be read or holds none."""
        self.path = path
        self._content = _content(path)
        headers = formats.find_headers(self._content)
        self.formats, self.contradictions = formats.read_formats(self._content, headers)
        length = np.zeros(256, np.int64)
        for known in self.formats.values():
            length[known.type] = known.dtype.itemsize
        self._scan = formats.chain_messages(self._content, headers, length)
        self.skipped_bytes, self.gaps = self._scan.skipped_bytes, self._scan.gaps
        describing: dict[str, NDArray[np.void]] = {
            name: self._rows(name) for name in DESCRIBING if name in self.formats
        }
        self.formats = formats.with_units(self.formats, describing)
        self._counts = np.bincount(self._scan.type, minlength=256)
        if self._counts.sum() <= self.count("FMT"):
            raise InputError(
                f"{path}: no ArduPilot DataFlash message in it; a .bin log as the vehicle wrote it is needed"
            )

    @property
    def size_bytes(self) -> int:
        """The file's size."""
        return len(self._content)

    def count(self, name: str) -> int:
        """How many messages of a kind there are; 0 of one that the file does not describe."""
        return int(self._counts[self.formats[name].type]) if name in self.formats else 0

    def names(self) -> list[str]:
        """The kinds of message that occur."""
        return sorted(name for name in self.formats if self.count(name))

    def table(
        self,
        name: str,
        labels: Iterable[str] | None = None,
        *,
        instance: int | None = None,
        t0_s: float | None = None,
        t1_s: float | None = None,
    ) -> Columns:
        """Fields of all messages of a kind, in file order; shape (n,), (n, 32) for arrays.

        Numbers are as ArduPilot's own tools give them: the factors of the characters c, C, e, E and L are applied
        (float64), those of MULT are not (`Format.multipliers`). Text is bytes, see `text`. instance: only one
        sensor's. t0_s, t1_s: only t0 <= time < t1, seconds since the vehicle started.
        KeyError where the kind, a label, its time or the instance field is unknown.
        """
        known = self.formats[name]
        wanted = known.labels if labels is None else tuple(labels)
        sliced = t0_s is not None or t1_s is not None
        unknown = {*wanted} - set(known.labels) | ({"time"} if sliced and known.clock is None else set())
        if unknown:
            raise KeyError(f"{name} has no {', '.join(sorted(unknown))}")
        at = self._offsets(known)
        if instance is not None:
            if known.instance is None:
                raise KeyError(f"{name} has no instance field")
            at = at[self._field(known, known.instance, at) == instance]
        if sliced:
            t_s = self._times(known, at)
            at = at[(t_s >= (-np.inf if t0_s is None else t0_s)) & (t_s < (np.inf if t1_s is None else t1_s))]
        rows = formats.records(self._content, known.dtype)[at]
        return {label: _converted(rows[label], known.code(label)) for label in wanted}

    def instances(self, name: str) -> list[int]:
        """Which sensors of a kind there are; empty where its messages carry no instance."""
        known = self.formats.get(name)
        if known is None or known.instance is None:
            return []
        found = np.unique(self._field(known, known.instance, self._offsets(known)))
        return [int(value) for value in found] if found.dtype.kind in "iu" else []

    def times(self, name: str, *, instance: int | None = None) -> Array:
        """When each message of a kind was written [s], seconds since the vehicle started; NaN where no time is known.

        A kind without a time of its own has that of the message before it.
        """
        known = self.formats[name]
        at = self._offsets(known)
        if instance is not None and known.instance is not None:
            at = at[self._field(known, known.instance, at) == instance]
        return self._times(known, at) if known.clock else self._times_before(at)

    def _times(self, known: formats.Format, at: formats.Indices) -> Array:
        assert known.clock is not None
        label, unit_s = known.clock
        return _scaled(self._field(known, label, at), unit_s)

    def _times_before(self, at: formats.Indices) -> Array:
        """The time of the last message before each offset, of the kind that is written most often."""
        timed = [known for known in self.formats.values() if known.clock and self._counts[known.type]]
        if not timed:
            return np.full(len(at), np.nan)
        clock = max(timed, key=lambda known: int(self._counts[known.type]))
        beside = self._offsets(clock)
        return np.asarray(self._times(clock, beside)[np.maximum(np.searchsorted(beside, at) - 1, 0)])

    def _offsets(self, known: formats.Format) -> formats.Indices:
        return np.asarray(self._scan.offset[self._scan.type == known.type])

    def _rows(self, name: str) -> NDArray[np.void]:
        known = self.formats[name]
        return np.asarray(formats.records(self._content, known.dtype)[self._offsets(known)])

    def _field(self, known: formats.Format, label: str, at: formats.Indices) -> NDArray[Any]:
        kind, place = known.dtype.fields[label][:2]  # type: ignore[index]
        return _converted(_gathered(self._content, np.dtype(kind), at + int(place)), known.code(label))


def read_columns(
    path: Path, messages: Collection[str] | None = None, *, t0_s: float | None = None, t1_s: float | None = None
) -> dict[str, Columns]:
    """The tables of some kinds of message (all that occur where None); kinds that do not occur are left out.

    A time slice leaves out the kinds that carry no time. InputError where the file is no DataFlash log.
    """
    log = DataFlash(path)
    sliced = t0_s is not None or t1_s is not None
    return {
        name: log.table(name, t0_s=t0_s, t1_s=t1_s)
        for name in log.names()
        if (messages is None or name in messages) and not (sliced and log.formats[name].clock is None)
    }


def text(column: NDArray[Any]) -> list[str]:
    """A text column as strings: up to the first zero byte, UTF-8, else Latin-1."""
    return [_decoded(bytes(value).split(b"\0", 1)[0]) for value in column.tolist()]


def _decoded(raw: bytes) -> str:
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _gathered(content: formats.Bytes, dtype: np.dtype[Any], at: formats.Indices) -> NDArray[Any]:
    count = max(0, len(content) - dtype.itemsize + 1)
    seen: NDArray[Any] = np.ndarray((count,), dtype, buffer=content.data, strides=(1,))
    return np.asarray(seen[at])


def _converted(values: NDArray[Any], code: str) -> NDArray[Any]:
    if code in formats.DIVISORS:
        return np.asarray(values / formats.DIVISORS[code])
    return np.ascontiguousarray(values)


def _content(path: Path) -> formats.Bytes:
    try:
        checked_size(path)
        with an_input(path).open("rb") as file:
            content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        as_text = is_text(content[:LOOKED_AT_BYTES])
        return np.frombuffer(binary_of(content[:]) if as_text else content, np.uint8)
    except ValueError:
        raise InputError(f"{path}: the file is empty; a .bin log as the vehicle wrote it is needed") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give an ArduPilot .bin log") from error


# -- checked rows -------------------------------------------------------------------------------------------
class Field(NamedTuple):
    """A field of a message: the limits of its values and the factor to their unit where the log states none.

    older: its name in the logs of years before.
    """

    label: str
    low: float
    high: float
    factor: float = 1.0
    required: bool = True
    may_be_nan: bool = False
    older: str = ""

    def named(self, labels: Collection[str]) -> str:
        """Its name among a message's labels."""
        return self.older if self.older in labels and self.label not in labels else self.label


def message_rows(
    log: DataFlash, name: str, fields: Sequence[Field], instance: int | None = None, *, timeless: bool = False
) -> CsvTable | None:
    """Every row of a kind of message as written, t_s seconds since the vehicle started.

    None where the kind does not occur, lacks a required field as a number, or, unless `timeless`, a time of its own.
    """
    if not log.count(name) or (lacking(log, name, fields) if not timeless else _unfilled(log, name, fields)):
        return None
    known = log.formats[name]
    present = {
        field.label: field.named(known.numbers) for field in fields if field.named(known.numbers) in known.numbers
    }
    columns = log.table(name, dict.fromkeys(present.values()), instance=instance)
    factor = {field.label: known.multipliers.get(field.named(known.numbers), field.factor) for field in fields}
    scaled = {label: _scaled(columns[there], factor[label]) for label, there in present.items()}
    return CsvTable(log.times(name, instance=instance), scaled, path=Path(f"{log.path}: {name}"))


def lacking(log: DataFlash, name: str, fields: Sequence[Field]) -> str:
    """The part that a kind of message lacks to be read, in words; "" where it lacks nothing."""
    unfilled = _unfilled(log, name, fields)
    if unfilled:
        return f"a field that is needed ({', '.join(field.label for field in fields if field.required)})"
    return (
        ""
        if log.formats[name].clock
        else "a time (TimeUS or TimeMS): ArduPilot before 3.2 wrote none, give a later log"
    )


def _unfilled(log: DataFlash, name: str, fields: Sequence[Field]) -> list[str]:
    numbers = log.formats[name].numbers
    return [field.label for field in fields if field.required and field.named(numbers) not in numbers]


def _scaled(values: NDArray[Any], factor: float) -> Array:
    """In float64, times a factor; a damaged file's signalling NaN or huge number is no warning, the checks see it."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(values.astype(float) * factor)


def good_rows(log: DataFlash, name: str, fields: Sequence[Field]) -> CsvTable | None:
    """The checked rows of a kind of message; None where it has none. InputError as `check_rows`."""
    table = message_rows(log, name, fields)
    if table is not None:
        check_rows(table, fields)
    return table if table is not None and len(table.t_s) else None


def check_rows(table: CsvTable, fields: Sequence[Field]) -> None:
    """Throw away and count what is not finite, out of range or out of order. InputError where the clock restarts."""
    check_finite(table, [Column(f.label, f.low, f.high, may_be_empty=f.may_be_nan) for f in fields])
    inside = np.ones(len(table.t_s), bool)
    for field in fields:
        values = table.columns.get(field.label)
        if values is not None:
            inside &= ~((values < field.low) | (values > field.high))
    table.keep(inside, "out_of_range")
    if len(table.t_s):
        check_clock(table)


def held_at(instants_s: Array, t_s: Array, values: Array) -> Array:
    """The latest value at each instant, the first one before there is any; values (n, ...), n at least 1."""
    return np.asarray(values[np.maximum(np.searchsorted(t_s, instants_s, side="right") - 1, 0)])
