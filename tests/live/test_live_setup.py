"""`live --setup`: both makes' parameters, read through losses and beside others, compared, written only when asked."""

from __future__ import annotations

import json
import os
import socket
import struct
import threading
import time
from collections import Counter
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from command import printed
from fake_autopilot import ARDUPILOT, PX4, FakeAutopilot, FakeLink
from flownav.cli import app
from flownav.core.errors import InputError
from flownav.live import byte_links
from flownav.live.link import parse_url
from flownav.live.options import SENDINGS
from flownav.live.setup import talk
from flownav.live.setup.check import check
from flownav.live.setup.compare import baud_of
from flownav.live.setup.knowledge import MAKES, knowledge_of
from flownav.live.setup.talk import TRIES, Talk, read
from flownav.logs.mavlink.framing import INTEGERS, Value, coder, decoded, dialect, name_of, set_value
from recorded_link import frames_of

UDP = parse_url("udp:14550")
SETS = {"POSXY": 3, "VELXY": 3, "POSZ": 1, "VELZ": 3, "YAW": 1}
OURS = {"POSXY": 6, "VELXY": 6, "POSZ": 1, "VELZ": 6, "YAW": 1}


def ardupilot(**changed):
    """A Copter that is set up for flownav in source set 2, and what a test changes."""
    found = {"AHRS_EKF_TYPE": 3, "EK3_ENABLE": 1, "VISO_TYPE": 1, "EK3_SRC_OPTIONS": 0, "FLOW_TYPE": 5,
             "RNGFND1_TYPE": 10, "RNGFND1_ORIENT": 25, "VISO_POS_M_NSE": 0.2, "VISO_VEL_M_NSE": 0.3,
             "VISO_YAW_M_NSE": 0.2, "VISO_DELAY_MS": 10, "VISO_SCALE": 1.0, "VISO_ORIENT": 0, "VISO_POS_X": 0.0,
             "VISO_POS_Y": 0.0, "VISO_POS_Z": 0.0, "VISO_QUAL_MIN": 10, "SERIAL1_PROTOCOL": 2, "SERIAL1_BAUD": 57,
             "SERIAL2_PROTOCOL": 2, "SERIAL2_BAUD": 115, "PLND_ENABLED": 0}  # fmt: skip
    for n, values in ((1, SETS), (2, OURS), (3, {"POSXY": 0, "VELXY": 0, "POSZ": 1, "VELZ": 0, "YAW": 1})):
        found |= {f"EK3_SRC{n}_{what}": number for what, number in values.items()}
    found |= {f"RC{n}_OPTION": 90 if n == 8 else 0 for n in range(5, 17)}
    return found | changed


def px4(**changed):
    found = {"EKF2_EN": 1, "EKF2_EV_CTRL": 7, "EKF2_EV_NOISE_MD": 0, "EKF2_EV_DELAY": 0.0, "EKF2_EVP_NOISE": 0.1,
             "EKF2_EVV_NOISE": 0.1, "EKF2_EV_QMIN": 0, "EKF2_EV_POS_X": 0.0, "EKF2_EV_POS_Y": 0.0, "EKF2_EV_POS_Z": 0.0,
             "EKF2_HGT_REF": 1, "EKF2_GPS_CTRL": 7, "EKF2_OF_CTRL": 0, "EKF2_RNG_CTRL": 1, "RTL_PLD_MD": 1,
             "PLD_BTOUT": 5.0, "PLD_HACC_RAD": 0.2, "PLD_FAPPR_ALT": 0.1, "PLD_MAX_SRCH": 3, "MAV_0_CONFIG": 101,
             "MAV_0_MODE": 0, "MAV_0_RATE": 1200, "MAV_1_CONFIG": 102, "MAV_1_MODE": 2, "MAV_1_RATE": 0,
             "SER_TEL1_BAUD": 57600, "SER_TEL2_BAUD": 115200}  # fmt: skip
    return found | changed


