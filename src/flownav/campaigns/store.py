"""A campaign's folder: its plan, its flights as Parquet files, and whatever is written when all have flown.

    campaign.json                        the plan, by which a folder is known again
    flights/cell-000/part-00000.parquet  flights 0 to 255 of the first cell, and so on
    flights/cell-000/begun-00001.parquet scores of the first flights of a part that is being flown, until it is there
    summary.json, report.html, records/  written at the end

Each file appears whole or not at all, and what is in it follows from the plan alone: a campaign that was killed goes on
where it stopped, and ends with the same bytes as one that was not. Its rows say whether they are as they were written
(`campaigns.chain`): a part that is not is named, and flown again.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.chain import DamagedError, read_part, write_part
from flownav.campaigns.measures import ROW_COLUMNS, measured
from flownav.campaigns.plan import Plan
from flownav.core import arrow_columns
from flownav.core.arrow_columns import as_numpy, numbers, words
from flownav.core.errors import InputError, arg
from flownav.core.files import written_whole
from flownav.core.guard import an_output_folder, object_in
from flownav.core.measurement import Array
from flownav.scoring.errors import SCORE_COLUMNS, touchdown_rows
from flownav.scoring.landings import BROKEN, verdict_of
from flownav.scoring.touchdown import LIMITED_BY, names_of

PLAN, FLIGHTS, SUMMARY, REPORT, RECORDS, LOCK = (
    "campaign.json", "flights", "summary.json", "report.html", "records", ".lock",
)  # fmt: skip
PART = 256  # flights of one file
PART_NAME = re.compile(r"part-(\d{5,})\.parquet")


class Kept(NamedTuple):
    """A part as it was written: its scores (flights, len(ROW_COLUMNS)), the digests before it and of its last row."""

    rows: Array
    before: bytes
    last: bytes


class Store:
    """The folder of a campaign. folder: made if it is not there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @contextmanager
    def opened(self, plan: Plan) -> Iterator[Store]:
        """The folder, locked, with this plan in it.

        InputError where it holds something else, or where another process is flying there.
        """
        an_output_folder(self.folder)
        plan_text = json.dumps(plan.as_json, indent=1, sort_keys=True) + "\n"
        self.check(plan.as_json)
        self.folder.mkdir(parents=True, exist_ok=True)
        lock = os.open(self.folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise InputError(
                    f"{self.folder}: another process is flying this campaign; wait, or give another name"
                ) from None
            self._sweep()
            if not (self.folder / PLAN).exists() or plan_in(self.folder) != json.loads(plan_text):
                _write_text(self.folder / PLAN, plan_text)
            yield self
        finally:
            os.close(lock)

    def check(self, plan: dict[str, Any]) -> None:
        """InputError unless the folder is new, or holds at most records, or is this plan's."""
        if not self.folder.exists():
            return
        there = {path.name for path in self.folder.iterdir()} - {LOCK}
        if not (self.folder / PLAN).is_file():
            if any(not name.endswith(".part") for name in there - {RECORDS}):
                raise InputError(f"{self.folder}: is there and holds no campaign; give another name")
            return
        known = plan_in(self.folder)
        for key, what in (("flownav", "version of flownav"), ("code_sha256", "code of flownav")):
            if known.get(key) != plan[key]:
                raise InputError(f"{self.folder}: was flown by another {what}; give another name, or move it away")
        asked = json.loads(json.dumps(plan))
        differs = [key for key in plan if known.get(key) != asked[key]]
        if differs and not _is_more_of(known, asked, differs):
            raise InputError(
                f"{self.folder}: holds another campaign (other {', '.join(differs)}); give another name, or move it "
                f"away (a plain campaign without {arg('until')} may be given more flights, and goes on)"
            )

    def _sweep(self) -> None:
        """Remove what a killed process has left half-written."""
        for path in (*self.folder.glob(".*.part"), *self.folder.glob("*/.*.part"), *self.folder.glob("*/*/.*.part")):
            path.unlink(missing_ok=True)

    def path_of(self, cell: int, part: int) -> Path:
        """Where the flights of a part lie."""
        return part_path(self.folder, cell, part)

    def kept(self, cell: int, part: int, flights: int) -> Kept | None:
        """A part's rows, where it has `flights` flights; None where it is not there, or has fewer.

        DamagedError where it is not as it was written.
        """
        path = self.path_of(cell, part)
        if not path.exists():
            return None
        found = read_part(path)
        rows = len(found.table)
        if rows < flights:
            return None
        if rows > flights:
            raise DamagedError(f"it has {rows} flights, not {flights}")
        return Kept(rows_of_table(found.table), found.before, found.last)

    def require_no_more(self, cell: int, parts: int) -> None:
        """InputError where a cell's folder has flights that are not the plan's, which has `parts` parts."""
        known = [part_path(self.folder, cell, number) for number in range(parts)]
        strange = next((path for path in Dataset(self.folder).parts(cell) if path not in known), None)
        if strange is not None:
            raise InputError(f"{strange}: holds flights that this campaign has not; move it away")

    def write(self, cell: int, part: int, table: Any, before: bytes) -> bytes:
        """Keep a part whose first row follows this digest; the digest of its last."""
        with written_whole(self.path_of(cell, part)) as temporary:
            return write_part(temporary, table, before, texts=["verdict", "limited_by"])

    def begun_path(self, cell: int, part: int) -> Path:
        """Where the first flights of a part lie while it is being flown."""
        return part_path(self.folder, cell, part, "begun")

    def begun(self, cell: int, part: int) -> Kept | None:
        """The saved rows of a part that is not complete; None without any. DamagedError where the file is not as it was
        written.
        """
        path = self.begun_path(cell, part)
        if not path.exists():
            return None
        found = read_part(path)
        if found.table.column_names != list(ROW_COLUMNS):
            raise DamagedError("it has other columns")
        return Kept(rows_of_table(found.table), found.before, found.last)

    def write_begun(self, cell: int, part: int, rows: Array, before: bytes) -> None:
        """Save the scores of a part's first flights, which follow this digest, (flights, len(ROW_COLUMNS))."""
        with written_whole(self.begun_path(cell, part)) as temporary:
            write_part(temporary, arrow_columns.table_of(dict(zip(ROW_COLUMNS, rows.T, strict=True))), before)

    def forget_begun(self, cell: int, part: int) -> None:
        """Remove what was saved of a part that is now there."""
        self.begun_path(cell, part).unlink(missing_ok=True)

    def keep_text(self, name: str, text: str) -> Path:
        """Keep a text beside the flights."""
        return _write_text(self.folder / name, text)


def part_path(folder: Path, cell: int, part: int, kind: str = "part") -> Path:
    """Where the flights of a part lie."""
    return folder / FLIGHTS / f"cell-{cell:03d}" / f"{kind}-{part:05d}.parquet"


class Dataset:
    """The flights of a campaign's folder, a column at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def parts(self, cell: int) -> list[Path]:
        """The files of a cell, in the order of its flights."""
        found = (self.folder / FLIGHTS / f"cell-{cell:03d}").glob("part-*.parquet")
        return sorted(
            (path for path in found if PART_NAME.fullmatch(path.name)), key=lambda path: (len(path.name), path.name)
        )

    def table(self, cell: int, columns: list[str] | None = None) -> Any:
        """A cell's flights as an Arrow table, flight by flight."""
        import pyarrow as pa

        tables = [self._read(path, columns) for path in self.parts(cell)]
        return pa.concat_tables(tables).unify_dictionaries() if tables else pa.table({})

    def column(self, cell: int, name: str) -> NDArray[Any]:
        """One column of a cell, (flights,)."""
        return as_numpy(self.table(cell, [name]).column(name))

    def rows(self, cell: int) -> Array:
        """The scores of a cell, (flights, len(ROW_COLUMNS)): flights in order."""
        return rows_of_table(self.table(cell, list(ROW_COLUMNS)))

    def scores(self, cell: int) -> Array:
        """Scores of the flights, (flights, len(SCORE_COLUMNS))."""
        return self.rows(cell)[:, : len(SCORE_COLUMNS)]

    def _read(self, path: Path, columns: list[str] | None) -> Any:
        """A file's columns; all but the digests where none are named. InputError where it is not as it was written."""
        try:
            table = read_part(path).table
        except DamagedError as error:
            raise InputError(f"{path}: is damaged ({error}); the command that flew it flies it again") from None
        return table if columns is None else table.select(columns)


def rows_of_table(table: Any) -> Array:
    """The scores of a table's flights, (flights, len(ROW_COLUMNS))."""
    return np.column_stack([as_numpy(table.column(name)) for name in ROW_COLUMNS])


def _is_more_of(known: dict[str, Any], asked: dict[str, Any], differs: list[str]) -> bool:
    """Whether a plan is a known one with more flights, each of which is independent of how many there are."""
    if differs != ["flights"] or asked["sampling"] != "plain" or asked["until"]:
        return False
    return isinstance(known["flights"], int) and known["flights"] < asked["flights"]


def plan_in(folder: Path) -> dict[str, Any]:
    """The plan in a campaign's folder. InputError where it cannot be read."""
    return object_in(folder / PLAN, "give a campaign's folder, or another name")


def _write_text(path: Path, text: str) -> Path:
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
    return path


# -- a flight as a row -------------------------------------------------------------------------------------------
INPUT = "input."  # before the name of a dispersed number
SWEPT = "set."  # before the name of what the campaign sweeps


def limited_by(row: Array) -> str:
    """The reason that limited a flight: its failures, or the largest part of its touchdown error."""
    landing = touchdown_rows(row[None, : len(SCORE_COLUMNS)])[0]
    if broken := names_of(landing[BROKEN]):
        return ", ".join(broken)
    parts = {name: float(measured(f"touchdown.{name}", row[None, :])[0]) for name in LIMITED_BY}
    if not np.isfinite(list(parts.values())).all():
        return verdict_of(landing)
    return max(parts, key=lambda name: parts[name]).removesuffix("_m")


def table_of(cell: int, values: dict[str, Any], first: int, rows: Array, inputs: Mapping[str, Sequence[float]]) -> Any:
    """The rows of flights from number `first` on as an Arrow table."""
    import pyarrow as pa

    landings = touchdown_rows(rows[:, : len(SCORE_COLUMNS)])
    count = len(rows)
    swept = {
        name: words([value] * count) if isinstance(value, str) else numbers(np.full(count, float(value)))
        for name, value in values.items()
    }
    names = {
        "cell": numbers(np.full(count, cell, np.int32)),
        "flight": numbers(np.arange(first, first + count, dtype=np.int64)),
        **{f"{SWEPT}{name}": column for name, column in swept.items()},
        "verdict": words([verdict_of(row) for row in landings]),
        "limited_by": words([limited_by(row) for row in rows]),
        **{name: numbers(rows[:, i]) for i, name in enumerate(ROW_COLUMNS)},
        **{f"{INPUT}{name}": numbers(np.asarray(drawn, float)) for name, drawn in inputs.items()},
    }
    return pa.table(names)
