"""The axes of ROS's own messages: a fix's variances are east, north, up; mavros' flow and a setpoint's mask by axis."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.logs.ros.standard import asked_table, streams_of
from flownav.logs.ros.topics import NAMES, TARGET, Clock, Gathered, values_of

S_NS = 1_000_000_000
CLOCK = Clock(0, 0, frozenset(), {})
FIX, TWIST, FLOW = "sensor_msgs/msg/NavSatFix", "geometry_msgs/msg/TwistStamped", "mavros_msgs/msg/OpticalFlowRad"


def gathered(kind: str, times_s, values) -> Gathered:
    """One topic of these rows, each in the order of NAMES[kind]."""
    topic = Gathered("/topic", kind)
    for t_s, row in zip(times_s, values, strict=True):
        topic.take(round(t_s * S_NS), 0, NAMES[kind], tuple(row))
    return topic


def fix(east: float, north: float, up: float, kind: int = 2):
    """A message of a fix with these variances [m2]; its covariance is row by row, in ENU."""
    covariance = [east, 0.1, 0.2, 0.1, north, 0.3, 0.2, 0.3, up]
    return SimpleNamespace(status=SimpleNamespace(status=0), latitude=47.0, longitude=8.0, altitude=500.0,
                           position_covariance=covariance, position_covariance_type=kind)  # fmt: skip


def streams(**roles: Gathered):
    return {stream.sensor: stream for stream in streams_of(roles, CLOCK)[0]}


def test_the_variance_of_a_fix_is_north_east_down_of_east_north_up():
    values = [values_of(FIX, fix(1.0 + k, 4.0 + k, 9.0 + k)) for k in range(5)]
    found = streams(gps=gathered(FIX, range(5), values))[Sensor.GPS_POSITION]
    np.testing.assert_allclose(found.variance, [(4.0 + k, 1.0 + k, 9.0 + k) for k in range(5)])


def test_a_fix_of_unknown_covariance_has_none():
    values = [values_of(FIX, fix(1.0, 4.0, 9.0, kind=0)) for _ in range(5)]
    assert np.isnan(streams(gps=gathered(FIX, range(5), values))[Sensor.GPS_POSITION].variance).all()


def test_a_fix_has_the_velocity_that_is_nearest_and_none_beyond_half_a_step_of_it():
    """Velocities of ENU each 0.2 s, of which those from 1 s to 2 s are missing; fixes between them."""
    told_s = np.array([k / 5 for k in range(16) if not 1.1 < k / 5 < 1.9])
    told = gathered(TWIST, told_s, [(10.0 * t_s, 100.0 + t_s, -1.0) for t_s in told_s])
    fixes_s = np.array([0.07, 0.53, 1.09, 1.12, 1.5, 1.93, 2.49])
    values = [values_of(FIX, fix(1.0, 4.0, 9.0)) for _ in fixes_s]
    found = streams(gps=gathered(FIX, fixes_s, values), gps_velocity=told)[Sensor.GPS_VELOCITY]
    nearest = {0.07: 0.0, 0.53: 0.6, 1.09: 1.0, 1.93: 2.0, 2.49: 2.4}
    for t_s, value in zip(found.t_s, np.asarray(found.value), strict=True):
        when = nearest.get(round(float(t_s), 2))
        if when is None:
            assert not np.isfinite(value).any()
        else:
            np.testing.assert_allclose(value, (100.0 + when, 10.0 * when, 1.0))


@pytest.mark.parametrize("column", [0, 1, 2, 3])
def test_each_angle_of_a_flow_is_a_rate_about_the_bodys_own_axis(column):
    """Integrals over 50 ms about forward and left of base_link; a reading describes the middle of them."""
    names = ("integrated_x", "integrated_y", "integrated_xgyro", "integrated_ygyro")
    row = dict.fromkeys(NAMES[FLOW], 0.0) | {"integration_time_us": 5e4, "quality": 200.0, names[column]: 0.1}
    found = streams(flow=gathered(FLOW, range(4), [tuple(row.values())] * 4))[Sensor.FLOW_RATE]
    expected = np.zeros(4)
    expected[column] = 2.0 if column in (0, 2) else -2.0
    np.testing.assert_allclose(found.value, np.tile(expected, (4, 1)))
    assert found.delay_s == pytest.approx(0.025)


@pytest.mark.parametrize(("bit", "name"), [(1, "pos_e_m"), (2, "pos_n_m"), (4, "pos_d_m")])
def test_a_bit_of_a_setpoints_mask_leaves_its_own_axis_open(bit, name):
    """The mask is of the message's x, y, z, which mavros has east, north, up."""
    row = dict(zip(NAMES[TARGET], (1.0, float(bit), 3.0, 4.0, 5.0), strict=True))
    table = asked_table(gathered(TARGET, [1.0], [tuple(row.values())]), np.array([1.0]))
    whole = {"pos_n_m": 4.0, "pos_e_m": 3.0, "pos_d_m": -5.0}
    assert np.isnan(table[name]).all()
    assert {key: float(table[key][0]) for key in whole if key != name} == {
        key: value for key, value in whole.items() if key != name
    }
