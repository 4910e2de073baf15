"""A GPS that jumps or is jammed, beside flow that nobody doubts: what is sent goes on (shared data)."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from flownav.logs.mavlink.framing import coder
from recorded_link import arrivals, play

GPS_RAW_INT = 24
BEGIN_S, END_S = 92.0, 102.0  # since boot, in the square at 8 m
METRES_A_DEGREE = 111_132.0
CAUGHT_M = 0.5  # beyond what the flight was off by before, flow being what holds it for 10 s


@pytest.fixture(scope="module")
def square(data_folder):
    """The flight on GPS and flow, which ends landed."""
    return cache(lambda: arrivals(data_folder / "ardupilot-live" / "square", 150.0))


def spoilt(frames, spoil):
    """Each fix between BEGIN_S and END_S as `spoil` leaves it."""
    decoder, packer = coder(), coder(1, 1)
    found = []
    for arrival in frames:
        if arrival.message_id == GPS_RAW_INT:
            message = decoder.decode(bytearray(arrival.frame))
            if BEGIN_S <= message.time_usec * 1e-6 < END_S:
                spoil(message)
                packer.srcSystem, packer.srcComponent = message.get_srcSystem(), message.get_srcComponent()
                packer.seq = message.get_seq()
                arrival = arrival._replace(frame=bytes(message.pack(packer)))
        found.append(arrival)
    return found


def flown(frames, truth):
    """Time since boot, level error and reset count of what was sent in the air, and the session."""
    session, sent = play(frames)
    told = [message for _, message in sent if message.msgname == "ODOMETRY"]
    t_s = np.array([message.time_usec * 1e-6 for message in told])
    place = np.array([[message.x, message.y] for message in told])
    true = np.column_stack([np.interp(t_s, truth["boot_s"], truth[name]) for name in ("pos_n_m", "pos_e_m")])
    air = (t_s > 80.0) & (t_s < 135.0)
    off_m = (place - true)[air]
    off_m -= np.median(off_m[t_s[air] < BEGIN_S], axis=0)  # GPS's own
    return t_s[air], np.hypot(*off_m.T), np.array([message.reset_counter for message in told])[air], session


@pytest.fixture(scope="module")
def truth(data_folder):
    return np.genfromtxt(data_folder / "ardupilot-live" / "square" / "truth.csv", delimiter=",", names=True)


def north(metres):
    def spoil(message):
        message.lat += round(metres / METRES_A_DEGREE * 1e7)

    return spoil


def jammed(message):
    message.fix_type, message.satellites_visible = 1, 0
    message.lat += 30_000


@pytest.mark.parametrize("spoil", [north(20.0), north(379.0), jammed], ids=["glitch", "far", "jam"])
def test_what_is_sent_goes_on_where_gps_jumps(square, truth, spoil):
    """A glitch of 20 m silenced a vehicle that had flow for 17 s, a jam for 9 s, and the filter went there and back."""
    t_s, off_m, resets, session = flown(spoilt(square(), spoil), truth)
    assert max(later - before for before, later in pairwise(t_s)) < 0.3
    assert off_m.max() < off_m[t_s < BEGIN_S].max() + CAUGHT_M
    assert len(set(resets)) == 1
    assert not session.alarms
