"""`flownav identify`: logs into a sensor file, with a verdict on what they show; `flownav flow`: pictures into flow."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import chosen, named, numbers, option, out_option, switch
from flownav.cli.output import Column, answer, by_reason, place, say, say_files, table, table_of
from flownav.core.errors import InputError
from flownav.core.text import number

if TYPE_CHECKING:
    from flownav.lab.identification.findings import Findings
    from flownav.lab.optics.flow import FlowSeries


LOGS = "Rig folders or their CSV files, or one flight's log."
ORDER = "The model's order; delay is gain and latency alone."
HEIGHTS = "Sensor's height [m], one for all logs or one each; repeated or with commas."
REFERENCE = "The reference: of a rig, of a flight."
FOR = "Also write this autopilot's parameters."
BASE = "The sensor file, or with --vehicle the vehicle file, for what no log shows."
VEHICLE = "Identify the vehicle instead, of one flight's log with commands; writes a vehicle file."
RESPONSES = (
    Column("axis", lambda r: r.axis),
    Column("height [m]", lambda r: f"{r.height_m:.2f}"),
    Column("gain", lambda r: _interval(r.gain, 1.0, 3)),
    Column("latency [ms]", lambda r: _latency(r)),
    Column("order", lambda r: r.model.structure.label),
    Column("fit [%]", lambda r: f"{r.model.fit_percent:.1f}"),
    Column("unseen [%]", lambda r: _mean([value for value in r.validation_percent if value == value])),
    Column("error [m/s]", lambda r: f"{r.model.sigma:.3f}"),
)
SCHEDULES = (
    Column("variance by", lambda s: s.name),
    Column("score", lambda s: f"{s.score:.3f}"),
    Column("within 2 sigma", lambda s: f"{100 * s.share_within_2_sigma:.1f} %"),
    Column("sigma low", lambda s: f"{s.sigma_lowest_m_s:.3f}"),
    Column("sigma high", lambda s: f"{s.sigma_highest_m_s:.3f}"),
)


def command(
    logs: Annotated[list[Path], named("LOG", LOGS)],
    order: Annotated[str, chosen(ORDER, *options.ORDERS)] = "auto",
    heights: Annotated[list[str] | None, option("M", HEIGHTS, unset="as the log says")] = None,
    reference: Annotated[str, chosen(REFERENCE, *options.REFERENCES)] = "auto",
    flow_instance: options.FlowInstance = None,
    autopilot: Annotated[str | None, chosen(FOR, *options.SCALED_FLOW, flag="--for")] = None,
    base: Annotated[Path | None, option("FILE.toml", BASE, unset="the paper's sensor, a shipped vehicle")] = None,
    vehicle: Annotated[bool, switch(VEHICLE, "--vehicle")] = False,
    out: Annotated[Path | None, out_option("The sensor or vehicle file (TOML)", "out/LOG.toml")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Identify a flow sensor: gain, latency, dynamics, noise, each with its interval, as a sensor file."""
    from flownav.api.identifying import require_logs

    require_logs(logs)
    if vehicle:
        given = {"--order": order != "auto", "--heights": bool(heights), "--reference": reference != "auto",
                 "--flow-instance": flow_instance is not None, "--for": autopilot is not None}  # fmt: skip
        identify_vehicle(logs, base, out, [name for name, is_given in given.items() if is_given], force, as_json)
        return

    from flownav.api.identifying import identify_logs
    from flownav.lab.identification.autopilot_parameters import left_out, parameters
    from flownav.lab.identification.parameter_file import AUTOPILOTS as SUFFIXES

    suffix = None if autopilot is None else SUFFIXES[autopilot]
    path = place(_sensor_path(out, logs), *logs, base, force=force, beside=(suffix,) if suffix else ())
    parameter_path = path.with_suffix(suffix) if suffix else None
    heights_m = numbers("--heights", heights, 0.001, 1000.0) if heights else []
    sensor = identify_logs(logs, order, heights_m, reference, flow_instance=flow_instance, base=base)
    facts = sensor.facts | {"sensor": str(sensor.save(path))}
    findings = sensor.findings
    if parameter_path is not None and autopilot is not None and findings is not None:
        facts |= {"parameters": str(parameter_path), "autopilot": sensor.save_parameters(parameter_path, autopilot)}
        facts |= {"left_out": dict(left_out(autopilot, findings))}
        facts |= {"cut": {p.name: p.needed for p in parameters(autopilot, findings) if p.needed is not None}}
    if findings is not None:
        answer(facts, as_json, lambda: show(findings, facts))


VEHICLE_COLUMNS = (
    Column("parameter", lambda f: f.name),
    Column("value [95 % interval]", lambda f: _figures(f.interval)),
    Column("unit", lambda f: f.unit),
)


