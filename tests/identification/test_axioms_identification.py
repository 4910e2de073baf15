"""Invariances of identification, time and units: a sensor that states its delay is the same sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.lab.identification.flight import Flight
from flownav.lab.identification.reference_motion import Motion
from flownav.lab.identification.scale import against_speed

GRID_S = np.arange(-2.0, 92.0, 0.02)
DELAY_S = 0.24


def moved(size: float = 1.0) -> Motion:
    """To and fro within a window, ever faster: half a period too late or too early is another motion."""
    speed = (0.5 + 0.03 * GRID_S) * np.sin(1.7 * GRID_S)
    velocity = size * np.column_stack([speed, 0.4 * np.sin(0.9 * GRID_S), np.zeros(len(GRID_S))])
    return Motion(GRID_S, velocity, 0.0, True, 0.0, None, None, None)


def flown(delay_s: float, size: float = 1.0, gain: float = 0.8) -> tuple[Flight, np.ndarray]:
    """Readings that tell the motion of delay_s ago, 80 % of it."""
    t_s = np.arange(0.0, 88.0, 0.04)
    reference = moved(size)
    velocity = gain * np.column_stack([np.interp(t_s, GRID_S, column) for column in reference.velocity_m_s[:, :2].T])
    level = Stream.of(Sensor.ATTITUDE, np.array([-9.0, 99.0]), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)))
    full = np.full(len(t_s), 255.0)
    flight = Flight("made", t_s + delay_s, velocity, 0.0, full, np.full(len(t_s), 2.0), np.ones(len(t_s), bool), level,
                    None, "truth", GRID_S, np.zeros((len(GRID_S), 3)), None, 2.0, ())  # fmt: skip
    return flight, velocity


def test_a_delay_that_is_known_costs_no_scale():
    prompt, velocity = flown(0.0)
    late, same = flown(DELAY_S)
    at_once = against_speed(prompt, moved(), velocity, 0.0)
    told = against_speed(late, moved(), same, DELAY_S)
    assert at_once is not None
    assert told is not None
    for found in (at_once, told):
        assert found.at_slow.value == pytest.approx(0.8, abs=1e-3)
        assert found.at_fast.value == pytest.approx(0.8, abs=1e-3)
        assert not found.matters
    untold = against_speed(late, moved(), same, 0.0)
    assert untold is not None
    assert untold.at_fast.value < 0.77  # what is late and does not say so reads too little


def test_a_scale_is_of_no_unit():
    """Faster motions have another speed at which the scale stands, and the same scale."""
    for size in (2.0, 5.0):
        flight, velocity = flown(0.0, size)
        found = against_speed(flight, moved(size), velocity, 0.0)
        assert found is not None
        assert found.at_fast.value == pytest.approx(0.8, abs=1e-3)
    doubled, velocity = flown(0.0)
    twice = against_speed(replace(doubled), moved(), 2.0 * velocity, 0.0)
    assert twice is not None
    assert twice.at_fast.value == pytest.approx(1.6, abs=2e-3)
