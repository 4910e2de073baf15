"""`flownav identify`: rig and flight logs into a sensor file, with intervals and a verdict on what they show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import chosen, named, numbers, option, out_option
from flownav.cli.tables import Column, answer, say, say_files, table_of

if TYPE_CHECKING:
    from flownav.lab.identification.findings import Findings

LOGS = "Rig folders or their CSV files, or one flight's log."
ORDER = "The model's order; delay is gain and latency alone."
HEIGHTS = "Sensor's height [m], one for all logs or one each; repeated or with commas."
REFERENCE = "What it is held against: of a rig, of a flight."
FOR = "Also write this autopilot's parameters."
BASE = "The sensor file for what no log shows (optics, limits)."
RESPONSES = (
    Column("axis", lambda r: r.axis),
    Column("height [m]", lambda r: f"{r.height_m:.2f}"),
    Column("gain", lambda r: _interval(r.gain, 1.0, 3)),
    Column("latency [ms]", lambda r: _interval(r.latency_s, 1e3, 0)),
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
    autopilot: Annotated[str | None, chosen(FOR, *options.AUTOPILOTS, flag="--for")] = None,
    base: Annotated[Path | None, option("FILE.toml", BASE, unset="the paper's sensor")] = None,
    out: Annotated[Path | None, out_option("The sensor file (TOML)", "out/LOG.toml")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Identify a flow sensor: gain, latency, dynamics, noise, each with its interval, as a sensor file."""
    from flownav.api.identifying import require_logs

    require_logs(logs)

    from flownav.api.identifying import identify_logs
    from flownav.cli.output import place
    from flownav.lab.identification.autopilot_parameters import AUTOPILOTS as SUFFIXES

    suffix = None if autopilot is None else SUFFIXES[autopilot]
    path = place(_sensor_path(out, logs), *logs, base, force=force, beside=(suffix,) if suffix else ())
    parameter_path = path.with_suffix(suffix) if suffix else None
    heights_m = numbers("--heights", heights, 0.001, 1000.0) if heights else []
    sensor = identify_logs(logs, order, heights_m, reference, flow_instance=flow_instance, base=base)
    facts = sensor.facts | {"sensor": str(sensor.save(path))}
    if parameter_path is not None and autopilot is not None:
        facts |= {"parameters": str(parameter_path), "autopilot": sensor.save_parameters(parameter_path, autopilot)}
    findings = sensor.findings
    if findings is not None:
        answer(facts, as_json, lambda: show(findings, facts))


def _sensor_path(out: Path | None, logs: list[Path]) -> Path:
    from flownav.core.errors import InputError
    from flownav.lab.identification.job import name_of

    path = out or Path("out") / f"{name_of(logs)}.toml"
    if path.suffix != ".toml":
        raise InputError(f"--out {path}: a sensor file's name ends in .toml")
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
    say(
        f"Error: {_interval(noise.sigma_m_s, 1.0, 3)} m/s at {noise.reference_m:.2f} m, growing with height to the "
        f"power {_interval(noise.exponent, 1.0, 2)} from {noise.low_m:.2f} to {noise.high_m:.2f} m",
        table_of(SCHEDULES, findings.noise.schedules, title="Schedules of the variance (best first)"),
        *(f"Note: {note}" for note in findings.notes),
    )
    say_files(facts, ("sensor", "parameters"))


def _mean(values: list[float]) -> str:
    return f"{sum(values) / len(values):.1f}" if values else "-"


def _interval(interval: Any, factor: float, digits: int) -> str:
    value, low, high = (f"{factor * number:.{digits}f}" for number in interval)
    return f"{value} [{low}, {high}]"
