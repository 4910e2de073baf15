"""A sensor file corrects a replay's flow: gain of the translation alone, latency, uncertain gains left alone."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.errors import InputError
from flownav.measurement import Sensor, Stream
from flownav.replay.prepare import IdentifiedFlow, corrected, identified_flow, put_right
from flownav.sensors.angular_flow import angular_flow
from flownav.sensors.datasheet import load_sensor


def test_gain_is_taken_off_the_translation_and_not_off_the_rotation():
    u, v, p, q, r, gain_u, gain_v = 1.2, -0.7, 0.3, -0.4, 2.0, 1.1, 0.9
    seen = angular_flow(gain_u * u, gain_v * v, p, q, r)
    stream = Stream.of(Sensor.FLOW_RATE, np.array([0.0]), np.array([[*seen, p, q]]))
    mended = corrected(stream, IdentifiedFlow(gain_u, gain_v, 0.08))
    assert mended.value[0, :2] == pytest.approx(angular_flow(u, v, p, q, r))
    assert mended.delay_s == 0.08


def test_metric_flow_is_divided_by_its_gains():
    stream = Stream.of(Sensor.FLOW_VELOCITY, np.array([0.0]), np.array([[1.1, 1.8, np.nan]]))
    assert corrected(stream, IdentifiedFlow(1.1, 0.9, 0.0)).value[0, :2] == pytest.approx((1.0, 2.0))


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
    """What such a sensor says of a motion, put right, is the motion: velocities, and rates with their own gyro."""
    found = identified_flow(sensor_with(axes=verdict))
    assert found.axes == axes
    t_s, body = np.arange(50) * 0.1, np.random.default_rng(1).normal(size=(50, 2))
    seen = body @ np.transpose(axes)
    metric = Stream.of(Sensor.FLOW_VELOCITY, t_s, np.column_stack([seen, np.full(50, np.nan)]))
    assert put_right(metric, found).value[:, :2] == pytest.approx(body)
    rates = Stream.of(Sensor.FLOW_RATE, t_s, np.column_stack([-seen[:, 1], seen[:, 0], -seen[:, 1], seen[:, 0]]))
    expected = np.column_stack([-body[:, 1], body[:, 0], -body[:, 1], body[:, 0]])
    assert put_right(rates, found).value == pytest.approx(expected)
