"""Findings of an identification, whatever kind of log it came from: the one bundle that file, JSON and table read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flownav.core.measurement import Array
from flownav.core.text import finite
from flownav.lab.identification import height_law
from flownav.lab.identification.first_look import Axes
from flownav.lab.identification.offset import Offset
from flownav.lab.identification.output_error import Fit
from flownav.lab.identification.own_gyro import OwnGyro
from flownav.lab.identification.quantities import Choice, Excitation, Interval
from flownav.lab.identification.scale import SpeedLaw
from flownav.sensors.datasheet import FlowSensor


@dataclass(frozen=True)
class Response:
    """Gain and latency of one axis at one height, the model behind them and how it does on unseen data.

    height_m is the middle of what the logs covered. validation_percent: one fit a held-out run.
    """

    axis: str
    height_m: float
    gain: Interval
    latency_s: Interval
    choice: Choice
    runs: int
    validation_percent: tuple[float, ...]

    @property
    def model(self) -> Fit:
        """The chosen model."""
        return self.choice.best


@dataclass(frozen=True)
class RunModel:
    """A second-order model of one run, as the paper's Table 1 lists them."""

    height_m: float
    model: int
    source: str
    fit: Fit


@dataclass(frozen=True)
class Noise:
    """The readings' error: by height, its law, by quality, and what schedules of it are worth.

    tail: how many of the law's standard deviations hold 99.7 % of the readings.
    """

    points: tuple[height_law.NoisePoint, ...]
    law: height_law.PowerLaw
    quality: tuple[height_law.QualityPoint, ...]
    schedules: tuple[height_law.ScheduleScore, ...]
    signal_sigma_m_s: float
    tail: float


def noise_of(
    error: Array, height_m: Array, quality: Array, signal_sigma_m_s: float, points: Sequence[height_law.NoisePoint] = ()
) -> Noise:
    """The noise that errors show; all (n,), in order of time. points: by height, in place of bins of equal shares."""
    points = points or height_law.noise_by_height(error, height_m)
    law = height_law.fit_power_law(points)
    grades = tuple(height_law.variance_by_quality(error, quality))
    schedules = tuple(height_law.compare_schedules(error, height_m, quality, signal_sigma_m_s))
    return Noise(tuple(points), law, grades, schedules, signal_sigma_m_s, height_law.tail(error, law.at(height_m)))


@dataclass(frozen=True)
class Findings:
    """Everything found.

    kind: "rig" or "flight"; reference: what the sensor was compared with; max_flow_rad_s: the fastest flow seen while
    usable (99.9 %); heights_m: least and greatest; notes: one line each; details: further figures for JSON;
    scale_with_speed: None where no law shows. offset: of the flow [rad/s], None where the log does not show it.
    own_gyro: the sensor's against the IMU's, None where either lacks. parameters: the vehicle's own settings, as far as
    the log states them. datasheet: the file given for numbers that no log shows; None where none was.
    """

    kind: str
    reference: str
    responses: tuple[Response, ...]
    axes: Axes
    noise: Noise
    run_models: tuple[RunModel, ...]
    heights_m: tuple[float, float]
    max_flow_rad_s: float
    least_quality: int
    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()
    details: dict[str, object] = field(default_factory=dict)
    scale_with_speed: SpeedLaw | None = None
    offset: Offset | None = None
    own_gyro: OwnGyro | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    datasheet: FlowSensor | None = None

    @property
    def gyro_verdict(self) -> str:
        """Verdict on the sensor's own gyro, in words; "" where nothing is wrong."""
        return "" if self.own_gyro is None else self.own_gyro.sentence(abs(self.gain.value))

    @property
    def no_scaler_mends(self) -> str:
        """Why no factor on the flow would mend it, in words; "" where one may."""
        gyro = self.own_gyro
        of_time = gyro is not None and gyro.is_off and gyro.is_of_time(abs(self.gain.value))
        return self.gyro_verdict if of_time else ""

    @property
    def gain(self) -> Interval:
        """Over axes and heights; what they differ by widens it."""
        return height_law.combined(list(dict.fromkeys(response.gain for response in self.responses)))

    @property
    def latency_s(self) -> Interval:
        """Over axes and heights; what they differ by widens it."""
        return height_law.combined(list(dict.fromkeys(response.latency_s for response in self.responses)))

    @property
    def best(self) -> Response:
        """The response with the best-known gain: its dynamics are the sensor's."""
        return min(self.responses, key=lambda r: (r.gain.high - r.gain.low) / max(abs(r.gain.value), 1e-6))

    @property
    def excitation(self) -> Excitation:
        """The verdict on the best response: of its model where dynamics were found, else of a second order."""
        choice = self.best.choice
        return choice.excitation if choice.best.structure.order else choice.widest


# -- as JSON -----------------------------------------------------------------------------------------------------
def facts_of(findings: Findings) -> dict[str, Any]:
    """The JSON object of `flownav identify`, less the files that it wrote."""
    law = findings.noise.law
    facts: dict[str, Any] = finite({
        "kind": findings.kind,
        "reference": findings.reference,
        "axes": findings.axes.verdict,
        "gain": findings.gain._asdict(),
        "latency_s": findings.latency_s._asdict(),
        "order": findings.best.model.structure.label,
        "fit_percent": findings.best.model.fit_percent,
        "excitation": {name: getattr(findings.excitation, name) for name in ("parameters", "identifiable", "verdict")},
        "noise": {
            "law": {
                "sigma_m_s": law.sigma_m_s._asdict(), "exponent": law.exponent._asdict(),
                "reference_height_m": law.reference_m, "low_m": law.low_m, "high_m": law.high_m,
            },
            "by_height": [p._asdict() | {"sigma_rad_s": p.sigma_rad_s} for p in findings.noise.points],
            "by_quality": [q._asdict() for q in findings.noise.quality],
            "schedules": [s._asdict() for s in findings.noise.schedules],
        },
        "scale_with_speed": _speed(findings),
        "flow_offset_rad_s": _offset(findings.offset),
        "own_gyro": _own_gyro(findings),
        "responses": [_response(response) for response in findings.responses],
        "notes": list(findings.notes),
        "details": findings.details,
    })  # fmt: skip
    return facts


def _offset(offset: Offset | None) -> dict[str, Any] | None:
    return None if offset is None else {axis: getattr(offset, axis)._asdict() for axis in offset._fields}


def _own_gyro(findings: Findings) -> dict[str, Any] | None:
    gyro = findings.own_gyro
    if gyro is None:
        return None
    return {
        "slope": gyro.slope._asdict(),
        "lag_s": gyro.lag_s,
        "likeness": gyro.likeness,
        "verdict": findings.gyro_verdict,
    }


def _speed(findings: Findings) -> dict[str, Any] | None:
    law = findings.scale_with_speed
    if law is None:
        return None
    ends = {"per_m_s": law.per_m_s._asdict(), "at_slow": law.at_slow._asdict(), "at_fast": law.at_fast._asdict()}
    return {**ends, "slow_m_s": law.slow_m_s, "fast_m_s": law.fast_m_s, "matters": law.matters, "verdict": law.verdict}


def _response(response: Response) -> dict[str, Any]:
    model = response.model
    return {
        "axis": response.axis,
        "height_m": response.height_m,
        "gain": response.gain._asdict(),
        "latency_s": response.latency_s._asdict(),
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
