"""Recordings in which one word contradicts all others: landed in flight, a far origin, a gimbal, a GPS that walks off.

What is sent is never more than a metre wrong; what is withheld is begun anew within 5 s of the cause's end.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.logs.mavlink.framing import coder
from played_recordings import Played
from recorded_link import Arrival
from scaled_imu import scaled_imu_beside

GPS_RAW_INT, EXTENDED_SYS_STATE = 24, 245
METRES_A_DEGREE = 111_132.0
SINCE_S, BEGIN_S, END_S, LAST_S = 78.0, 92.0, 102.0, 112.0  # since boot, in the square at 8 m
UNDISTURBED_M = 0.50  # worst of this square where nobody lies
ON_GROUND, GIMBAL = 1, 26


def again(arrival, spoil):
    """An arrival whose message is spoilt."""
    packer, message = coder(1, 1), coder().decode(bytearray(arrival.frame))
    if not spoil(message):
        return arrival
    packer.srcSystem, packer.srcComponent, packer.seq = arrival.frame[5], arrival.frame[6], arrival.frame[4]
    return arrival._replace(frame=bytes(message.pack(packer)))


def walking(north_m_s):
    """The receiver's place goes north, its velocity does not, and it comes back at the end."""

    def heard(frames, ahead_s):
        def spoil(message):
            t_s = message.time_usec * 1e-6
            if not BEGIN_S <= t_s < END_S:
                return False
            message.lat += round(north_m_s * (t_s - BEGIN_S) / METRES_A_DEGREE * 1e7)
            return True

        for arrival in frames:
            yield again(arrival, spoil) if arrival.message_id == GPS_RAW_INT else arrival

    return heard


def said_beside(message, since_s, until_s, hz):
    """Between two times since boot somebody says this so often, and EXTENDED_SYS_STATE is the other's no more."""

    def heard(frames, ahead_s):
        due_s = since_s
        for arrival in frames:
            t_s = arrival.now_s - ahead_s
            while due_s <= t_s and due_s < until_s:
                yield Arrival(arrival.now_s, message(arrival))
                due_s += 1.0 / hz
            if arrival.message_id != EXTENDED_SYS_STATE or not since_s <= t_s < until_s:
                yield arrival

    return heard


def landed(arrival):
    return bytes(coder(arrival.frame[5], 1).extended_sys_state_encode(0, ON_GROUND).pack(coder(arrival.frame[5], 1)))


def far_origin(arrival):
    mav = coder(1, 1)
    return bytes(mav.gps_global_origin_encode(round(40.4684e7), round(-105.2306e7), 1_586_000).pack(mav))


def gimbal(arrival):
    mav = coder(1, 154)
    return bytes(mav.heartbeat_encode(GIMBAL, 3, 0, 0, 4, 3).pack(mav))


@pytest.fixture
def square(data_folder):
    """The square on GPS and flow, by a session that begins in flight, with something spoilt; beyond GPS's own error."""

    def fly(spoil, until_s=LAST_S):
        def beside(heard, truth):
            heard = list(heard)
            ahead_s = boot_ahead_s(heard)
            flown = [a for a in heard if SINCE_S <= a.now_s - ahead_s < until_s]
            return list(spoil(flown, ahead_s))

        found = Played(data_folder / "ardupilot-live" / "square", until_s, beside=beside)
        calm = found.between(SINCE_S + 7.0, BEGIN_S)
        found.error_m -= np.median(found.error_m[calm], axis=0)
        return found

    return fly


def boot_ahead_s(heard):
    """The clock of the arrivals less the vehicle's since boot."""
    raw = next(arrival for arrival in heard if arrival.message_id == 27)
    return raw.now_s - coder().decode(bytearray(raw.frame)).time_usec * 1e-6


def worst_m(found, since_s=BEGIN_S):
    return np.hypot(*found.error_m[found.t_s >= since_s, :2].T).max()


def silent_s(found, since_s, until_s):
    """The longest time without an estimate between two times."""
    times = [since_s, *found.t_s[found.between(since_s, until_s)], until_s]
    return max(later - before for before, later in pairwise(times))


@pytest.mark.parametrize("north_m_s", [1.0, 1.5, 2.0, 5.0])
def test_a_receiver_that_walks_off_leads_nobody_away(square, north_m_s):
    """Its own velocity and the flow show that it does not. At 1 m/s it was followed by 8.5 m, at 1.5 by 3.7 m."""
    found = square(walking(north_m_s))
    assert worst_m(found) < 1.0
    assert silent_s(found, END_S + 5.0, LAST_S - 0.5) < 0.3


def test_landed_that_is_said_twice_a_second_in_flight_moves_nothing(square):
    """983 estimates were sent up to 1.1 m off, without a warning."""
    found = square(said_beside(landed, BEGIN_S, END_S, 2.0))
    assert worst_m(found) < UNDISTURBED_M + 0.1
    assert Sensor.LANDED in found.session.offering.past_alarms
    assert silent_s(found, BEGIN_S, LAST_S - 0.5) < 0.3


def test_an_origin_of_another_town_and_a_gimbal_move_nothing(square):
    """44 km off at quality 69; nothing sent for a gimbal's heartbeat, and exit 0."""

    def both(frames, ahead_s):
        first = frames[0]._replace(frame=gimbal(frames[0]))
        return said_beside(far_origin, BEGIN_S, BEGIN_S + 0.4, 2.0)([first, *frames], ahead_s)

    found = square(both, 100.0)
    assert worst_m(found) < UNDISTURBED_M + 0.1
    assert silent_s(found, SINCE_S + 7.0, 99.5) < 0.3
    assert found.session.intake.origin.as_facts()["doubted"]
    assert len(set(found.resets)) == 1


def test_landed_in_flight_without_gps_moves_nothing(data_folder):
    """PX4's quad, 6 m up on flow alone."""

    def beside(heard, truth):
        heard = list(scaled_imu_beside(heard, truth))
        raw = next(arrival for arrival in heard if arrival.message_id == 105)
        ahead_s = raw.now_s - coder().decode(bytearray(raw.frame)).time_usec * 1e-6
        return list(said_beside(landed, 50.0, 58.0, 2.0)(heard, ahead_s))

    found = Played(data_folder / "px4-live" / "px4-indoor-liftoff-bias", 62.0, beside=beside)
    assert np.hypot(*found.error_m[found.t_s > 45.0, :2].T).max() < 1.0
    assert np.abs(found.error_m[found.t_s > 45.0, 2]).max() < 1.0
    assert Sensor.LANDED in found.session.offering.past_alarms
    assert silent_s(found, 45.0, found.t_s[-1]) < 0.3
