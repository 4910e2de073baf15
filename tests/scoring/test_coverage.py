"""From when to when a sensor spoke, and which silences are worth a word."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import COLUMNS, Sensor, Stream
from flownav.scoring.coverage import coverage_of, silences


def spoken(sensor: Sensor, t0: float, t1: float) -> Stream:
    t_s = np.linspace(t0, t1, 20)
    return Stream.of(sensor, t_s, np.zeros((20, len(COLUMNS[sensor]))))


def learnt_of(t0: float, t1: float, span: tuple[float, float], sensor: Sensor = Sensor.RANGE) -> list[str]:
    return silences({sensor: spoken(sensor, t0, t1)}, span)


def test_coverage_is_the_first_and_last_reading_by_name():
    streams = {Sensor.RANGE: spoken(Sensor.RANGE, 2.0, 31.2), Sensor.BARO: Stream.of(Sensor.BARO, np.zeros(0), [])}
    assert coverage_of(streams) == {"range": (2.0, 31.2)}


def test_a_sensor_that_falls_silent_is_named_with_both_times():
    assert learnt_of(0.0, 31.2, (0.0, 60.0)) == ["range ends at 31.2 s of 60.0 s"]
    assert learnt_of(12.0, 60.0, (0.0, 60.0)) == ["range starts at 12.0 s of 60.0 s"]


@pytest.mark.parametrize(("t0", "t1", "span", "lines"), [
    (0.0, 55.1, (0.0, 60.0), 0),  # less than 5 s
    (0.0, 54.9, (0.0, 60.0), 1),
    (0.0, 951.0, (0.0, 1000.0), 0),  # less than 5 %
    (0.0, 949.0, (0.0, 1000.0), 1),
    (1010.0, 1050.0, (1000.0, 1060.0), 2),  # a clock that starts anywhere
    (1004.0, 1058.0, (1000.0, 1060.0), 0),
])  # fmt: skip
def test_five_seconds_and_five_percent_are_needed(t0, t1, span, lines):
    assert len(learnt_of(t0, t1, span)) == lines


@pytest.mark.parametrize("sensor", [Sensor.LANDED, Sensor.PAD])
def test_what_speaks_only_when_there_is_something_to_say_is_not_missed(sensor):
    assert learnt_of(20.0, 25.0, (0.0, 60.0), sensor) == []


def spoken_by(**spans: tuple[float, float]) -> list[str]:
    streams = {Sensor[name.upper()]: spoken(Sensor[name.upper()], *span) for name, span in spans.items()}
    ends = [time for span in spans.values() for time in span]
    return silences(streams, (min(ends), max(ends)))


def test_one_that_goes_on_alone_is_named_and_not_all_the_others():
    others = {"imu": (0.0, 100.0), "flow_rate": (0.0, 100.0), "range": (0.0, 100.0)}
    assert spoken_by(**others, baro=(0.0, 200.0)) == ["baro goes on to 200.0 s, and most others end at 100.0 s"]
    assert spoken_by(**others, baro=(-50.0, 100.0)) == ["baro starts at -50.0 s, and most others at 0.0 s"]
    assert spoken_by(**others, baro=(-4.0, 104.0)) == []


def test_of_two_the_longer_one_is_the_log():
    assert spoken_by(imu=(0.0, 50.0), baro=(0.0, 100.0)) == ["imu ends at 50.0 s of 100.0 s"]


def test_half_of_a_short_log_is_missed_too():
    assert learnt_of(0.0, 4.0, (0.0, 8.0)) == ["range ends at 4.0 s of 8.0 s"]
    assert learnt_of(0.0, 7.0, (0.0, 8.0)) == []


@pytest.mark.parametrize(("gaps", "words"), [
    ([(20.0, 24.9)], None),
    ([(20.0, 26.0)], "range has no usable reading for 6.1 s from 19.9 s on"),
    ([(10.0, 16.0), (30.0, 50.0)],
     "range has no usable reading for 20.1 s from 29.9 s on (2 such gaps, 26.2 s together)"),
])  # fmt: skip
def test_a_long_pause_is_named(gaps, words):
    t_s = 0.1 * np.arange(601)
    for t0, t1 in gaps:
        t_s = t_s[(t_s < t0 - 1e-9) | (t_s > t1 - 1e-9)]
    stream = Stream.of(Sensor.RANGE, t_s, np.ones((len(t_s), 1)))
    assert silences({Sensor.RANGE: stream}, (0.0, 60.0)) == ([words] if words else [])


def test_a_slow_sensor_does_not_pause_at_every_step():
    assert silences({Sensor.BARO: spoken(Sensor.BARO, 0.0, 200.0)}, (0.0, 200.0)) == []
