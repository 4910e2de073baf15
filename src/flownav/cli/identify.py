"""`flownav identify`: rig and flight logs into a sensor file, with intervals and a verdict on what they show."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from flownav.identification.findings import Findings


def command(
    logs: Annotated[
        list[Path], typer.Argument(help="Rig folders or CSV files, or one flight log (docs/identification.md).")
    ],
    order: Annotated[str, typer.Option(help="auto, delay (gain and latency), 1 to 6, or e.g. 2+delay.")] = "auto",
    heights: Annotated[
        str | None, typer.Option(metavar="H[,H..]", help="Sensor's height [m]: one for all logs, or one each.")
    ] = None,
    reference: Annotated[str, typer.Option(help="auto; rig: velocity or encoder; flight: truth or gps.")] = "auto",
    flow_instance: Annotated[
        int | None, typer.Option("--flow-instance", metavar="N", help="Which of a flight's several flow sensors.")
    ] = None,
    autopilot: Annotated[
        str | None, typer.Option("--for", help="Also write this autopilot's parameters: px4 or ardupilot.")
    ] = None,
    base: Annotated[
        Path | None, typer.Option(help="Sensor file for what no log tells (optics, limits); the paper's where unsaid.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="The sensor file; out/NAME.toml where unsaid.", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Identify a flow sensor: gain, latency, dynamics, noise, each with its interval, as a sensor file."""
    from flownav.cli.output import require_writable
    from flownav.compile import announce_compilation
    from flownav.identification.job import identify, name_of, parse_heights
    from flownav.identification.orders import parse_order
    from flownav.identification.sensor_file import sensor_entries, write_sensor
    from flownav.provenance import command_line
    from flownav.sensors.datasheet import load_sensor

    structures, heights_m = parse_order(order), parse_heights(heights)
    path = _sensor_path(out, logs)
    parameter_path = _parameter_path(path, autopilot)
    for output in (path, parameter_path):
        if output is not None:
            require_writable(output, *logs, base)
    base_sensor = load_sensor(base)
    with announce_compilation("identification"):
        findings = identify(logs, structures, heights_m, reference, flow_instance)
    entries = sensor_entries(findings, base_sensor, f"identified from {name_of(logs)}", command_line())
    sensor = write_sensor(path, entries)
    facts = _facts(findings) | {"sensor": str(path)}
    if parameter_path is not None:
        from flownav.identification.autopilot_parameters import write_parameters

        assert autopilot is not None
        found = write_parameters(parameter_path, autopilot, findings, sensor)
        facts["parameters"] = str(parameter_path)
        facts["autopilot"] = {parameter.name: float(parameter.text) for parameter in found}
    if as_json:
        typer.echo(json.dumps(facts))
    else:
        _print(findings, facts)


def _sensor_path(out: Path | None, logs: list[Path]) -> Path:
    from flownav.errors import InputError
    from flownav.identification.job import name_of

    path = out or Path("out") / f"{name_of(logs)}.toml"
    if path.suffix != ".toml":
        raise InputError(f"--out {path}: a sensor file's name ends in .toml")
    return path


def _parameter_path(path: Path, autopilot: str | None) -> Path | None:
    from flownav.errors import InputError

    if autopilot is None:
        return None
    from flownav.identification.autopilot_parameters import AUTOPILOTS

    if autopilot not in AUTOPILOTS:
        raise InputError(f"--for {autopilot}: px4 or ardupilot are possible")
    return path.with_suffix(AUTOPILOTS[autopilot])


def _facts(findings: Findings) -> dict[str, Any]:
    """The JSON object, less the files."""
    from flownav.identification.job import finite

    law = findings.noise.law
    facts: dict[str, Any] = finite({
        "kind": findings.kind,
        "reference": findings.reference,
        "axes": findings.axes.verdict,
        "gain": findings.gain.as_dict(),
        "latency_s": findings.latency_s.as_dict(),
        "order": findings.best.model.structure.label,
        "fit_percent": findings.best.model.fit_percent,
        "excitation": {
            "parameters": findings.excitation.parameters,
            "identifiable": findings.excitation.identifiable,
            "verdict": findings.excitation.verdict,
        },
        "noise": {
            "law": {
                "sigma_m_s": law.sigma_m_s.as_dict(), "exponent": law.exponent.as_dict(),
                "reference_height_m": law.reference_m, "low_m": law.low_m, "high_m": law.high_m,
            },
            "by_height": [p._asdict() | {"sigma_rad_s": p.sigma_rad_s} for p in findings.noise.points],
            "by_quality": [q._asdict() for q in findings.noise.quality],
            "schedules": [s._asdict() for s in findings.noise.schedules],
        },
        "scale_with_speed": _speed(findings),
        "responses": [_response(response) for response in findings.responses],
        "notes": list(findings.notes),
        "details": findings.details,
    })  # fmt: skip
    return facts


