"""`flownav view`: a record in Rerun's viewer, or as a file for it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flownav.cli import options
from flownav.cli.options import out_option
from flownav.cli.output import emit


def command(
    record: options.Record,
    out: Annotated[
        Path | None,
        out_option("A file for Rerun (.rrd) instead of a window", "none is written; without a display RECORD.rrd"),
    ] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Show a record in Rerun: vehicle, pad, cameras, flow, paths and standard deviations in space, errors over time.

    Without --out a window opens; on a machine without a display the file is written beside the record instead.
    """
    from flownav.cli.output import place
    from flownav.core.errors import InputError
    from flownav.core.record import Record
    from flownav.export.viewing.view import SUFFIX, has_display, show, write_rrd

    beside = out is None and not has_display()
    path = record.with_suffix(SUFFIX) if beside else out
    if path is not None:
        path = path if path.suffix == SUFFIX else path.with_name(path.name + SUFFIX)
        path = place(path, record, force=force)
    flown = Record.load(record)
    try:
        notes = show(flown, record.stem) if path is None else write_rrd(flown, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another --out") from error
    if as_json:
        written = None if path is None else str(path)
        emit({"record": str(record), "file": written, "window": path is None, "notes": notes})
        return
    if path is None:
        typer.echo(f"Opened in Rerun: {record}")
    elif beside:
        typer.echo(f"No display here, so no window: written {path}; `rerun {path}` opens it where there is one")
    else:
        typer.echo(f"Written: {path}")
    for note in notes:
        typer.echo(f"Note: {note}")
