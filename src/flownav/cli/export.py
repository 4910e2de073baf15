"""`flownav export`: a record in the formats that other tools read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flownav.cli import options
from flownav.cli.options import FORMATS, one_of, option, out_option
from flownav.cli.output import emit

FRAME = "The frame of tum and euroc: ned (body FRD), enu (body FLU)."
FrameOption = Annotated[str | None, typer.Option(help=FRAME, show_default="ned", **one_of("ned", "enu"))]
MergeOption = Annotated[
    Path | None, option("ORIGINAL.ulg", "With ulog: into a copy of the log that was replayed.", "--merge")
]
OriginOption = Annotated[
    str | None, option("LAT,LON,ALT", "With kml, gpx: where the record's origin lies [deg, m].", "--origin")
]


def command(
    record: options.Record,
    to: Annotated[str, typer.Option("--to", help="The format.", show_default=False, **one_of(*FORMATS))],
    out: Annotated[Path | None, out_option("The file, or the folder of parquet and csv", "beside the record")] = None,
    force: options.Force = False,
    frame: FrameOption = None,
    merge: MergeOption = None,
    origin: OriginOption = None,
    as_json: options.Json = False,
) -> None:
    """Write a record for other tools: Foxglove, evo, spreadsheets, data frames, PlotJuggler, Google Earth, maps."""
    from flownav.cli.output import folder_place, place, several_place
    from flownav.core.errors import InputError
    from flownav.core.record import Record
    from flownav.export.earth import origin_from
    from flownav.export.formats import FOLDERS, FRAMED, destination, export, written_files

    path = destination(record, to, out)
    if to in FOLDERS:
        path = folder_place(path, record, merge)
    elif to in FRAMED:
        path = several_place(path, record, force=force)
    else:
        beside = [each.name.removeprefix(path.stem) for each in written_files(to, path) if each != path]
        path = place(path, record, merge, force=force, beside=beside)
    about = None if origin is None else origin_from(origin)
    flown = Record.load(record)
    try:
        written = export(flown, to, path, frame, merge, about)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another --out") from error
    if as_json:
        files = [str(file) for file in written.files]
        emit({"record": str(record), "format": to, "files": files, "notes": written.notes})
        return
    for file in written.files:
        typer.echo(f"Written: {file}")
    for note in written.notes:
        typer.echo(f"Note: {note}")
