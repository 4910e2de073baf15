"""Glitches of an IMU that are finite and have a good checksum: they cost little, and the record flags them."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.live.filtering import Keeper
from flownav.logs.mavlink import outgoing as say
from flownav.navigation.tape import IMU_SPIKE
from live_ends import GRAVITY, Hover, hovering, reading

HIGHRES_IMU = 105
BEGIN_S = 10.0  # after what all of them begin with


class Flagged(Keeper):
    """Counts spikes."""

    spikes = 0

    def written(self, estimate, innovation, event):
        self.spikes += int(np.count_nonzero(event[:, 1] == IMU_SPIKE))


class Glitching(Hover):
    """`says(chance)` gives rate and force while `when(t_s)` holds; it never does before `when` is set."""

    def when(self, t_s):
        return False

    def frames(self, t_s):
        frames = super().frames(t_s)
        if not self.when(t_s):
            return frames
        rates, force = self.says(self.noise)
        message = say.highres_imu(self.mav, round((self.boot_s + t_s) * 1e6), reading(Sensor.IMU, *rates, *force))
        spoilt = bytes(message.pack(self.mav))
        return [spoilt if frame[7] | frame[8] << 8 == HIGHRES_IMU else frame for frame in frames]


def every_second(t_s):
    return t_s > BEGIN_S and abs(t_s - round(t_s)) < 0.004


def during(seconds):
    return lambda t_s: BEGIN_S <= t_s < BEGIN_S + seconds


def steady(*values):
    return lambda chance: (values[:3], (*values[3:5], values[5] - GRAVITY))


def noisy(chance):
    return [chance.gauss(0.0, 5.0) for _ in range(3)], [chance.gauss(0.0, 50.0) for _ in range(3)]


@pytest.mark.parametrize("gps", [True, False])
@pytest.mark.parametrize(("when", "says"), [
    (every_second, steady(0.0, 0.0, 0.0, 100.0, 0.0, 0.0)),
    (every_second, steady(30.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
    (during(0.1), steady(0.0, 0.0, 0.0, 30.0, 0.0, 0.0)),
    (during(0.3), steady(0.0, 0.0, 0.0, 30.0, 0.0, 0.0)),
    (during(0.2), steady(5.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
    (during(0.2), noisy),
    (during(1.0), steady(0.0, 0.0, 0.0, 0.0, 0.0, GRAVITY)),  # six zeros, which are no reading
])  # fmt: skip
def test_spikes_and_bursts_cost_a_tenth_of_a_metre_at_most_and_are_flagged(when, says, gps):
    wire = hovering(8, Glitching, Flagged)
    vehicle, keeper = wire.vehicle, wire.session.keeper
    vehicle.when, vehicle.says = when, says
    vehicle.gps = gps
    wire.fly(8.0)
    told = wire.estimates(7.5)
    places = np.array([[message.x, message.y, message.z] for message in told])
    off = np.abs(places - places[:20].mean(axis=0)).max(axis=0)
    wire.close()
    assert len(told) > 350
    assert off[:2].max() < 0.1
    assert off[2] < 0.2
    assert keeper.spikes >= 1 or wire.session.dropped["imu: no_data"] > 50
    assert wire.session.reason == ""
