"""8 m/s from any side: the nose goes into it, and no wind carries the vehicle off."""

import numpy as np
import pytest

from flownav.campaigns.judged import fly_judged
from flownav.campaigns.local import in_wind, touchdown_history
from flownav.core.frames import heading_from_quaternion
from flownav.core.record import QUATERNION
from flownav.scoring.consistency import over_stated
from flownav.scoring.landings import touchdown_of_flights
from flownav.simulation.engine import fly_blocks
from flownav.simulation.history import columns
from flownav.simulation.scenario import load_scenario

FLIGHTS = 16
HOVERING = slice(1400, 1700)  # outer steps, from 28 s to 34 s: it may turn from 5 s on, half way round in 18 s


def headings_deg(history):
    return np.degrees(heading_from_quaternion(*np.moveaxis(history[HOVERING, columns("truth", QUATERNION)], 1, 0)))


def flown(speed_m_s, from_deg):
    setup = in_wind(load_scenario("approach"), speed_m_s, from_deg)

    def judge(history):
        return headings_deg(history), touchdown_history(setup.flight, history)

    blocks = [judged for _, judged in fly_blocks(setup.flight, 1, 0, FLIGHTS, judge, None, setup.ensemble())]
    headings, touchdowns = zip(*blocks, strict=True)
    return np.concatenate(headings, 1), touchdown_of_flights(np.concatenate(touchdowns))


@pytest.mark.parametrize(("from_deg", "most_deg"), [(0.0, 10.0), (90.0, 30.0), (180.0, 40.0), (270.0, 15.0)])
def test_the_nose_goes_into_8_m_s_from_every_side(from_deg, most_deg):
    """A tail wind is the hard one: some vehicles begin to turn late."""
    headings, landings = flown(8.0, from_deg)
    off = (headings - from_deg + 180.0) % 360.0 - 180.0
    assert np.sqrt(np.mean(off**2)) < most_deg
    assert landings["success"]["rate"] >= 15 / 16


@pytest.mark.parametrize("from_deg", [90.0, 270.0])
def test_a_side_wind_that_needs_much_tilt_carries_nothing_off(from_deg):
    """At 0.20 of tilt against trim the vehicle was carried off downwind by 30 m in 9 to 10 m/s from the east."""
    _, landings = flown(10.0, from_deg)
    assert landings["success"]["rate"] >= 15 / 16
    assert landings["broken"] == {}


def test_velocity_errs_by_what_is_stated_of_it_in_a_tail_wind_too():
    """Of 64 flights 1.6 to 1.8 before turning made the gyro's scale doubted, and acceleration a receiver's velocity.

    Vertically it is 1.38.
    """
    setup = in_wind(load_scenario("approach"), 8.0, 180.0)
    ratios = over_stated(fly_judged(setup.flight, 1, 4 * FLIGHTS).sums)
    assert max(ratios[name] for name in ("u", "v")) < 1.1
    assert ratios["w"] < 1.45
