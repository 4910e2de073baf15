"""The score of a window: what was predicted of the sensors, and how far the path was off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flownav.core.measurement import COLUMNS, Sensor, Stream
from flownav.estimation.gating import Reason
from flownav.logs.log import Log
from flownav.navigation.rows import InnovationRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions
from flownav.studies.tuning.scores import (
    LEAST_SHARE,
    LOSS_NATS,
    SENSORS,
    Scores,
    _flow_errors,
    as_reported,
    densities,
    gains_of,
    reference_name,
    with_cuts,
)

WINDOWS = [(0.0, 10.0), (20.0, 30.0)]


def offers(news, variance, *, hz=20.0, sensor=Sensor.RANGE, reason=Reason.FUSED, start_s=0.0, component=0):
    """Rows as the navigator's tape has them."""
    columns = dict.fromkeys(InnovationRow._fields, 0.0) | {
        "t_s": start_s + np.arange(len(news)) / hz, "sensor": sensor, "component": component, "reason": reason,
        "innovation": news, "innovation_variance": variance,
    }  # fmt: skip
    return np.column_stack([np.broadcast_to(column, len(news)).astype(float) for column in columns.values()])


def density(rows, window=0, sensor=Sensor.RANGE):
    return densities(rows, WINDOWS)[0][window, sensor]


@pytest.fixture(scope="module")
def white():
    """Innovations of 200 s with a standard deviation of 0.3."""
    return 0.3 * np.random.default_rng(1).standard_normal(4000)


def best_sigma(news, windows, **more):
    sigmas = np.exp(np.linspace(np.log(0.01), np.log(10.0), 141))
    found = [densities(offers(news, sigma**2, **more), windows)[0][:, Sensor.RANGE].mean() for sigma in sigmas]
    return sigmas[int(np.argmax(found))]


LONG = [(10.0 * k, 10.0 * k + 10.0) for k in range(20)]


def test_the_true_size_of_innovations_scores_best(white):
    assert best_sigma(white, LONG) == pytest.approx(0.3, rel=0.3)
    assert best_sigma(white, LONG, reason=Reason.OUTAGE) == pytest.approx(0.3, rel=0.06)


def test_an_error_that_lasts_counts_for_what_it_does(white):
    lasting = np.repeat(white[::20], 20)  # one error a second, read twenty times
    assert best_sigma(lasting, LONG) == pytest.approx(0.3 * np.sqrt(20.0), rel=0.3)


def test_a_density_is_that_of_the_sum():
    z = np.array([1.0, 2.0, -0.5])
    rows = offers(z, np.array([1.0, 4.0, 0.25]), hz=1.0)
    variance = 5.25 / 3.0
    assert density(rows) == pytest.approx(-0.5 * np.log(variance) - 0.5 * 2.5**2 / 5.25)
    far = offers([10.0], [1.0])
    assert density(far) == pytest.approx(-(3.0 * 10.0 - 4.5))  # Huber's tail


def test_only_what_lies_in_a_window_and_was_predicted_counts():
    inside = offers([0.5], [1.0], start_s=25.0)
    value, readings = densities(np.vstack([
        inside, offers([9.0], [1.0], start_s=15.0), offers([9.0], [1.0], start_s=30.0),
        offers([np.nan], [1.0], start_s=26.0), offers([9.0], [0.0], start_s=26.0),
        offers([9.0], [1.0], start_s=26.0, reason=Reason.STUCK),
        offers([9.0], [1.0], start_s=26.0, sensor=Sensor.LANDED),
    ]), WINDOWS)  # fmt: skip
    assert value[1, Sensor.RANGE] == pytest.approx(-0.125)
    assert readings.sum() == readings[1, Sensor.RANGE] == 1
    assert np.isnan(value[0]).all()


GAINS = NavigatorSettingsFile(flow_gain_x=2.0, flow_gain_y=0.5)


