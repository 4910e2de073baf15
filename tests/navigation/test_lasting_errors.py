"""The effect of lasting errors: headings of a compass that is turned aside, and a flow scale without a reference."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.estimation.states import ATTITUDE, FLOW_SCALE, INS_ERROR
from flownav.navigation.feed import heading_source
from flownav.navigation.heading import RECONSIDERED_S, weigh_heading
from flownav.navigation.kernel_settings import FROM_MAG, NO_HEADING
from flownav.navigation.reasons import FUSED, INNOVATION_GATE, SILENT
from flownav.navigation.records import GpsMemory, HeadingMemory
from flownav.navigation.verdicts import Doubt, Fate, Noise
from flownav.navigation.verdicts import Tested as Outcome
from navigation_streams import Flown, body_axes, circle, fly, navigate

INDOORS = (Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE, Sensor.MAG)
OUTDOORS = (*INDOORS, Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
SIGMA, GATE = 0.04, 5.0
NONE = (Doubt(ATTITUDE + 2, 0.0), Doubt(INS_ERROR + 2, 0.0))


# -- the gate of a heading -----------------------------------------------------------------------------------
GONE, HOLDS = GpsMemory(), GpsMemory(last_fix_s=1.0e9)


def weighed(innovation: float, m: HeadingMemory, t_s: float = 1.0, reason: int = FUSED, gps: GpsMemory = GONE):
    """A heading of 100 Hz: fused with 72 degrees, one alone is known to 2.3."""
    tested = Outcome(reason, innovation, 2.0 * SIGMA**2, SIGMA**2)
    return weigh_heading.law(Fate(reason), tested, gps, m, t_s=t_s, gate_sigma=GATE)


def test_the_gate_of_a_heading_is_that_of_one_however_often_it_is_read():
    m = HeadingMemory(fused_rad2=1.6)
    edge = GATE * math.sqrt(2.0) * SIGMA
    passes = weighed(0.99 * edge, m)
    assert (passes.fate, passes.noise, passes.doubts) == (Fate(FUSED), Noise(1.6), NONE)
    assert (passes.heading.agreed_s, weighed(0.0, passes.heading, 2.0).heading.agreed_s) == (1.0, 1.0)
    refused = weighed(-1.01 * edge, m)
    assert (refused.fate, refused.heading.refused_s, refused.doubts) == (Fate(INNOVATION_GATE), 1.0, NONE)
    again = weighed(1.01 * edge, refused.heading, 2.0)
    assert again.heading.refused_s == 1.0
    assert math.isnan(weighed(0.0, again.heading, 3.0).heading.refused_s)
    assert weighed(9.0, again.heading, 3.0, SILENT).heading.refused_s == 1.0  # one that is not offered says nothing


@pytest.mark.parametrize(("agreed_s", "after_s", "own"), [
    (0.0, 3.0, 0.0),  # one wrong reading at the start is no witness against all that follow
    (0.9, 3.0, 0.0),
    (2.0, 6.0, 0.0),
    (4.0, 12.0, 1.44),  # both agreed for a while: nothing tells which is wrong
    (9.0, 27.0, 1.44),
    (60.0, 30.0, 1.44),
])  # fmt: skip
def test_headings_that_are_refused_longer_than_they_agreed_make_what_they_taught_doubted(agreed_s, after_s, own):
    m = HeadingMemory(fused_rad2=1.6, agreed_s=100.0 - agreed_s, refused_s=100.0)
    assert weighed(-1.2, m, 100.0 + 0.99 * after_s).doubts == NONE
    lasts = weighed(-1.2, m, 100.0 + 1.01 * after_s)
    assert lasts.doubts == (Doubt(ATTITUDE + 2, pytest.approx(1.44)), Doubt(INS_ERROR + 2, pytest.approx(own)))
    assert math.isnan(lasts.heading.refused_s)  # what is doubted once is not doubted again at the next reading
    assert math.isnan(lasts.heading.agreed_s)


def test_where_gps_tells_the_heading_by_the_course_only_their_own_error_is_doubted():
    m = HeadingMemory(fused_rad2=1.6, agreed_s=99.0, refused_s=100.0)
    lasts = weighed(-1.2, m, 103.1, gps=HOLDS)
    assert lasts.doubts == (Doubt(ATTITUDE + 2, 0.0), Doubt(INS_ERROR + 2, pytest.approx(1.44)))


# -- a compass that is turned aside --------------------------------------------------------------------------
def oftener(flown: Flown, hz: float) -> Flown:
    """The same flight with a magnetometer of another rate."""
    t_s = np.arange(0.0, flown.streams[Sensor.MAG].t_s[-1], 1.0 / hz)
    yaw = np.interp(t_s, flown.t_s, flown.yaw)
    north = flown.streams[Sensor.MAG].value[0, :3]
    field = np.column_stack([body_axes(yaw, np.tile(north, (len(t_s), 1)))])
    stream = flown.streams[Sensor.MAG]
    return flown.added(type(stream).of(Sensor.MAG, t_s, field))


def turned_aside(flown: Flown, angle_rad: float, t0_s: float, t1_s: float) -> Flown:
    """The field that the magnetometer reads is turned by an angle for a while, as beside steel."""
    stream = flown.streams[Sensor.MAG]
    inside = (stream.t_s >= t0_s) & (stream.t_s < t1_s)
    value = stream.value.copy()
    value[:, :3] = np.where(inside[:, None], body_axes(np.full(len(value), angle_rad), value[:, :3]), value[:, :3])
    return flown.changed(Sensor.MAG, value=value)


@pytest.mark.parametrize("sensors", [INDOORS, OUTDOORS], ids=["indoors", "outdoors"])
@pytest.mark.parametrize("hz", [10.0, 100.0])
@pytest.mark.parametrize("angle_deg", [58.0, -90.0])
def test_a_compass_that_is_turned_aside_for_8_s_turns_the_heading_by_less_than_2_degrees(sensors, hz, angle_deg):
    """1.2 degrees without GPS and 0.5 with it; 4 to 7 where readings pass the gate of what they are fused with."""
    flown = oftener(fly(circle, 45.0, yaw_rate=0.2).only(*sensors), hz)
    found = navigate(turned_aside(flown, math.radians(angle_deg), 20.0, 28.0))
    assert np.abs(found.yaw_error[found.t_s > 5.0]).max() < math.radians(2.0)
    assert found.reasons(Sensor.MAG)["innovation_gate"] >= 0.9 * 8.0 * hz


def test_a_field_that_stays_turned_is_followed_in_the_end_and_its_doubt_is_stated():
    """The vehicle may be wrong as well as the compass, once it has gone on for half a minute."""
    flown = fly(circle, 80.0, yaw_rate=0.2).only(*INDOORS)
    found = navigate(turned_aside(flown, math.radians(60.0), 20.0, 1e9))
    assert np.abs(found.yaw_error[found.t_s < 20.0 + RECONSIDERED_S]).max() < math.radians(5.0)
    assert np.abs(found.yaw_error[-1]) < 3.0 * found.sigma(ATTITUDE + 2)


@pytest.mark.parametrize("sensors", [INDOORS, OUTDOORS], ids=["indoors", "outdoors"])
@pytest.mark.parametrize("wrong", [1, 5, 20])
@pytest.mark.parametrize("angle_deg", [60.0, 90.0])
def test_wrong_fields_at_the_start_are_unlearnt(sensors, wrong, angle_deg):
    """Indoors 5 to 20 of them had left the heading 44 to 54 degrees off at 30 s, with 10 stated."""
    flown = fly(circle, 40.0, yaw_rate=0.1).only(*sensors)
    found = navigate(turned_aside(flown, math.radians(angle_deg), -1.0, 0.1 * wrong - 0.05))
    late = found.t_s > 20.0
    stated = found.estimate_rows.std_tilt_ned_rad[late, 2]
    assert (np.abs(found.yaw_error[late]) < 2.0 * stated).all()
    assert np.abs(found.yaw_error[late]).max() < math.radians(16.0)


def test_without_gps_a_compass_holds_the_heading_that_a_biased_gyro_loses():
    flown = fly(circle, 60.0, yaw_rate=0.1).only(*INDOORS)
    imu = flown.streams[Sensor.IMU]
    flown = flown.changed(Sensor.IMU, value=imu.value + np.array([0.0, 0.0, 0.006, 0.0, 0.0, 0.0]))
    held, lost = navigate(flown), navigate(flown.without(Sensor.MAG))
    assert np.abs(held.yaw_error[-1]) < math.radians(5.0) < 0.5 * np.abs(lost.yaw_error[-1])


def test_a_magnetometer_is_a_source_of_headings_with_gps_or_without_and_an_attitude_only_with_it():
    streams = fly().streams
    attitude = {Sensor.ATTITUDE: streams[Sensor.ATTITUDE]}
    gps = {Sensor.GPS_POSITION: streams[Sensor.GPS_POSITION]}
    mag = {Sensor.MAG: streams[Sensor.MAG]}
    assert heading_source(mag) == heading_source(mag | gps) == heading_source(mag | attitude) == FROM_MAG
    assert heading_source(attitude) == heading_source({}) == NO_HEADING
    assert heading_source({Sensor.MAG: replace(streams[Sensor.MAG], t_s=np.zeros(0))} | attitude) != FROM_MAG


# -- a scale without a reference -----------------------------------------------------------------------------
def test_a_flow_scale_is_learnt_beside_gps_and_stays_as_it_is_without_it_whatever_the_flow_reads():
    """Ten seconds of noise without GPS had made a scale of +0.6 of it, known to 0.03."""
    flown = fly(circle, 60.0)
    flow = flown.streams[Sensor.FLOW_RATE]
    value = flow.value.copy()
    value[:, :2] *= 1.08
    noisy = (flow.t_s >= 40.0) & (flow.t_s < 50.0)
    value[:, :2] += np.where(noisy[:, None], np.random.default_rng(3).normal(0.0, 0.6, (len(value), 2)), 0.0)
    flown = flown.changed(Sensor.FLOW_RATE, value=value)
    for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY):
        flown = flown.cut(sensor, 38.0, 1e9)
    found = navigate(flown)
    scale = found.column(FLOW_SCALE)[:, 0]
    learnt, after = scale[np.searchsorted(found.t_s, 37.9)], scale[found.t_s > 39.5]
    assert learnt == pytest.approx(0.08, abs=0.03)
    assert np.ptp(after) < 1e-3  # by what ranges tell of states that go with it
    assert after[0] == pytest.approx(learnt, abs=0.01)
