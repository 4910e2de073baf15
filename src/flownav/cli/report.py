"""`flownav report`: a record as one HTML page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flownav.cli import options
from flownav.cli.options import out_option
from flownav.cli.output import emit


def command(
    record: options.Record,
    out: Annotated[Path | None, out_option("The page (HTML)", "RECORD.html, beside the record")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Write a record's report: figures, scores, events and provenance in one HTML file that works offline."""
    from flownav.cli.output import place
    from flownav.core.errors import InputError
    from flownav.core.record import Record
    from flownav.report.html import write_report

    page = out or record.with_suffix(".html")
    if page.resolve() == record.resolve():
        raise InputError(f"{page}: the report would replace its own record; give another --out")
    page = place(page, record, force=force)
    flown = Record.load(record)
    try:
        write_report(flown, page)
    except OSError as error:
        raise InputError(f"{page}: the report cannot be written ({error.strerror}); give another --out") from error
    if as_json:
        emit({"record": str(record), "report": str(page)})
    else:
        typer.echo(f"Report: {page}")