def _speed(findings: Findings) -> dict[str, Any] | None:
    law = findings.scale_with_speed
    if law is None:
        return None
    ends = {"per_m_s": law.per_m_s.as_dict(), "at_slow": law.at_slow.as_dict(), "at_fast": law.at_fast.as_dict()}
    return {**ends, "slow_m_s": law.slow_m_s, "fast_m_s": law.fast_m_s, "matters": law.matters, "verdict": law.verdict}


def _response(response: Any) -> dict[str, Any]:
    model = response.model
    return {
        "axis": response.axis,
        "height_m": response.height_m,
        "gain": response.gain.as_dict(),
        "latency_s": response.latency_s.as_dict(),
        "order": model.structure.label,
        "fit_percent": model.fit_percent,
        "fits_percent": list(model.fits),
        "validation_percent": list(response.validation_percent),
        "sigma_m_s": model.sigma,
        "residuals_white": model.whiteness.white,
        "verdict": response.choice.excitation.verdict,
        "tried": [
            {"order": fit.structure.label, "fit_percent": fit.fit_percent, "aic": fit.aic, "bic": fit.bic,
             "parameters": shown.parameters, "identifiable": shown.identifiable}
            for fit, shown in response.choice.tried
        ],
    }  # fmt: skip


def _print(findings: Findings, facts: dict[str, Any]) -> None:
    """The same figures for people."""
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, highlight=False)
    table = Table(
        "axis", "height [m]", "gain", "latency [ms]", "order", "fit [%]", "unseen [%]", "error [m/s]",
        title=f"Flow sensor against {findings.reference}, 95 % intervals",
    )  # fmt: skip
    for r in findings.responses:
        unseen = [value for value in r.validation_percent if value == value]
        table.add_row(
            r.axis, f"{r.height_m:.2f}", _interval(r.gain, 1.0, 3), _interval(r.latency_s, 1e3, 0),
            r.model.structure.label, f"{r.model.fit_percent:.1f}",
            f"{sum(unseen) / len(unseen):.1f}" if unseen else "-", f"{r.model.sigma:.3f}",
        )  # fmt: skip
    console.print(table)
    console.print(f"Axes: {findings.axes.verdict}")
    console.print(f"Excitation: {findings.excitation.verdict}")
    law = findings.scale_with_speed
    if law is not None:
        console.print(f"Speed: {law.verdict}; {_interval(law.per_m_s, 1.0, 3)} per m/s")
    noise = findings.noise.law
    console.print(
        f"Error: {_interval(noise.sigma_m_s, 1.0, 3)} m/s at {noise.reference_m:.2f} m, growing with height to the "
        f"power {_interval(noise.exponent, 1.0, 2)} from {noise.low_m:.2f} to {noise.high_m:.2f} m"
    )
    title = "Schedules of the variance (best first)"
    schedules = Table("variance by", "score", "within 2 sigma", "sigma low", "sigma high", title=title)
    for s in findings.noise.schedules:
        schedules.add_row(
            s.name, f"{s.score:.3f}", f"{100 * s.share_within_2_sigma:.1f} %", f"{s.sigma_lowest_m_s:.3f}",
            f"{s.sigma_highest_m_s:.3f}",
        )  # fmt: skip
    console.print(schedules)
    for note in findings.notes:
        console.print(f"Note: {note}")
    for name in ("sensor", "parameters"):
        if name in facts:
            console.print(f"{name.capitalize()}: {facts[name]}", soft_wrap=True)


def _interval(interval: Any, factor: float, digits: int) -> str:
    value, low, high = (f"{factor * number:.{digits}f}" for number in interval)
    return f"{value} [{low}, {high}]"
