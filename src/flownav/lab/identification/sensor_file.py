"""Findings as a sensor file: the datasheet that simulation, replay and campaigns read, written whole or not at all.

Entries that a log cannot show (optics, limits, the sonar's floor) are taken from a base file and marked so. Dynamics
that the input did not show are those of a second-order Bessel lag with the identified gain and latency, and marked so.
"""

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.guard import write_text
from flownav.core.parameter_files import check
from flownav.core.provenance import hash_of
from flownav.core.text import to_toml
from flownav.lab.identification.descent import Structure
from flownav.lab.identification.findings import Findings, Response
from flownav.lab.identification.quantities import Interval, coefficients, numerator
from flownav.sensors.datasheet import FlowSensor

SHORTEST_LATENCY_S = 0.005
STEEPEST_EXPONENT = 4.0
FILE_DIGITS = 7  # of the numbers in the file


def sensor_entries(findings: Findings, base: FlowSensor, name: str, provenance: str) -> dict[str, Any]:
    """The file's content as nested dictionaries, in the order in which it is written, numbers of FILE_DIGITS digits."""
    entries = {
        "schema_version": 1,
        "name": name,
        "provenance": provenance,
        "sonar_floor_m": _taken(base.sonar_floor_m, base),
        "dynamics": _dynamics(findings),
        "noise": _noise(findings),
        "limits": _limits(findings, base),
        "optics": {key: _taken(getattr(base.optics, key), base) for key in ("focal_length_px", "image_side_px")},
        "identification": _identification(findings),
        "identified_models": _run_models(findings),
    }
    rounded: dict[str, Any] = _rounded(entries)
    return rounded


def _rounded(value: Any) -> Any:
    """Entries with no more digits than their numbers deserve."""
    if isinstance(value, Mapping):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return float(f"{value:.{FILE_DIGITS}g}") if isinstance(value, float) else value


def write_sensor(path: Path, entries: Mapping[str, Any]) -> FlowSensor:
    """Write the file and read it back. InputError where it would not load, or cannot be written."""
    text = to_toml(entries)
    sensor = check(tomllib.loads(text), FlowSensor, str(path))
    write_whole(path, text)
    return sensor


