"""`flownav tune`: settings of the filter proposed from logs, judged on windows held out from the fit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import out_option
from flownav.cli.tables import Column, answer, say, say_files, table_of

if TYPE_CHECKING:
    from flownav.studies.tuning.job import OfLog, Tuned

FILE = "The settings file, written only if the proposal is accepted"
PROPOSED = (
    Column("setting", "key"),
    Column("was", "default", "g"),
    Column("tuned", "value", "g"),
    Column("95 % interval", lambda row: f"{row['low']:g} to {row['high']:g}"),
)
LOGS = (
    Column("log", "log"),
    Column("windows", lambda log: _windows(log)),
    Column("against", "against"),
    Column("was", lambda log: _with_unit(log, "median_error")),
    Column("tuned", lambda log: _with_unit(log, "median_error_tuned")),
)


def command(
    logs: options.Logs,
    settings: options.Settings = None,
    sensor: options.Sensor = None,
    out: Annotated[Path | None, out_option(FILE, "out/settings.toml")] = None,
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
    answer(facts, as_json, lambda: _show(tuned, facts))


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


def _show(tuned: Tuned, facts: dict[str, Any]) -> None:
    """The same figures for people."""
    from flownav.studies.tuning.settings_file import gain_words

    if tuned.proposed:
        say(table_of(PROPOSED, facts["settings"], title="Proposed"))
    say(table_of(LOGS, facts["logs"], title="Median error in the held-out windows"))
    judgement = tuned.judgement
    figures = f": {gain_words(judgement.error)}" if judgement.error is not None else ""
    say(f"{judgement.verdict.capitalize()}: {judgement.why}{figures}", soft=True)
    say_files({"settings": facts["file"]}, ("settings",))


def _windows(log: dict[str, Any]) -> str:
    fit = "all held out" if log["held_out_whole"] else f"fit on {len(log['fit_windows'])}"
    return f"{len(log['held_out_windows'])}, {fit}"


def _with_unit(log: dict[str, Any], key: str) -> str:
    return "-" if log[key] is None else f"{log[key]:.3f} {log['unit'] or ''}"
