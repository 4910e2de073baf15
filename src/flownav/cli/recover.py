"""`flownav recover`: the record of a live session that was killed, from its journal."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flownav.cli import options
from flownav.cli.options import out_option
from flownav.cli.output import emit


def command(
    journal: Annotated[
        Path,
        typer.Argument(metavar="FILE.fnr.journal", help="What a killed `flownav live` left.", show_default=False),
    ],
    out: Annotated[Path | None, out_option("The record", "FILE.fnr")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Make the record of a live session that was killed, or could not write it; the journal stays."""
    from flownav.cli.output import require_recordable, told
    from flownav.core.errors import InputError, VerdictError
    from flownav.core.free_names import free_name
    from flownav.live.journal_place import is_locked, journal_of
    from flownav.live.recovery import recovered
    from flownav.logs.journal import SUFFIX

    if not journal.exists() and journal_of(journal).exists():
        journal = journal_of(journal)
    if is_locked(journal):
        raise InputError(f"{journal}: its session still records; end that, and it writes the record itself")
    asked = out or (journal.with_suffix("") if journal.suffix == SUFFIX else journal.with_suffix(".fnr"))
    require_recordable(asked, journal, force=force)
    path = asked if force else told(asked, free_name(asked))
    found = recovered(journal)
    try:
        found.record.save(path, replacing=force)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another --out") from error
    facts = {
        "record": str(path),
        "journal": str(journal),
        "duration_s": found.record.manifest["duration_s"],
        **{name: getattr(found, name) for name in found._fields if name != "record"},
    }
    if as_json:
        emit(facts)
    else:
        how = "the session came to its end" if found.ended else "the session was cut off"
        typer.echo(f"{facts['duration_s']:.1f} s in {found.blocks} blocks; {how}")
        if found.torn_bytes:
            typer.echo(f"At the end {found.torn_bytes} bytes of a block that was not written whole are left out")
        typer.echo(f"Record: {path} ({journal} is no longer needed)")
    if found.lost_blocks:
        raise VerdictError(
            f"{journal}: {found.lost_blocks} damaged blocks ({found.lost_bytes} bytes) in its middle are missing from "
            "the record; from there on a replay differs from what was flown"
        )
