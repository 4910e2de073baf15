"""A live session over loopback sockets: what it sends is finite, fresh and of its vehicle, whatever is sent to it.

Time is the test's own, so that a cable can be pulled for half a minute without waiting for it.
"""

from __future__ import annotations

import math
import random
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.estimation.states import POSITION, STATE
from flownav.live.answers import why_withheld
from flownav.live.display import draw
from flownav.live.filtering import ROOM, Keeper
from flownav.live.horizon import Refused
from flownav.live.loop import Latency
from flownav.live.options import Limits, Options
from flownav.live.reception import BESIDE, Accepted, accepted_by, accepted_of
from flownav.live.screen import Screen
from flownav.live.session import Session
from flownav.logs.mavlink import outgoing as say
from flownav.logs.mavlink.framing import coder
from flownav.logs.mavlink.position_messages import LOCAL_FRD
from flownav.logs.mavlink.signing import SignatureCheck
from flownav.navigation.memory import PROTECTION
from live_ends import HEIGHT_M, ORIGIN, START_S, UNIX_S, Hover, Wire, hovering, reading

KEY = bytes(range(32))
MOST_WAITING = int(ROOM.most)


@pytest.fixture
def wires():
    """Makes wires; their sockets are closed afterwards."""
    made = []

    def make(vehicle=None, **options):
        made.append(Wire(vehicle or Hover(), Options(**options)))
        return made[-1]

    yield make
    for wire in made:
        wire.close()


def is_good(message):
    numbers = [message.x, message.y, message.z, message.vx, message.vy, message.vz, *message.q]
    return all(map(math.isfinite, numbers)) and math.hypot(message.x, message.y) < 3.0


def assert_all_good(wire, at_least=1):
    """Every estimate that was ever sent was finite, near the vehicle, and stamped with the vehicle's own time."""
    estimates = wire.estimates()
    assert len(estimates) >= at_least
    assert all(is_good(message) for message in estimates)


def test_a_copied_session_goes_on_as_one_that_was_never_copied(wires):
    """The start of most tests here; another copy of it that flies otherwise in between changes nothing."""
    whole, wire, other = wires().fly(6.0), hovering(4), hovering(4)
    for _ in range(4):
        other.fly(0.5, silent=True)
        wire.fly(0.5)
    assert (wire.frames, wire.heard_s) == (whole.frames, whole.heard_s)
    assert wire.session.dropped == whole.session.dropped
    assert wire.session.filtering.running.work.tobytes() == whole.session.filtering.running.work.tobytes()
    assert other.session.reason == "stale"


def test_the_estimate_is_sent_with_covariance_frames_and_the_vehicles_time():
    wire = hovering(8)
    assert wire.session.reason == ""
    last = wire.estimates()[-1]
    assert_all_good(wire, at_least=200)
    assert abs(last.z) < 1.5  # the origin is the first fix, at the vehicle's own height
    assert math.hypot(last.vx, last.vy) < 0.2
    assert last.frame_id == LOCAL_FRD
    assert np.isfinite(last.pose_covariance).all()
    assert np.isfinite(last.velocity_covariance).all()
    assert 0.0 < last.pose_covariance[0] < 4.0
    assert last.time_usec == pytest.approx((wire.vehicle.boot_s + wire.t_s) * 1e6, abs=30e3)
    assert len({message.reset_counter for message in wire.estimates(4.0)}) == 1


def test_streams_are_asked_for_and_timesync_is_answered_in_the_vehicles_time():
    wire = hovering(3)
    asked = {int(m.param1) for m in wire.heard if m.msgname == "COMMAND_LONG" and m.command == 511}
    assert {105, 106} & asked  # sent again until it is acknowledged
    wire.send(bytes(wire.vehicle.mav.timesync_encode(0, 123).pack(wire.vehicle.mav)))
    answer = [m for m in wire.heard if m.msgname == "TIMESYNC"][-1]
    assert answer.ts1 == 123
    assert answer.tc1 * 1e-9 == pytest.approx(wire.vehicle.boot_s + wire.t_s, abs=0.02)


