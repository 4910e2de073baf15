"""A leap of a reference that is spread over many rows: known since no accelerometer felt it, at any speed."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import Sensor, Stream
from flownav.core.record import POSITION_NED
from flownav.logs.references import examined
from flownav.logs.unfelt import GRAVITY_M_S2, unfelt

SPAN_S = 40.0


def place(t_s):
    """A flight with turns and a climb, (n,) to (n, 3) [m]."""
    return np.column_stack([10.0 * np.sin(0.3 * t_s), 4.0 * t_s, -1.0 - 0.1 * t_s])


def imu_of(place, *, late_s=0.0, weight=True, seed=1):
    """The accelerometer of a vehicle on a path, 200 Hz, with its noise; all of its force along one axis."""
    t_s = np.arange(0.0, SPAN_S, 0.005)
    speed = np.gradient(place(t_s), t_s, axis=0)
    force = np.gradient(speed, t_s, axis=0) - [0.0, 0.0, GRAVITY_M_S2 * weight]
    value = np.zeros((len(t_s), 6))
    value[:, 5] = -np.linalg.norm(force, axis=1)
    value[:, 3:] += np.random.default_rng(seed).normal(0.0, 0.5, (len(t_s), 3))
    return Stream.of(Sensor.IMU, t_s + late_s, value)


def table(t_s, position):
    return {"t_s": t_s} | dict(zip(POSITION_NED, position.T, strict=True))


def path_of(truth):
    return np.column_stack([truth[name] for name in POSITION_NED])


def spread(t_s, begin_s, lasts_s, by):
    return np.clip((t_s - begin_s) / lasts_s, 0.0, 1.0)[:, None] * by


@pytest.mark.parametrize("late_s", [0.0, 0.2, -0.2])
@pytest.mark.parametrize(("hz", "lasts_s", "by"), [
    (10.0, 1.0, [8.0, -6.0, 0.0]), (10.0, 1.5, [0.0, 12.0, 0.0]), (50.0, 1.0, [3.0, 0.0, 0.0]),
    (100.0, 0.5, [0.0, -2.0, 0.0]), (100.0, 1.0, [0.0, 4.0, -3.0]),
])  # fmt: skip
def test_a_leap_slower_than_20_m_s_is_named_and_taken_back(hz, lasts_s, by, late_s):
    """Between 3 and 10 m/s: none of them was named, and all that followed was scored as error."""
    t_s = np.arange(0.5, SPAN_S - 0.5, 1.0 / hz)
    bad = place(t_s) + spread(t_s, 20.0, lasts_s, by)
    assert examined(table(t_s, bad), "truth.csv")[1] == ()
    truth, notes = examined(table(t_s, bad), "truth.csv", imu_of(place, late_s=late_s))
    kept = np.isin(t_s, truth["t_s"])
    assert np.abs(path_of(truth) - place(t_s[kept])).max() < 0.6
    assert (~kept).sum() > 0.5 * lasts_s * hz
    assert ((t_s[~kept] > 19.8) & (t_s[~kept] < 20.2 + lasts_s)).all()
    (note,) = notes
    assert note.startswith("truth.csv leaps by ")
    assert note.endswith("which no accelerometer felt; these rows are left out, and what follows is shifted back")
    assert float(note.split(" leaps by ")[1].split(" m ")[0]) == pytest.approx(np.linalg.norm(by), abs=0.6)


def test_two_leaps_are_taken_back_each():
    t_s = np.arange(0.5, SPAN_S - 0.5, 0.02)
    bad = place(t_s) + spread(t_s, 10.0, 0.8, [5.0, 0.0, 0.0]) + spread(t_s, 25.0, 0.8, [0.0, -6.0, 0.0])
    truth, notes = examined(table(t_s, bad), "x", imu_of(place))
    assert np.abs(path_of(truth) - place(np.asarray(truth["t_s"]))).max() < 0.5
    begins = [float(one.split(" to ")[0]) for one in notes[0].split(" from ")[1:]]
    assert begins == pytest.approx([10.0, 25.0], abs=0.1)


def dash(t_s):
    """A vehicle that dashes 8 m sideways in 2 s, hard: its accelerometer feels it."""
    way = np.clip((t_s - 20.0) / 2.0, 0.0, 1.0)
    return place(t_s) + (8.0 * (way - np.sin(2.0 * np.pi * way) / (2.0 * np.pi)))[:, None] * [1.0, 0.0, 0.0]


@pytest.mark.parametrize("noise_m", [0.0, 0.003])
@pytest.mark.parametrize("hz", [10.0, 100.0])
def test_what_was_felt_is_flown(hz, noise_m):
    t_s = np.arange(0.5, SPAN_S - 0.5, 1.0 / hz)
    for path in (place, dash):
        truth = table(t_s, path(t_s) + np.random.default_rng(2).normal(0.0, 1.0, (len(t_s), 3)) * noise_m)
        assert examined(truth, "x", imu_of(path)) == (truth, ())


def test_an_accelerometer_without_gravity_with_gaps_or_of_another_flight_tells_nothing():
    t_s = np.arange(0.5, SPAN_S - 0.5, 0.02)
    bad = place(t_s) + spread(t_s, 20.0, 1.0, [5.0, 0.0, 0.0])
    imu = imu_of(place)
    assert len(unfelt(t_s, bad, imu)) == 1
    assert not unfelt(t_s, bad, None)
    assert not unfelt(t_s, bad, imu_of(place, weight=False))
    there = (imu.t_s < 19.5) | (imu.t_s > 21.5)
    assert not unfelt(t_s, bad, Stream.of(Sensor.IMU, imu.t_s[there], imu.value[there]))
    wild = place(t_s) + 0.5 * np.sin(12.0 * t_s)[:, None]
    assert not unfelt(t_s, wild, imu)


def test_a_path_that_goes_on_where_it_was_going_is_left_alone():
    """A bump of a second that no accelerometer felt: it is back where it would have been."""
    t_s = np.arange(0.5, SPAN_S - 0.5, 0.02)
    bump = 2.0 * np.clip(1.0 - np.abs(t_s - 20.0) / 0.5, 0.0, 1.0)
    truth = table(t_s, place(t_s) + bump[:, None] * [1.0, 0.0, 0.0])
    assert examined(truth, "x", imu_of(place)) == (truth, ())


def test_a_vehicle_that_dashes_a_little_after_or_before_its_accelerometer_says_so_has_flown_there():
    t_s = np.arange(0.5, SPAN_S - 0.5, 0.02)
    for late_s in (-0.25, 0.25):
        assert examined(table(t_s, hard(t_s)), "x", imu_of(hard, late_s=late_s))[1] == ()


def hard(t_s):
    """A dash of 4 m in 0.7 s: 50 m/s2."""
    way = np.clip((t_s - 20.0) / 0.7, 0.0, 1.0)
    return place(t_s) + (4.0 * (way - np.sin(2.0 * np.pi * way) / (2.0 * np.pi)))[:, None] * [1.0, 0.0, 0.0]


def test_a_noisy_reference_does_not_leap():
    t_s = np.arange(0.5, SPAN_S - 0.5, 0.02)
    noisy = place(t_s) + np.random.default_rng(3).normal(0.0, 0.05, (len(t_s), 3))
    assert examined(table(t_s, noisy), "x", imu_of(place))[1] == ()
