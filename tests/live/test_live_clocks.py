"""The time of what is sent, where a vehicle's UNIX time, in which some autopilots stamp their sensors, is set in
flight, and where its time since boot is found to be earlier than it was taken for.
"""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from flownav.logs.mavlink import outgoing as say
from live_ends import Hover, Wire, hovering

UNIX_S, SET_S = 1.7e9, 8.0  # of the vehicle's boot; when it is set, on its way
STAMPED = ("highres_imu", "optical_flow_rad", "gps_raw_int")


class ByUnixTime(Hover):
    """IMU, flow and GPS are stamped in UNIX time, which is set by `step_s`; the rest in time since boot."""

    step_s = 0.0
    says_both = False  # SYSTEM_TIME

    def frames(self, t_s):
        unix_s = UNIX_S + (self.step_s if t_s >= SET_S else 0.0)

        def later(encode):
            return lambda mav, time_us, *more, **named: encode(mav, time_us + round(1e6 * unix_s), *more, **named)

        with pytest.MonkeyPatch.context() as patched:
            for name in STAMPED:
                patched.setattr(say, name, later(getattr(say, name)))
            told = super().frames(t_s)
        if self.says_both and self.steps % 100 == 1:
            boot_s = self.boot_s + t_s
            both = self.mav.system_time_encode(round(1e6 * (boot_s + unix_s)), round(1e3 * boot_s))
            told.append(bytes(both.pack(self.mav)))
        return told


@pytest.mark.parametrize("says_both", [True, False])
@pytest.mark.parametrize("step_s", [3600.0, -3600.0, 40.0, 0.5, -0.5])
def test_unix_time_that_is_set_in_flight_costs_a_second_at_most(step_s, says_both):
    """By an hour it was taken for a reboot, 2 s of silence and a reset; by half a second back all was late for good."""
    vehicle = ByUnixTime()
    vehicle.step_s, vehicle.says_both = step_s, says_both
    wire = Wire(vehicle).fly(16.0)
    told = wire.estimates(5.0)
    stamps_s = [1e-6 * message.time_usec for message in told]
    assert all(0.0 <= b - a < 1.0 for a, b in pairwise(stamps_s))
    assert stamps_s[-1] == pytest.approx(wire.vehicle.boot_s + wire.t_s, abs=0.05)
    assert max(math.hypot(message.x, message.y) for message in told) < 0.2
    assert wire.session.resets == 1
    assert wire.session.reason == ""
    wire.close()


@pytest.mark.parametrize(("back_s", "waits_s"), [(0.0, 0.0), (0.2, 0.2), (0.9, 0.9), (1.1, 0.0)])
def test_no_estimate_is_of_an_earlier_time_than_the_one_before(back_s, waits_s):
    """On a loaded machine, whose messages all come late, one estimate was followed by those of 0.2 s before. A clock
    that is back by more is another one.
    """
    wire = hovering(6)
    before, begin_s = wire.session.clock.now_s, wire.now_s
    wire.session.clock.now_s = lambda now_s: before(now_s) - (back_s if now_s > begin_s else 0.0)
    wire.fly(2.0)
    came = zip(wire.heard, wire.heard_s, strict=True)
    told = [(t_s, 1e-6 * message.time_usec) for message, t_s in came if message.msgname == "ODOMETRY" and t_s > 5.0]
    assert max(b[0] - a[0] for a, b in pairwise(told)) == pytest.approx(waits_s, abs=0.05)
    assert all(b[1] >= a[1] for a, b in pairwise(told)) == (back_s <= 1.0)
    wire.close()
