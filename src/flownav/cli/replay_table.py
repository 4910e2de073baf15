"""What `flownav replay` prints for people: errors, sensors and their innovations, what was not fused, and findings."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

from flownav.cli.output import autopilot_errors
from flownav.core.record import Record
from flownav.scoring.consistency import verdict


def show(record: Record, scores: dict[str, Any]) -> None:
    """The same figures for people."""
    console = Console(markup=False, highlight=False)
    console.print(f"{record.manifest['log']}: {scores['duration_s']:.1f} s")
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
    for note in record.manifest["notes"]:
        console.print(f"Note: {note}")
    for finding in record.manifest["findings"]:
        console.print(f"{finding['label']}: {finding['text']}")
    for name in ("record", "report"):
        if name in scores:
            console.print(f"{name.capitalize()}: {scores[name]}", soft_wrap=True)


def _sensors(scores: dict[str, Any]) -> Any:
    """When each sensor spoke, and whether the filter's innovations are as large as it states, and news."""
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
