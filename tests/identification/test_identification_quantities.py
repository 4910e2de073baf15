"""Gain, latency, frequency and damping with their intervals, against draws from the covariance of a fit."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from flownav.lab.identification.descent import Point, Structure
from flownav.lab.identification.quantities import Interval, coefficients, gain, latency, latency_s, numerator
from second_order import damping, natural_frequency

POINT = Point(np.log([14.8, 191.9]), 1.03, 0.02)
ROOT = np.array([[0.040, 0.0, 0.0, 0.0], [0.015, 0.020, 0.0, 0.0], [0.010, -0.015, 0.030, 0.0],
                 [0.0004, 0.0003, -0.0005, 0.0008]])  # fmt: skip
FIT = SimpleNamespace(structure=Structure(2, True), point=POINT, covariance=ROOT @ ROOT.T)


def drawn(count=200_000):
    """a_1, a_2, gain and delay as the fit's covariance lets them be, (count,) each."""
    shift = ROOT @ np.random.default_rng(31).standard_normal((4, count))
    return (
        np.exp(POINT.log_a[0] + shift[0]),
        np.exp(POINT.log_a[1] + shift[1]),
        POINT.gain + shift[2],
        (POINT.delay_s + shift[3]),
    )


A_1, A_2, GAIN, DELAY = drawn()


@pytest.mark.parametrize(
    ("found", "draws"),
    [
        (gain(FIT), GAIN),
        (latency(FIT), DELAY + A_1 / A_2),
        (natural_frequency(FIT), np.sqrt(A_2)),
        (damping(FIT), A_1 / (2.0 * np.sqrt(A_2))),
        (numerator(FIT), GAIN * A_2),
        (coefficients(FIT)[0], A_1),
        (coefficients(FIT)[1], A_2),
    ],
    ids=["gain", "latency", "frequency", "damping", "numerator", "a_1", "a_2"],
)
def test_an_interval_holds_95_per_cent_of_what_the_covariance_allows(found, draws):
    low, middle, high = np.percentile(draws, [2.5, 50.0, 97.5])
    width = high - low
    assert found.value == pytest.approx(middle, abs=0.01 * width)
    assert found.low == pytest.approx(low, abs=0.02 * width)
    assert found.high == pytest.approx(high, abs=0.02 * width)


def test_latency_is_the_delay_of_a_slow_signal_through_the_model():
    system = signal.TransferFunction([POINT.gain * 191.9], [1.0, 14.8, 191.9])
    slow = 1e-3
    _, response = signal.freqresp(system, [slow])
    assert latency_s(POINT) == pytest.approx(-np.angle(response[0]) / slow + POINT.delay_s, rel=1e-5)


def test_frequency_and_damping_are_those_of_the_models_poles():
    poles = np.roots([1.0, 14.8, 191.9])
    assert natural_frequency(FIT).value == pytest.approx(np.abs(poles[0]))
    assert damping(FIT).value == pytest.approx(-poles[0].real / np.abs(poles[0]))


def test_a_logarithms_interval_is_as_wide_in_proportion_on_either_side():
    found = Interval.of_log(2.0, 0.1)
    assert found.high / found.value == pytest.approx(found.value / found.low)
    assert found.low == pytest.approx(2.0 * np.exp(-0.196), rel=1e-4)