@pytest.mark.parametrize(("sensor", "component", "gain"), [
    (Sensor.FLOW_RATE, 0, 0.5), (Sensor.FLOW_RATE, 1, 2.0),  # flow_y shows the speed forward
    (Sensor.FLOW_VELOCITY, 0, 2.0), (Sensor.FLOW_VELOCITY, 1, 0.5), (Sensor.FLOW_VELOCITY, 2, 1.0),
    (Sensor.RANGE, 0, 1.0),
])  # fmt: skip
def test_flow_is_scored_as_it_is_reported_whatever_gain_the_filter_takes_off(white, sensor, component, gain):
    as_seen, one = (offers(white[:200] / g, (0.3 / g) ** 2, sensor=sensor, component=component) for g in (gain, 1.0))
    reported = as_reported(as_seen, GAINS)
    assert density(reported, sensor=sensor) == pytest.approx(density(one, sensor=sensor))
    np.testing.assert_array_equal(np.delete(reported, (5, 6), axis=1), np.delete(as_seen, (5, 6), axis=1))


def scores(density=0.0, readings=100.0, error=1.0):
    table = np.full((2, SENSORS), np.nan)
    table[:, Sensor.RANGE] = density
    counts = np.where(np.isfinite(table), readings, 0.0)
    log_error = np.log(np.array([error, np.nan]))
    return Scores(table, counts, log_error, np.exp(log_error))


def tempered(gain):
    return np.sign(gain) * np.log1p(abs(gain))


def test_gains_are_nats_over_the_start_and_great_ones_count_less():
    found = gains_of(scores(density=0.5, error=0.5), scores())
    assert found.prediction == pytest.approx([tempered(0.5)] * 2)
    assert found.error[0] == pytest.approx(tempered(np.log(2.0)))
    assert np.isnan(found.error[1])
    assert found.total == pytest.approx([tempered(0.5) + tempered(np.log(2.0)), tempered(0.5)])


def test_nobody_gains_by_predicting_less():
    fewer = gains_of(scores(density=5.0, readings=100.0 * LEAST_SHARE - 1.0), scores())
    assert fewer.prediction == pytest.approx([tempered(LOSS_NATS)] * 2)
    nothing = gains_of(scores(density=np.nan, error=np.nan), scores())
    assert nothing.prediction == pytest.approx([tempered(LOSS_NATS)] * 2)
    assert nothing.error[0] == pytest.approx(tempered(LOSS_NATS))


@pytest.mark.parametrize(("sensors", "truth", "named", "gps_cuts", "flow_cuts"), [
    ((Sensor.GPS_POSITION, Sensor.FLOW_RATE), {}, "gps cuts", tuple(WINDOWS), ()),
    ((Sensor.FLOW_RATE,), {}, "truth velocity", (), ()),
    ((Sensor.FLOW_VELOCITY,), None, "flow cuts", (), tuple(WINDOWS)),
    ((Sensor.RANGE,), None, None, (), ()),
])  # fmt: skip
def test_what_the_path_is_held_against_is_withheld(sensors, truth, named, gps_cuts, flow_cuts):
    one = np.zeros(1)
    streams = {sensor: Stream.of(sensor, one, np.zeros((1, len(COLUMNS[sensor])))) for sensor in sensors}
    log = Log(Path("made"), streams, truth=truth)
    options = with_cuts(log, ReplayOptions(gps_delay_s=0.1), WINDOWS)
    assert reference_name(log) == named
    assert (options.gps_outages_s, options.flow_outages_s, options.gps_delay_s) == (gps_cuts, flow_cuts, 0.1)


def test_withheld_flow_is_an_error_of_the_path():
    rows = np.vstack([
        offers([3.0, 4.0], [1.0, 1.0], sensor=Sensor.FLOW_RATE, reason=Reason.OUTAGE),
        offers([9.0], [1.0], sensor=Sensor.FLOW_RATE, reason=Reason.FUSED),
        offers([9.0], [1.0], sensor=Sensor.RANGE, reason=Reason.OUTAGE),
    ])  # fmt: skip
    first, second = _flow_errors(rows, WINDOWS)
    assert first == pytest.approx(np.sqrt(12.5))
    assert np.isnan(second)
