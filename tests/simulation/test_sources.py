"""The names of a flight's noise, and the normals behind them."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.simulation import layout
from flownav.simulation.assemble import assemble
from flownav.simulation.layout import in_pairs
from flownav.simulation.noise import CHANNELS_PER_STEP, normal_pair
from flownav.simulation.plan import ATTITUDE_STEPS, PHYSICS_STEPS
from flownav.simulation.scenario import load_scenario, with_filter
from flownav.simulation.sensor_table import carry, sensor_rows
from flownav.simulation.sources import normals_of, sources_of, starts_of
from flownav.simulation.truth import SENSOR_TABLE


@pytest.fixture(scope="module", params=[("landing", "paper"), ("gusty", "paper"), ("approach", "landing")])
def flight(request):
    name, which = request.param
    return assemble(with_filter(load_scenario(name), which)).flight


def test_normals_are_those_that_the_kernel_draws():
    streams, steps = np.arange(30, dtype=np.uint64) + np.uint64(1 << 40), np.arange(30, dtype=np.uint64) * np.uint64(7)
    with np.errstate(over="ignore"):
        expected = np.array([normal_pair(3, int(a), int(b), 11) for a, b in zip(streams, steps, strict=True)]).T
    np.testing.assert_allclose(normals_of(3, streams, steps, 11), expected, rtol=0.0, atol=1e-13)


def test_every_normal_has_one_name_and_one_place(flight):
    starts, sources = starts_of(flight), sources_of(flight)
    assert len({one.row for one in starts}) == len({one.name for one in starts}) == len(starts)
    assert all(0 <= one.row < layout.START_END - layout.START_NORMALS for one in starts)
    places = {(one.channel, one.half) for one in sources}
    assert len(places) == len(sources)
    assert all("spare" not in one.name for one in (*starts, *sources))


def test_what_is_not_carried_has_no_noise():
    landing = assemble(with_filter(load_scenario("landing"), "paper")).flight
    assert not starts_of(landing)  # white GPS noise, no wind: nothing lasts from before the first epoch
    assert {one.name.partition(".")[0] for one in sources_of(landing)} == {"gps", "flow", "range"}
    approach = assemble(load_scenario("approach")).flight
    assert {"pad_camera", "gps_receiver", "inertial", "wind"} <= {
        one.name.partition(".")[0] for one in sources_of(approach)
    }


def test_no_two_draws_of_an_epoch_share_a_channel():
    parts = ATTITUDE_STEPS * PHYSICS_STEPS  # the most inertial readings that an epoch has
    taken = [*range(40)]  # of wind, recirculation and the paper's sensors
    for sensor in SENSOR_TABLE:
        times = 1 if sensor.on_epochs else parts
        taken += range(sensor.channels.reading, sensor.channels.reading + times * in_pairs(sensor.normals) // 2)
        taken += range(sensor.channels.fault, sensor.channels.fault + 3 * times * len(sensor.says))
    assert len(set(taken)) == len(taken)
    assert max(taken) < CHANNELS_PER_STEP


def test_no_two_draws_before_a_flight_share_a_channel():
    for record in ("unit", "begun"):
        taken = [
            channel
            for sensor in SENSOR_TABLE
            for channel in range(sensor.channels.start, sensor.channels.start + in_pairs(getattr(sensor, record)) // 2)
        ]
        assert len(set(taken)) == len(taken)
        assert max(taken) < CHANNELS_PER_STEP


def test_what_is_carried_is_known_once_the_simulator_is_there():
    with pytest.raises(RuntimeError, match="barometer: what vehicles carry is known"):
        carry(next(sensor for sensor in SENSOR_TABLE if sensor.name == "barometer"))
    assert sensor_rows() == SENSOR_TABLE
