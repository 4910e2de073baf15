"""Invariances of a whole replay: one made flight of 20 s, later, turned, and cut short."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from flownav.core.frames import quaternion_product
from flownav.core.measurement import Sensor, Stream
from flownav.logs.csv_folder import read_csv_folder
from flownav.logs.log import Log
from flownav.navigation.rows import EstimateRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from replay_logs import log_of_flight

NED = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Log:
    """No two readings of one instant, whose order would be rounding; and no compass, whose north is the place's own."""
    read = read_csv_folder(log_of_flight(20.0).write(tmp_path_factory.mktemp("axioms") / "made"))
    apart = {sensor: replace(stream, t_s=stream.t_s + 0.0013 * k) for k, (sensor, stream) in
             enumerate(read.streams.items()) if sensor != Sensor.MAG}  # fmt: skip
    return replace(read, streams=apart, truth=None, autopilot=None)


@pytest.fixture(scope="module")
def known(log):
    return said(log)


def said(log: Log) -> EstimateRow:
    return replay(log, ReplayOptions(), NavigatorSettingsFile()).estimate_rows


def at_common_times(one: EstimateRow, other: EstimateRow, shift_s: float = 0.0) -> tuple[EstimateRow, EstimateRow]:
    """The rows of one instant: rows are some 20 ms apart, and to which readings they fall is rounding."""
    times = [np.rint(1e5 * t_s).astype(np.int64) for t_s in (one.t_s, other.t_s - shift_s)]
    _, first, second = np.intersect1d(*times, return_indices=True)
    assert len(first) > 0.4 * len(one.t_s)
    return EstimateRow(*(column[first] for column in one)), EstimateRow(*(column[second] for column in other))


def with_streams(log: Log, change) -> Log:
    return replace(log, streams={sensor: change(stream) for sensor, stream in log.streams.items()})


@pytest.mark.parametrize("shift_s", [1024.0, -4096.0])
def test_a_log_that_is_shifted_in_time_is_the_same_flight(log, known, shift_s):
    later = said(with_streams(log, lambda stream: replace(stream, t_s=stream.t_s + shift_s)))
    known, later = at_common_times(known, later, shift_s)
    for name in ("pos_ned_m", "vel_ned_m_s", "quaternion", "std_pos_ned_m", "std_tilt_ned_rad", "protection_m"):
        np.testing.assert_allclose(getattr(later, name), getattr(known, name), rtol=1e-5, atol=1e-5, err_msg=name)


@pytest.mark.parametrize("angle", [0.5 * math.pi, -2.2])
def test_a_log_of_a_turned_world_is_the_same_flight_turned(log, known, angle):
    """GPS and the attitude's heading turned about down: path, velocity, heading and covariance turn along."""
    c, s = math.cos(angle), math.sin(angle)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    half = (math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle))

    def turned(stream: Stream) -> Stream:
        if stream.sensor in NED:
            return replace(stream, value=stream.value @ rotation.T)
        if stream.sensor == Sensor.ATTITUDE:
            return replace(stream, value=np.column_stack(quaternion_product(half, tuple(stream.value.T))))
        return stream

    known, there = at_common_times(known, said(with_streams(log, turned)))
    np.testing.assert_allclose(there.pos_ned_m, known.pos_ned_m @ rotation.T, atol=2e-4)
    np.testing.assert_allclose(there.vel_ned_m_s, known.vel_ned_m_s @ rotation.T, atol=2e-4)
    np.testing.assert_allclose(there.vel_frd_m_s, known.vel_frd_m_s, atol=2e-4)
    back = np.column_stack(quaternion_product(half, tuple(known.quaternion.T)))
    assert np.abs(np.abs(np.sum(back * there.quaternion, axis=1)) - 1.0).max() < 1e-6
    level = np.hypot(*known.std_pos_ned_m[:, :2].T)
    np.testing.assert_allclose(np.hypot(*there.std_pos_ned_m[:, :2].T), level, rtol=1e-3)  # the trace does not turn
    np.testing.assert_allclose(there.std_pos_ned_m[:, 2], known.std_pos_ned_m[:, 2], rtol=1e-3)
    # a drift of GPS is sought north and east, and the worse of the two counts, which does not quite turn
    np.testing.assert_allclose(there.protection_m, known.protection_m, rtol=3e-2, atol=1e-3)


def test_what_comes_later_changes_nothing_that_was_said(log, known):
    """The filter runs forward: a log cut in its middle says to there what the whole one says."""
    middle_s = float(known.t_s[0]) + 10.0

    def first_half(stream: Stream) -> Stream:
        kept = stream.t_s <= middle_s + 1.0
        return replace(stream, t_s=stream.t_s[kept], value=stream.value[kept], variance=stream.variance[kept],
                       quality=stream.quality[kept])  # fmt: skip

    known, half = at_common_times(known, said(with_streams(log, first_half)))
    shared = known.t_s < middle_s
    assert np.count_nonzero(shared) > 300
    np.testing.assert_allclose(half.pos_ned_m[shared], known.pos_ned_m[shared], atol=1e-9)
    np.testing.assert_allclose(half.std_pos_ned_m[shared], known.std_pos_ned_m[shared], atol=1e-9)
