"""The output that all commands share: progress, where files go, one JSON object or tables, each described once.

A column of a table is its title, its key in the row, and how its figure is written.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

from flownav.core.errors import InputError
from flownav.core.text import harmless, interval_words

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress
    from rich.table import Table

    from flownav.core.record import Record


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar on standard error; the value is called with how many more are done."""
    with _bar() as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.advance(task, done)


@contextmanager
def stages(what: str, total: int) -> Iterator[Callable[[str], None]]:
    """A progress bar over stages on standard error; the value is called with the name of each as it begins."""
    begun = count()
    with _bar() as bar:
        task = bar.add_task(what, total=total)
        yield lambda name: bar.update(task, completed=next(begun), description=f"{what} {name}")


def _bar() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(20), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=Console(stderr=True), transient=True)


def emit(facts: Mapping[str, Any], schema: int = 1) -> None:
    """Print a command's one JSON object, with the number of its schema (`flownav schema`)."""
    typer.echo(json.dumps({"schema": schema, **facts}))


def require_between(option: str, value: float, low: float, high: float) -> None:
    """InputError where an option's number is out of range."""
    if not low <= value <= high:
        raise InputError(f"{option} {value}: must be from {low} to {high}")


def place(path: Path, *inputs: str | Path | None, force: bool, beside: Sequence[str] = ()) -> Path:
    """Where a file is written: at `path`, or under the next free number where something is there, reported on stderr.

    inputs: the files that the run reads (None for an option that is not given; a name that is no path does no harm).
    beside: suffixes of files written next to it. force: an existing file is replaced, if flownav wrote it. InputError,
    before the work is done, where nothing must or can be put there.
    """
    from flownav.core.free_names import a_place

    found = a_place(path, _read(inputs), force=force, beside=beside)
    require_place(path)
    return named_place(path, found)


def _read(inputs: Iterable[str | Path | None]) -> list[Path]:
    """The files that a run reads, looked for. InputError where one is none to read."""
    from flownav.core.guard import an_input

    return [an_input(Path(each)) for each in inputs if each is not None]


def several_place(path: Path, *inputs: str | Path | None, force: bool) -> Path:
    """Where files lie that are called after a path: NAME_estimate.tum, NAME_truth.tum, ... As `place`."""
    from flownav.core.free_names import a_place_of_several

    found = a_place_of_several(path, _read(inputs), force=force)
    require_place(path)
    return named_place(path, found)


def folder_place(path: Path, *inputs: str | Path | None, force: bool | None = None) -> Path:
    """Where a folder lies, which is new or empty; with force it is as it is, for its writer to look into. As `place`.

    force: None where the command replaces no folder.
    """
    from flownav.core.free_names import a_folder_place

    _read(inputs)
    found = a_folder_place(path, force=bool(force))
    require_place(path)
    return named_place(path, found, replaces=force is not None)


def record_place(path: Path, *inputs: str | Path | None, force: bool, report: bool) -> Path:
    """Where a record lies, and its report beside it. InputError as `place`, and where the report would replace it."""
    page = page_of(path, report=report)
    return place(path, *inputs, force=force, beside=() if page is None else (page.suffix,))


def named_place(asked: Path, found: Path, *, replaces: bool = True) -> Path:
    """The path that is written; printed on stderr where it is not the one that was asked for."""
    if found != asked:
        how = " (--force replaces it)" if replaces else ""
        print(f"flownav: {asked} is there already{how}; writing {found}", file=sys.stderr)
    return found


def require_recordable(path: Path, *inputs: str | Path | None, force: bool) -> None:
    """InputError where a live session's record cannot be put there; the recorder numbers it."""
    from flownav.core.guard import a_record_place

    a_record_place(path, _read(inputs), force=force)
    require_place(path)


def require_place(path: Path) -> None:
    """InputError where no file can be made in the folder that a path lies in, or in the nearest that is there."""
    there = next((parent for parent in path.absolute().parents if parent.exists()), path.absolute().parent)
    with writing(path), TemporaryFile(dir=there):
        pass


def page_of(record: Path, *, report: bool) -> Path | None:
    """Where the report of a record lies; None where none is asked for. InputError where it would replace the record."""
    page = record.with_suffix(".html")
    if report and page == record:
        raise InputError(f"--out {record}: the report would replace the record; name it .fnr")
    return page if report else None


def save(record: Record, path: Path, *, report: bool) -> dict[str, str]:
    """Write a record and, if asked, its report beside it; where they lie. InputError where that cannot be."""
    page = page_of(path, report=report)
    with writing(path):
        record.save(path)
        if page is not None:
            from flownav.report.html import write_report

            write_report(record, page)
    return {"record": str(path), **({"report": str(page)} if page else {})}


@contextmanager
def writing(path: Path, what: str = "") -> Iterator[None]:
    """InputError where what is done within it cannot be written. what: is written, before "cannot"."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: {what}cannot be written ({error.strerror}); give another --out") from error


Row = Mapping[str, Any]


class Column(NamedTuple):
    """A column of a table whose rows are facts, as the JSON object has them.

    key: of the fact, or what makes the cell of a row. form: how a number is written; scale: times what it is.
    """

    title: str
    key: str | Callable[[Any], str]
    form: str = ""
    scale: float = 1.0

    def cell(self, row: Any) -> str:
        """The text of a row's cell."""
        return self.key(row) if callable(self.key) else figure(row[self.key], self.form, self.scale)