def checked(make, parameters, send="odometry", url=UDP, writing=False, asked_set=None, **how):
    """The report, and the autopilot and its link afterwards."""
    autopilot = FakeAutopilot(make, parameters, **how)
    link = FakeLink(autopilot)
    talk = Talk(link, clock=link.clock, wait=link.wait)
    return check(talk, url, send, writing=writing, asked_set=asked_set), autopilot, link


def row(report, name):
    return next(found for found in report.rows if found.name == name)


# -- the two encodings ------------------------------------------------------------------------------------
@pytest.mark.parametrize("make", [ARDUPILOT, PX4])
@given(data=st.data(), kind=st.sampled_from(sorted(INTEGERS)))
def test_an_integer_goes_there_and_back_in_either_make_s_way(make, data, kind):
    size = 8 * struct.calcsize(INTEGERS[kind])
    signed = INTEGERS[kind][1].islower()
    most = 2 ** min(size - signed, 24 if make == ARDUPILOT else 64) - 1  # a float holds 24 bits
    number = data.draw(st.integers(-most - 1 if signed else 0, most))
    mav = coder(1, 1)
    sent = set_value(mav, 1, 1, "X", Value(number, kind), make).param_value
    heard = coder().decode(bytearray(mav.param_value_encode(b"X", sent, kind, 1, 0).pack(mav)))
    if struct.unpack("<f", struct.pack("<f", sent))[0] == sent:  # not a float's NaN, which Python may not carry
        assert decoded(heard, make) == Value(number, kind)


def test_what_the_wire_says_of_five_depends_on_the_make():
    x25crc, crc_extra = dialect().x25crc, dialect().MAVLink_param_value_message.crc_extra
    mav = coder(1, 1)
    assert set_value(mav, 1, 1, "X", Value(5, 6), ARDUPILOT).param_value == 5.0
    assert struct.pack("<f", set_value(mav, 1, 1, "X", Value(5, 6), PX4).param_value) == struct.pack("<i", 5)
    frame = mav.param_value_encode(b"X", 0.0, 6, 1, 0).pack(mav)
    minus = bytearray(frame[:-2])
    minus[10:14] = struct.pack("<i", -1)  # as a float it is no number
    minus += x25crc(bytes(minus[1:]) + bytes([crc_extra])).crc.to_bytes(2, "little")
    assert decoded(coder().decode(minus), PX4).number == -1.0


# -- what is known ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("make", sorted(MAKES))
def test_every_parameter_has_a_reason_a_source_and_a_value_that_fits(make):
    known = knowledge_of(make)
    assert known is not None
    for wanted in known.parameter:
        assert len(wanted.name) <= 16 + len("{n}") - 1
        assert wanted.why
        assert "/" in wanted.source or "wiki" in wanted.source
        assert wanted.words() or wanted.level == "shown", wanted.name
        if wanted.set_to is not None:
            assert wanted.fits(wanted.set_to), wanted.name
        for number in (0.0, 1.0, 15.0):
            repaired = wanted.repaired(number)
            assert repaired is None or wanted.fits(repaired), wanted.name
    assert all(set(wanted.sends) <= set(SENDINGS) for wanted in known.parameter)
    assert knowledge_of(4) is None


@pytest.mark.parametrize("make", sorted(MAKES))
@pytest.mark.parametrize("send", SENDINGS)
def test_a_name_fits_in_the_message_and_is_asked_for_once(make, send):
    names = knowledge_of(make).names(send)
    assert max(Counter(names).values(), default=1) == 1
    assert all(len(name) <= 16 and "{" not in name for name in names)


def test_bits_are_set_and_cleared_beside_the_others():
    rule = next(found for found in knowledge_of(PX4).parameter if found.name == "EKF2_EV_CTRL")
    assert [rule.fits(number) for number in (0, 5, 7, 13, 15, 1)] == [False, False, True, False, False, False]
    assert rule.repaired(18) == 23.0
    assert rule.words() == "bits 0 and 1 and 2 set, bit 3 clear"


