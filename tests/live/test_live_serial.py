"""A session over a serial line of a baud rate, in real time: what is asked for fits, and nothing waits."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaigns.local import fly_recorded
from flownav.faults.flight_log import log_of
from flownav.live.rates import plan
from flownav.live.simulated import SimulatedVehicle
from flownav.live.warm import warm_up
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from serial_line import fly_over, options_of


@pytest.fixture(scope="module")
def flight():
    warm_up()
    setup = assemble(load_scenario("pad_return"))
    return log_of(fly_recorded(setup, 1), setup), setup


@pytest.mark.parametrize("baud", [57_600, 115_200])
def test_a_slow_line_carries_what_is_asked_of_it(flight, baud):
    log, setup = flight
    flown = fly_over(baud, SimulatedVehicle(log), 11.0, options_of(setup, baud))
    assert not flown.damaged
    assert flown.lost == 0
    assert flown.received_bytes_s < 0.85 * baud / 10
    assert flown.written_bytes_s < 0.85 * baud / 10
    assert flown.estimate_hz > 0.8 * plan(0, baud / 10, "odometry").estimate_hz
    assert np.percentile(flown.reading_age_s, 95) < 0.1
    assert np.percentile(flown.estimate_age_s, 95) < 0.1
    assert flown.most_backlog_s < 0.3
    assert flown.session.reason == ""
    assert flown.session.dropped.get("link: lost", 0) < 400  # before the rates were asked for
