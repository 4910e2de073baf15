"""Findings as the JSON object that `flownav identify` prints."""

from __future__ import annotations

from typing import Any

from flownav.core.text import finite
from flownav.lab.identification.findings import Findings, Response


def facts_of(findings: Findings) -> dict[str, Any]:
    """The JSON object of `flownav identify`, less the files that it wrote."""
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


def _response(response: Response) -> dict[str, Any]:
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