@pytest.mark.parametrize(("code", "baud"), [(57, 57600), (115, 115200), (921, 921600), (460, 460800), (57600, 57600)])
def test_ardupilot_s_codes_of_baud_rates(code, baud):
    assert baud_of(code) == baud


# -- compared ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("make", "parameters"), [(ARDUPILOT, ardupilot()), (PX4, px4())])
def test_a_vehicle_that_is_set_up_fits(make, parameters):
    report, autopilot, _ = checked(make, parameters, gimbal=True)
    assert report.fits, [found for found in report.rows if found.status in ("wrong", "absent")]
    assert report.blocks == []
    assert report.in_flight
    assert {found.status for found in report.rows} <= {"right", "shown"}
    assert autopilot.counts["PARAM_SET"] == 0


@pytest.mark.parametrize(
    ("make", "changed", "name", "status"),
    [
        (ARDUPILOT, {"VISO_TYPE": 0}, "VISO_TYPE", "wrong"),
        (ARDUPILOT, {"EK3_SRC_OPTIONS": 1}, "EK3_SRC_OPTIONS", "wrong"),
        (ARDUPILOT, {"EK3_SRC_OPTIONS": 2}, "EK3_SRC_OPTIONS", "right"),
        (ARDUPILOT, {"EK3_SRC2_VELZ": 3}, "EK3_SRC2_VELZ", "wrong"),
        (ARDUPILOT, {"EK3_SRC2_YAW": 6}, "EK3_SRC2_YAW", "wrong"),
        (ARDUPILOT, {"VISO_VEL_M_NSE": 0.05}, "VISO_VEL_M_NSE", "unusual"),
        (ARDUPILOT, {"FLOW_TYPE": 0}, "FLOW_TYPE", "wrong"),
        (ARDUPILOT, {"RC8_OPTION": 0}, "RCx_OPTION", "unusual"),
        (PX4, {"EKF2_EV_CTRL": 0}, "EKF2_EV_CTRL", "wrong"),
        (PX4, {"EKF2_EV_CTRL": 15}, "EKF2_EV_CTRL", "wrong"),
        (PX4, {"EKF2_EV_CTRL": 5}, "EKF2_EV_CTRL", "wrong"),  # without the height
        (PX4, {"EKF2_EV_NOISE_MD": 1}, "EKF2_EV_NOISE_MD", "wrong"),
        (PX4, {"EKF2_EV_DELAY": 175.0}, "EKF2_EV_DELAY", "unusual"),
        (PX4, {"EKF2_HGT_REF": 3}, "EKF2_HGT_REF", "unusual"),
    ],
)
def test_one_wrong_value_is_found(make, changed, name, status):
    report, _, _ = checked(make, (ardupilot if make == ARDUPILOT else px4)(**changed))
    found = row(report, name)
    assert found.status == status
    assert found.has == pytest.approx(next(iter(changed.values()))) or found.has is None
    assert report.fits == (status != "wrong")
    assert [other.name for other in report.rows if other.status == "wrong"] == ([name] if status == "wrong" else [])


def test_a_parameter_that_must_be_there_and_is_not():
    parameters = px4()
    del parameters["EKF2_EV_CTRL"], parameters["EKF2_EV_QMIN"]
    report, autopilot, _ = checked(PX4, parameters)
    assert row(report, "EKF2_EV_CTRL").status == "absent"
    assert row(report, "EKF2_EV_QMIN").status == "not there"
    assert not report.fits
    assert autopilot.counts["PARAM_REQUEST_READ"] >= 2 * TRIES
    again, quick, _ = checked(PX4, parameters, tells_unknown=True)
    assert row(again, "EKF2_EV_CTRL").status == "absent"
    assert quick.counts["PARAM_REQUEST_READ"] < autopilot.counts["PARAM_REQUEST_READ"] - TRIES


def test_a_name_of_another_version_counts():
    parameters = px4(EKF2_OF0_CTRL=1)
    del parameters["EKF2_OF_CTRL"]
    report, _, _ = checked(PX4, parameters)
    assert row(report, "EKF2_OF0_CTRL").status == "unusual"


