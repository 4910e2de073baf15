"""Comparing: a log's estimators side by side, one row each, in JSON, words and Markdown; the league of many logs."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.files import natural_order
from flownav.core.measurement import Sensor
from flownav.core.version import __version__
from flownav.logs.csv_folder import FILES
from flownav.logs.log import Log
from flownav.logs.open_log import log_kind, open_flight
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.fed import as_fed
from flownav.replays.judged import airborne_of
from flownav.replays.prepare import FLOW, ReplayOptions, check_windows
from flownav.replays.session import Replay, outage_summary, outage_table, replay
from flownav.scoring.path import Path as ScoredPath
from flownav.scoring.path import References, end_drift_of, outage_entry, outage_of
from flownav.scoring.reference import OutageError
from flownav.studies.compare.tracks import (
    Reference,
    Track,
    Window,
    dead_reckoned,
    errors_of,
    of_estimate,
    of_table,
    reference_of,
    shared_by,
)

FLOWNAV, DEAD_RECKONING, AUTOPILOT = "flownav", "dead reckoning", "autopilot"
WINDOW_S = 60.0
SETTLED_S = 60.0  # after the log's start and before its end nothing is cut
SHORT_CUTS, SHORT_SETTLED = 2, 0.2  # of a log too short for that: cuts, and the share of it before and after them
LEAST_CUT_S = 10.0

HEADINGS = (
    "log", "estimator", "against", "horizontal [m]", "in flight [m]", "velocity [m/s]", "in flight [m/s]",
    "end drift [m]", "GPS cut: median [m]", "worst [m]",
)  # fmt: skip

Row = dict[str, Any]


class Entrant(NamedTuple):
    """Who estimates, by which settings (an autopilot: by which of its estimators), its path, its GPS cuts."""

    estimator: str
    settings: str | None
    track: Track
    outages: tuple[OutageError, ...] = ()


def rows_of(name: str, log: Log, entrants: Sequence[Entrant], gps_delay_s: float) -> list[Row]:
    """One row for each entrant, errors at the instants that all of them have; the first entrant is always scored."""
    reference, airborne = reference_of(log, gps_delay_s), airborne_of(log)
    figures = _figures(entrants, reference, airborne)
    known = References(truth=log.truth, heading=log.heading_truth, flight_s=airborne)
    return [
        {
            "log": name,
            "settings": entrant.settings,
            "estimator": entrant.estimator,
            **found,
            "end_drift_m": end_drift_of(entrant.track.motion, known),
            "outages": _outages(entrant.outages),
        }
        for entrant, found in zip(entrants, figures, strict=True)
    ]


def _figures(entrants: Sequence[Entrant], reference: Reference | None, airborne: Window | None) -> list[Row]:
    """The figures that all kinds of estimator have."""
    nothing = {"horizontal_rms_m": None, "velocity_rms_m_s": None, "samples": 0}
    if reference is None:
        return [{"against": None, **nothing, "airborne": None} for _ in entrants]
    tracks = [entrant.track for entrant in entrants]
    places, kept = shared_by(tracks, reference.position_t_s)
    speeds, _ = shared_by([track for track, stays in zip(tracks, kept, strict=True) if stays], reference.velocity_t_s)
    rows = []
    for track, stays in zip(tracks, kept, strict=True):
        whole = errors_of(track, reference, places, speeds) if stays else nothing
        apart = errors_of(track, reference, places, speeds, airborne) if stays and airborne is not None else None
        rows.append({"against": reference.against, **whole, "airborne": apart})
    return rows


def _outages(errors: Sequence[OutageError]) -> Row:
    summary = outage_summary(list(errors))
    return {
        "median_m": summary["outage_median_rms_m"],
        "worst_m": summary["outage_worst_rms_m"],
        "windows": [outage_entry(error) for error in errors],
    }


def default_windows(span_s: Window) -> list[Window]:
    """Whole windows of WINDOW_S, from SETTLED_S after the log's start (to the second) to SETTLED_S before its end.

    Of a log too short for one: SHORT_CUTS windows of whole seconds, after SHORT_SETTLED of its time and as long before
    its end; none where they would be shorter than LEAST_CUT_S.
    """
    start, end = float(round(span_s[0])), span_s[1]
    count, length, first = int((end - start - 2.0 * SETTLED_S) // WINDOW_S), WINDOW_S, start + SETTLED_S
    if count < 1:
        aside = float(round(SHORT_SETTLED * (end - start)))
        count, length, first = SHORT_CUTS, float((end - start - 2.0 * aside) // SHORT_CUTS), start + aside
    return [(first + k * length, first + (k + 1) * length) for k in range(count)] if length >= LEAST_CUT_S else []


def names_of(paths: Sequence[Path]) -> list[str]:
    """The last part of each path, and as much before it as tells it from the others."""
    parts = [path.resolve().parts for path in paths]
    deepest = max((len(part) for part in parts), default=1)
    names = ["/".join(part[-1:]) for part in parts]
    for depth in range(2, deepest + 1):
        twice = {name for name in names if names.count(name) > 1}
        names = ["/".join(p[-depth:]) if n in twice else n for n, p in zip(names, parts, strict=True)]
    return names


# -- words -------------------------------------------------------------------------------------------------
def cells(row: Row) -> tuple[str, ...]:
    """A row under HEADINGS; a dash where there is nothing to say."""
    airborne = row["airborne"] or {}
    estimator = row["estimator"] if row["settings"] is None else f"{row['estimator']} ({row['settings']})"
    return (
        row["log"], estimator, row["against"] or "-",
        _figure(row["horizontal_rms_m"]), _figure(airborne.get("horizontal_rms_m")),
        _figure(row["velocity_rms_m_s"]), _figure(airborne.get("velocity_rms_m_s")),
        _figure(row["end_drift_m"]), _figure(row["outages"]["median_m"]), _figure(row["outages"]["worst_m"]),
    )  # fmt: skip


def markdown(rows: Sequence[Row]) -> str:
    """The table as Markdown."""
    lines = [HEADINGS, ("---", "---", "---", *["---:"] * (len(HEADINGS) - 3)), *map(cells, rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


# -- a log through every estimator -------------------------------------------------------------------------------
class Setting(NamedTuple):
    """A name, options of the replay, and settings of the filter (None: as shipped, or as a session's record says)."""

    name: str
    options: ReplayOptions
    numbers: NavigatorSettingsFile | None


def windows_of(log: Log, asked: Sequence[Window], option: str) -> list[Window]:
    """The GPS cuts of a log: those asked for, else the usual ones; none without GPS.

    InputError where one that was asked for lies outside the log.
    """
    if Sensor.GPS_POSITION not in log.streams:
        return []
    check_windows(log, asked, option)
    return list(asked) or default_windows(log.span_s)


def compare_log(
    name: str, log: Log, settings: Sequence[Setting], windows: list[Window], on_progress: Callable[[int], None]
) -> list[Row]:
    """A log's rows: flownav by each setting, dead reckoning, the autopilot, as far as the log allows.

    on_progress is called with 1 after each replay, of which there are settings times (windows + 1). InputError where
    the filter never starts.
    """
    entrants: list[Entrant] = []
    first: Replay | None = None
    for setting in settings:
        options, numbers = as_fed(log, setting.options, setting.numbers)
        flown = replay(log, options, numbers)
        first = first or flown
        on_progress(1)
        cuts = outage_table(log, options, numbers, windows, on_progress) if windows else []
        entrants.append(Entrant(FLOWNAV, setting.name, of_estimate(flown.estimate), tuple(cuts)))
    assert first is not None
    entrants += [*_reckoned(first, windows), *_autopilot(log)]
    return rows_of(name, log, entrants, first.options.gps_delay_s)


def _reckoned(flown: Replay, windows: list[Window]) -> list[Entrant]:
    """Dead reckoning on the streams as they were fed, where there is flow with a height; GPS it never had."""
    track = dead_reckoning_of(flown)
    if track is None:
        return []
    path = ScoredPath(track.t_s, track.motion.position, np.full((len(track.t_s), 2), np.nan))
    cuts = [outage_of(path, flown.references, *window) for window in windows]  # none without GPS
    return [Entrant(DEAD_RECKONING, None, track, tuple(cuts))]


def dead_reckoning_of(flown: Replay) -> Track | None:
    """By the logged attitude, or the filter's where the log has none; rotation taken off as the replay does."""
    streams = flown.prepared.streams
    for sensor in FLOW:
        if sensor in streams:
            return dead_reckoned(
                streams[sensor], streams.get(Sensor.RANGE), streams.get(Sensor.ATTITUDE, flown.attitude)
            )
    return None


def _autopilot(log: Log) -> list[Entrant]:
    """The autopilot's own estimate; it had GPS all along, so that no cut tells of it."""
    return [] if log.autopilot is None else [Entrant(AUTOPILOT, log.autopilot_name or None, of_table(log.autopilot))]


# -- every log in a folder ---------------------------------------------------------------------------------------
HEAD = """# The league

What flownav makes of every log at hand as it is shipped, with no setting fitted to any, beside dead reckoning on the
same flow and the autopilot's own estimate. [compare](../how-to/compare.md) says what the columns mean. Printed by
`make league` with flownav {version}; a change to the navigator prints it anew, and what got worse shows.

"""

LeftOut = tuple[str, str]  # a log's name, and why it is not in the table


def logs_in(folder: Path) -> list[Path]:
    """Every folder of CSV files and every log file below, in order of their names (2 before 10).

    InputError where the folder is missing or holds none.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; set FLOWNAV_DATA to the folder of logs")
    found = [path for path in sorted(folder.rglob("*"), key=natural_order) if _is_folder_of_csv(path) or log_kind(path)]
    if not found:
        raise InputError(f"{folder}: holds no log; set FLOWNAV_DATA to the folder of logs")
    return found


def _is_folder_of_csv(path: Path) -> bool:
    return any((path / f"{name}.csv").is_file() for name in FILES if name not in ("truth", "heading_truth"))


def play(paths: Sequence[Path], on_log: Callable[[str], None]) -> tuple[list[Row], list[LeftOut]]:
    """The rows of all logs that can be replayed, by the shipped settings, and which cannot.

    on_log: called with each log's name before it is read.
    """
    rows: list[Row] = []
    left_out: list[LeftOut] = []
    for name, path in zip(names_of(paths), paths, strict=True):
        on_log(name)
        try:
            log = open_flight(path)
            setting = Setting("default", ReplayOptions(), None)
            rows += compare_log(name, log, [setting], windows_of(log, (), ""), lambda done: None)
        except InputError as error:
            left_out.append((name, str(error).removeprefix(f"{path}: ")))
    return rows, left_out


def page(rows: Sequence[Row], left_out: Sequence[LeftOut]) -> str:
    """The league as Markdown."""
    text = HEAD.format(version=__version__) + markdown(rows)
    if left_out:
        text += "\nNot in the table:\n\n" + "".join(f"- `{name}`: {why}\n" for name, why in left_out)
    return text
