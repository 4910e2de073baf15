"""A simulator is asked for the truth, a vehicle is not; the received truth is kept."""

from __future__ import annotations

import pytest

from flownav.live.filtering import Keeper
from flownav.live.options import Options
from flownav.live.requests import HIL_FLAG, MOST_QUESTIONS, SET_MESSAGE_INTERVAL, SILENT_S
from flownav.live.session import Session
from flownav.logs.mavlink import outgoing as say
from flownav.logs.mavlink.framing import coder

ARDUPILOT, PX4 = 3, 12


class Kept(Keeper):
    def __init__(self):
        self.truths = []

    def truth(self, t_s, state):
        self.truths.append((t_s, state))


class Autopilot:
    """Answers what an autopilot of a make would, on a clock of the test's own."""

    def __init__(self, make, *, simulated, base_mode=0, deaf_until_s=0.0):
        self.mav, self.decoder = coder(1, 1), coder()
        self.make, self.simulated, self.base_mode, self.deaf_until_s = make, simulated, base_mode, deaf_until_s
        self.keeper = Kept()
        self.session = Session(Options(), self.keeper, 0.0, 1.8e9)
        self.asked, self.parameters_asked, self.now_s, self.interval_s, self.told_s = [], 0, 0.0, 0.0, 0.0

    def say(self, message):
        self.session.take(bytes(message.pack(self.mav)), self.now_s, whole=True)

    def live(self, seconds):
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.now_s += 0.05
            if round(self.now_s / 0.05) % 20 == 1:
                self.say(self.mav.heartbeat_encode(4, self.make, self.base_mode, 0, 3, 3))
                self.say(self.mav.system_time_encode(0, round((self.now_s + 20.0) * 1e3)))
            if self.interval_s and self.now_s - self.told_s >= self.interval_s:
                self.told_s = self.now_s
                self.tell_truth()
            self.session.tick(self.now_s)
            while self.session.outbox:
                self.hear(self.decoder.decode(bytearray(self.session.outbox.popleft())))
        return self

    def tell_truth(self):
        place, still = (47.0, 8.0, 400.0), (0.0, 0.0, 0.0)
        self.say(say.attitude_quaternion(self.mav, round((self.now_s + 20.0) * 1e3), (1.0, 0.0, 0.0, 0.0), still))
        self.say(say.sim_state(self.mav, place, still, (1.0, 0.0, 0.0, 0.0), still, still, (0.0, 0.0, -9.8)))

    def hear(self, message):
        if message.msgname == "PARAM_REQUEST_READ":
            assert message.param_id == "SIM_SPEEDUP"
            self.parameters_asked += 1
            if self.simulated and self.now_s >= self.deaf_until_s:
                self.say(self.mav.param_value_encode(b"SIM_SPEEDUP", 1.0, 9, 1, 0))
        elif message.msgname == "COMMAND_LONG" and message.command == SET_MESSAGE_INTERVAL:
            number = int(message.param1)
            self.asked.append(number)
            known = number != 108 or self.simulated
            if number == 108 and known:
                self.interval_s = message.param2 * 1e-6
            self.say(self.mav.command_ack_encode(message.command, 0 if known else 4))


def test_ardupilots_simulator_is_asked_for_the_truth_and_it_is_kept():
    autopilot = Autopilot(ARDUPILOT, simulated=True, deaf_until_s=3.0).live(8.0)
    assert autopilot.asked.count(108) == 1
    assert autopilot.interval_s == pytest.approx(0.04)
    assert len(autopilot.keeper.truths) > 20
    assert autopilot.parameters_asked == 3  # the first two were not received


def test_a_vehicle_is_not_asked_for_it():
    autopilot = Autopilot(ARDUPILOT, simulated=False).live(20.0)
    assert 27 in autopilot.asked
    assert 108 not in autopilot.asked
    assert autopilot.parameters_asked == MOST_QUESTIONS
    assert "SIM_STATE" not in autopilot.session.requests.refused


@pytest.mark.parametrize(("simulated", "base_mode"), [(True, HIL_FLAG), (True, 0), (False, 0)])
def test_px4_is_asked_whether_it_says_that_it_is_simulated_or_not(simulated, base_mode):
    """SIH's heartbeat has no HIL bit; a vehicle has no truth to tell, and refuses."""
    autopilot = Autopilot(PX4, simulated=simulated, base_mode=base_mode).live(3.0)
    assert 115 in autopilot.asked
    assert autopilot.parameters_asked == 0


def test_after_a_reboot_it_is_asked_for_again():
    """Rates are 0 then: only HEARTBEAT comes, and what is silent is asked for again."""
    autopilot = Autopilot(ARDUPILOT, simulated=True).live(6.0)
    assert autopilot.asked.count(108) == 1
    autopilot.interval_s = 0.0
    autopilot.live(4.0 + SILENT_S)
    assert autopilot.asked.count(108) == 2
    assert autopilot.interval_s > 0.0
