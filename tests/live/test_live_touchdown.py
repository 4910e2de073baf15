"""A touchdown without GPS: below its range and flow the vehicle stands, and the autopilot takes its time to say so."""

from __future__ import annotations

import pytest

from flownav.core.measurement import Sensor
from flownav.live.options import Options
from flownav.logs.mavlink import outgoing as say
from flownav.logs.mavlink.framing import PX4
from live_ends import GRAVITY, Hover, Wire, reading
from played_recordings import Notes

DESCENT_S, TOUCHDOWN_S, LANDED_S = (
    8.0,
    12.0,
    16.0,
)  # 4 s of doubt are what was seen of PX4, 1.5 s of dead reckoning a limit
HEIGHT_M, BLIND_M = 2.0, 0.15
SPEEDING_S = 0.2  # up to the speed of the descent, and to rest


def height_m(t_s):
    """Level, then down at an even speed, then on the ground."""
    share = (t_s - DESCENT_S) / (TOUCHDOWN_S - DESCENT_S)
    return HEIGHT_M * (1.0 - min(max(share, 0.0), 1.0))


def speeding_m_s2(t_s):
    """The acceleration downwards."""
    change = HEIGHT_M / (TOUCHDOWN_S - DESCENT_S) / SPEEDING_S
    begins, ends = abs(t_s - DESCENT_S) < 0.5 * SPEEDING_S, abs(t_s - TOUCHDOWN_S) < 0.5 * SPEEDING_S
    return change * (begins - ends)


class Landing(Hover):
    """PX4 without a receiver: its range is 0 and its flow without quality below 15 cm."""

    def frames(self, t_s):
        step, time_us = self.steps, round((self.boot_s + t_s) * 1e6)
        self.steps += 1
        a, b, c = (self.noise.gauss(0.0, 1.0) for _ in range(3))
        force = (0.02 * a, 0.02 * b, speeding_m_s2(t_s) - GRAVITY + 0.02 * c)
        messages = [say.heartbeat(self.mav, armed=True, autopilot=PX4)] if step % 100 == 0 else []
        messages.append(
            say.highres_imu(self.mav, time_us, reading(Sensor.IMU, *(0.002 * n for n in (b, c, a)), *force))
        )
        blind = height_m(t_s) < BLIND_M
        if step % 2 == 0:
            messages.append(say.attitude_quaternion(self.mav, time_us // 1000, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
            seen = reading(Sensor.FLOW_RATE, *(0.0 if blind else 0.01 * n for n in (a, b)), 0.002 * b, 0.002 * c)
            seen = seen._replace(quality=0.0) if blind else seen
            messages.append(say.optical_flow_rad(self.mav, time_us, seen, 0.02))
        if step % 5 == 0:
            seen = reading(Sensor.RANGE, 0.0 if blind else height_m(t_s) + 0.01 * a)
            messages.append(say.distance_sensor(self.mav, time_us // 1000, seen, (0.1, 40.0)))
        if step % 20 == 0:
            messages.append(self.mav.extended_sys_state_encode(0, 1 if t_s > LANDED_S else 2))
        return [bytes(message.pack(self.mav)) for message in messages]


@pytest.mark.parametrize("send", ["odometry", "vision"])
def test_what_is_sent_goes_on_through_a_touchdown_without_gps(send):
    """Nothing was sent for 0.8 to 4.4 s at every touchdown (`dead_reckoning`): standing did not count as an aid."""
    wire = Wire(Landing(gps=False), Options(send=send), Notes())
    wire.fly(DESCENT_S)
    assert wire.session.reason == ""
    withheld = dict(wire.session.withheld)
    wire.fly(LANDED_S + 2.0 - DESCENT_S)
    assert dict(wire.session.withheld) == withheld
    assert wire.session.estimate.pos_ned_m[:2] == pytest.approx((0.0, 0.0), abs=0.3)
    assert wire.session.estimate.reset_counter == 1
    wire.close()
