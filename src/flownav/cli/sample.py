"""`flownav sample`: small simulated logs in the formats that vehicles write, to try every other command on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import SAMPLES, argument, out_option, switch, words
from flownav.cli.output import emit
from flownav.cli.tables import answer

if TYPE_CHECKING:
    from flownav.export.samples.writing import Written


def command(
    kinds: Annotated[list[str] | None, argument("KIND", "Which samples", *SAMPLES, default="all of them")] = None,
    list_only: Annotated[bool, switch("Only say what there is; write nothing.", "--list")] = False,
    out: Annotated[Path | None, out_option("The folder to write into", "samples")] = None,
    seed: options.RigSeed = 1,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Write sample logs: a simulated flight in the formats of PX4, ArduPilot, MAVLink and CSV, a rig, and a record."""
    from importlib.util import find_spec

    from flownav.core.errors import InputError
    from flownav.export.samples.kinds import SAMPLES as MADE
    from flownav.export.samples.kinds import sample_of
    from flownav.export.samples.writing import write_samples

    folder = out or Path("samples")
    asked = [sample_of(kind) for kind in (words("KIND", kinds) if kinds else [])]
    if list_only:
        _list(as_json=as_json)
        return
    has_mavlink = find_spec("pymavlink") is not None
    left_out = [s for s in MADE if s.uses and not has_mavlink]
    if unmade := [sample.kind for sample in asked if sample in left_out]:
        raise InputError(f"{unmade[0]}: needs pymavlink; install it with `pip install 'flownav[live]'`")
    samples = asked or [sample for sample in MADE if sample not in left_out]
    notes = [] if asked else [f"{s.kind} is left out: `pip install 'flownav[{s.uses}]'` adds it" for s in left_out]
    written = write_samples(samples, folder, seed, force=force, on_written=_quiet if as_json else _show)
    if as_json:
        emit({"folder": str(folder), "seed": seed, "samples": _facts(written), "notes": notes})
        return
    for note in notes:
        typer.echo(f"Note: {note}")
    typer.echo(f"{folder / 'README.txt'} says what each holds.")


def _list(*, as_json: bool) -> None:
    from flownav.export.samples.kinds import SAMPLES as MADE

    rows = [{"kind": s.kind, "name": s.name, "what": s.what, "commands": list(s.commands)} for s in MADE]
    said = "\n".join(f"{row['kind']:<10} {row['name']}\n    {row['what']}" for row in rows)
    answer({"samples": rows}, as_json, lambda: typer.echo(said))


def _facts(written: list[Written]) -> list[dict[str, Any]]:
    return [
        {"kind": each.sample.kind, "path": str(each.path), "bytes": each.size_bytes, "state": each.state,
         "what": each.sample.what, "commands": each.commands}
        for each in written
    ]  # fmt: skip


def _quiet(written: Written) -> None:
    """Nothing is said beside the JSON object."""


def _show(written: Written) -> None:
    """A sample, and what to try with it."""
    size = f"{written.size_bytes / 1e6:.1f} MB, {written.state}"
    taken = f"; {written.instead_of} is there already (--force replaces it)" if written.instead_of else ""
    typer.echo(f"{written.path} ({size}{taken})\n  {written.sample.what}")
    for command in written.commands:
        typer.echo(f"    {command}")
