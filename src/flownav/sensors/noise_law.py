"""How a flow sensor's noise grows with height: the laws, and the polynomial that the equations evaluate.

- `constant`: one standard deviation.
- `power`: sigma_r (h/h_r)^n. Table 2's means follow 0.0350 (h/0.6)^2.06 m/s.
- `accuracy`: (1 - A sqrt(h_r/h)) sigma_signal with A = 0.9, h_r = 0.6 m: the paper's accuracy rule (87, 92, 92,
  90 % after its scaling by field of view and speed) read as a fit of 100 (1 - sigma/sigma_signal) per cent.

A power is a library call that would stop the lanes from vectorising. The law is therefore fitted once, by
relative least squares, with a polynomial in the fourth root of the height; powers and the square root are
smooth in it: degree 8 follows the shipped law to 2e-12, every power from -1 to 3 over heights of 1 : 30 to 7e-4.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from pydantic import Field, ValidationInfo, field_validator

from flownav.core.measurement import Array
from flownav.core.parameter_files import Number, ParameterModel
from flownav.sensors.flow import NOISE_DEGREE

Law = Callable[[Array], Array]
WORST_FIT = 1e-3


class NoiseFit(NamedTuple):
    """sigma(h) = sum c_i s^i, s = (h^(1/4) - centre) scale, for low_m <= h <= high_m."""

    low_m: float
    high_m: float
    centre: float
    scale: float
    coefficients: tuple[float, ...]
    worst: float  # largest relative error


def power_law(sigma_m_s: float, reference_height_m: float, exponent: float) -> Law:
    """sigma(h) = sigma_m_s (h/reference)^exponent."""
    return lambda height_m: sigma_m_s * (height_m / reference_height_m) ** exponent


def accuracy_law(accuracy: float, reference_height_m: float, signal_sigma_m_s: float) -> Law:
    """sigma(h) = (1 - accuracy sqrt(reference/h)) signal_sigma, the paper's rule."""
    return lambda height_m: (1.0 - accuracy * np.sqrt(reference_height_m / height_m)) * signal_sigma_m_s


def constant_noise(sigma_m_s: float, low_m: float, high_m: float) -> NoiseFit:
    """A law with one standard deviation, which may be zero, at every height."""
    return NoiseFit(low_m, high_m, 0.0, 0.0, (sigma_m_s, *(0.0,) * NOISE_DEGREE), 0.0)


def fit_noise_law(law: Law, low_m: float, high_m: float) -> NoiseFit:
    """The polynomial for a law that is positive from low_m to high_m.

    ValueError where the law is not positive there, or is too steep to be followed within 0.1 %.
    """
    if high_m <= low_m * (1.0 + 1e-6):  # one height
        return constant_noise(float(law(np.array([low_m]))[0]), low_m, high_m)
    height = np.geomspace(low_m, high_m, 400)
    sigma = law(height)
    if not np.all(sigma > 0.0):
        raise ValueError(f"the noise law is not positive from {low_m:g} to {high_m:g} m; raise the lower height")
    root = height**0.25
    centre = 0.5 * float(root[0] + root[-1])
    scale = 2.0 / float(root[-1] - root[0])
    s = (root - centre) * scale
    fit = Polynomial.fit(s, sigma, NOISE_DEGREE, w=1.0 / sigma, domain=[-1.0, 1.0], window=[-1.0, 1.0])
    worst = float(np.max(np.abs(fit(s) / sigma - 1.0)))
    if worst > WORST_FIT:
        raise ValueError(f"the noise law is too steep from {low_m:g} to {high_m:g} m; narrow the heights")
    return NoiseFit(low_m, high_m, centre, scale, tuple(float(c) for c in fit.coef), worst)


class Noise(ParameterModel):
    """Standard deviation of a published velocity against height (`noise_law.py`); the law picks its keys."""

    law: Literal["constant", "power", "accuracy"]  # one figure, a power of the height, or the paper's accuracy rule
    sigma_m_s: Number | None = Field(None, ge=0.0, le=100.0, validate_default=True)  # at reference_height_m, or always
    reference_height_m: Number = Field(0.6, gt=0.0, le=1000.0)  # of the laws power and accuracy
    exponent: Number = Field(1.0, ge=-4.0, le=4.0)  # of the height, in the law power; 0: the same at all heights
    accuracy: Number = Field(0.9, gt=0.0, lt=1.0)  # of the law accuracy: 1 - sigma/signal_sigma at the reference
    signal_sigma_m_s: Number | None = Field(None, gt=0.0, le=100.0, validate_default=True)  # of the law accuracy
    floor_m_s: Number = Field(0.0, ge=0.0, le=100.0)  # least standard deviation, whatever the law gives
    min_height_m: Number = Field(gt=0.0, le=1000.0)  # below it the standard deviation stays
    max_height_m: Number = Field(gt=0.0, le=1000.0)  # above it the standard deviation stays

    @field_validator("sigma_m_s", "signal_sigma_m_s")
    @classmethod
    def _scale_is_given(cls, value: float | None, info: ValidationInfo) -> float | None:
        law = info.data.get("law")
        needed = "signal_sigma_m_s" if law == "accuracy" else "sigma_m_s"
        if law is not None and value is None and info.field_name == needed:
            raise ValueError(f'law = "{law}" needs this key')
        return value

    @field_validator("max_height_m")
    @classmethod
    def _law_holds(cls, value: float, info: ValidationInfo) -> float:
        """Above the lower height, and the law can be evaluated between the two (checked if all else is right)."""
        value = not_below("min_height_m", value, info)
        if set(info.data) | {"max_height_m"} == set(cls.model_fields):
            cls.model_construct(**info.data, max_height_m=value).fit()
        return value

    def fit(self) -> NoiseFit:
        """The law as the equations evaluate it, without its floor. ValueError as `fit_noise_law`."""
        return _fitted(self)

    def curve(self) -> Law:
        """The law that varies with height: heights [m] to standard deviations [m/s]."""
        if self.law == "accuracy":
            return accuracy_law(self.accuracy, self.reference_height_m, self.signal_sigma_m_s or 0.0)
        return power_law(self.sigma_m_s or 0.0, self.reference_height_m, self.exponent)


@lru_cache(maxsize=64)
def _fitted(noise: Noise) -> NoiseFit:
    """The law's fit, which many flights of one sensor share."""
    if noise.law == "constant":
        return constant_noise(noise.sigma_m_s or 0.0, noise.min_height_m, noise.max_height_m)
    return fit_noise_law(noise.curve(), noise.min_height_m, noise.max_height_m)


def not_below(lower: str, value: float, info: ValidationInfo) -> float:
    """The value, which must not be below that of another key. ValueError where it is."""
    if value < info.data.get(lower, 0.0):
        raise ValueError(f"at least {lower} = {info.data[lower]} is needed")
    return value