def identify_vehicle(
    logs: list[Path], base: Path | None, out: Path | None, sensors_own: list[str], force: bool, as_json: bool
) -> None:
    """Identify the vehicle of one flight, print what it shows with intervals, and write the vehicle file."""
    from flownav.api.identifying import identify_vehicle_log
    from flownav.lab.identification.vehicle_file import moved_entries, write_vehicle

    if sensors_own:
        raise InputError(f"{sensors_own[0]} is of a flow sensor; leave it out with --vehicle")
    if len(logs) != 1:
        raise InputError("--vehicle takes one flight's log")
    path = place(_sensor_path(out, logs, "-vehicle"), *logs, base, force=force)
    found, contents = identify_vehicle_log(logs[0], base)
    flight = found.flight
    moved = [entry.key for entry in moved_entries(found, base_of(base, flight.kind))]
    if moved:
        write_vehicle(path, contents)
    shown = [each for each in found.found if each.interval is not None]
    facts = {
        "kind": flight.kind, "log": str(logs[0]), "commands": flight.command_name, "setpoint": flight.setpoint_name,
        "seconds": flight.span_s, "highest_hz": flight.highest_hz,
        "parameters": [
            {"key": f.key, "unit": f.unit, **_numbers(f.interval), "why_none": f.why or None}
            for f in found.found
        ],
        "entries": moved, "notes": list(found.notes),
        "vehicle": str(path) if moved else None,
    }  # fmt: skip
    lacking = list(by_reason((f.name, f.why) for f in found.found if f.interval is None))

    def show() -> None:
        title = f"{flight.kind}, {flight.span_s:.0f} s in the air, commands: {flight.command_name}"
        say(
            table_of(VEHICLE_COLUMNS, shown, title=title),
            *(f"No number: {names}; {why}" for names, why in lacking),
            *(f"Note: {note}" for note in found.notes),
            f"Moved in the file: {', '.join(moved)}" if moved else "No vehicle file: nothing found moves an entry",
        )
        say_files(facts, ("vehicle",))

    answer(facts, as_json, show)


def base_of(base: Path | None, kind: str) -> Path:
    """The vehicle file for what no log shows."""
    return base or Path("maxi-joker-3" if kind == "helicopter" else "quad-450")


def _numbers(interval: Any) -> dict[str, float | None]:
    return dict(zip(("value", "low", "high"), interval or (None,) * 3, strict=True))


def _figures(interval: Any) -> str:
    value, low, high = (f"{number:.3g}" for number in interval)
    return f"{value} [{low}, {high}]"


def _sensor_path(out: Path | None, logs: list[Path], ending: str = "") -> Path:
    from flownav.lab.identification.job import name_of

    path = out or Path("out") / f"{name_of(logs)}{ending}.toml"
    if path.suffix != ".toml":
        raise InputError(f"--out {path}: a {'vehicle' if ending else 'sensor'} file's name ends in .toml")
    return path


def show(findings: Findings, facts: dict[str, Any]) -> None:
    """The sensor's figures with their intervals, what the log could show, and the files that were written."""
    say(
        table_of(RESPONSES, findings.responses, title=f"Flow sensor against {findings.reference}, 95 % intervals"),
        f"Axes: {findings.axes.verdict}",
        f"Excitation: {findings.excitation.verdict}",
    )
    law, noise = findings.scale_with_speed, findings.noise.law
    if law is not None:
        say(f"Speed: {law.verdict}; {_interval(law.per_m_s, 1.0, 3)} per m/s")
    if findings.offset is not None:
        x, y = (_interval(axis, 1.0, 4) for axis in findings.offset)
        say(f"Offset: flow about x {x}, about y {y} rad/s{'' if findings.offset.matters else '; none that is certain'}")
    if findings.gyro_verdict:
        say(f"Fault: {findings.gyro_verdict}")
    say(
        f"Error: {_interval(noise.sigma_m_s, 1.0, 3)} m/s at {noise.reference_m:.2f} m, growing with height to the "
        f"power {_interval(noise.exponent, 1.0, 2)} from {noise.low_m:.2f} to {noise.high_m:.2f} m",
        table_of(SCHEDULES, findings.noise.schedules, title="Schedules of the variance (best first)"),
        *(f"Note: {note}" for note in findings.notes),
        *(f"Not written: {names}; {why}" for names, why in by_reason(facts.get("left_out", {}).items())),
        *(f"Cut to its range: {name}; {needed:.4g} is needed" for name, needed in facts.get("cut", {}).items()),
    )
    say_files(facts, ("sensor", "parameters"))


def _latency(response: Any) -> str:
    """The latency; in words that it is none where the log's motion does not show it."""
    return _interval(response.latency_s, 1e3, 0) if response.choice.excitation.identifiable > 1 else "not shown"


def _mean(values: list[float]) -> str:
    return f"{sum(values) / len(values):.1f}" if values else "-"


def _interval(interval: Any, factor: float, digits: int) -> str:
    value, low, high = (f"{factor * number:.{digits}f}" for number in interval)
    return f"{value} [{low}, {high}]"


