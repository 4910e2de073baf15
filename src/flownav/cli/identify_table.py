"""What `flownav identify` prints for people."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

from flownav.lab.identification.findings import Findings


def show(findings: Findings, facts: dict[str, Any]) -> None:
    """The sensor's figures with their intervals, what the log could show, and the files that were written."""
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
