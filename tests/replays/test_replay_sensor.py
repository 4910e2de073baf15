"""A sensor file in a replay: latency and axes of the readings, gains of the navigator, uncertain ones left alone."""

from __future__ import annotations

from dataclasses import replace as altered

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream
from flownav.logs.csv_folder import read_csv_folder
from flownav.logs.log import Log
from flownav.navigation.rows import EstimateRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions, prepare, put_right
from flownav.replays.session import replay
from flownav.sensors.datasheet import IdentifiedFlow, identified_flow, load_sensor
from replay_logs import log_of_flight


@pytest.fixture(scope="module")
def flight_log(tmp_path_factory) -> Log:
    return read_csv_folder(log_of_flight(31.0).write(tmp_path_factory.mktemp("log") / "flight"))


def test_a_sensor_file_sets_the_age_of_flow_and_leaves_its_values(flight_log):
    """Gains are the navigator's settings."""
    plain = prepare(flight_log, ReplayOptions())
    aged = prepare(flight_log, ReplayOptions(identified=IdentifiedFlow(1.1, 0.9, 0.08)))
    assert aged.delays_s[Sensor.FLOW_RATE] == 0.08
    assert (aged.streams[Sensor.FLOW_RATE].value == plain.streams[Sensor.FLOW_RATE].value).all()


def test_gains_of_the_settings_are_taken_off_the_flow(flight_log):
    """Flow with a stated gain error: the path is that without."""
    flow = flight_log.streams[Sensor.FLOW_RATE]
    turning, value = flow.value[:, 2:4], flow.value.copy()
    value[:, :2] = turning + (value[:, :2] - turning) * [0.8, 1.25]
    wrong = altered(flight_log, streams={**flight_log.streams, Sensor.FLOW_RATE: altered(flow, value=value)})
    told = NavigatorSettingsFile(flow_gain_x=1.25, flow_gain_y=0.8)
    cut = ReplayOptions(gps_outages_s=((15.0, 30.0),))
    right, mended, unsaid = (
        EstimateRow.of(replay(log, cut, settings).estimate).pos_ned_m
        for log, settings in ((flight_log, NavigatorSettingsFile()), (wrong, told), (wrong, NavigatorSettingsFile()))
    )
    assert np.abs(mended - right).max() < 0.02
    assert np.abs(unsaid - right).max() > 0.5


def test_the_papers_file_gives_the_gain_and_delay_of_its_dynamics():
    found = identified_flow(load_sensor())
    assert found[:3] == pytest.approx((1.0261, 1.0261, 0.0771), abs=1e-4)
    assert found.axes == ((1.0, 0.0), (0.0, 1.0))


def sensor_with(axes="axes and signs are right", gain=(0.95, 0.94, 0.96)):
    response = {
        "axis": "x", "height_m": 1.0, "gain": gain[0], "gain_low": gain[1], "gain_high": gain[2], "latency_s": 0.05,
        "latency_low_s": 0.04, "latency_high_s": 0.06, "order": "delay", "fit_percent": 80.0,
        "validation_percent": 79.0, "residual_sigma_m_s": 0.05, "residuals_white": False, "runs": 1, "readings": 100,
    }  # fmt: skip
    known = load_sensor()
    sample = type(known).model_fields["identification"].annotation.__args__[0]
    found = sample.model_construct(
        axes=axes, gain=gain[0], latency_s=0.05, responses=[_Row(**response), _Row(**{**response, "axis": "y"})]
    )
    return known.model_copy(update={"identification": found})


class _Row:
    def __init__(self, **entries):
        self.__dict__.update(entries)


def test_a_gain_whose_interval_holds_one_is_left_at_one():
    assert identified_flow(sensor_with(gain=(0.95, 0.94, 0.96))).gain_u == 0.95
    assert identified_flow(sensor_with(gain=(0.95, 0.85, 1.05))).gain_u == 1.0


@pytest.mark.parametrize("verdict", ["unclear; nearest: axes are swapped", "mirrored: the axes are swapped, or so"])
def test_a_file_that_does_not_know_the_axes_is_refused(verdict):
    with pytest.raises(InputError, match="mend the log's axes"):
        identified_flow(sensor_with(axes=verdict))


@pytest.mark.parametrize(("verdict", "axes"), [
    ("axes and signs are right", ((1, 0), (0, 1))),
    ("signs of x and y are inverted (sensor turned by 180 deg)", ((-1, 0), (0, -1))),
    ("sign of x is inverted", ((-1, 0), (0, 1))),
    ("axes are swapped", ((0, 1), (1, 0))),
    ("axes are swapped, sign of y is inverted", ((0, 1), (-1, 0))),
    ("not mirrored (heading unknown)", ((1, 0), (0, 1))),
])  # fmt: skip
def test_a_sensor_whose_axes_are_known_is_put_right(verdict, axes):
    """The corrected readings of such a sensor show the motion: velocities, and rates with their own gyro."""
    found = identified_flow(sensor_with(axes=verdict))
    assert found.axes == axes
    t_s, body = np.arange(50) * 0.1, np.random.default_rng(1).normal(size=(50, 2))
    seen = body @ np.transpose(axes)
    metric = Stream.of(Sensor.FLOW_VELOCITY, t_s, np.column_stack([seen, np.full(50, np.nan)]))
    assert put_right(metric, found).value[:, :2] == pytest.approx(body)
    rates = Stream.of(Sensor.FLOW_RATE, t_s, np.column_stack([-seen[:, 1], seen[:, 0], -seen[:, 1], seen[:, 0]]))
    expected = np.column_stack([-body[:, 1], body[:, 0], -body[:, 1], body[:, 0]])
    assert put_right(rates, found).value == pytest.approx(expected)