FOCAL = "Focal length [px]; the PX4FLOW's is 666.67."
RANGE = "Distance to the ground [m]; adds velocities."
RATES = "CSV with columns rate_x_rad_s, rate_y_rad_s, rate_z_rad_s, a row a frame: compensates rotation."
MIDDLE = "Use the middle PX x PX pixels only."
BIN = "Average PX x PX pixels into one first."
Frames = Annotated[
    list[Path], typer.Argument(help="A folder of pictures, pictures in order, or one video.", show_default=False)
]


def flow(
    frames: Frames,
    fps: Annotated[float, option("HZ", "Frames a second.", unset=False, within=(1e-3, 1e6))],
    focal: Annotated[float, option("PX", FOCAL, within=(1.0, 1e6))] = 666.67,
    distance: Annotated[float | None, option("M", RANGE, "--range", unset=False, within=(0.01, 10_000.0))] = None,
    rates: Annotated[Path | None, option("FILE.csv", RATES, unset=False)] = None,
    firmware: options.Firmware = "2014-12",
    window: Annotated[int | None, option("PX", MIDDLE, unset=False)] = None,
    bin_by: Annotated[int, option("PX", BIN, "--bin", within=(1, 64))] = 1,
    as_json: options.Json = False,
) -> None:
    """Flow and quality from each frame to the next, with the historical firmware of your choice."""
    from flownav.core.compile import announce_compilation
    from flownav.lab.optics.flow import flow_of_frames
    from flownav.lab.optics.frame_files import binned, middle, read_frames

    turned = _rates(rates) if rates else None
    grey = binned(read_frames(frames), bin_by)
    if window is not None:
        grey = middle(grey, window)
    with announce_compilation("flow"):
        series = flow_of_frames(
            grey, fps, focal_px=focal / bin_by, rates_rad_s=turned, range_m=distance, firmware=firmware
        )
    facts = _facts(series, len(grey), grey.shape[2], grey.shape[1], fps, focal / bin_by, firmware)
    answer(facts, as_json, lambda: _show_flow(facts))


def _rates(path: Path) -> Any:
    """The rates of a CSV file, one row a frame."""
    import csv

    import numpy as np

    from flownav.core.guard import an_input

    names = ("rate_x_rad_s", "rate_y_rad_s", "rate_z_rad_s")
    try:
        with an_input(path).open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    try:
        return np.array([[number(row[name]) for name in names] for row in rows]).reshape(-1, 3)
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{path}: columns {', '.join(names)} of numbers are needed, one row a frame") from None


def _facts(
    series: FlowSeries, count: int, width: int, height: int, fps: float, focal_px: float, firmware: str
) -> dict[str, Any]:
    import numpy as np

    good = series.quality > 0
    moving = np.isfinite(series.velocity_m_s).all()
    per_frame = []
    for k in range(count - 1):
        row = {
            "t_s": float(series.time_s[k]),
            "flow_x_px": float(series.flow_px[k, 0]),
            "flow_y_px": float(series.flow_px[k, 1]),
            "quality": int(series.quality[k]),
        }
        if moving:
            row |= {f"velocity_{a}_m_s": float(v) for a, v in zip("xy", series.velocity_m_s[k], strict=True)}
        per_frame.append(row)
    summary = {
        "valid": int(good.sum()),
        "mean_quality": float(series.quality.mean()),
        "mean_flow_px": _mean_of_valid(series.flow_px, good),
        "std_flow_px": series.flow_px[good].std(axis=0).tolist() if good.any() else None,
        "mean_flow_rad_s": _mean_of_valid(series.flow_rad_s, good),
        "mean_velocity_m_s": _mean_of_valid(series.velocity_m_s, good) if moving else None,
    }
    return {
        "frames": count,
        "size_px": [width, height],
        "fps": fps,
        "focal_px": focal_px,
        "firmware": firmware,
        "summary": summary,
        "per_frame": per_frame,
    }


def _mean_of_valid(values: Any, good: Any) -> list[float] | None:
    """The mean of the valid rows, None where there are none."""
    return values[good].mean(axis=0).tolist() if good.any() else None


def _show_flow(facts: dict[str, Any]) -> None:
    summary = facts["summary"]
    width, height = facts["size_px"]
    rows = [
        (label, *(f"{value:.4f}" for value in summary[key]))
        for label, key in (
            ("flow [px]", "mean_flow_px"), ("spread [px]", "std_flow_px"), ("flow [rad/s]", "mean_flow_rad_s"),
            ("velocity [m/s]", "mean_velocity_m_s"),
        )
        if summary[key] is not None
    ]  # fmt: skip
    say(
        f"{facts['frames']} frames of {width}x{height} px, firmware {facts['firmware']}",
        f"{summary['valid']} of {facts['frames'] - 1} pairs valid, quality {summary['mean_quality']:.0f}/255",
        table(("mean of the valid pairs", "x", "y"), rows),
    )