@pytest.mark.parametrize(("make", "parameters"), [(ARDUPILOT, ardupilot()), (PX4, px4())])
def test_answers_that_are_lost_are_asked_for_again(make, parameters):
    report, autopilot, link = checked(make, parameters, loss=0.3, gimbal=True)
    assert report.fits
    assert autopilot.counts["PARAM_REQUEST_READ"] > 1.2 * len(knowledge_of(make).names("odometry"))
    assert link.now_s - 100.0 < 30.0


def test_landing_target_asks_for_other_parameters():
    report, _, _ = checked(ARDUPILOT, ardupilot(), send="landing-target")
    assert row(report, "PLND_ENABLED").status == "wrong"
    assert row(report, "PLND_TYPE").status == "absent"  # until it is enabled
    assert not any(found.name == "VISO_TYPE" for found in report.rows)
    assert any("may appear once" in note for note in report.notes)
    report, _, _ = checked(PX4, px4(), send="landing-target")
    assert report.fits
    assert row(report, "LTEST_MODE").status == "not there"
    assert not report.in_flight


# -- source sets and arming -------------------------------------------------------------------------------
def test_the_source_set_on_external_navigation_is_found_or_a_free_one_taken():
    assert checked(ARDUPILOT, ardupilot())[0].source_set == 2
    swapped = {f"EK3_SRC3_{what}": number for what, number in OURS.items()}
    swapped |= {f"EK3_SRC2_{what}": number for what, number in {**SETS, "POSXY": 0, "VELXY": 5, "VELZ": 0}.items()}
    assert checked(ARDUPILOT, ardupilot(**swapped))[0].source_set == 3
    free = {**swapped, "EK3_SRC3_POSXY": 0, "EK3_SRC3_VELXY": 0}
    report, _, _ = checked(ARDUPILOT, ardupilot(**free))
    assert report.source_set == 3  # set 2 is on optical flow
    assert row(report, "EK3_SRC3_POSXY").set_to == 6
    assert checked(ARDUPILOT, ardupilot(), asked_set=1)[0].source_set == 1
    assert "param1 = 3" in " ".join(report.in_flight)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"VISO_TYPE": 0}, "AHRS: EK3 sources require VisualOdom; VISO_TYPE is 0"),
        ({"EK3_SRC3_VELXY": 5, "FLOW_TYPE": 0}, "AHRS: EK3 sources require OpticalFlow; FLOW_TYPE is 0"),
        ({"EK3_SRC1_POSZ": 2, "RNGFND1_TYPE": 0}, "AHRS: EK3 sources require RangeFinder; RNGFND1_TYPE is 0"),
        ({"EK3_SRC3_POSXY": 5}, "AHRS: Check EK3_SRC3_POSXY"),
        ({"EK3_SRC1_POSZ": 0}, "AHRS: Check EK3_SRC1_POSZ"),
        ({"EK3_SRC3_YAW": 5}, "AHRS: Check EK3_SRC3_YAW"),
    ],
)
def test_what_blocks_arming_is_named_in_the_autopilot_s_words(changed, says):
    """A set that does not fly blocks as well."""
    report, _, _ = checked(ARDUPILOT, ardupilot(**changed))
    assert {block.says for block in report.blocks} == {says}
    assert not report.fits


def test_the_serial_port_is_found_by_its_baud_rate():
    report, _, _ = checked(ARDUPILOT, ardupilot(SERIAL2_PROTOCOL=1), url=parse_url("serial:/dev/ttyS0:115200"))
    assert report.port == "SERIAL2"
    assert row(report, "SERIAL2_PROTOCOL").status == "wrong"
    assert row(report, "SERIAL2_BAUD").status == "unusual"
    report, _, _ = checked(PX4, px4(), url=parse_url("serial:/dev/ttyS0:115200"))
    assert report.port == "MAV_1 on TEL2"
    assert row(report, "MAV_1_RATE").status == "unusual"
    assert row(report, "SER_TEL2_BAUD").status == "unusual"
    report, _, _ = checked(PX4, px4(), url=parse_url("serial:/dev/ttyS0:921600"))
    assert "none is set to MAVLink at 921600 baud" in report.port
    usb, autopilot, _ = checked(PX4, px4(), url=parse_url("serial:/dev/ttyACM0"))
    assert usb.port == ""
    assert autopilot.counts["PARAM_REQUEST_READ"] < 2 * len(knowledge_of(PX4).names("odometry")) + 2 * TRIES


