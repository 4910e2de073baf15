"""`flownav compare` and `flownav tune`: many logs by many settings, and settings proposed from logs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import named, option, out_option
from flownav.cli.output import Column, answer, place, plain_look, progress, say, say_files, table, table_of, writing
from flownav.core.errors import InputError

if TYPE_CHECKING:
    from flownav.studies.compare.job import Setting
    from flownav.studies.tuning.job import OfLog, Tuned

DEFAULT = "default"
SHORT_RECORDS = ("against", "horizontal\n[m]", "vertical\n[m]", "velocity\n[m/s]", "touchdown\n[m]")
SHORT_APART = ("mean", "95 % from", "95 % to")
ERROR_TITLES = {"horizontal_m": "horizontal [m]", "vertical_m": "vertical [m]", "velocity_m_s": "velocity [m/s]"}
SHORT = (
    "estimator", "place\n[m]", "flying\n[m]", "speed\n[m/s]", "flying\n[m/s]", "end\n[m]", "cut [m]\nmedian",
    "cut [m]\nworst",
)  # fmt: skip
WITH_GPS = (
    "With GPS, place and end show how far the receiver's own slow error carried each estimate, not what flow is worth. "
    "The columns named cut show that: the rms drift through {length} s without GPS."
)
TITLE = "rms errors where all estimators of a log have rows; end drift; GPS cuts"


LOGS = f"Logs, each {options.LOG_KINDS}; or two and more records."
WITH = f"Settings of the navigator, or `{DEFAULT}`; may be repeated."
WINDOWS = "Windows of LENGTH from T0 to T1 [s] in which GPS is withheld."
MINUTES = "whole minutes of the flight; two cuts of a short one"


def command(
    logs: Annotated[list[Path], named("LOG", LOGS)],
    settings: Annotated[list[str] | None, option("FILE.toml", WITH, "--with", unset=DEFAULT)] = None,
    sensor: options.Sensor = None,
    outages: Annotated[str | None, option("T0:T1:LENGTH", WINDOWS, unset=MINUTES)] = None,
    out: Annotated[Path | None, out_option("The comparison (HTML)")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Score every log by every setting, beside dead reckoning and its autopilot; or lay records over each other."""
    from flownav.cli.replay import numbers
    from flownav.core.measurement import Sensor
    from flownav.logs.open_log import open_flight
    from flownav.replays.session import table_windows
    from flownav.report.comparison import write_comparison
    from flownav.studies.compare.job import HEADINGS, cells, compare_log, names_of, windows_of

    if len(logs) > 1 and all(path.suffix == ".fnr" for path in logs) and not (settings or sensor or outages):
        return _records(logs, None if out is None else place(out, *logs, force=force), as_json=as_json)
    option = f"--outages {outages}"
    asked = table_windows(*numbers("--outages", outages, ":", 3, "T0:T1:LENGTH"), option="--outages") if outages else []
    path = None if out is None else place(out, *logs, *(settings or []), sensor, force=force)
    chosen = settings_asked(settings or [DEFAULT], sensor)
    flights = [open_flight(path) for path in logs]
    if asked and not any(Sensor.GPS_POSITION in log.streams for log in flights):
        raise InputError(f"{option}: none of the logs has GPS to cut; leave it out")
    windows = [windows_of(log, asked, option) for log in flights]
    rows: list[dict[str, Any]] = []
    with progress("replays", sum(len(chosen) * (len(cuts) + 1) for cuts in windows)) as advance:
        for name, log, cuts in zip(names_of(logs), flights, windows, strict=True):
            rows += compare_log(name, log, chosen, cuts, advance)
    if path is not None:
        with writing(path):
            write_comparison(HEADINGS, [cells(row) for row in rows], rows, path)
    written = {} if path is None else {"page": str(path)}
    answer({"rows": rows, **written}, as_json, lambda: _show(rows, written))


def _records(paths: list[Path], out: Path | None, *, as_json: bool) -> None:
    """Records beside each other, as they are: nothing is replayed."""
    from flownav.core.record import Record
    from flownav.report.comparison import write_records
    from flownav.studies.compare.job import names_of
    from flownav.studies.compare.records import HEADINGS, cells, errors_in_time, rows_of_records

    records = list(zip(names_of(paths), [Record.load(path) for path in paths], strict=True))
    rows = rows_of_records(records)
    written = {}
    if out is not None:
        errors = [errors_in_time(record) for _, record in records]
        with writing(out):
            write_records(records, errors, HEADINGS, [cells(row) for row in rows], out)
        written = {"page": str(out)}
    answer({"records": rows, **written}, as_json, lambda: _show_records(rows, written))


