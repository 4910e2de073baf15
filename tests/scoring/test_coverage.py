"""From when to when a sensor spoke, and which silences are worth a word."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.measurement import COLUMNS, Sensor, Stream
from flownav.scoring.coverage import coverage_of, silences


def spoken(sensor: Sensor, t0: float, t1: float) -> Stream:
    t_s = np.linspace(t0, t1, 20)
    return Stream.of(sensor, t_s, np.zeros((20, len(COLUMNS[sensor]))))


def said_of(t0: float, t1: float, span: tuple[float, float], sensor: Sensor = Sensor.RANGE) -> list[str]:
    return silences({sensor: spoken(sensor, t0, t1)}, span)


def test_coverage_is_the_first_and_last_reading_by_name():
    streams = {Sensor.RANGE: spoken(Sensor.RANGE, 2.0, 31.2), Sensor.BARO: Stream.of(Sensor.BARO, np.zeros(0), [])}
    assert coverage_of(streams) == {"range": (2.0, 31.2)}


def test_a_sensor_that_falls_silent_is_named_with_both_times():
    assert said_of(0.0, 31.2, (0.0, 60.0)) == ["range ends at 31.2 s of 60.0 s"]
    assert said_of(12.0, 60.0, (0.0, 60.0)) == ["range starts at 12.0 s of 60.0 s"]


@pytest.mark.parametrize(("t0", "t1", "span", "lines"), [
    (0.0, 55.1, (0.0, 60.0), 0),  # less than 5 s
    (0.0, 54.9, (0.0, 60.0), 1),
    (0.0, 951.0, (0.0, 1000.0), 0),  # less than 5 %
    (0.0, 949.0, (0.0, 1000.0), 1),
    (1010.0, 1050.0, (1000.0, 1060.0), 2),  # a clock that starts anywhere
    (1004.0, 1058.0, (1000.0, 1060.0), 0),
])  # fmt: skip
def test_five_seconds_and_five_percent_are_needed(t0, t1, span, lines):
    assert len(said_of(t0, t1, span)) == lines


@pytest.mark.parametrize("sensor", [Sensor.LANDED, Sensor.PAD])
def test_what_speaks_only_when_there_is_something_to_say_is_not_missed(sensor):
    assert said_of(20.0, 25.0, (0.0, 60.0), sensor) == []
