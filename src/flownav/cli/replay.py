"""`flownav replay`: a recorded flight through the filter."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer


def command(
    folder: Annotated[
        Path, typer.Argument(help="A log: CSV folder, .ulg, .bin, .tlog, or a live .fnr.", show_default=False)
    ],
    gps_outage: Annotated[
        list[str] | None,
        typer.Option("--gps-outage", metavar="T0:T1", help="Withhold GPS in [T0, T1) s; may be repeated."),
    ] = None,
    no_flow: Annotated[bool, typer.Option("--no-flow", help="Withhold the optical flow.")] = False,
    flow_scale: Annotated[
        str, typer.Option("--flow-scale", metavar="X,Y", help="Factors on flow_x and flow_y (or on velocity u and v).")
    ] = "1,1",
    gps_delay: Annotated[
        float, typer.Option("--gps-delay", metavar="S", help="How old a GPS reading is when it arrives.")
    ] = 0.22,
    sensor: Annotated[
        Path | None, typer.Option("--sensor", help="A flow sensor file: its gains and latency correct the flow.")
    ] = None,
    outage_table: Annotated[
        str | None,
        typer.Option("--outage-table", metavar="T0:T1:LENGTH", help="One replay a window, each with GPS cut there."),
    ] = None,
    flow_instance: Annotated[
        int | None, typer.Option("--flow-instance", metavar="N", help="Which of several flow sensors.")
    ] = None,
    topic: Annotated[
        list[str] | None,
        typer.Option("--topic", metavar="ROLE=TOPIC", help="Of a ROS bag: which topic serves as what; several times."),
    ] = None,
    settings: Annotated[
        Path | None, typer.Option("--settings", help="TOML of filter settings (docs/landing-filter.md).")
    ] = None,
    smooth: Annotated[
        bool, typer.Option("--smooth", help="Also the best estimate after the flight (docs/smoother.md).")
    ] = False,
    filter_name: Annotated[
        str, typer.Option("--filter", help="landing, an installed filter's name, or file.py:Class.")
    ] = "landing",
    out: Annotated[
        Path | None, typer.Option("--out", help="The record; out/FOLDER.fnr where unsaid.", show_default=False)
    ] = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write the HTML report beside it.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Fuse a recorded flight: its trajectory, its errors against its own GPS, and the drift through GPS outages."""
    from flownav.api.parts import own_filter
    from flownav.api.replaying import replay_log
    from flownav.cli.output import progress, require_writable_record, save
    from flownav.errors import VerdictError
    from flownav.logs.open_log import open_flight
    from flownav.logs.ros.choice import asked_topics
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.parameter_files import load
    from flownav.replays.prepare import ReplayOptions
    from flownav.replays.session import table_windows
    from flownav.sensors.datasheet import load_sensor

    windows = [numbers("--gps-outage", text, ":", 2, "T0:T1") for text in gps_outage or []]
    scale = numbers("--flow-scale", flow_scale, ",", 2, "X,Y")
    record_path = out or Path("out") / f"{folder.resolve().name}.fnr"
    require_writable_record(record_path, folder, settings, sensor, report=report)
    table = table_windows(*numbers("--outage-table", outage_table, ":", 3, "T0:T1:LENGTH")) if outage_table else []
    flow = load_sensor(sensor) if sensor else None
    stated = load(settings, NavigatorSettingsFile) if settings else None
    options = ReplayOptions(gps_delay, tuple((t0, t1) for t0, t1 in windows), not no_flow, (scale[0], scale[1]))
    part = own_filter(filter_name)
    log = open_flight(folder, flow_instance=flow_instance, topics=asked_topics(topic or []))
    with progress("GPS outages", len(table)) if table else nullcontext() as advance:
        record = replay_log(log, options, flow, stated, smooth=smooth, table=table, part=part, progress=advance)
    scores = record.scores | save(record, record_path, report=report)
    if as_json:
        typer.echo(json.dumps(scores))
    else:
        from flownav.cli.replay_table import show

        show(record, scores)
    if record.verdict:
        raise VerdictError(f"{folder}: {record.verdict}")


def numbers(option: str, text: str, separator: str, count: int, form: str) -> tuple[float, ...]:
    """An option's numbers; InputError where it has another form than it should."""
    from math import isfinite

    from flownav.errors import InputError
    from flownav.text import number

    try:
        found = tuple(number(part) for part in text.split(separator))
    except ValueError:
        found = ()
    if len(found) != count or not all(map(isfinite, found)):
        raise InputError(f"{option} {text}: {form} is needed, numbers")
    return found
