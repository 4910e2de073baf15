"""`flownav report`, `view`, `export` and `recover`: what is made of a record, and a record made of a journal."""

from pathlib import Path
from typing import Annotated

import typer

from flownav.cli import options
from flownav.cli.options import chosen, named, option, out_option
from flownav.cli.output import answer, folder_place, named_place, place, require_recordable, several_place, writing
from flownav.core.errors import InputError, VerdictError

NO_FILE = "none is written; without a display RECORD.rrd"

FRAME = "The frame of tum and euroc: ned (body FRD), enu (body FLU)."
MERGE = "With ulog: into a copy of the log that was replayed."
ORIGIN = "With kml, gpx: where the record's origin lies [deg, m]."


def report(
    record: options.Record,
    out: Annotated[Path | None, out_option("The page (HTML)", "RECORD.html, beside the record")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Write a record's report: figures, scores, events and provenance in one HTML file that works offline."""
    from flownav.core.record import Record
    from flownav.report.html import write_report

    page = out or record.with_suffix(".html")
    if page.resolve() == record.resolve():
        raise InputError(f"{page}: the report would replace its own record; give another --out")
    page = place(page, record, force=force)
    flown = Record.load(record)
    with writing(page, "the report "):
        write_report(flown, page)
    answer({"record": str(record), "report": str(page)}, as_json, lambda: typer.echo(f"Report: {page}"))


def view(
    record: options.Record,
    out: Annotated[Path | None, out_option("A file for Rerun (.rrd) instead of a window", NO_FILE)] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Show a record in Rerun: vehicle, pad, cameras, flow, paths and standard deviations in space, errors over time.

    Without --out a window opens; on a machine without a display the file is written beside the record instead.
    """
    from flownav.core.record import Record
    from flownav.export.viewing import SUFFIX, has_display, show, write_rrd

    beside = out is None and not has_display()
    path = record.with_suffix(SUFFIX) if beside else out
    if path is not None:
        path = path if path.suffix == SUFFIX else path.with_name(path.name + SUFFIX)
        path = place(path, record, force=force)
    flown = Record.load(record)
    with writing(path or record):
        notes = show(flown, record.stem) if path is None else write_rrd(flown, path)
    written = None if path is None else str(path)
    if path is None:
        message = f"Opened in Rerun: {record}"
    elif beside:
        message = f"No display here, so no window: written {path}; `rerun {path}` opens it where there is one"
    else:
        message = f"Written: {path}"
    facts = {"record": str(record), "file": written, "window": path is None, "notes": notes}
    answer(facts, as_json, lambda: _echo(message, *(f"Note: {note}" for note in notes)))


def export_to(
    record: options.Record,
    to: Annotated[str, chosen("The format.", *options.FORMATS, flag="--to", unset=False)],
    out: Annotated[Path | None, out_option("The file, or the folder of parquet and csv", "beside the record")] = None,
    force: options.Force = False,
    frame: Annotated[str | None, chosen(FRAME, "ned", "enu", unset="ned")] = None,
    merge: Annotated[Path | None, option("ORIGINAL.ulg", MERGE)] = None,
    origin: Annotated[str | None, option("LAT,LON,ALT", ORIGIN)] = None,
    as_json: options.Json = False,
) -> None:
    """Write a record for other tools: Foxglove, evo, spreadsheets, data frames, PlotJuggler, Google Earth, maps."""
    from flownav.core.record import Record
    from flownav.export.formats import FOLDERS, FRAMED, destination, export, written_files
    from flownav.export.paths import origin_from

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
    with writing(path):
        written = export(flown, to, path, frame, merge, about)
    files = [str(file) for file in written.files]
    message = [*(f"Written: {file}" for file in files), *(f"Note: {note}" for note in written.notes)]
    facts = {"record": str(record), "format": to, "files": files, "notes": written.notes}
    answer(facts, as_json, lambda: _echo(*message))


def recover(
    journal: Annotated[Path, named("FILE.fnr.journal", "The journal that a killed `flownav live` left.")],
    out: Annotated[Path | None, out_option("The record", "FILE.fnr")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Make the record of a live session that was killed, or could not write it; the journal stays."""
    from flownav.core.free_names import free_name
    from flownav.live.recovery import recovered
    from flownav.live.writing import is_locked, journal_of
    from flownav.logs.journal import SUFFIX

    if not journal.exists() and journal_of(journal).exists():
        journal = journal_of(journal)
    if is_locked(journal):
        raise InputError(f"{journal}: its session still records; end that, and it writes the record itself")
    asked = out or (journal.with_suffix("") if journal.suffix == SUFFIX else journal.with_suffix(".fnr"))
    require_recordable(asked, journal, force=force)
    path = asked if force else named_place(asked, free_name(asked))
    found = recovered(journal)
    with writing(path):
        found.record.save(path, replacing=force)
    facts = {
        "record": str(path),
        "journal": str(journal),
        "duration_s": found.record.manifest["duration_s"],
        **{name: getattr(found, name) for name in found._fields if name != "record"},
    }
    how = "the session came to its end" if found.ended else "the session was cut off"
    torn = f"At the end {found.torn_bytes} bytes of a block that was not written whole are left out"
    message = [f"{facts['duration_s']:.1f} s in {found.blocks} blocks; {how}", *([torn] if found.torn_bytes else [])]
    answer(facts, as_json, lambda: _echo(*message, f"Record: {path} ({journal} is no longer needed)"))
    if found.lost_blocks:
        raise VerdictError(
            f"{journal}: {found.lost_blocks} damaged blocks ({found.lost_bytes} bytes) in its middle are missing from "
            "the record; from there on a replay differs from what was flown"
        )


def _echo(*lines: str) -> None:
    for line in lines:
        typer.echo(line)
