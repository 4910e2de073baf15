"""Invariances of faults: a flight that began later fails alike, and sensors that are not struck stay as they are."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaigns.faults.catalogue import FAULTS
from flownav.campaigns.faults.inject import as_fed
from flownav.core.measurement import COLUMNS, Sensor, Stream

BEGIN_S, END_S = 4.0, 7.0
LATER_S = 512.1875  # no multiple of any fault's own period
STRUCK = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY, Sensor.RANGE, Sensor.IMU,
          Sensor.BARO, Sensor.ATTITUDE)  # fmt: skip


def flight(shift_s: float) -> dict[Sensor, Stream]:
    """Every sensor, at rates and with values of its own; times are dyadic, so that a shift changes no difference."""
    streams = {}
    for k, sensor in enumerate(STRUCK):
        rng = np.random.default_rng(k)
        t_s = np.arange(0.0, 12.0, (k + 1) / 64.0)
        value = 2.0 + rng.normal(size=(len(t_s), len(COLUMNS[sensor])))
        streams[sensor] = Stream.of(sensor, t_s + shift_s, value, delay_s=k / 128.0)
    return streams


def alike(one: Stream, other: Stream, shift_s: float) -> None:
    np.testing.assert_allclose(other.t_s - shift_s, one.t_s, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(other.value, one.value, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(other.quality, one.quality)


@pytest.mark.parametrize("name", FAULTS)
def test_a_flight_that_began_later_fails_alike(name):
    fault = FAULTS[name]
    now = fault.inject(flight(0.0), BEGIN_S, END_S, seed=3)
    later = fault.inject(flight(LATER_S), BEGIN_S + LATER_S, END_S + LATER_S, seed=3)
    for sensor in now:
        alike(now[sensor], later[sensor], LATER_S)
    fed, fed_later = as_fed(now), as_fed(later)
    np.testing.assert_array_equal(fed.sensor, fed_later.sensor)
    np.testing.assert_allclose(fed_later.t_s - LATER_S, fed.t_s, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("name", FAULTS)
def test_sensors_that_are_not_struck_and_readings_outside_stay_as_they_are(name):
    fault, sound = FAULTS[name], flight(0.0)
    struck = fault.inject(sound, BEGIN_S, END_S, seed=3)
    for sensor, stream in sound.items():
        if sensor not in fault.sensors:
            assert struck[sensor] is stream
            continue
        for outside in (lambda t_s: t_s < BEGIN_S, lambda t_s: t_s >= END_S + 1.0):
            before, after = (each.value[outside(each.t_s)] for each in (stream, struck[sensor]))
            np.testing.assert_array_equal(after, before)


@pytest.mark.parametrize("name", FAULTS)
def test_one_sensor_fails_alone_as_it_does_among_others(name):
    """Its draws are its own: without another sensor it fails just so (but for one that looks at the range)."""
    fault, sound = FAULTS[name], flight(0.0)
    among = fault.inject(sound, BEGIN_S, END_S, seed=3)
    for sensor in set(fault.sensors) & set(sound):
        company = {sensor, Sensor.RANGE}
        alone = fault.inject({each: sound[each] for each in sound if each in company}, BEGIN_S, END_S, seed=3)
        alike(among[sensor], alone[sensor], 0.0)
