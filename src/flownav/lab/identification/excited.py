"""Responses of commands and rates to a set-point: spectra over windows, averaged against the set-point.

A vehicle flies in closed loop, so that its commands answer the gusts that also turn it: a regression of one on the
other shows the autopilot instead of the vehicle. The set-point knows nothing of the gusts. Each signal's average
against the set-point over the windows (an instrumental variable) is therefore its response to the set-point alone, and
the ratio of two responses is the vehicle's. Windows are Hann's, half over each other; every second line of their
spectra is used, since neighbours share what they see. (Bendat and Piersol, Random Data, 4th ed., chapters 6 and 11;
Söderström and Stoica, System Identification, chapter 8.)
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array

WINDOW_S = 4.0
OVERLAP = 2  # windows begin this many times in a window's length
LOWEST_HZ = 0.7  # below it gusts move the vehicle more than any command
LEAST_POWER = 0.02  # of a line's set-point, over the strongest line's: less is the window's own side
SET = 0.9  # share of a window in which the set-point is at work; in others what came before is still at work, too
NEIGHBOUR = 1.0 / 6.0  # correlation of noise in windows half over each other

Complex = NDArray[np.complex128]


class Spectra(NamedTuple):
    """Lines of all windows: w_rad_s (m,), what was set, and the signals by name, each (windows, m)."""

    w_rad_s: Array
    setpoint: Complex
    signals: dict[str, Complex]
    shared: float  # correlation of noise in neighbouring windows


class Responses(NamedTuple):
    """Responses to the set-point, each (m,), and the set-point's energy in each line, which divides their noise."""

    w_rad_s: Array
    signals: dict[str, Complex]
    energy: Array


def spectra(
    step_s: float, setpoint: Array, signals: dict[str, Array], highest_hz: float, *, periodic: bool = False
) -> Spectra:
    """Spectra of evenly sampled signals (n,) while the set-point is at work. Empty where they are too short.

    periodic: the set-point has whole periods in a window: then windows need no taper, lie one after another up to the
    end of the set-point, and every line is independent.
    """
    length = round(WINDOW_S / step_s)
    hz = np.arange(length // 2 + 1) / (length * step_s)
    lines = np.flatnonzero((hz >= LOWEST_HZ) & (hz <= highest_hz))[:: 1 if periodic else 2]
    starts = _one_after_another(setpoint, length) if periodic else _half_over_each_other(setpoint, length)
    taper = np.ones(length) if periodic else np.hanning(length + 1)[:-1]

    def of(signal: Array) -> Complex:
        rows = [np.fft.rfft(taper * (part - part.mean()))[lines] for part in (signal[k : k + length] for k in starts)]
        return np.array(rows, complex).reshape(len(starts), len(lines))

    return Spectra(
        2.0 * np.pi * hz[lines], of(setpoint), {name: of(signal) for name, signal in signals.items()},
        0.0 if periodic else NEIGHBOUR,
    )  # fmt: skip


def _half_over_each_other(setpoint: Array, length: int) -> list[int]:
    """Where windows begin in which the set-point is at work; before and after it something else is."""
    starts = range(0, len(setpoint) - length + 1, max(1, length // OVERLAP))
    return [k for k in starts if np.mean(setpoint[k : k + length] != 0.0) > SET]


def _one_after_another(setpoint: Array, length: int) -> list[int]:
    """Where windows begin that end with each stretch of the set-point."""
    edges = np.diff((setpoint != 0.0).astype(int), prepend=0, append=0)
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    return [
        int(end) - (k + 1) * length for a, end in zip(begins, ends, strict=True) for k in range((end - a) // length)
    ]


def responses(found: Spectra) -> Responses:
    """The responses in those lines that the set-point excites."""
    energy = np.sum(np.abs(found.setpoint) ** 2, axis=0)
    excited = energy > LEAST_POWER * energy.max(initial=0.0)
    averaged = {
        name: np.sum(np.conj(found.setpoint) * signal, axis=0)[excited] / energy[excited]
        for name, signal in found.signals.items()
    }
    return Responses(found.w_rad_s[excited], averaged, energy[excited])


def excited_only(found: Spectra) -> Spectra:
    """The same lines as `responses` has, window by window."""
    energy = np.sum(np.abs(found.setpoint) ** 2, axis=0)
    kept = energy > LEAST_POWER * energy.max(initial=0.0)
    signals = {name: signal[:, kept] for name, signal in found.signals.items()}
    return Spectra(found.w_rad_s[kept], found.setpoint[:, kept], signals, found.shared)


def overlap_factor(found: Spectra) -> Array:
    """By how much the variance of each line's average grows since the windows share half of their readings (m,).

    Noise in neighbouring windows correlates by NEIGHBOUR, turned by half a window.
    """
    turn = np.exp(1j * found.w_rad_s * WINDOW_S / OVERLAP)
    pairs = np.sum(np.real(found.setpoint[1:] * np.conj(found.setpoint[:-1]) * np.conj(turn)), axis=0)
    return np.asarray(
        1.0 + 2.0 * found.shared * pairs / np.maximum(np.sum(np.abs(found.setpoint) ** 2, axis=0), 1e-300)
    )


def strength(found: Spectra, name: str) -> float:
    """How far a signal's response stands out of what the set-point does not explain: the F ratio over the lines.

    A set-point that moves a signal less than gusts do is a weak instrument: its ratios are those of the noise, and look
    sure. Below 10 an instrument counts as weak (Staiger and Stock, Econometrica 65, 1997).
    """
    kept = excited_only(found)
    energy = np.sum(np.abs(kept.setpoint) ** 2, axis=0)
    response = np.sum(np.conj(kept.setpoint) * kept.signals[name], axis=0) / energy
    left = np.sum(np.abs(kept.signals[name] - kept.setpoint * response) ** 2)
    explained = float(np.sum(np.abs(response) ** 2 * energy))
    return explained * (len(kept.setpoint) - 1) / max(float(left), 1e-300)
