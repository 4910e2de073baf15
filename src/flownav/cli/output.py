"""What every command says the same way: progress on standard error, numbers held to their range."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
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
    from flownav.core.guard import an_input

    read = [an_input(Path(each)) for each in inputs if each is not None]
    found = a_place(path, read, force=force, beside=beside)
    _require_place(path)
    return told(path, found)


def several_place(path: Path, *inputs: str | Path | None, force: bool) -> Path:
    """The same of files that are called after a path: NAME_estimate.tum, NAME_truth.tum, ..."""
    from flownav.core.free_names import a_place_of_several
    from flownav.core.guard import an_input

    found = a_place_of_several(path, [an_input(Path(each)) for each in inputs if each is not None], force=force)
    _require_place(path)
    return told(path, found)


def folder_place(path: Path, *inputs: str | Path | None, force: bool | None = None) -> Path:
    """The same of a folder, which is new or empty; with force it is as it is, for its writer to look into.

    force: None where the command replaces no folder.
    """
    from flownav.core.free_names import a_folder_place
    from flownav.core.guard import an_input

    for each in inputs:
        if each is not None:
            an_input(Path(each))
    found = a_folder_place(path, force=bool(force))
    _require_place(path)
    return told(path, found, replaces=force is not None)


def record_place(path: Path, *inputs: str | Path | None, force: bool, report: bool) -> Path:
    """The same of a record and of its report beside it. InputError where the report would replace the record."""
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
    from flownav.core.guard import a_record_place, an_input

    a_record_place(path, [an_input(Path(each)) for each in inputs if each is not None], force=force)
    _require_place(path)


def _require_place(path: Path) -> None:
    """InputError where no file can be made in the folder that a path lies in, or in the nearest that is there."""
    there = next((parent for parent in path.absolute().parents if parent.exists()), path.absolute().parent)
    try:
        with TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another --out") from error


def page_of(record: Path, *, report: bool) -> Path | None:
    """Where the report of a record lies; None where none is asked for. InputError where it would replace the record."""
    page = record.with_suffix(".html")
    if report and page == record:
        raise InputError(f"--out {record}: the report would replace the record; name it .fnr")
    return page if report else None


def save(record: Record, path: Path, *, report: bool) -> dict[str, str]:
    """Write a record and, if asked, its report beside it; where they lie. InputError where that cannot be."""
    page = page_of(path, report=report)
    try:
        record.save(path)
        if page is not None:
            from flownav.report.html import write_report

            write_report(record, page)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another --out") from error
    return {"record": str(path), **({"report": str(page)} if page else {})}


def autopilot_errors(scores: dict[str, Any]) -> str:
    """The errors of an autopilot's own estimate (scoring/autopilot) in words, where it was compared with anything."""
    against = {"truth": "the reference, turned and shifted onto it", "gps": "GPS, mean difference taken out"}
    velocity = "" if scores["velocity_rms_m_s"] is None else f"; velocity {scores['velocity_rms_m_s']:.3f} m/s rms"
    return (
        f"against {against[scores['against']]}: horizontal {scores['horizontal_rms_m']:.2f} m rms, "
        f"{scores['horizontal_max_m']:.2f} m max; vertical {scores['vertical_rms_m']:.2f} m rms{velocity}"
    )
