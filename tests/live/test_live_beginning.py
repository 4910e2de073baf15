"""A session that begins in flight without GPS: its height is the range's where another witness says the same."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.live.beginning import ALIKE_M, ASKED_S, READINGS, SAME_M, common
from flownav.live.options import Options
from flownav.logs.mavlink import outgoing as say
from live_ends import HEIGHT_M, Hover, Wire, reading
from played_recordings import Notes

RANGE, LISTENED_S = 132, Options().listen_s


class Flying(Hover):
    """It hovers, 2 m up, has no GPS and says that it flies. ranges(step): of its range finder, every 50 ms; own_m: the
    height that it states itself twice a second, None where it states none; down_s: it says from then on that it stands.
    """

    own_m, down_s = HEIGHT_M, float("inf")

    def ranges(self, step):
        return HEIGHT_M

    def frames(self, t_s):
        step, time_ms = self.steps, round((self.boot_s + t_s) * 1e3)
        self.gps = False
        told = [frame for frame in super().frames(t_s) if frame[7] | frame[8] << 8 != RANGE]
        messages = []
        if step % 5 == 0:
            seen = reading(Sensor.RANGE, self.ranges(step // 5) + self.noise.gauss(0.0, 0.02))
            messages.append(say.distance_sensor(self.mav, time_ms, seen, (0.1, 40.0)))
        if step % 20 == 0:
            messages.append(self.mav.extended_sys_state_encode(0, 1 if t_s > self.down_s else 2))
        if step % 50 == 0 and self.own_m is not None:
            messages.append(self.mav.local_position_ned_encode(time_ms, 0.0, 0.0, -self.own_m, 0.0, 0.0, 0.0))
        return [*told, *(bytes(message.pack(self.mav)) for message in messages)]


@pytest.fixture
def flown():
    made = []

    def fly(seconds, **how):
        kind = type("Made", (Flying,), how)
        made.append(Wire(kind(), Options(), Notes()))
        return made[-1].fly(seconds)

    yield fly
    for wire in made:
        wire.close()


def heights(wire):
    return np.array([-message.z for message in wire.estimates()])


def begun(wire):
    return [detail for _, _, kind, detail in wire.session.keeper.all if kind == "begun_in_flight"]


def first_s(wire):
    return next(t_s for message, t_s in zip(wire.heard, wire.heard_s, strict=True) if message.msgname == "ODOMETRY")


def test_where_the_autopilot_says_the_same_it_begins_at_once(flown):
    wire = flown(5.0)
    assert np.abs(heights(wire) - HEIGHT_M).max() < 0.2
    assert begun(wire) == ["the height above the ground is by range and autopilot"]
    assert first_s(wire) < LISTENED_S + 1.0


def test_an_autopilot_that_states_no_height_is_waited_for_a_while_only(flown):
    wire = flown(6.5, own_m=None)
    assert begun(wire) == ["the height above the ground is by range alone"]
    assert LISTENED_S + ASKED_S <= first_s(wire) < LISTENED_S + ASKED_S + 1.0
    assert np.abs(heights(wire) - HEIGHT_M).max() < 0.2
    asked = [m for m in wire.heard if m.msgname == "COMMAND_LONG" and m.param1 == 32]
    assert asked, "how high it is"


@pytest.mark.parametrize("own_m", [HEIGHT_M, None])
def test_one_reading_of_a_range_is_not_believed(flown, own_m):
    """Each third reading is of a leg or a gap: the last one before the start was the height."""
    wire = flown(9.0, own_m=own_m, ranges=lambda self, step: 12.0 if step % 6 == 0 else HEIGHT_M)
    assert len(heights(wire)) > 50
    assert np.abs(heights(wire) - HEIGHT_M).max() < 0.5


def test_while_the_autopilot_says_another_height_nothing_is_sent(flown):
    """The range sees its own mount, 12 m; then the ground."""
    wire = flown(12.0, ranges=lambda self, step: 12.0 if step < 160 else HEIGHT_M)
    session = wire.session
    assert session.withheld["begins_in_flight"] > 100
    assert not [m for m, t_s in zip(wire.heard, wire.heard_s, strict=True) if m.msgname == "ODOMETRY" and t_s < 8.0]
    wire.fly(5.0)
    assert session.reason == ""
    assert np.abs(heights(wire) - HEIGHT_M).max() < 1.0


def test_landing_ends_the_doubt(flown):
    wire = flown(9.0, own_m=HEIGHT_M + 1.5 * SAME_M, down_s=6.0)
    assert begun(wire) == ["the height above the ground is by landing"]
    assert wire.session.reason == ""
    assert np.abs(heights(wire)).max() < 0.2


def test_most_of_the_readings_have_to_agree():
    same = [2.0, 2.1, 1.9, 2.0]
    assert np.isnan(common(deque(same)))
    assert len([*same, 40.0]) == READINGS
    assert common(deque([*same, 40.0])) == pytest.approx(2.0)
    assert np.isnan(common(deque([*same[:3], 40.0, 41.0])))
    assert np.isnan(common(deque([2.0, 2.0 + 1.1 * ALIKE_M, 2.0 - 1.1 * ALIKE_M, 2.0, 2.0])))
