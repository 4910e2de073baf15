"""Sensors that a simulator lacks, made from its truth: a flow sensor, sent as MAVLink's OPTICAL_FLOW_RAD, and a second
GPS receiver, sent as HIL_GPS.
"""

import random
from collections import deque

import pymap3d

from flownav.core.frames import angular_flow, rotation_from_quaternion, to_body
from flownav.core.measurement import Measurement, Sensor
from flownav.live.sitl.tables import Eyes
from flownav.live.sitl.wire import Truth, Wire
from flownav.logs.mavlink import outgoing as say
from flownav.logs.mavlink.framing import INVALID_AUTOPILOT, Message, coder
from flownav.logs.mavlink.messages import TrueState

COMPONENT = 158  # MAV_COMP_ID_PERIPHERAL
ONBOARD = 18  # MAV_TYPE
EXPOSURE_S, DELAY_S = 0.02, 0.02  # 50 Hz, sent 20 ms later
NOISE_RAD_S, GYRO_NOISE_RAD_S = 0.05, 0.003  # settings.flow_sigma_rad_s, and a quiet gyro
LENS_M = 0.1  # the lens above the ground on its legs
QUALITY = 200
LEAST_COSINE = 0.3  # of tilt
LONGEST_STEP_S = 0.2
FIX_S = 0.2
SHORT_S = 0.0015  # of an exposure: the truth's own steps jitter


class FlowSensor:
    """A flow sensor with a gyro on a level floor. state: what is wrong with it; ground_m: the floor's altitude."""

    def __init__(self, wire: Wire, system: int, ground_m: float, seed: int) -> None:
        self.state = Eyes()
        self._wire, self._ground_m = wire, ground_m
        self._mav = coder(system, COMPONENT)
        self._chance = random.Random(seed)
        self._waiting: deque[tuple[float, Message]] = deque()  # when, what
        self._before: Truth | None = None
        self._sums, self._since_s = [0.0] * 5, 0.0
        self._stuck: Message | None = None
        self._seen, self._beat_s = 0, float("-inf")
        wire.turns.append(self.turn)

    def turn(self, now_s: float) -> None:
        """Look at the truth that has come, and send the readings that are due."""
        news = self._wire.history.truth[self._seen :]
        self._seen += len(news)
        for truth in news:
            self._look(truth)
        if now_s - self._beat_s >= 1.0:
            self._beat_s = now_s
            self._wire.say(self._mav.heartbeat_encode(ONBOARD, INVALID_AUTOPILOT, 0, 0, 4, 3), self._mav)
        while self._waiting and self._waiting[0][0] <= now_s:
            self._wire.say(self._waiting.popleft()[1], self._mav)

    def _look(self, truth: Truth) -> None:
        before, self._before = self._before, truth
        step_s = truth.now_s - before.now_s if before is not None else LONGEST_STEP_S
        if not 0.0 < step_s < LONGEST_STEP_S:
            return
        self._sums = [
            total + rate * step_s for total, rate in zip(self._sums, seen(truth.state, self._ground_m), strict=True)
        ]
        self._since_s += step_s
        if self._since_s < EXPOSURE_S - SHORT_S:
            return
        interval_s = self._since_s
        rates = [total / interval_s for total in self._sums]
        self._sums, self._since_s = [0.0] * 5, 0.0
        noise = self.state.flow_noise_rad_s or NOISE_RAD_S
        wrong = self.state.flow_sign * self.state.flow_scale
        flow = [wrong * rate + self._chance.gauss(0.0, noise) for rate in rates[:2]]  # a lens errs in turning, too
        gyro = [rate + self._chance.gauss(0.0, GYRO_NOISE_RAD_S) for rate in rates[2:]]
        gyro[0] += self.state.gyro_rad_s
        reading = Measurement(truth.now_s, Sensor.FLOW_RATE, (*flow, *gyro[:2]), (0.0,) * 4, 0.0, QUALITY)
        message = say.optical_flow_rad(self._mav, round(truth.now_s * 1e6), reading, interval_s)
        message.integrated_zgyro = gyro[2] * interval_s  # of fewer axes, PX4 would put its own gyro in their place
        self._stuck = (self._stuck or message) if self.state.flow_stuck else None
        if self.state.flow:
            self._waiting.append((truth.now_s + DELAY_S + self.state.flow_late_s, self._stuck or message))


class Receiver:
    """A second GPS receiver, which sends fixes while its state has an error, off by that and otherwise good."""

    def __init__(self, wire: Wire, system: int) -> None:
        self.state = Eyes()
        self._wire, self._mav = wire, coder(system, COMPONENT)
        self._sent_s = float("-inf")
        wire.turns.append(self.turn)

    def turn(self, now_s: float) -> None:
        """Send a fix where one is due."""
        off_m = self.state.gps_north_m
        if off_m is None or now_s - self._sent_s < FIX_S or not self._wire.history.truth:
            return
        self._sent_s = now_s
        latest = self._wire.history.truth[-1]
        fix = pymap3d.ned2geodetic(off_m, 0.0, 0.0, *latest.state.position_deg_m)
        self._wire.say(say.hil_gps(self._mav, round(latest.now_s * 1e6), fix, latest.state.vel_ned_m_s), self._mav)


def seen(state: TrueState, ground_m: float) -> tuple[float, ...]:
    """Angular flow about the body's x and y over a level floor, and the turning about its three axes [rad/s]."""
    rotation = rotation_from_quaternion(*state.quaternion)
    forward, right, _ = to_body(rotation, *state.vel_ned_m_s)
    height_m = max(state.position_deg_m[2] - ground_m, 0.0) + LENS_M
    range_m = height_m / max(rotation[8], LEAST_COSINE)
    turning_x, turning_y, turning_z = state.rate_frd_rad_s
    flow_x, flow_y = angular_flow(forward, right, turning_x, turning_y, range_m)
    return float(flow_x), float(flow_y), turning_x, turning_y, turning_z
