"""`flownav export`: a record in the formats that other tools read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

FORMAT_HELP = "mcap, foxglove (mcap with a layout), tum, euroc, parquet, csv, ulog, kml or gpx."


def command(
    record: Annotated[Path, typer.Argument(help="The record that fly or replay wrote.", show_default=False)],
    to: Annotated[
        str,
        typer.Option(
            "--to",
            help=FORMAT_HELP,
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", help="The file, or folder for parquet and csv; beside the record where unsaid."),
    ] = None,
    frame: Annotated[
        str | None, typer.Option("--frame", help="tum, euroc: ned (body FRD; where unsaid) or enu (body FLU).")
    ] = None,
    merge: Annotated[
        Path | None,
        typer.Option("--merge", metavar="ORIGINAL.ulg", help="ulog: into a copy of the log that was replayed."),
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option("--origin", metavar="LAT,LON,ALT", help="kml, gpx: where the record's origin lies (deg, m)."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Write a record for other tools: Foxglove, evo, spreadsheets, data frames, PlotJuggler, Google Earth, maps."""
    from flownav.cli.output import require_writable, require_writable_folder
    from flownav.errors import InputError
    from flownav.export.earth import origin_from
    from flownav.export.formats import FOLDERS, destination, export, written_files
    from flownav.record import Record

    path = destination(record, to, out)
    if to in FOLDERS:
        require_writable_folder(path, record, merge)
    else:
        for one in written_files(to, path):
            require_writable(one, record, merge)
    about = None if origin is None else origin_from(origin)
    flown = Record.load(record)
    try:
        written = export(flown, to, path, frame, merge, about)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another --out") from error
    if as_json:
        files = [str(file) for file in written.files]
        typer.echo(json.dumps({"record": str(record), "format": to, "files": files, "notes": written.notes}))
        return
    for file in written.files:
        typer.echo(f"Written: {file}")
    for note in written.notes:
        typer.echo(f"Note: {note}")
