"""What every command says the same way: progress on standard error, numbers held to their range."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

import typer

from flownav.core.errors import InputError

if TYPE_CHECKING:
    from flownav.core.record import Record


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar on standard error; the value is called with how many more are done."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.advance(task, done)


def emit(facts: Mapping[str, Any], schema: int = 1) -> None:
    """Print a command's one JSON object, with the number of its schema (`flownav schema`)."""
    typer.echo(json.dumps({"schema": schema, **facts}))


def require_between(option: str, value: float, low: float, high: float) -> None:
    """InputError where an option's number is out of range."""
    if not low <= value <= high:
        raise InputError(f"{option} {value}: must be from {low} to {high}")


def place(path: Path, *inputs: str | Path | None, force: bool, beside: Sequence[str] = ()) -> Path:
    """Where a file is written: at `path`, or under the next free number where something is there, said on stderr.

    inputs: what the run reads (None for an option that is not given; a name that is no path does no harm). beside:
    suffixes of what is written beside it. force: what is there is replaced, if flownav wrote it. InputError, before the
    work is done, where nothing must or can be put there.
    """
    from flownav.core.free_names import a_place

    found = a_place(path, _read(inputs), force=force, beside=beside)
    _require_place(path)
    return told(path, found)


def _read(inputs: Iterable[str | Path | None]) -> list[Path]:
    """The files that a run reads, looked for. InputError where one is none to read."""
    from flownav.core.guard import an_input

    return [an_input(Path(each)) for each in inputs if each is not None]


def several_place(path: Path, *inputs: str | Path | None, force: bool) -> Path:
    """Where files lie that are called after a path: NAME_estimate.tum, NAME_truth.tum, ... As `place`."""
    from flownav.core.free_names import a_place_of_several

    found = a_place_of_several(path, _read(inputs), force=force)
    _require_place(path)
    return told(path, found)


def folder_place(path: Path, *inputs: str | Path | None, force: bool | None = None) -> Path:
    """Where a folder lies, which is new or empty; with force it is as it is, for its writer to look into. As `place`.

    force: None where the command replaces no folder.
    """
    from flownav.core.free_names import a_folder_place

    _read(inputs)
    found = a_folder_place(path, force=bool(force))
    _require_place(path)
    return told(path, found, replaces=force is not None)


def record_place(path: Path, *inputs: str | Path | None, force: bool, report: bool) -> Path:
    """Where a record lies, and its report beside it. InputError as `place`, and where the report would replace it."""
    page = page_of(path, report=report)
    return place(path, *inputs, force=force, beside=() if page is None else (page.suffix,))


def told(asked: Path, found: Path, *, replaces: bool = True) -> Path:
    """The path that is written, which is said where it is not the one that was asked for."""
    if found != asked:
        how = " (--force replaces it)" if replaces else ""
        print(f"flownav: {asked} is there already{how}; writing {found}", file=sys.stderr)
    return found


def require_recordable(path: Path, *inputs: str | Path | None, force: bool) -> None:
    """InputError where a live session's record cannot be put there; the recorder numbers it."""
    from flownav.core.guard import a_record_place

    a_record_place(path, _read(inputs), force=force)
    _require_place(path)


def _require_place(path: Path) -> None:
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


def write_text(path: Path, text: str, newline: str | None = "\n") -> None:
    """Write a text, whole or not at all; what is no text in names of files is written as it is typed."""
    from flownav.core.guard import written_whole

    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace", newline=newline)
