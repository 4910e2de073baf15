"""replay: a recorded flight through the navigator, as a record with its scores."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flownav.api.arguments import checked
from flownav.api.calls import call_of, changed, own_filter
from flownav.api.record import Record
from flownav.api.sensor import Sensor
from flownav.core.errors import InputError
from flownav.core.parameter_files import check, load
from flownav.core.provenance import called_as, command_words
from flownav.logs.log import Log
from flownav.logs.open_log import open_flight
from flownav.navigation.filter_protocol import Filter
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.settings_of import settings_of
from flownav.replays.bundle import to_record
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import Replay, outage_summary, table_windows
from flownav.replays.session import outage_table as fly_table
from flownav.replays.session import replay as run_log
from flownav.scoring.path import outage_entry
from flownav.sensors.datasheet import FlowSensor, identified_flow, load_sensor

GPS_DELAY_S = 0.22
Progress = Callable[[int], object]
Windows = Sequence[tuple[float, float]]
Settings = str | Path | Mapping[str, float] | None


@checked
def replay(
    log: str | Path,
    *,
    gps_outages: Windows = (),
    flow: bool = True,
    flow_scale: tuple[float, float] = (1.0, 1.0),
    gps_delay_s: float = GPS_DELAY_S,
    sensor: str | Path | Sensor | None = None,
    settings: Settings = None,
    smooth: bool = False,
    outage_table: tuple[float, float, float] | None = None,
    flow_instance: int | None = None,
    topics: Mapping[str, str] | None = None,
    filter: str | Filter | type[Filter] | None = None,
    progress: Progress | None = None,
) -> Record:
    """Fuse a recorded flight with the navigator that flies in `fly`, and score it against what the log knows.

    log: a CSV folder, PX4 ULog, ArduPilot .bin, MAVLink .tlog, or a record of `live` or `fly`, which gives the same
    estimate bit for bit. gps_outages: windows (t0, t1) [s] in which GPS is withheld. flow: False withholds the optical
    flow; flow_scale: factors on its two axes. gps_delay_s: how old a GPS reading is when it arrives. sensor: a flow
    sensor (its gains and latency correct the flow). settings: the filter's, by name or as a TOML file
    (docs/reference/keys.md). smooth: also the best estimate after the flight. outage_table: (t0, t1, length), one
    replay for each window of that length (the last may be shorter), with GPS cut there alone. flow_instance: which of
    several flow sensors. topics: of a ROS bag, which topic serves as what, by role (docs: ROS bags and MCAP).
    filter: one of your own in the navigator's place (docs: own parts).
    progress: called with 1 for each window of the table.
    InputError, one line, where the log or an option cannot serve. What is wrong with the log is in `record.verdict`.

    Example:
        >>> import flownav
        >>> record = flownav.replay(log, gps_outages=[(10, 20)])
        >>> record.scores["outages"][0]["t0"]
        10.0
    """
    options: dict[str, Any] = {
        "gps_outages": gps_outages, "flow": flow, "flow_scale": flow_scale, "gps_delay_s": gps_delay_s,
        "sensor": sensor, "settings": settings, "smooth": smooth, "outage_table": outage_table,
        "flow_instance": flow_instance,
        "topics": None if topics is None else dict(topics),
        "filter": filter if filter is None or isinstance(filter, str) else _name_of(filter),
    }  # fmt: skip
    part = own_filter(filter)
    call = call_of("replay", log, **changed(replay, options))
    outages = tuple(_window(window) for window in gps_outages)
    table = table_windows(*outage_table, option="outage_table") if outage_table is not None else []
    datasheet = sensor.file if isinstance(sensor, Sensor) else None if sensor is None else load_sensor(sensor)
    stated = _stated(settings)
    scale = (float(flow_scale[0]), float(flow_scale[1]))
    asked = ReplayOptions(gps_delay_s, outages, flow, scale)
    with called_as(call):
        read = open_flight(Path(log), flow_instance=flow_instance, topics=topics)
        return replay_log(read, asked, datasheet, stated, smooth=smooth, table=table, part=part, progress=progress)


def replay_log(
    log: Log, options: ReplayOptions, sensor: FlowSensor | None = None, stated: NavigatorSettingsFile | None = None, *,
    smooth: bool = False, table: Windows = (), part: Filter | None = None, progress: Progress | None = None,
) -> Record:  # fmt: skip
    """A log that is read, through the navigator.

    sensor: its file; stated: the user's own settings. table: windows, one replay each. part: a filter in the
    navigator's place. InputError as `replay`.
    """
    given = settings_of(sensor, stated=stated)
    identified = identified_flow(sensor, given.lag_states) if sensor else None
    options = replace(options, identified=identified, flow_noise=given.noise)
    options, settled = as_fed(log, options, given.settings if sensor or stated else None)
    if part is not None and (table or smooth):
        raise InputError("a filter of your own takes neither an outage table nor smoothing; leave them out")
    if part is not None:
        from flownav.parts.flying import replay_with

        flown = replay_with(log, options, settled, part)
    else:
        flown = run_log(log, options, settled, smoothed=smooth)
    scores = flown.scores()
    if table:
        scores |= _table_scores(flown, table, scores["outages"], progress)
    record = Record.of(to_record(flown, scores, command_words()))
    if part is not None:
        record.manifest["filter"] = _name_of(part)
    return record


def _name_of(part: object) -> str:
    """The name of a filter of one's own in records and calls."""
    from flownav.parts.calling import name_of

    return name_of(part)


def _table_scores(
    flown: Replay, table: Windows, explicit: list[dict[str, Any]], progress: Progress | None
) -> dict[str, Any]:
    """The table's windows after the explicit ones, with their median and worst."""
    advance = progress or (lambda done: None)
    errors = fly_table(flown.log, flown.options, flown.settings, list(table), advance)
    return {"outages": [*explicit, *map(outage_entry, errors)], **outage_summary(errors)}


def _window(window: Sequence[float]) -> tuple[float, float]:
    try:
        t0, t1 = window
        return float(t0), float(t1)
    except (TypeError, ValueError):
        raise InputError(f"gps_outages: {window!r}: a window (t0, t1) in seconds is needed") from None


def _stated(settings: Settings) -> NavigatorSettingsFile | None:
    """The user's own settings. InputError names the one that cannot be."""
    if settings is None:
        return None
    if isinstance(settings, Mapping):
        return check(dict(settings), NavigatorSettingsFile, "settings")
    return load(Path(settings), NavigatorSettingsFile)
