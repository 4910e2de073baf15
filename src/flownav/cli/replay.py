"""`flownav replay`: a recorded flight through the filter."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from flownav.replays.session import Replay


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
    settings: Annotated[
        Path | None, typer.Option("--settings", help="TOML of filter settings (docs/landing-filter.md).")
    ] = None,
    smooth: Annotated[
        bool, typer.Option("--smooth", help="Also the best estimate after the flight (docs/smoother.md).")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="The record; out/FOLDER.fnr where unsaid.", show_default=False)
    ] = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write the HTML report beside it.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Fuse a recorded flight: its trajectory, its errors against its own GPS, and the drift through GPS outages."""
    from flownav.cli.output import require_writable_record, save
    from flownav.errors import VerdictError
    from flownav.navigation.settings_of import settings_of
    from flownav.replays.bundle import to_record
    from flownav.replays.fed import as_fed
    from flownav.replays.prepare import ReplayOptions
    from flownav.replays.session import replay, table_windows
    from flownav.sensors.datasheet import load_sensor
    from flownav.sensors.identified import identified_flow

    windows = tuple(numbers("--gps-outage", text, ":", 2, "T0:T1") for text in gps_outage or [])
    scale = numbers("--flow-scale", flow_scale, ",", 2, "X,Y")
    record_path = out or Path("out") / f"{folder.resolve().name}.fnr"
    require_writable_record(record_path, folder, settings, sensor, report=report)
    table = table_windows(*numbers("--outage-table", outage_table, ":", 3, "T0:T1:LENGTH")) if outage_table else []
    flow, stated = load_sensor(sensor) if sensor else None, _settings(settings) if settings else None
    told = settings_of(flow, stated=stated)
    outages = tuple((t0, t1) for t0, t1 in windows)
    identified = identified_flow(flow, told.lag_states) if flow else None
    options = ReplayOptions(gps_delay, outages, not no_flow, (scale[0], scale[1]), identified, told.noise)
    log = _read(folder, flow_instance)
    options, settled = as_fed(log, options, told.settings if flow or stated else None)
    flown = replay(log, options, settled, smoothed=smooth)
    scores = flown.scores()
    if table:
        scores.update(_fly_table(flown, table, scores["outages"]))
    scores |= save(to_record(flown, scores, ["flownav", *sys.argv[1:]]), record_path, report=report)
    if as_json:
        typer.echo(json.dumps(scores))
    else:
        _print(flown, scores)
    wrong = [finding.text for finding in flown.findings if finding.flow_is_wrong or finding.unfused]
    if wrong:
        raise VerdictError(f"{folder}: {wrong[0]}")


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


def _read(path: Path, flow_instance: int | None) -> Any:
    from flownav.logs.open_log import open_flight

    return open_flight(path, flow_instance=flow_instance)


def _settings(path: Path) -> Any:
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.parameter_files import load

    return load(path, NavigatorSettingsFile)


def _fly_table(flown: Replay, table: list[tuple[float, float]], explicit: list[dict[str, Any]]) -> dict[str, Any]:
    """The table's windows after the explicit ones, with their median and worst."""
    from flownav.cli.output import progress
    from flownav.replays.session import outage_entry, outage_summary, outage_table

    with progress("GPS outages", len(table)) as advance:
        errors = outage_table(flown.log, flown.options, flown.settings, table, advance)
    return {"outages": [*explicit, *map(outage_entry, errors)], **outage_summary(errors)}