# -- written ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("loss", [0.0, 0.3])
def test_what_must_change_is_written_and_told(loss):
    parameters = ardupilot(VISO_TYPE=0, EK3_SRC_OPTIONS=3, VISO_VEL_M_NSE=0.05, EK3_SRC2_YAW=6)
    report, autopilot, _ = checked(ARDUPILOT, parameters, writing=True, loss=loss)
    assert {(change.name, change.before, change.after) for change in report.changes} == {
        ("VISO_TYPE", 0, 1), ("EK3_SRC_OPTIONS", 3, 2), ("EK3_SRC2_YAW", 6, 1),
    }  # fmt: skip
    assert autopilot.parameters["EK3_SRC_OPTIONS"] == 2
    assert autopilot.parameters["VISO_VEL_M_NSE"] == 0.05  # advised only
    assert report.fits
    assert any("Reboot" in note and "VISO_TYPE" in note for note in report.notes)
    assert report.verdict.endswith("must be rebooted")


def test_px4_s_integers_are_written_bytewise():
    report, autopilot, _ = checked(PX4, px4(EKF2_EV_CTRL=8, EKF2_EV_NOISE_MD=1), writing=True)
    assert autopilot.parameters["EKF2_EV_CTRL"] == 7
    assert autopilot.parameters["EKF2_EV_NOISE_MD"] == 0
    assert report.fits


def test_nothing_is_written_without_being_asked_to_or_while_armed():
    wrong = ardupilot(VISO_TYPE=0)
    report, autopilot, _ = checked(ARDUPILOT, dict(wrong))
    assert autopilot.counts["PARAM_SET"] == 0
    assert report.changes == []
    report, autopilot, _ = checked(ARDUPILOT, dict(wrong), writing=True, armed=True)
    assert autopilot.counts["PARAM_SET"] == 0
    assert autopilot.parameters == wrong
    assert report.refused == ["nothing is written while the vehicle is armed: disarm it first"]
    assert report.armed
    assert not report.fits


def test_a_vehicle_that_falls_silent_is_not_written_to():
    autopilot = FakeAutopilot(ARDUPILOT, ardupilot(VISO_TYPE=0))
    link = FakeLink(autopilot)
    talk = Talk(link, clock=link.clock, wait=link.wait)
    assert talk.meet(5.0) is not None
    link.now_s += 10.0
    assert talk.armed is None


def test_a_parameter_that_keeps_its_value_is_said():
    report, _, _ = checked(ARDUPILOT, ardupilot(VISO_TYPE=0), writing=True, stubborn=("VISO_TYPE",))
    assert [(change.name, change.after, change.done) for change in report.changes] == [("VISO_TYPE", 0, False)]
    assert not report.fits


def test_where_the_user_must_choose_nothing_is_written():
    report, autopilot, _ = checked(ARDUPILOT, ardupilot(FLOW_TYPE=0), writing=True)
    assert autopilot.counts["PARAM_SET"] == 0
    assert report.refused == ["FLOW_TYPE: you must choose (not 0 (your sensor's))"]


# -- nobody answers ---------------------------------------------------------------------------------------
def test_no_vehicle_is_a_verdict():
    link = FakeLink(None)
    report = check(Talk(link, clock=link.clock, wait=link.wait), UDP, "odometry")
    assert report.verdict.startswith("nothing was received in 10 s")
    assert not report.fits


