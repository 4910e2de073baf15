"""`flownav tune`: settings of the filter proposed from logs, judged on windows held out from the fit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import out_option
from flownav.cli.output import emit

if TYPE_CHECKING:
    from flownav.studies.tuning.job import OfLog, Tuned


def command(
    logs: options.Logs,
    settings: options.Settings = None,
    sensor: options.Sensor = None,
    out: Annotated[
        Path | None, out_option("The settings file, written only if the proposal is accepted", "out/settings.toml")
    ] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Propose settings from logs: fitted on every other window of the flights, accepted only if the rest gain by it."""
    from flownav.cli.compare import DEFAULT, settings_asked
    from flownav.cli.output import place, progress
    from flownav.core.errors import InputError
    from flownav.core.parameter_files import load
    from flownav.core.provenance import command_line
    from flownav.logs.open_log import open_flight
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.studies.tuning.job import runs_expected, tune
    from flownav.studies.tuning.settings_file import write_settings

    path = out or Path("out/settings.toml")
    if path.suffix != ".toml":
        raise InputError(f"--out {path}: a settings file's name ends in .toml")
    path = place(path, *logs, settings, sensor, force=force)
    (start,) = settings_asked([DEFAULT if settings is None else str(settings)], sensor)
    stated = None if settings is None else load(settings, NavigatorSettingsFile)
    flights = [open_flight(path) for path in logs]
    with progress("replays", runs_expected(flights)) as advance:
        tuned = tune(logs, flights, start.options, start.numbers, advance)
    if tuned.accepted:
        write_settings(path, tuned, stated, command_line())
    facts = _facts(tuned) | {"file": str(path) if tuned.accepted else None}
    if as_json:
        emit(facts)
    else:
        _print(tuned, facts)


def _facts(tuned: Tuned) -> dict[str, Any]:
    """The JSON object, less the file."""
    judgement = tuned.judgement
    return {
        "verdict": judgement.verdict,
        "why": judgement.why,
        "settings": [row._asdict() for row in tuned.proposed],
        "gain_nats": None if judgement.total is None else judgement.total._asdict(),
        "error_gain_nats": None if judgement.error is None else judgement.error._asdict(),
        "logs": [_log_facts(log) for log in tuned.logs],
        "runs": tuned.runs,
    }


def _log_facts(log: OfLog) -> dict[str, Any]:
    from flownav.studies.tuning.scores import UNITS

    return {
        "log": log.name,
        "held_out_whole": log.split.whole,
        "fit_windows": [list(window) for window in log.split.fit],
        "held_out_windows": [list(window) for window in log.split.held],
        "against": log.reference,
        "unit": UNITS.get(log.reference or ""),
        "gain_nats": log.gain,
        "median_error": log.start_error,
        "median_error_tuned": log.error,
    }


def _print(tuned: Tuned, facts: dict[str, Any]) -> None:
    """The same figures for people."""
    from rich.console import Console
    from rich.table import Table

    from flownav.studies.tuning.scores import UNITS
    from flownav.studies.tuning.settings_file import gain_words

    console = Console(markup=False, highlight=False)
    if tuned.proposed:
        table = Table("setting", "was", "tuned", "95 % interval", title="Proposed")
        for row in tuned.proposed:
            table.add_row(row.key, f"{row.default:g}", f"{row.value:g}", f"{row.low:g} to {row.high:g}")
        console.print(table)
    table = Table("log", "windows", "against", "was", "tuned", title="Median error in the held-out windows")
    for log in tuned.logs:
        windows = f"{len(log.split.held)}, {'all held out' if log.split.whole else f'fit on {len(log.split.fit)}'}"
        unit = UNITS.get(log.reference or "", "")
        errors = (f"{value:.3f} {unit}" if value is not None else "-" for value in (log.start_error, log.error))
        table.add_row(log.name, windows, log.reference or "-", *errors)
    console.print(table)
    judgement = tuned.judgement
    figures = f": {gain_words(judgement.error)}" if judgement.error is not None else ""
    console.print(f"{judgement.verdict.capitalize()}: {judgement.why}{figures}", soft_wrap=True)
    if facts["file"] is not None:
        console.print(f"Settings: {facts['file']}", soft_wrap=True)
