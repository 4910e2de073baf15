"""What every command says the same way: progress on standard error, numbers held to their range."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.errors import InputError

if TYPE_CHECKING:
    from flownav.record import Record

VehicleOption = Annotated[
    str | None, typer.Option(help="A vehicle: maxi-joker-3, quad-450, hexa-550, or a file (TOML).")
]


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar on standard error; the value is called with how many more are done."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.advance(task, done)


def require_between(option: str, value: float, low: float, high: float) -> None:
    """InputError where an option's number is out of range."""
    if not low <= value <= high:
        raise InputError(f"{option} {value}: must be from {low} to {high}")


def require_one_of(option: str, value: str, known: Sequence[str]) -> None:
    """InputError where an option is none of the words that it may be."""
    if value not in known:
        raise InputError(f"{option} {value}: must be {', '.join(known[:-1])} or {known[-1]}")


def require_writable(path: Path, *inputs: str | Path | None) -> None:
    """InputError where a file must not or cannot be put there; asked before the work is done, not after.

    inputs: what the run reads (None for an option that is not given; a name that is no path does no harm).
    """
    from flownav.guard import an_input, an_output

    read = [an_input(Path(each)) for each in inputs if each is not None]
    an_output(path, read)
    _require_place(path)


def require_recordable(path: Path, *inputs: str | Path | None, force: bool) -> None:
    """The same of a record that is numbered where one is there, or replaces it."""
    from flownav.guard import a_record_place, an_input

    a_record_place(path, [an_input(Path(each)) for each in inputs if each is not None], force=force)
    _require_place(path)


def require_writable_folder(path: Path, *inputs: str | Path | None) -> None:
    """The same of a folder: a new one, or an empty one."""
    from flownav.guard import an_input, an_output_folder

    for each in inputs:
        if each is not None:
            an_input(Path(each))
    an_output_folder(path)
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


def require_writable_record(path: Path, *inputs: str | Path | None, report: bool) -> None:
    """The same of a record and of its report beside it."""
    page = page_of(path, report=report)
    for output in (path, page):
        if output is not None:
            require_writable(output, *inputs)


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