def test_commands_follow_one_another_as_they_are_answered(wires):
    wire = wires()

    def answer():
        for message in wire.heard:
            if message.msgname == "COMMAND_LONG" and id(message) not in seen:
                seen.add(id(message))
                denied = message.param1 == 29
                ack = wire.vehicle.mav.command_ack_encode(message.command, 4 if denied else 0)
                wire.socket.send(bytes(ack.pack(wire.vehicle.mav)))

    seen = set()
    wire.fly(2.0, beside=answer)
    assert wire.session.requests.refused == ["SCALED_PRESSURE"]
    assert wire.session.requests.answers["accepted"] >= 8


def test_malformed_packets_are_counted_and_change_nothing(wires):
    wire, chance = wires(), random.Random(1)

    def damage():
        frame = bytearray(wire.vehicle.mav.heartbeat_encode(2, 3, 0, 0, 4, 3).pack(wire.vehicle.mav))
        frame[chance.randrange(len(frame))] ^= 1 << chance.randrange(8)
        wire.socket.send(bytes(frame))
        wire.socket.send(chance.randbytes(chance.randrange(1, 300)))
        wire.socket.send(bytes(frame[: chance.randrange(1, len(frame))]))
        wire.socket.send(b"\xfd" * chance.randrange(1, 600))

    wire.fly(6.0, beside=damage)
    assert wire.session.reason == ""
    assert wire.session.dropped["link: skipped_bytes"] > 10_000
    assert_all_good(wire, at_least=100)