def test_a_vehicle_without_answers_is_a_verdict_and_soon():
    report, _, link = checked(ARDUPILOT, ardupilot(), deaf=True)
    assert "answers no request for a parameter" in report.verdict
    assert not report.fits
    assert link.now_s - 100.0 < 10.0


def test_a_signed_vehicle_is_read_with_the_key_and_one_that_does_not_sign_is_not_heard():
    key = bytes(range(32))
    for signs in (True, False):
        link = FakeLink(FakeAutopilot(ARDUPILOT, ardupilot(), key=key if signs else None))
        talk = Talk(link, key=key, clock=link.clock, wait=link.wait)
        report = check(talk, UDP, "odometry")
        assert report.fits == signs
        assert signs or "something is received (unsigned 1" in report.verdict


def test_parameters_that_a_real_ardupilot_told(data_folder):
    """ArduPilot's simulator, 4.6-dev: 8-bit and 32-bit integers and floats, all cast to float."""
    told = {}
    for _, frame in frames_of(data_folder / "ardupilot-live" / "square" / "from_vehicle.tlog"):
        message = coder().decode(bytearray(frame)) if frame[7:10] == b"\x16\0\0" else None
        if message is not None:
            told[name_of(message)] = decoded(message, ARDUPILOT)
        if "EK3_SRC2_VELXY" in told:
            break
    assert told["EK3_SRC1_POSXY"] == Value(3.0, 2)
    assert told["EK3_SRC2_VELXY"] == Value(5.0, 2)
    assert told["INS_GYR_ID"].number == 2752772
    assert told["BARO1_GND_PRESS"] == Value(83670.52, 9)


def test_another_make_is_a_verdict():
    report, _, _ = checked(4, {})
    assert "neither ArduPilot nor PX4" in report.verdict


def test_reading_ends_although_much_never_answers():
    autopilot = FakeAutopilot(ARDUPILOT, {"A0": 1})
    link = FakeLink(autopilot)
    talk = Talk(link, clock=link.clock, wait=link.wait)
    talk.meet(5.0)
    began_s = link.now_s
    assert set(read(talk, [f"A{n}" for n in range(200)], limit_s=20.0)) == {"A0"}
    assert link.now_s - began_s < 21.0


# -- the command ------------------------------------------------------------------------------------------
@pytest.fixture
def command(monkeypatch):
    """The command, a fake autopilot at the other end of whatever link it opens, on the link's own clock."""

    def run(autopilot, url, *arguments):
        link = FakeLink(autopilot)
        monkeypatch.setattr(byte_links, "open_link", lambda url: link)
        monkeypatch.setattr(talk, "Talk", partial(Talk, clock=link.clock, wait=link.wait))
        return CliRunner().invoke(app, ["live", url, *arguments])

    return run


def test_the_command_prints_the_table_and_its_status_is_the_verdict(command):
    good = command(FakeAutopilot(ARDUPILOT, ardupilot()), "udp:0", "--setup")
    assert good.exit_code == 0, good.output
    for words in ("EK3_SRC2_POSXY", "ExternalNav", "MAV_CMD_SET_EKF_SOURCE_SET", "ArduPilot fits", "not healthy"):
        assert words in good.output
    bad = command(FakeAutopilot(PX4, px4(EKF2_EV_CTRL=0), tells_unknown=True), "udp:0", "--setup", "--json")
    assert bad.exit_code == 1
    facts = json.loads(bad.output)
    found = next(entry for entry in facts["parameters"] if entry["name"] == "EKF2_EV_CTRL")
    assert (found["has"], found["status"], found["set_to"]) == (0.0, "wrong", 7.0)
    assert facts["make"] == "PX4"
    assert not facts["fits"]


def test_the_command_writes_over_a_serial_port(command):
    autopilot = FakeAutopilot(ARDUPILOT, ardupilot(VISO_TYPE=0), tells_unknown=True)
    done = command(autopilot, "serial:/dev/ttyS1:115200", "--setup", "--write")
    assert done.exit_code == 0, done.output
    assert "written: VISO_TYPE 0 -> 1" in done.output
    assert "SERIAL2" in done.output
    assert autopilot.parameters["VISO_TYPE"] == 1


