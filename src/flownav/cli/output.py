"""What every command says the same way: progress on standard error, numbers held to their range."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
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


def require_writable(path: Path) -> None:
    """InputError where a file cannot be put there; asked before the work is done, not after."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another --out") from error
    if path.is_dir() or not os.access(path.parent, os.W_OK):
        raise InputError(f"{path}: cannot be written; give another --out")


def save(record: Record, path: Path, *, report: bool) -> dict[str, str]:
    """Write a record and, if asked, its report beside it; where they lie. InputError where that cannot be."""
    page = path.with_suffix(".html")
    if report and page == path:
        raise InputError(f"--out {path}: the report would replace the record; name it .fnr")
    try:
        record.save(path)
        if report:
            from flownav.report.html import write_report

            write_report(record, page)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another --out") from error
    return {"record": str(path), **({"report": str(page)} if report else {})}


def autopilot_errors(scores: dict[str, Any]) -> str:
    """The errors of an autopilot's own estimate (scoring/autopilot) in words, where it was compared with anything."""
    against = {"truth": "the reference, turned and shifted onto it", "gps": "GPS, mean difference taken out"}
    velocity = "" if scores["velocity_rms_m_s"] is None else f"; velocity {scores['velocity_rms_m_s']:.3f} m/s rms"
    return (
        f"against {against[scores['against']]}: horizontal {scores['horizontal_rms_m']:.2f} m rms, "
        f"{scores['horizontal_max_m']:.2f} m max; vertical {scores['vertical_rms_m']:.2f} m rms{velocity}"
    )