def figure(value: Any, form: str = ".2f", scale: float = 1.0) -> str:
    """A figure as tables have it: a dash where there is none, words as they are."""
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value if scale == 1.0 else scale * value:{form}}"


def with_ends(value: float | None, ends: Iterable[float | None], join: str = "-", form: str = ".3f") -> str:
    """A figure with its interval in brackets; a dash where there is none, "at least" where the upper end is open."""
    if value is None:
        return "-"
    low, high = ends
    return f"{value:{form}} ({interval_words(low, high, form, join)})"


def table(
    heads: Sequence[str], rows: Iterable[Sequence[str]] = (), *, left: int | None = None, fixed: int = 0, **look: Any
) -> Table:
    """A table. left: how many columns stand to the left, the others to the right (None: all); fixed: never broken."""
    from rich.table import Table

    made = Table(**look)
    for k, head in enumerate(heads):
        made.add_column(head, justify="left" if left is None or k < left else "right", no_wrap=k < fixed)
    for row in rows:
        made.add_row(*map(harmless, row))
    return made


def table_of(columns: Sequence[Column], rows: Iterable[Any], **look: Any) -> Table:
    """A table of facts by the description of its columns."""
    return table([column.title for column in columns], ([c.cell(row) for c in columns] for row in rows), **look)


def plain_look(*, edge: bool = True) -> dict[str, Any]:
    """A line under the heads and no other; without an edge the columns stand close."""
    from rich.box import SIMPLE_HEAD

    return {"box": SIMPLE_HEAD} | ({} if edge else {"show_edge": False, "padding": (0, 1, 0, 0)})


def say(*things: Any, wide: int = 0, soft: bool = False) -> None:
    """Print tables and lines. soft: long lines are not broken.

    On a terminal, and where COLUMNS gives a width, tables fit its width; into a file or a pipe things have
    `wide` columns at least.
    """
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, highlight=False)
    known = console.is_terminal or bool(os.environ.get("COLUMNS"))
    if wide and not known:
        console.width = max(console.width, wide)
    for thing in things:
        for part in fitted(thing, console) if isinstance(thing, Table) and known else (thing,):
            console.print(harmless(part) if isinstance(part, str) else part, soft_wrap=soft)


LEAST_WORDS = 20  # columns that a column of words is not made narrower than


def fitted(made: Table, console: Console) -> Iterator[Table]:
    """A table in the console's width: as it is where it fits, or with broken heads and words, or else its columns in
    tables one under the other, each of which begins with the first column, or with all the first that are fixed.
    """
    from rich.measure import Measurement

    if Measurement.get(console, console.options.update(max_width=10_000), made).maximum <= console.width:
        yield made
        return

    def too_wide(chosen: list[int]) -> bool:
        part = _with_columns(made, chosen)
        return Measurement.get(console, console.options.update(max_width=10_000), part).minimum > console.width

    fixed = next((k for k, column in enumerate(made.columns) if not column.no_wrap), 0)
    keys = list(range(max(fixed, 1)))
    chosen, title = keys, made.title
    for k in range(len(keys), len(made.columns)):
        if len(chosen) > len(keys) and too_wide([*chosen, k]):
            yield _with_columns(made, chosen, title)
            chosen, title = keys, None
        chosen = [*chosen, k]
    yield _with_columns(made, chosen, title)


def _with_columns(made: Table, chosen: list[int], title: Any = None) -> Table:
    """Some columns of a table: heads are broken between words, figures never, words to LEAST_WORDS."""
    from textwrap import wrap

    names = ("box", "show_edge", "padding", "title_justify")
    frame: dict[str, Any] = {name: getattr(made, name) for name in names}
    part = type(made)(**frame, title=title)
    for k in chosen:
        column, cells = made.columns[k], [str(cell) for cell in made.columns[k].cells]
        lines = [line for cell in cells for line in cell.splitlines()]
        longest, word = (max(map(len, parts), default=0) for parts in (lines, " ".join(lines).split()))
        broken = column.justify == "left" and longest > LEAST_WORDS and not column.no_wrap
        head = wrap(str(column.header), max(longest, 1), break_long_words=False)
        least = max(LEAST_WORDS, word) if broken else max(longest, *map(len, head), 1)
        part.add_column(
            "\n".join(head), justify=column.justify, style=column.style, min_width=least, no_wrap=not broken
        )
    for row in zip(*(made.columns[k].cells for k in chosen), strict=True):
        part.add_row(*row)
    return part


def by_reason(pairs: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The names that share a reason in one text, and the reason, from pairs of a name and its reason."""
    names: dict[str, list[str]] = {}
    for name, why in pairs:
        names.setdefault(why, []).append(name)
    return [(", ".join(shared), why) for why, shared in names.items()]


def say_files(written: Mapping[str, Any], names: Iterable[str]) -> None:
    """Where what was written lies, a line a file."""
    for name in names:
        if written.get(name):
            say(f"{name.capitalize()}: {written[name]}", soft=True)


def answer(facts: Mapping[str, Any], as_json: bool, show: Callable[[], object]) -> None:
    """Print the facts as the one JSON object that was asked for, or show them to people."""
    if as_json:
        emit(facts)
    else:
        show()
