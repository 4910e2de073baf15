"""`flownav report`: a record as one HTML page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer


def command(
    record: Annotated[Path, typer.Argument(help="The record that fly, replay or live wrote.", show_default=False)],
    out: Annotated[
        Path | None, typer.Option("--out", help="Where the page goes; beside the record where unsaid.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Write a record's report: figures, scores, events and provenance in one HTML file that works offline."""
    from flownav.cli.output import require_writable
    from flownav.errors import InputError
    from flownav.record import Record
    from flownav.report.html import write_report

    page = out or record.with_suffix(".html")
    if page.resolve() == record.resolve():
        raise InputError(f"{page}: the report would replace its own record; give another --out")
    require_writable(page, record)
    flown = Record.load(record)
    try:
        write_report(flown, page)
    except OSError as error:
        raise InputError(f"{page}: the report cannot be written ({error.strerror}); give another --out") from error
    if as_json:
        typer.echo(json.dumps({"record": str(record), "report": str(page)}))
    else:
        typer.echo(f"Report: {page}")
