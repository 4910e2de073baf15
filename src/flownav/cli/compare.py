"""`flownav compare`: many logs, many settings, and what else could have navigated."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import named, option, out_option
from flownav.cli.output import writing
from flownav.cli.tables import answer, plain_look, say, say_files, table

if TYPE_CHECKING:
    from flownav.studies.compare.job import Setting

DEFAULT = "default"
SHORT_RECORDS = ("against", "horizontal\n[m]", "vertical\n[m]", "velocity\n[m/s]", "touchdown\n[m]")
SHORT_APART = ("mean", "95 % from", "95 % to")
SAID = {"horizontal_m": "horizontal [m]", "vertical_m": "vertical [m]", "velocity_m_s": "velocity [m/s]"}
SHORT = (
    "estimator", "place\n[m]", "flying\n[m]", "speed\n[m/s]", "flying\n[m/s]", "end\n[m]", "cut [m]\nmedian",
    "cut [m]\nworst",
)  # fmt: skip
TITLE = "rms errors where all estimators of a log have rows; end drift; GPS cuts"


LOGS = f"Logs, each {options.LOG_KINDS}; or two and more records."
WITH = f"Settings of the navigator, or `{DEFAULT}`; may be repeated."
WINDOWS = "Windows of LENGTH from T0 to T1 [s] in which GPS is withheld."
MINUTES = "whole minutes of the flight"


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
    from flownav.cli.output import place, progress
    from flownav.cli.replay import numbers
    from flownav.core.errors import InputError
    from flownav.core.measurement import Sensor
    from flownav.logs.open_log import open_flight
    from flownav.replays.session import table_windows
    from flownav.report.comparison import write_comparison
    from flownav.studies.compare.job import compare_log, windows_of
    from flownav.studies.compare.rows import HEADINGS, cells, names_of

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
    from flownav.studies.compare.records import HEADINGS, cells, errors_in_time, rows_of_records
    from flownav.studies.compare.rows import names_of

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
    from flownav.core.errors import InputError
    from flownav.core.parameter_files import load
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.navigation.settings_of import settings_of
    from flownav.replays.prepare import ReplayOptions
    from flownav.sensors.datasheet import load_sensor
    from flownav.sensors.identified import identified_flow
    from flownav.studies.compare.job import Setting
    from flownav.studies.compare.rows import names_of

    twice = sorted({name for name in asked if asked.count(name) > 1})
    if twice:
        raise InputError(f"--with {twice[0]}: named twice; once is enough")
    flow = load_sensor(sensor) if sensor else None
    names = dict(zip(asked, names_of([Path(name) for name in asked]), strict=True))
    found = []
    for text in asked:
        stated = None if text == DEFAULT else load(Path(text), NavigatorSettingsFile)
        told = settings_of(flow, stated=stated)
        identified = identified_flow(flow, told.lag_states) if flow else None
        options = ReplayOptions(identified=identified, flow_noise=told.noise)
        found.append(Setting(names[text], options, told.settings if flow or stated else None))
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
            apart.add_row(f"  {SAID[name]}", *(figure(found.get(key)) for key in ("mean", "low", "high")))
    say(errors, apart)
    say_files(written, written)


def _show(rows: list[dict[str, Any]], written: dict[str, str]) -> None:
    """The same figures for people: a log's name, then its estimators."""
    from flownav.studies.compare.rows import cells

    shown, log = _table(SHORT, TITLE), ""
    for row in rows:
        name, estimator, against, *figures = cells(row)
        if name != log:
            shown.add_section()
            shown.add_row(name if against == "-" else f"{name}, by {against}")
        shown.add_row(f"  {estimator}", *figures)
        log = name
    say(shown)
    say_files(written, written)


def _table(heads: Sequence[str], title: str) -> Any:
    """An empty table whose first column is folded where it is long, and whose figures stay on a line."""
    made = table(heads, left=1, title=title, **plain_look(edge=False))
    made.columns[0].overflow = "fold"
    for column in made.columns[1:]:
        column.no_wrap = True
    return made
