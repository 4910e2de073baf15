"""`flownav replay`: a recorded flight through the filter."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flownav.cli.choices import installed_filters, one_of, option
from flownav.cli.options import (
    FlowInstanceOption,
    ForceOption,
    GpsDelayOption,
    JsonOption,
    LogArgument,
    ReportOption,
    SensorOption,
    SettingsOption,
    TopicOption,
    out_option,
)
from flownav.cli.output import emit

if TYPE_CHECKING:
    from flownav.replays.prepare import ReplayOptions


OUTAGE = "Withhold GPS from T0 to T1 [s]; repeated or with commas."
OUTAGES = "Windows of LENGTH from T0 to T1 [s]: one replay each, with GPS withheld in it."
SmoothOption = Annotated[
    bool, typer.Option("--smooth", help="Also compute the best estimate after the flight (the smoother).")
]
InPlaceOption = Annotated[
    str,
    typer.Option(
        "--filter",
        help="The navigator's filter, an installed one's name, or your own class.",
        **one_of("landing", beside="FILE.py:CLASS", also=installed_filters),
    ),
]


def command(
    log: LogArgument,
    gps_outage: Annotated[list[str] | None, option("T0:T1", OUTAGE)] = None,
    no_flow: Annotated[bool, typer.Option("--no-flow", help="Withhold the optical flow.")] = False,
    flow_scale: Annotated[str, option("X,Y", "Factors on the flow about body x and y.")] = "1,1",
    gps_delay: GpsDelayOption = 0.22,
    sensor: SensorOption = None,
    outage_table: Annotated[str | None, option("T0:T1:LENGTH", OUTAGES)] = None,
    flow_instance: FlowInstanceOption = None,
    topic: TopicOption = None,
    settings: SettingsOption = None,
    smooth: SmoothOption = False,
    filter_name: InPlaceOption = "landing",
    out: Annotated[Path | None, out_option("The record", "out/LOG.fnr")] = None,
    force: ForceOption = False,
    report: ReportOption = True,
    as_json: JsonOption = False,
) -> None:
    """Fuse a recorded flight: its trajectory, its errors against its own GPS, and the drift through GPS outages."""
    from flownav.api.calls import own_filter
    from flownav.api.replaying import replay_log
    from flownav.cli.output import progress, record_place, save
    from flownav.core.errors import VerdictError
    from flownav.core.parameter_files import load
    from flownav.logs.open_log import open_flight
    from flownav.logs.ros.choice import asked_topics
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.replays.session import table_windows
    from flownav.sensors.datasheet import load_sensor

    options = _options(gps_delay, gps_outage or [], flow_scale, no_flow=no_flow)
    asked = out or Path("out") / f"{log.resolve().name}.fnr"
    record_path = record_place(asked, log, settings, sensor, force=force, report=report)
    table = table_windows(*numbers("--outage-table", outage_table, ":", 3, "T0:T1:LENGTH")) if outage_table else []
    flow = load_sensor(sensor) if sensor else None
    stated = load(settings, NavigatorSettingsFile) if settings else None
    part = own_filter(filter_name)
    read = open_flight(log, flow_instance=flow_instance, topics=asked_topics(topic or []))
    with progress("GPS outages", len(table)) if table else nullcontext() as advance:
        record = replay_log(read, options, flow, stated, smooth=smooth, table=table, part=part, progress=advance)
    scores = record.scores | save(record, record_path, report=report)
    if as_json:
        emit(scores)
    else:
        from flownav.cli.replay_table import show

        show(record, scores)
    if record.verdict:
        raise VerdictError(f"{log}: {record.verdict}")


def _options(gps_delay_s: float, outages: list[str], flow_scale: str, *, no_flow: bool) -> ReplayOptions:
    """What is withheld, scaled and late. InputError where a window or the factors are none."""
    from flownav.replays.prepare import ReplayOptions

    cuts = [text for given in outages for text in given.split(",")]
    windows = [numbers("--gps-outage", text, ":", 2, "T0:T1") for text in cuts]
    scale = numbers("--flow-scale", flow_scale, ",", 2, "X,Y")
    return ReplayOptions(gps_delay_s, tuple((t0, t1) for t0, t1 in windows), not no_flow, (scale[0], scale[1]))


def numbers(option: str, text: str, separator: str, count: int, form: str) -> tuple[float, ...]:
    """An option's numbers; InputError where it has another form than it should."""
    from math import isfinite

    from flownav.core.errors import InputError
    from flownav.core.text import number

    try:
        found = tuple(number(part) for part in text.split(separator))
    except ValueError:
        found = ()
    if len(found) != count or not all(map(isfinite, found)):
        raise InputError(f"{option} {text}: {form} is needed, numbers")
    return found
