"""A session over a serial line of a baud rate: what is asked for fits, and nothing waits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flownav.campaigns.faults.table import log_of
from flownav.campaigns.local import fly_recorded
from flownav.live.loop import warm_up
from flownav.live.rates import plan
from flownav.live.simulated import SimulatedVehicle
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from serial_line import fly_over, fly_virtually, options_of

BAUDS = (57_600, 115_200, 921_600)
FLOWN_S = 11.0


@pytest.fixture(scope="module")
def flight():
    warm_up()
    setup = assemble(load_scenario("pad_return"))
    return log_of(fly_recorded(setup, 1), setup), setup


def assert_it_fits(flown, baud):
    assert flown.received_bytes_s < 0.85 * baud / 10
    assert flown.written_bytes_s < 0.85 * baud / 10


@pytest.mark.parametrize("baud", BAUDS)
def test_a_line_carries_what_is_asked_of_it(flight, baud):
    log, setup = flight
    flown = fly_virtually(baud, SimulatedVehicle(log), FLOWN_S, options_of(setup, baud))
    assert_it_fits(flown, baud)
    assert not flown.damaged
    assert flown.error_m < 2.0
    assert flown.velocity_error_m_s < 0.25
    assert flown.session.reason == ""
    assert flown.lost == 0
    assert flown.estimate_hz > 0.9 * min(50.0, plan(0, baud / 10, "odometry").estimate_hz)
    assert flown.reading_age_s.max() < 0.1
    assert flown.estimate_age_s.max() < 0.1
    assert flown.most_backlog_s < 0.1


def test_a_slow_line_that_everything_is_asked_of_loses_frames_and_grows_old(flight):
    """The reason for the plan; and that the line above is one that can lose."""
    log, setup = flight
    asked = replace(options_of(setup, 57_600), capacity_bytes_s=None)
    flown = fly_virtually(57_600, SimulatedVehicle(log), FLOWN_S, asked)
    assert flown.lost > 100
    assert np.median(flown.reading_age_s) > 0.1


@pytest.mark.real_time
@pytest.mark.parametrize("baud", BAUDS)
def test_a_real_line_carries_what_is_asked_of_it(flight, baud):
    """Over a pseudo-terminal: no frame is torn, estimates come. What a loaded machine loses is the benchmark's."""
    log, setup = flight
    vehicle = SimulatedVehicle(log)
    flown = fly_over(baud, vehicle, FLOWN_S, options_of(setup, baud), estimates=20)
    assert_it_fits(flown, baud)
    assert len(flown.estimate_age_s) >= 20
    assert not vehicle.damage
    assert set(flown.damaged) <= {"lost"}