def settings_asked(asked: list[str], sensor: Path | None) -> list[Setting]:
    """Each `--with` as what a replay takes; InputError where a file is not right, or one is named twice."""
    from flownav.core.parameter_files import load
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.navigation.settings_of import settings_of
    from flownav.replays.prepare import ReplayOptions
    from flownav.sensors.datasheet import identified_flow, load_sensor
    from flownav.studies.compare.job import Setting, names_of

    twice = sorted({name for name in asked if asked.count(name) > 1})
    if twice:
        raise InputError(f"--with {twice[0]}: named twice; once is enough")
    flow = load_sensor(sensor) if sensor else None
    names = dict(zip(asked, names_of([Path(name) for name in asked]), strict=True))
    found = []
    for text in asked:
        stated = None if text == DEFAULT else load(Path(text), NavigatorSettingsFile)
        given = settings_of(flow, stated=stated)
        identified = identified_flow(flow, given.lag_states) if flow else None
        options = ReplayOptions(identified=identified, flow_noise=given.noise)
        found.append(Setting(names[text], options, given.settings if flow or stated else None))
    return found


def _show_records(rows: list[dict[str, Any]], written: dict[str, str]) -> None:
    """Records for people: their errors, then how each differs from the first."""
    from flownav.studies.compare.records import MEASURES, cells, figure

    errors = _table(("record", *SHORT_RECORDS), "rms errors in flight; touchdown off the pad's centre")
    for row in rows:
        errors.add_row(*cells(row)[:6])
    apart = _table(("record", *SHORT_APART), f"mean error less that of {rows[0]['record']}")
    for row in rows[1:]:
        apart.add_section()
        apart.add_row(row["record"])
        for name in MEASURES:
            found = (row["difference"] or {}).get(name) or {}
            apart.add_row(f"  {ERROR_TITLES[name]}", *(figure(found.get(key)) for key in ("mean", "low", "high")))
    say(errors, apart)
    say_files(written, written)


def _show(rows: list[dict[str, Any]], written: dict[str, str]) -> None:
    """Print the figures for people: a log's name, then its estimators."""
    from flownav.studies.compare.job import cells

    shown, log = _table(SHORT, TITLE), ""
    for row in rows:
        name, estimator, against, *figures = cells(row)
        if name != log:
            shown.add_section()
            shown.add_row(name if against == "-" else f"{name}, by {against}")
        shown.add_row(f"  {estimator}", *figures)
        log = name
    say(shown)
    cut_s = sorted({cut["t1"] - cut["t0"] for row in rows for cut in row["outages"]["windows"]})
    if cut_s:
        say(WITH_GPS.format(length=" to ".join(f"{length:g}" for length in dict.fromkeys((cut_s[0], cut_s[-1])))))
    say_files(written, written)


def _table(heads: Sequence[str], title: str) -> Any:
    """An empty table whose first column is folded where it is long, and whose figures stay on a line."""
    made = table(heads, left=1, title=title, **plain_look(edge=False))
    made.columns[0].overflow = "fold"
    for column in made.columns[1:]:
        column.no_wrap = True
    return made


FILE = "The settings file, written only if the proposal is accepted"
PROPOSED = (
    Column("setting", "key"),
    Column("was", "default", "g"),
    Column("tuned", "value", "g"),
    Column("95 % interval", lambda row: f"{row['low']:g} to {row['high']:g}"),
)
OF_LOGS = (
    Column("log", "log"),
    Column("windows", lambda log: _windows(log)),
    Column("against", "against"),
    Column("was", lambda log: _with_unit(log, "median_error")),
    Column("tuned", lambda log: _with_unit(log, "median_error_tuned")),
)


def tune_settings(
    logs: options.Logs,
    settings: options.Settings = None,
    sensor: options.Sensor = None,
    out: Annotated[Path | None, out_option(FILE, "out/settings.toml")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Propose settings from logs: fitted on every other window of the flights, accepted only if the rest gain by it."""
    from flownav.core.parameter_files import load
    from flownav.core.provenance import command_line
    from flownav.logs.open_log import open_flight
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.studies.tuning.job import runs_expected, tune, write_settings

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
    answer(facts, as_json, lambda: _show_tuned(tuned, facts))


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
        "left_out": [{"log": name, "why": why} for name, why in tuned.left_out],
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


def _show_tuned(tuned: Tuned, facts: dict[str, Any]) -> None:
    """Print the figures for people."""
    from flownav.studies.tuning.job import gain_words

    if tuned.proposed:
        say(table_of(PROPOSED, facts["settings"], title="Proposed"))
    say(table_of(OF_LOGS, facts["logs"], title="Median error in the held-out windows"))
    worse = [log.name for log in tuned.logs if tuned.proposed and (log.error or 0.0) > (log.start_error or 0.0)]
    if worse:
        why = "the verdict is by the mean over all windows, in which the large errors count most"
        say(f"The median window errs more with the proposal in {', '.join(worse)}; {why}", soft=True)
    for name, why in tuned.left_out:
        say(f"Left out: {name}: {why}", soft=True)
    judgement = tuned.judgement
    figures = f": {gain_words(judgement.error)}" if judgement.error is not None else ""
    say(f"{judgement.verdict.capitalize()}: {judgement.why}{figures}", soft=True)
    say_files({"settings": facts["file"]}, ("settings",))


def _windows(log: dict[str, Any]) -> str:
    fit = "all held out" if log["held_out_whole"] else f"fit on {len(log['fit_windows'])}"
    return f"{len(log['held_out_windows'])}, {fit}"


def _with_unit(log: dict[str, Any], key: str) -> str:
    return "-" if log[key] is None else f"{log[key]:.3f} {log['unit'] or ''}"
