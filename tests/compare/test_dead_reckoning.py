"""Flow times range, summed: it must follow a flight whose sensors have no error, and stand where nothing is seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flownav.core.frames import quaternion_from_euler
from flownav.core.measurement import Array, Sensor, Stream
from flownav.logs.open_log import open_flight
from flownav.replays.prepare import ReplayOptions, prepare
from flownav.scoring.reference import outage_error
from flownav.studies.compare.job import default_windows
from flownav.studies.compare.tracks import dead_reckoned
from replay_logs import log_of_flight

T_S = np.arange(0.0, 20.0, 0.05)
LEVEL = Stream.of(Sensor.ATTITUDE, np.array([0.0, 20.0]), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)))


def rates(flow_x: float, flow_y: float, gyro_x: float = 0.0, gyro_y: float = 0.0, **more) -> Stream:
    value = np.tile([flow_x, flow_y, gyro_x, gyro_y], (len(T_S), 1))
    return Stream.of(Sensor.FLOW_RATE, T_S, value, **more)


def ranges(metres: Array | float, t_s: Array = T_S) -> Stream:
    return Stream.of(Sensor.RANGE, t_s, np.zeros(len(t_s))[:, None] + np.reshape(metres, (-1, 1)))


def end(flow: Stream, distance: Stream | None, attitude: Stream = LEVEL) -> list[float]:
    track = dead_reckoned(flow, distance, attitude)
    assert track is not None
    return track.motion.position[-1].tolist()


def test_flow_less_its_gyro_times_range_is_velocity_by_px4s_convention():
    """flow_y = w_y + v_x / r: 0.5 rad/s at 2 m is 1 m/s ahead; flow_x = w_x - v_y / r: 0.25 rad/s is 0.5 m/s left."""
    assert end(rates(0.35, 0.8, 0.1, 0.3), ranges(2.0)) == pytest.approx([19.95, -9.975, -2.0])


def test_the_attitude_turns_it():
    east = Stream.of(Sensor.ATTITUDE, LEVEL.t_s, np.tile(quaternion_from_euler(0.0, 0.0, np.pi / 2), (2, 1)))
    track = dead_reckoned(rates(0.0, 0.5), ranges(2.0), east)
    assert track.motion.position[-1] == pytest.approx([0.0, 19.95, -2.0], abs=1e-9)
    assert track.motion.heading_rad == pytest.approx(np.full(len(T_S), np.pi / 2))
    assert track.velocity_ne[0] == pytest.approx([0.0, 1.0], abs=1e-12)


def test_a_tilted_vehicle_moves_level_and_hangs_lower_than_its_range():
    nose_down = Stream.of(Sensor.ATTITUDE, LEVEL.t_s, np.tile(quaternion_from_euler(0.0, -0.4, 0.0), (2, 1)))
    north, _, down = end(rates(0.0, 0.5), ranges(2.0), nose_down)
    assert north == pytest.approx(19.95 / np.cos(0.4))  # what the lens sees is the part across its boresight
    assert down == pytest.approx(-2.0 * np.cos(0.4))


@pytest.mark.parametrize("blind", ["quality", "value", "range"])
def test_what_is_not_seen_does_not_move(blind):
    flow, distance, away = rates(0.0, 0.5), ranges(2.0), (T_S > 5.0) & (T_S < 15.0)
    if blind == "quality":
        flow = replace(flow, quality=np.where(away, 0.0, 200.0))
    elif blind == "value":
        flow = replace(flow, value=np.where(away[:, None], np.nan, flow.value))
    else:
        distance = ranges(2.0, T_S[(T_S < 4.1) | (T_S > 15.9)])
    assert end(flow, distance)[0] == pytest.approx(10.0, abs=0.15)


def test_a_short_pause_is_bridged_and_a_long_one_is_not():
    flow = rates(0.0, 0.5)
    for length, way in ((0.9, 19.95), (3.0, 16.95)):
        kept = (T_S < 5.0) | (T_S - length > 5.0)
        paused = Stream.of(Sensor.FLOW_RATE, T_S[kept], flow.value[kept])
        assert end(paused, ranges(2.0))[0] == pytest.approx(way, abs=0.11)


def test_no_range_no_path_but_a_metric_sensor_needs_none():
    assert dead_reckoned(rates(0.0, 0.5), None, LEVEL) is None
    assert dead_reckoned(rates(0.0, 0.5), ranges(np.nan), LEVEL) is None
    metric = Stream.of(Sensor.FLOW_VELOCITY, T_S, np.tile([1.0, -0.5, np.nan], (len(T_S), 1)))
    assert end(metric, None)[:2] == pytest.approx([19.95, -9.975])
    assert dead_reckoned(Stream.of(Sensor.FLOW_VELOCITY, T_S[:1], metric.value[:1]), None, LEVEL) is None


def test_a_flight_without_errors_is_followed(tmp_path):
    flown = log_of_flight(40.0)
    streams = prepare(open_flight(flown.write(tmp_path / "garden")), ReplayOptions()).streams
    track = dead_reckoned(streams[Sensor.FLOW_RATE], streams[Sensor.RANGE], streams[Sensor.ATTITUDE])
    true = np.column_stack([np.interp(track.t_s, flown.t_s, column) for column in flown.position.T])
    assert np.hypot(*(track.motion.position - true)[:, :2].T).max() < 0.4  # of 90 m; its climbs are not level
    speed = np.column_stack([np.interp(track.t_s, flown.t_s, column) for column in flown.velocity.T])
    assert np.sqrt(np.mean((track.velocity_ne - speed[:, :2]) ** 2)) < 0.03


@pytest.mark.parametrize(("name", "median", "worst"), [
    ("quad-px4flow-outdoor", 0.87, 1.47), ("quad-px4flow-outdoor-2", 0.64, 5.11),
])  # fmt: skip
def test_the_recorded_flights_give_the_figures_that_others_found(data_folder, name, median, worst):
    """Dead reckoning as the data's own page has it (of outdoor-2 nine of its ten windows), written apart from this."""
    log = open_flight(data_folder / name)
    streams = prepare(log, ReplayOptions()).streams
    track = dead_reckoned(streams[Sensor.FLOW_RATE], streams[Sensor.RANGE], streams[Sensor.ATTITUDE])
    gps = log.streams[Sensor.GPS_POSITION]
    rms = [
        outage_error(track.t_s, track.motion.position[:, :2], gps.t_s, gps.value[:, :2], 0.22, *w).horizontal_rms_m
        for w in default_windows(log.span_s)
    ]
    assert np.median(rms) == pytest.approx(median, rel=0.1)
    assert max(rms) == pytest.approx(worst, rel=0.15)