def test_values_that_cannot_be_never_reach_what_is_sent():
    wire = hovering(4)
    mav, chance = wire.vehicle.mav, random.Random(2)

    def nonsense():
        worst = [math.nan, math.inf, -math.inf, 1e30]
        time_us = round((wire.vehicle.boot_s + wire.t_s) * 1e6)
        values = [chance.choice(worst) for _ in range(9)]
        wire.socket.send(bytes(mav.highres_imu_encode(time_us, *values, 1e3, 0.0, 0.0, 0.0, 0x1FF).pack(mav)))
        quaternion = [chance.choice(worst) for _ in range(4)]
        wire.socket.send(bytes(mav.attitude_quaternion_encode(time_us // 1000, *quaternion, 0, 0, 0).pack(mav)))

    wire.fly(4.0, beside=nonsense)
    assert wire.session.dropped["imu: not_finite"] > 100
    assert wire.session.reason == ""
    assert_all_good(wire, at_least=200)


def test_a_flood_is_dropped_and_counted_and_memory_stays():
    wire = hovering(4)
    mav = wire.vehicle.mav
    ahead_us = round((wire.vehicle.boot_s + wire.t_s) * 1e6)
    for k in range(2 * MOST_WAITING):
        stamp = ahead_us + 1_000_000 + 1000 * (k % 500)  # a second ahead: all would wait
        message = mav.highres_imu_encode(stamp, 0, 0, -9.8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x3F)
        wire.session.take(bytes(message.pack(mav)), wire.now_s, whole=True)
        assert len(wire.session.filtering.rings) <= MOST_WAITING
    assert wire.session.dropped["imu: overflow"] > MOST_WAITING // 2
    began = wire.t_s
    wire.fly(12.0)
    assert wire.session.reason == ""
    assert wire.estimates(began + 8.0)
    assert_all_good(wire)


def test_a_second_autopilot_is_not_listened_to(wires):
    wire = wires().fly(0.1)
    other = Hover(system=9, boot_s=900.0)
    wire.fly(6.0, beside=lambda: [wire.socket.send(frame) for frame in other.frames(wire.t_s)])
    assert wire.session.reception.vehicle[:2] == (1, 1)
    assert wire.session.reception.others == [(9, 1)]
    assert wire.session.dropped["link: other_system"] > 500
    assert wire.session.reason == ""
    assert_all_good(wire, at_least=100)


def test_a_stranger_with_the_vehicles_number_on_another_port_is_not_listened_to():
    wire = hovering(4)
    stranger, forger = wire.another(), Hover(boot_s=777.0)
    wire.fly(2.0, beside=lambda: [stranger.send(frame) for frame in forger.frames(wire.t_s)])
    stranger.close()
    assert wire.link.counts["other_sender"] > 300
    assert wire.session.reason == ""


def test_the_system_that_was_asked_for_is_waited_for(wires):
    wire = wires(Hover(system=3), system=4).fly(2.0)
    assert wire.session.reception.vehicle is None
    assert not wire.heard
    assert wire.session.dropped["link: other_system"] > 100


def test_with_a_key_unsigned_forged_and_replayed_packets_are_rejected(wires):
    wire = wires(Hover(key=KEY), key=KEY)
    unsigned, forger = Hover(), Hover(key=bytes(32))

    def attack():
        for frame in (*wire.last, *unsigned.frames(wire.t_s), *forger.frames(wire.t_s)):
            wire.socket.send(frame)

    wire.fly(6.0, beside=attack)
    dropped = wire.session.dropped
    assert dropped["link: unsigned"] > 500
    assert dropped["link: bad_signature"] > 500
    assert dropped["link: replayed"] > 500
    assert wire.session.reason == ""
    assert_all_good(wire, at_least=100)
    check = SignatureCheck(KEY, UNIX_S)
    assert all(check.accepts(frame) for frame in wire.frames)


def test_a_cable_pulled_for_thirty_seconds_stops_the_sending_and_it_goes_on_by_itself():
    wire = hovering(6)
    before = wire.estimates()[-1].reset_counter
    pulled = wire.t_s
    wire.fly(30.0, silent=True)
    assert wire.session.reason == "stale"
    assert not wire.estimates(pulled + Limits().age_s + 0.02)
    back = wire.t_s
    wire.fly(6.0)
    assert wire.session.reason == ""
    assert wire.estimates(back)
    assert wire.estimates()[-1].reset_counter != before  # the vehicle may have been carried
    assert wire.session.withheld["stale"] > 100
    assert_all_good(wire)


def test_a_short_silence_needs_no_new_start():
    wire = hovering(6)
    jumps = wire.session.filtering.jumps
    wire.fly(1.0, silent=True)
    assert wire.session.reason == "stale"
    wire.fly(2.0)
    assert wire.session.reason == ""
    assert wire.session.filtering.jumps == jumps


def test_a_vehicle_that_reboots_is_navigated_anew():
    wire = hovering(6)
    before = wire.estimates()[-1].reset_counter
    wire.vehicle.boot_s = 1.0 - wire.t_s
    wire.fly(6.0)
    assert wire.session.reason == ""
    assert wire.session.dropped["clock: clock_jump"] == 1
    last = wire.estimates()[-1]
    assert last.reset_counter == before + 1  # one reboot is one jump
    assert last.time_usec == pytest.approx((wire.vehicle.boot_s + wire.t_s) * 1e6, abs=30e3)
    assert_all_good(wire)


@pytest.mark.parametrize("jump_s", [1.5, 100.0, -1.0, -15.0])
def test_a_clock_that_jumps_is_followed(jump_s):
    wire = hovering(6)
    wire.vehicle.boot_s += jump_s
    wire.fly(9.0)
    assert wire.session.reason == ""
    assert wire.estimates(wire.t_s - 1.0)
    assert_all_good(wire)


@pytest.mark.parametrize("stray_s", [1.9, 9.0, 5000.0, -9.0])
def test_one_stamp_that_cannot_be_does_not_stop_it_for_long(stray_s):
    wire = hovering(5)
    mav = wire.vehicle.mav
    stamp = round(max(0.0, wire.vehicle.boot_s + wire.t_s + stray_s) * 1e6)
    wire.send(bytes(mav.highres_imu_encode(stamp, 0, 0, -9.8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x3F).pack(mav)))
    wire.fly(9.0)
    assert wire.session.reason == ""
    assert_all_good(wire)


def test_without_any_horizontal_aid_it_stops_and_says_why():
    wire = hovering(5)
    wire.vehicle.gps = wire.vehicle.flow = False
    lost = wire.t_s
    wire.fly(7.0)
    assert wire.session.reason == "position_invalid"
    assert not wire.estimates(lost + 1.7)
    wire.vehicle.gps = wire.vehicle.flow = True
    wire.fly(2.0)
    assert wire.session.reason == ""
    assert_all_good(wire)


def test_the_limit_of_dead_reckoning_may_be_tighter(wires):
    wire = wires(limits=Limits(dead_reckoning_s=1.5)).fly(5.0)
    wire.vehicle.gps = wire.vehicle.flow = False
    wire.fly(3.0)
    assert wire.session.reason == "dead_reckoning"


def test_without_its_imu_the_estimate_is_not_sent():
    wire = hovering(5)
    wire.vehicle.imu = False
    wire.fly(2.0)
    assert wire.session.reason == "stale"


def test_an_uncertain_estimate_is_not_sent(wires):
    wire = wires(limits=Limits(sigma_m=0.01)).fly(5.0)
    assert wire.session.reason == "uncertain"
    assert not wire.estimates()


def shown(wire):
    """The screen's text."""
    console = Console(width=160, file=StringIO(), record=True)
    console.print(draw(Screen(wire.session, Latency(), "udp:1").view(wire.now_s)))
    return console.export_text()


def test_while_a_fault_is_suspected_nothing_is_sent_and_the_screen_names_it():
    """GPS drifts north at 1 m/s, its own velocity along with it; flow and IMU say that the vehicle hovers."""
    wire, told = hovering(12), {}
    wire.vehicle.north_m_s = 1.0

    def drift():
        wire.vehicle.north_m += 0.01
        if wire.session.reason == "fault_suspected" and not told:
            told.update(t_s=wire.t_s, screen=shown(wire))

    assert "protection levels: none yet" in shown(hovering(0))
    assert "suspected" not in shown(wire)
    wire.fly(12.0, beside=drift)
    assert "suspected: GPS drift north" in told["screen"]
    assert "withheld: innovations show that a sensor fails" in told["screen"]
    assert 12.0 < told["t_s"] < 20.0
    assert wire.estimates(told["t_s"] - 1.0)
    assert not wire.estimates(told["t_s"] + 0.02)
    assert wire.session.withheld["fault_suspected"] > 100


@pytest.mark.parametrize(("drift_m_s", "most_m"), [(1.0, 0.7), (2.0, 0.5), (5.0, 0.5)])
def test_a_position_that_leaves_its_receivers_velocity_and_the_flow_is_refused_before_it_leads_far(drift_m_s, most_m):
    """It led 4.8 m off in 6 s. A slower one drifts as sound receivers do: at 0.5 m/s 2.5 m in 12 s."""
    wire = hovering(12)

    def drift():
        wire.vehicle.north_m += 0.01 * drift_m_s

    wire.fly(12.0, beside=drift)
    assert abs(wire.session.estimate.pos_ned_m[0]) < most_m
    assert wire.session.reason == ""
    assert wire.session.alarms[Sensor.GPS_POSITION].why == "innovation_gate"


def test_without_protection_nothing_is_sent(wires):
    """A level that is above the limit, and one that is no number."""
    wire = hovering(5)
    on = wire.session.filtering.running
    level_m, t_s = float(on.work[PROTECTION]), on.clock_s
    assert f"protection levels: {level_m:.2f} m horizontal, {float(on.work[PROTECTION + 1]):.2f} m vertical" in shown(
        wire
    )
    for limit_m, reason in ((1.01 * level_m, ""), (0.99 * level_m, "unprotected")):
        assert why_withheld(on, t_s, t_s, Limits(protection_m=limit_m)) == reason
    on.work[PROTECTION] = math.nan
    assert why_withheld(on, t_s, t_s, Limits()) == "unprotected"
    strict = wires(limits=Limits(protection_m=0.5 * level_m)).fly(5.0)
    assert strict.session.reason == "unprotected"
    assert not strict.estimates()


def test_without_gps_the_flow_starts_it_and_nothing_is_sent_before(wires):
    wire = wires(Hover(gps=False)).fly(1.5)
    assert wire.session.reason == "listening"
    assert not wire.estimates()
    wire.fly(4.0)
    assert wire.session.reason == ""
    assert_all_good(wire)


@pytest.mark.parametrize(
    ("send", "names"),
    [("vision", {"VISION_POSITION_ESTIMATE", "VISION_SPEED_ESTIMATE"}), ("none", set()), ("landing-target", set())],
)
def test_what_is_sent_is_what_was_asked_for(wires, send, names):
    wire = wires(send=send).fly(5.0)
    sent = {message.msgname for message in wire.heard} - {"HEARTBEAT", "TIMESYNC", "COMMAND_LONG"}
    assert sent == names
    assert wire.session.reason == {"vision": "", "none": "nothing_asked", "landing-target": "no_pad"}[send]


def test_the_pad_is_told_once_it_was_seen():
    wire = hovering(4, options=Options(send="landing-target"))
    mav = wire.vehicle.mav

    def see():
        time_us = round((wire.vehicle.boot_s + wire.t_s) * 1e6)
        message = mav.landing_target_encode(time_us, 0, 12, 0.1, -0.2, HEIGHT_M, 0, 0)
        wire.socket.send(bytes(message.pack(mav)))

    wire.fly(3.0, beside=see)
    last = [message for message in wire.heard if message.msgname == "LANDING_TARGET"][-1]
    assert last.angle_x == pytest.approx(0.1, abs=0.05)
    assert last.angle_y == pytest.approx(-0.2, abs=0.05)
    assert last.position_valid == 1
    assert coder().decode(bytearray(wire.frames[-1])).get_srcSystem() == 1


CAMERA = 191  # MAV_COMP_ID_ONBOARD_COMPUTER


def sees_the_pad(wire, system, component):
    """A camera's LANDING_TARGET, through the autopilot's link, under its own component."""
    mav = coder(system, component)

    def see():
        time_us = round((wire.vehicle.boot_s + wire.t_s) * 1e6)
        message = mav.landing_target_encode(time_us, 0, 12, 0.1, -0.2, HEIGHT_M, 0, 0)
        wire.socket.send(bytes(message.pack(mav)))

    return see


def test_a_camera_with_a_component_of_its_own_is_heard():
    wire = hovering(4, options=Options(send="landing-target"))
    wire.fly(3.0, beside=sees_the_pad(wire, 1, CAMERA))
    assert wire.session.reason == ""
    last = [message for message in wire.heard if message.msgname == "LANDING_TARGET"][-1]
    assert last.angle_x == pytest.approx(0.1, abs=0.05)
    assert "link: lost" not in wire.session.dropped  # its sequence is not the autopilot's


def test_a_camera_of_another_system_is_heard_where_it_is_named(wires):
    for accept, heard in (((), False), (accepted_by(["LANDING_TARGET=42.191"]), True)):
        wire = wires(send="landing-target", **({"accept": accept} if accept else {})).fly(4.0)
        wire.fly(2.0, beside=sees_the_pad(wire, 42, CAMERA))
        assert (wire.session.reason == "") is heard
        assert (wire.session.dropped.get("link: other_system", 0) > 100) is not heard


def test_what_flownav_sent_itself_is_not_taken_when_it_comes_back():
    wire = hovering(4, options=Options(send="landing-target"))
    wire.fly(2.0, beside=sees_the_pad(wire, 1, say.ODOMETRY_COMPONENT))
    assert wire.session.reason == "no_pad"


@pytest.mark.parametrize("text", ["", "LANDING_TARGET", "LANDING_TARGET=1", "LANDING_TARGET=1.256", "NO_SUCH=1.1"])
def test_what_accepts_nothing_is_one_line(text):
    with pytest.raises(InputError, match=f"accept {text}: "):
        accepted_of(text)


def test_one_naming_replaces_what_is_accepted_of_that_message():
    accepted = accepted_by(["LANDING_TARGET=0.191"])
    assert accepted[0] == Accepted("LANDING_TARGET", None, CAMERA)
    assert [entry.message for entry in accepted].count("LANDING_TARGET") == 1
    assert {entry.message for entry in accepted} == {entry.message for entry in BESIDE}


class Asked(Hover):
    """Sends a stream only after it was asked for since its last boot, as ArduPilot does; HEARTBEAT comes always."""

    def __post_init__(self):
        super().__post_init__()
        self.rates = set()

    def frames(self, t_s):
        return [f for f in super().frames(t_s) if (number := f[7] | f[8] << 8) == 0 or number in self.rates]


def answering(wire):
    """Commands are acknowledged, and TIMESYNC is answered; for `fly(beside=...)`."""
    done = 0

    def answer():
        nonlocal done
        mav = wire.vehicle.mav
        for message in wire.heard[done:]:
            if message.msgname == "COMMAND_LONG" and message.command == 511:
                wire.vehicle.rates.add(int(message.param1))
                wire.socket.send(bytes(mav.command_ack_encode(511, 0).pack(mav)))
            elif message.msgname == "TIMESYNC" and not message.tc1:
                boot_ns = round((wire.vehicle.boot_s + wire.t_s) * 1e9)
                wire.socket.send(bytes(mav.timesync_encode(boot_ns, message.ts1).pack(mav)))
        done = len(wire.heard)

    return answer


def test_a_vehicle_that_reboots_and_sends_nothing_unasked_is_back_within_a_few_seconds(wires):
    wire = wires(Asked())
    answer = answering(wire)
    wire.fly(8.0, beside=answer)
    assert wire.session.reason == ""
    wire.vehicle.boot_s, wire.vehicle.rates = 1.0 - wire.t_s, set()
    rebooted = wire.t_s
    wire.fly(10.0, beside=answer)
    back = min(
        t_s for m, t_s in zip(wire.heard, wire.heard_s, strict=True) if m.msgname == "ODOMETRY" and t_s > rebooted + 1.0
    )
    assert back - rebooted < 3.0 + Options().listen_s + 1.0  # asked within 3 s, listened to, started
    assert wire.session.reason == ""
    assert [message.reset_counter for message in wire.estimates()][:: len(wire.estimates()) - 1] == [1, 2]


def test_one_stream_that_stops_is_asked_for_again(wires):
    wire = wires(Asked())
    answer = answering(wire)
    wire.fly(5.0, beside=answer)
    wire.vehicle.rates.discard(132)
    stopped = wire.t_s
    wire.fly(4.0, beside=answer)
    asked = [t_s for m, t_s in zip(wire.heard, wire.heard_s, strict=True)
             if m.msgname == "COMMAND_LONG" and m.param1 == 132 and t_s > stopped]  # fmt: skip
    assert len(asked) == 1
    assert asked[0] - stopped < 2.5
    assert 132 in wire.vehicle.rates


def test_quality_is_what_is_left_of_the_limits(wires):
    wire = hovering(6)
    sure = wire.estimates()[-1].quality
    assert 50 < sure <= 100
    strict = wires(limits=Limits(protection_m=1.2 * float(wire.session.filtering.running.work[PROTECTION]))).fly(6.0)
    assert 1 <= strict.estimates()[-1].quality < 30
    wire.vehicle.gps = wire.vehicle.flow = False
    lost = wire.t_s
    wire.fly(2.0)
    coasting = [message.quality for message in wire.estimates(lost)]
    assert coasting[-1] < 20 < sure
    assert not wire.estimates(lost + Limits().dead_reckoning_s + 0.4)


@pytest.mark.parametrize(("old_s", "heard"), [(3600.0, False), (61.0, False), (30.0, True)])
def test_a_recorded_link_played_into_a_fresh_session_is_not_heard_beyond_the_protocols_minute(old_s, heard):
    vehicle = Hover(boot_s=5000.0, key=KEY)
    recorded = [frame for step in range(200) for frame in vehicle.frames(-old_s + 0.01 * step)]
    session = Session(Options(key=KEY), Keeper(), START_S, UNIX_S)
    for number, frame in enumerate(recorded):
        session.take(frame, START_S + 1e-3 * number, whole=True)
    assert (session.reception.vehicle is not None) is heard
    assert bool(session.intake.readings) is heard


# -- what a reviewer broke ---------------------------------------------------------------------------------
@pytest.mark.parametrize("ahead_s", [0.5, 1.5, 5.0])
def test_one_stamp_of_the_future_moves_nothing(ahead_s):
    wire = hovering(6)
    before = wire.t_s
    stamp_ms = round((wire.vehicle.boot_s + wire.t_s + ahead_s) * 1e3)
    seen = say.distance_sensor(wire.vehicle.mav, stamp_ms, reading(Sensor.RANGE, HEIGHT_M), (0.1, 40.0))
    wire.send(bytes(seen.pack(wire.vehicle.mav)))
    wire.fly(3.0)
    stamps = [message.time_usec * 1e-6 - wire.vehicle.boot_s for message in wire.estimates(before)]
    assert wire.session.dropped["clock: ahead"] == 1
    assert "clock: clock_jump" not in wire.session.dropped
    assert max(stamps) < wire.t_s + 0.03
    assert len(stamps) > 140
    assert_all_good(wire)


def test_a_first_fix_in_flight_is_where_the_vehicle_is_by_then(wires):
    """It took off on flow alone and has moved: the origin lies behind the fix, and nothing jumps."""
    wire = wires(Hover(gps=False)).fly(8.0)
    on = wire.session.filtering.running
    on.work[STATE + POSITION] += 25.0  # what it has flown
    wire.vehicle.gps = True
    wire.fly(8.0)
    assert wire.session.reason == ""
    assert wire.estimates()[-1].x == pytest.approx(25.0, abs=3.0)
    origin, metres = wire.session.origin_deg_m, 111_200.0
    assert (ORIGIN[0] - origin[0]) * metres == pytest.approx(25.0, abs=3.0)


class LateImu(Hover):
    """Its IMU comes at 2 Hz until a time."""

    def frames(self, t_s):
        self.imu = t_s > self.from_s or self.steps % 50 == 0
        return super().frames(t_s)


def test_an_imu_that_comes_late_serves(wires):
    vehicle = LateImu()
    vehicle.from_s = 6.0
    wire = wires(vehicle).fly(5.0)
    assert wire.session.filtering.lacks_imu
    wire.fly(10.0)
    assert not wire.session.filtering.lacks_imu
    assert wire.session.reason == ""
    assert wire.estimates(wire.t_s - 1.0)


class Standing(Hover):
    """On the ground, indoors: landed, a flow sensor that sees nothing, and a range too short to be measured."""

    def frames(self, t_s):
        step = self.steps
        frames = [f for f in super().frames(t_s) if f[7] | f[8] << 8 not in (106, 132)]
        if step % 2 == 0:
            blind = reading(Sensor.FLOW_RATE, 0.0, 0.0, 0.0, 0.0)._replace(quality=0.0)
            time_us = round((self.boot_s + t_s) * 1e6)
            frames.append(bytes(say.optical_flow_rad(self.mav, time_us, blind, 0.02).pack(self.mav)))
        if step % 20 == 0:
            frames.append(bytes(self.mav.extended_sys_state_encode(0, 1).pack(self.mav)))
        return frames


def test_a_vehicle_that_stands_indoors_is_told_where_it_is(wires):
    """ArduPilot does not arm before an estimate comes."""
    wire = wires(Standing(gps=False)).fly(12.0)
    assert wire.session.reason == ""
    assert_all_good(wire, at_least=100)


class Liar(Hover):
    """It flies, 2 m up, and says for six seconds that it has landed."""

    def frames(self, t_s):
        frames = super().frames(t_s)
        if self.steps % 20 == 0:
            frames.append(bytes(self.mav.extended_sys_state_encode(0, 1 if 12.0 < t_s < 18.0 else 2).pack(self.mav)))
        return frames


def test_landed_that_is_said_in_flight_is_an_alarm_and_moves_nothing(wires):
    wire = wires(Liar()).fly(17.9)
    assert wire.session.alarms[Sensor.LANDED].why == "innovation_gate"
    assert wire.session.reason == ""
    told = wire.session.estimate
    assert np.abs(np.array(told.pos_ned_m[:2])).max() < 0.3
    wire.fly(4.0)
    assert Sensor.LANDED not in wire.session.alarms


def test_alarms_that_ended_are_kept(wires):
    from flownav.cli.live import _facts

    wire = wires(limits=Limits(unfused_s=2.0)).fly(6.0)
    spell = Refused(1.0, 4.0, 20, "late")
    wire.session.intake.serving._spells[Sensor.POSE] = spell._replace(until_s=wire.session.intake.newest_s)
    wire.fly(0.1)
    assert Sensor.POSE in wire.session.alarms
    wire.fly(4.0)
    assert not wire.session.alarms
    kept = _facts(wire.session, Latency(), 1.0)["alarms"]["pose"]
    assert (kept["reason"], kept["now"]) == ("late", False)