# -- the command, over real links -------------------------------------------------------------------------
def speak(autopilot, take, give, stop):
    """The autopilot's end of a real link: until `stop`."""
    beat_s = 0.0
    while not stop.is_set():
        if time.monotonic() - beat_s > 0.2:
            beat_s = time.monotonic()
            give(autopilot.heartbeat())
        for answer in autopilot.hear(take()):
            give(answer)


def commanded(autopilot, take, give, *arguments):
    stop = threading.Event()
    thread = threading.Thread(target=speak, args=(autopilot, take, give, stop))
    thread.start()
    try:
        return CliRunner().invoke(app, ["live", *arguments])
    finally:
        stop.set()
        thread.join()


def over_udp(autopilot, *arguments):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.settimeout(0.05)

        def take():
            try:
                return vehicle.recv(2048)
            except (TimeoutError, ConnectionRefusedError):
                return b""

        def give(frame):
            try:
                vehicle.sendto(frame, ("127.0.0.1", port))
            except ConnectionRefusedError:
                return

        return commanded(autopilot, take, give, f"udp:{port}", *arguments)


@pytest.mark.real_time
def test_over_udp():
    good = over_udp(FakeAutopilot(ARDUPILOT, ardupilot()), "--setup")
    assert good.exit_code == 0, good.output
    assert "ArduPilot fits" in good.output


@pytest.mark.real_time
def test_over_a_serial_port():
    ours, port = os.openpty()
    os.set_blocking(ours, False)

    def take():
        time.sleep(0.005)
        try:
            return os.read(ours, 4096)
        except BlockingIOError:
            return b""

    autopilot = FakeAutopilot(ARDUPILOT, ardupilot(VISO_TYPE=0), tells_unknown=True)
    try:
        done = commanded(
            autopilot, take, lambda frame: os.write(ours, frame),
            f"serial:{os.ttyname(port)}:115200", "--setup", "--write",
        )  # fmt: skip
    finally:
        os.close(ours)
        os.close(port)
    assert done.exit_code == 0, done.output
    assert "written: VISO_TYPE 0 -> 1" in done.output
    assert "SERIAL2" in done.output
    assert autopilot.parameters["VISO_TYPE"] == 1


@pytest.mark.real_time
def test_over_tcp():
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(120.0)
        held = []

        def take():
            if not held:
                held.append(server.accept()[0])
                held[0].settimeout(0.05)
            try:
                return held[0].recv(4096)
            except TimeoutError:
                return b""

        def give(frame):
            if held:
                try:
                    held[0].sendall(frame)
                except OSError:
                    return

        url = f"tcp:127.0.0.1:{server.getsockname()[1]}"
        done = commanded(FakeAutopilot(PX4, px4(), tells_unknown=True), take, give, url, "--setup")
        held[0].close()
    assert done.exit_code == 0, done.output
    assert "PX4 fits" in done.output


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--write"], "--write, --source-set and --origin go with --setup only"),
        (["--setup", "--record", "x.fnr"], "--setup flies nothing"),
        (["--setup", "--source-set", "4"], "--source-set 4: must be from 1 to 3"),
        (["--setup", "--send", "all"], "--send all"),
    ],
)
def test_mistakes_are_one_line(options, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["live", "udp:0", *options])
    assert isinstance(result.exception, InputError)
    assert said in printed(result.exception)


def test_a_gimbal_that_says_it_is_an_autopilot_is_not_written_to():
    """It is received first, a second before the autopilot."""
    link = FakeLink(FakeAutopilot(ARDUPILOT, {"A": 1}))
    mav = coder(1, 154)
    link._to_us.append(bytes(mav.heartbeat_encode(2, ARDUPILOT, 0, 0, 4, 3).pack(mav)))
    link._beat_s = link.now_s
    talk = Talk(link, clock=link.clock, wait=link.wait)
    assert talk.meet(10.0)[:2] == (1, 1)
