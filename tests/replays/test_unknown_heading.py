"""GPS and flow without any heading: it is found from the course, whatever it is."""

from __future__ import annotations

from dataclasses import replace as altered

import numpy as np
import pytest

from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import Sensor
from flownav.estimation.gating import Reason
from flownav.logs.csv_folder import read_csv_folder
from flownav.navigation.rows import EstimateRow, EventRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tape import COMPASS_REFUTED, HEADING_FOUND
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from replay_logs import log_of_flight

FIRST_YAW_RAD, YAW_RATE_RAD_S = 0.3, 0.05  # of replay_logs' flights


@pytest.fixture(scope="module")
def flight():
    return log_of_flight(25.0)


@pytest.fixture(scope="module")
def unheaded(flight, tmp_path_factory):
    log = read_csv_folder(flight.write(tmp_path_factory.mktemp("log") / "flight"))
    streams = {s: stream for s, stream in log.streams.items() if s not in (Sensor.MAG, Sensor.ATTITUDE)}
    return altered(log, streams=streams)


def turned(log, by_rad: float):
    """The log of the same flight in a world that is turned: the vehicle's own sensors read the same."""
    cosine, sine = np.cos(by_rad), np.sin(by_rad)
    turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    streams = dict(log.streams)
    for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY):
        streams[sensor] = altered(streams[sensor], value=streams[sensor].value @ turn)
    return altered(log, streams=streams)


def yaw_of(estimate: np.ndarray) -> np.ndarray:
    rotation = rotation_from_quaternion(*EstimateRow.of(estimate).quaternion.T)
    return np.arctan2(rotation[3], rotation[0])


def test_all_of_36_headings_are_found_within_3_m_and_2_deg(unheaded, flight):
    way_m = np.cumsum(np.hypot(*np.diff(flight.position[:, :2], axis=0, prepend=flight.position[:1, :2]).T))
    for by_rad in np.radians(np.arange(0.0, 360.0, 10.0)):
        run = replay(turned(unheaded, float(by_rad)), ReplayOptions(), NavigatorSettingsFile())
        (found,) = [event for event in run.written.event if event[1] == HEADING_FOUND]
        assert np.interp(found[0], flight.t_s, way_m) < 3.0
        t_s = run.estimate_rows.t_s
        error = yaw_of(run.estimate) - FIRST_YAW_RAD - YAW_RATE_RAD_S * t_s - by_rad
        error = np.abs((error + np.pi) % (2.0 * np.pi) - np.pi)
        assert np.degrees(error[t_s > found[0] + 0.1].max()) < 2.5  # 2.1 of the worst
        cosine, sine = np.cos(by_rad), np.sin(by_rad)
        north, east = (np.interp(t_s, flight.t_s, column) for column in flight.position[:, :2].T)
        off_m = np.hypot(
            run.estimate_rows.pos_ned_m[:, 0] - cosine * north + sine * east,
            run.estimate_rows.pos_ned_m[:, 1] - sine * north - cosine * east,
        )
        assert off_m.max() < 0.8  # 0.63 of the worst


def test_no_flow_is_fused_before(unheaded):
    run = replay(turned(unheaded, 2.0), ReplayOptions(), NavigatorSettingsFile())
    found_s = next(event[0] for event in run.written.event if event[1] == HEADING_FOUND)
    flow = run.innovation[run.offered.sensor == Sensor.FLOW_RATE]
    assert not (flow[flow[:, 0] < found_s, 8] == 0).any()
    assert (flow[flow[:, 0] > found_s, 8] == 0).mean() > 0.95


def test_a_flow_of_the_wrong_sign_finds_a_heading_half_a_turn_off(unheaded):
    """No other sensor could tell: the sentinel does, by the turning."""
    flow = unheaded.streams[Sensor.FLOW_RATE]
    wrong = flow.value.copy()
    wrong[:, :2] = 2.0 * wrong[:, 2:4] - wrong[:, :2]  # the velocity's part inverted, the turning's kept
    log = altered(unheaded, streams={**unheaded.streams, Sensor.FLOW_RATE: altered(flow, value=wrong)})
    run = replay(log, ReplayOptions(), NavigatorSettingsFile())
    (found,) = [event for event in run.written.event if event[1] == HEADING_FOUND]
    assert abs(abs(found[2] - FIRST_YAW_RAD) - np.pi) < 0.5


# -- a compass that is wrong ------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def compassed(flight, tmp_path_factory):
    log = read_csv_folder(flight.write(tmp_path_factory.mktemp("compassed") / "flight"))
    return altered(log, streams={s: stream for s, stream in log.streams.items() if s != Sensor.ATTITUDE})


def magnet_turned(log, by_rad: float):
    """The log of a vehicle whose compass reads a heading that is less by this much."""
    cosine, sine = np.cos(by_rad), np.sin(by_rad)
    mag = log.streams[Sensor.MAG]
    value = mag.value.copy()
    value[:, :2] = value[:, :2] @ np.array([[cosine, sine], [-sine, cosine]])
    return altered(log, streams={**log.streams, Sensor.MAG: altered(mag, value=value)})


def heading_error(run, by_rad: float) -> np.ndarray:
    error = yaw_of(run.estimate) - FIRST_YAW_RAD - YAW_RATE_RAD_S * run.estimate_rows.t_s - by_rad
    return np.degrees(np.abs((error + np.pi) % (2.0 * np.pi) - np.pi))


@pytest.mark.parametrize("wrong_deg", [90.0, -90.0])
def test_a_compass_that_is_90_deg_wrong_is_refuted_whatever_the_heading(compassed, flight, wrong_deg):
    way_m = np.cumsum(np.hypot(*np.diff(flight.position[:, :2], axis=0, prepend=flight.position[:1, :2]).T))
    for by_rad in np.radians(np.arange(0.0, 360.0, 10.0)):
        log = magnet_turned(turned(compassed, float(by_rad)), np.radians(wrong_deg) - float(by_rad))
        run = replay(log, ReplayOptions(), NavigatorSettingsFile())
        events = run.written.event
        (refuted,), (found,) = events[events[:, 1] == COMPASS_REFUTED], events[events[:, 1] == HEADING_FOUND]
        assert refuted[0] < found[0]
        assert np.interp(found[0], flight.t_s, way_m) < 3.5
        assert heading_error(run, by_rad)[run.estimate_rows.t_s > found[0] + 0.1].max() < 8.0
        mag = run.innovation[run.offered.sensor == Sensor.MAG]
        assert (mag[mag[:, 0] > refuted[0], 8] == Reason.NO_HEADING).all()


def test_one_that_is_right_is_not(compassed):
    for by_rad in (0.0, 2.0, 4.0):
        run = replay(magnet_turned(turned(compassed, by_rad), -by_rad), ReplayOptions(), NavigatorSettingsFile())
        assert not (EventRow.of(run.written.event).kind == COMPASS_REFUTED).any()
        assert heading_error(run, by_rad)[-100:].max() < 1.0