def _print(flown: Replay, scores: dict[str, Any]) -> None:
    """The same figures for people."""
    from rich.console import Console
    from rich.table import Table

    from flownav.cli.output import autopilot_errors

    console = Console(markup=False, highlight=False)
    console.print(f"{flown.log.path.name}: {scores['duration_s']:.1f} s")
    if scores["outages"]:
        table = Table("GPS cut [s]", "rms [m]", "max [m]", title="Horizontal error through GPS outages")
        for outage in scores["outages"]:
            table.add_row(
                f"{outage['t0']:g} to {outage['t1']:g}",
                *map(_figure, (outage["horizontal_rms_m"], outage["horizontal_max_m"])),
            )
        console.print(table)
    if "outage_median_rms_m" in scores:
        median, worst = _figure(scores["outage_median_rms_m"]), _figure(scores["outage_worst_rms_m"])
        console.print(f"Over the table's windows: median {median} m rms, worst {worst} m rms")
    if scores["velocity_rms_m_s"] is not None:
        console.print(f"Horizontal velocity against GPS: {scores['velocity_rms_m_s']:.3f} m/s rms")
    if "truth" in scores:
        truth = scores["truth"]
        turned = "" if truth["yaw_rad"] is None else f", turned by {57.29578 * truth['yaw_rad']:.1f} deg"
        console.print(
            f"Against {truth['reference']}{turned}: horizontal "
            f"{truth['horizontal_rms_m']:.2f} m rms, {truth['horizontal_max_m']:.2f} m max; "
            f"velocity {truth['velocity_rms_m_s']:.3f} m/s rms"
        )
    if scores["end_drift_m"] is not None:
        console.print(
            f"At the end of the flight, {scores['truth']['reference']} laid on it at take-off: "
            f"{scores['end_drift_m']:.2f} m off"
        )
    if scores["protection"]:
        console.print(_protection(scores["protection"]))
    if "smoothed" in scores:
        console.print(f"Smoothed over the whole flight: {_smoothed_errors(scores['smoothed'])}")
    if scores.get("autopilot", {}).get("against"):
        own = scores["autopilot"]
        console.print(f"The autopilot's own estimate ({own['name']}) {autopilot_errors(own)}")
    console.print(_sensors(scores))
    rejected = _rejected(scores)
    if rejected.row_count:
        console.print(rejected)
    for note in flown.prepared.notes:
        console.print(f"Note: {note}")
    for finding in flown.findings:
        console.print(f"{finding.label}: {finding.text}")
    for name in ("record", "report"):
        if name in scores:
            console.print(f"{name.capitalize()}: {scores[name]}", soft_wrap=True)


def _sensors(scores: dict[str, Any]) -> Any:
    """When each sensor spoke, and whether the filter's innovations are as large as it states, and news."""
    from rich.table import Table

    from flownav.scoring.consistency import verdict

    table = Table("sensor", "from, to [s]", "innovations", "NIS", "verdict", title="Sensors and their innovations")
    for name in dict.fromkeys([*scores["coverage"], *scores["consistency"]]):
        span, judged = scores["coverage"].get(name), scores["consistency"].get(name)
        said = (str(judged["samples"]), _figure(judged["nis_per_dof"])) if judged else ("", "")
        words = verdict(judged["nis_per_dof"], white=judged["white"]) if judged else ""
        table.add_row(name, f"{span['t0']:.1f}, {span['t1']:.1f}" if span else "", *said, words)
    return table


def _protection(found: dict[str, Any]) -> str:
    """Protection levels in words."""
    level, unsaid = found["horizontal_m"], found["exceeded_unsaid_fraction"]
    said = f"Protection level, horizontal: {level['median']:.2f} m in the median, {level['p95']:.2f} m at 95 %"
    return (
        said
        if unsaid is None
        else f"{said}; the error is larger and nothing says so {100.0 * unsaid:.2f} % of the time"
    )


def _rejected(scores: dict[str, Any]) -> Any:
    """What was not fused and why, in readings and in components (a row that the reader threw away is one)."""
    from rich.table import Table

    table = Table("sensor", "reason", "readings", "of", "components", title="Not fused")
    for sensor, counted in scores["readings"].items():
        offered, components = counted["offered"], scores["rejected"].get(sensor, {})
        for reason, count in counted["rejected"].items():
            table.add_row(sensor, reason, str(count), str(offered or ""), str(components.get(reason, "")))
    return table


def _smoothed_errors(scores: dict[str, Any]) -> str:
    """The smoothed path's errors in words."""
    said = [
        f"GPS cut {cut['t0']:g} to {cut['t1']:g} s: {_figure(cut['horizontal_rms_m'])} m rms, "
        f"{_figure(cut['horizontal_max_m'])} m max"
        for cut in scores["outages"]
    ]
    if scores["velocity_rms_m_s"] is not None:
        said.append(f"velocity against GPS {scores['velocity_rms_m_s']:.3f} m/s rms")
    if "truth" in scores:
        truth = scores["truth"]
        said.append(f"against {truth['reference']} {truth['horizontal_rms_m']:.2f} m rms horizontally")
    return "; ".join(said) or "nothing to compare it with"


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