def write_whole(path: Path, text: str) -> None:
    """A text file under a temporary name, then renamed. InputError where it cannot be written."""
    try:
        write_text(text, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another name") from error


# -- the tables ----------------------------------------------------------------------------------------------
def _taken(value: float, base: FlowSensor) -> dict[str, Any]:
    return {"value": value, "source": f"not measured here; taken over from {base.name}"}


def _valued(interval: Interval, source: str) -> dict[str, Any]:
    return {"value": interval.value, "uncertainty": 0.5 * (interval.high - interval.low), "source": source}


def is_identified(response: Response) -> bool:
    """Whether a response's dynamics are a second-order model that its input showed whole."""
    return response.model.structure == Structure(2) and response.choice.excitation.complete


def _dynamics(findings: Findings) -> dict[str, Any]:
    best = findings.best
    if is_identified(best):
        b, c = coefficients(best.model)
        source = f"output error, {best.axis} at {best.height_m:.2f} m, +- 95 %"
        a = numerator(best.model)
        return {"a_1_s2": _valued(Interval(abs(a.value), a.low, a.high), source),
                "b_1_s": _valued(b, source), "c_1_s2": _valued(c, source)}  # fmt: skip
    gain = best.gain if findings.kind == "rig" else findings.gain
    slowness, stiffness = bessel(max(findings.latency_s.value, SHORTEST_LATENCY_S))
    source = "Bessel lag of the identified gain and latency; the natural frequency is assumed"
    lag = {"a_1_s2": abs(gain.value) * stiffness, "b_1_s": slowness, "c_1_s2": stiffness}
    return {key: {"value": value, "source": source} for key, value in lag.items()}


def bessel(latency_s: float) -> tuple[float, float]:
    """b and c of the second-order Bessel lag: unit gain, this delay, 3/(s^2 + 3 s + 3) in units of it."""
    return 3.0 / latency_s, 3.0 / latency_s**2


def _noise(findings: Findings) -> dict[str, Any]:
    law = findings.noise.law
    exponent = float(np.clip(law.exponent.value, -STEEPEST_EXPONENT, STEEPEST_EXPONENT))
    source = f"{len(findings.noise.points)} heights, weighted least squares of log sigma on log h, +- 95 %"
    entries: dict[str, Any] = {"law": "power" if law.high_m > law.low_m and exponent != 0.0 else "constant"}
    entries["sigma_m_s"] = _valued(law.sigma_m_s, source)
    entries["reference_height_m"] = law.reference_m
    if entries["law"] == "power":
        entries["exponent"] = _valued(law.exponent._replace(value=exponent), source)
    entries["signal_sigma_m_s"] = {"value": findings.noise.signal_sigma_m_s, "source": 'only for law = "accuracy"'}
    entries["min_height_m"] = {"value": law.low_m, "source": "lowest height identified"}
    entries["max_height_m"] = {"value": law.high_m, "source": "greatest height identified"}
    return entries


def _limits(findings: Findings, base: FlowSensor) -> dict[str, Any]:
    """The base's limits, widened to what was seen to work."""
    seen = {
        "min_height_m": min(base.limits.min_height_m, findings.heights_m[0]),
        "max_height_m": max(base.limits.max_height_m, findings.heights_m[1]),
        "max_flow_rad_s": max(base.limits.max_flow_rad_s, findings.max_flow_rad_s),
    }
    entries: dict[str, Any] = {
        key: {"value": value, "source": "reached in the logs"} if value != getattr(base.limits, key)
        else _taken(value, base)
        for key, value in seen.items()
    }  # fmt: skip
    entries["max_tilt_deg"] = _taken(base.limits.max_tilt_deg, base)
    entries["hysteresis"] = base.limits.hysteresis
    return entries


def _identification(findings: Findings) -> dict[str, Any]:
    excitation, law = findings.excitation, findings.noise.law
    return {
        "kind": findings.kind,
        "reference": findings.reference,
        "axes": findings.axes.verdict,
        "verdict": excitation.verdict,
        "parameters": excitation.parameters,
        "identifiable": excitation.identifiable,
        **_interval("gain", findings.gain, ""),
        **_interval("latency", findings.latency_s, "_s"),
        **_offset(findings),
        "lowest_height_m": findings.heights_m[0],
        "highest_height_m": findings.heights_m[1],
        "fastest_flow_rad_s": findings.max_flow_rad_s,
        "least_quality": findings.least_quality,
        "noise_exponent_low": law.exponent.low,
        "noise_exponent_high": law.exponent.high,
        "notes": list(findings.notes),
        "dynamics": _dynamics_interval(findings.best),
        "responses": [_response(response) for response in findings.responses],
        "noise": [point._asdict() for point in findings.noise.points],
        "quality": [
            {"quality_low": q.low, "quality_high": q.high, "variance_m2_s2": q.variance_m2_s2, "readings": q.readings}
            for q in findings.noise.quality
        ],
        "sources": [{"path": str(file), "sha256": hash_of(file)} for file in findings.files],
    }


def _offset(findings: Findings) -> dict[str, float]:
    found = findings.offset
    if found is None:
        return {}
    return _interval("offset_x", found.x, "_rad_s") | _interval("offset_y", found.y, "_rad_s")


def _interval(name: str, interval: Interval, unit: str) -> dict[str, float]:
    return {f"{name}{unit}": interval.value, f"{name}_low{unit}": interval.low, f"{name}_high{unit}": interval.high}


def _dynamics_interval(best: Response) -> dict[str, Any]:
    if not is_identified(best):
        return {"validity": "assumed", "note": "only gain and latency hold; natural frequency and damping do not"}
    b, c = coefficients(best.model)
    a = numerator(best.model)
    return {
        "validity": "identified",
        "note": f"{best.axis} at {best.height_m:.2f} m; gain and latency of other heights stand in responses",
        "a_low_1_s2": a.low, "a_high_1_s2": a.high, "b_low_1_s": b.low, "b_high_1_s": b.high,
        "c_low_1_s2": c.low, "c_high_1_s2": c.high,
    }  # fmt: skip


def _response(response: Response) -> dict[str, Any]:
    known = [value for value in response.validation_percent if math.isfinite(value)]
    return {
        "axis": response.axis,
        "height_m": response.height_m,
        **_interval("gain", response.gain, ""),
        **_interval("latency", response.latency_s, "_s"),
        "order": response.model.structure.label,
        "fit_percent": response.model.fit_percent,
        **({"validation_percent": float(np.mean(known))} if known else {}),
        "residual_sigma_m_s": response.model.sigma,
        "residuals_white": response.model.whiteness.white,
        "runs": response.runs,
        "readings": response.model.readings,
    }


def _run_models(findings: Findings) -> list[dict[str, Any]]:
    rows = []
    for row in findings.run_models:
        b, c = coefficients(row.fit)
        a = abs(numerator(row.fit).value)
        if max(a, c.value) <= 1e7 and b.value <= 1e4:
            rows.append({"height_m": row.height_m, "model": row.model, "fit_percent": row.fit.fit_percent,
                         "a_1_s2": a, "b_1_s": b.value, "c_1_s2": c.value})  # fmt: skip
    return rows
