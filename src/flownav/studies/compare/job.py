"""Comparing: each log through flownav by every setting, by dead reckoning, and as its autopilot saw it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from flownav.core.measurement import Sensor
from flownav.logs.log import Log
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.fed import as_fed
from flownav.replays.prepare import FLOW, ReplayOptions, check_windows
from flownav.replays.session import Replay, outage_table, replay
from flownav.scoring.outage import outage_error
from flownav.studies.compare.dead_reckoning import dead_reckoned
from flownav.studies.compare.like_for_like import Window
from flownav.studies.compare.rows import AUTOPILOT, DEAD_RECKONING, FLOWNAV, Entrant, Row, default_windows, rows_of
from flownav.studies.compare.tracks import Track, of_estimate, of_table


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
    log, delay_s = flown.log, flown.options.gps_delay_s
    track = dead_reckoning_of(flown)
    if track is None:
        return []
    gps = log.streams.get(Sensor.GPS_POSITION)
    cuts = [] if gps is None else [
        outage_error(track.t_s, track.motion.position[:, :2], gps.t_s, gps.value[:, :2], delay_s, *window)
        for window in windows
    ]  # fmt: skip
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
