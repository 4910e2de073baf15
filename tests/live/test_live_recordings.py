"""Recordings of a live link with ArduPilot's helicopter simulator, played on a virtual clock (shared data)."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.live.filtering import Keeper
from flownav.live.options import Limits, Options
from flownav.logs.mavlink.framing import coder
from flownav.navigation.memory import PROTECTION
from recorded_link import Arrival, arrivals, play

GPS_RAW_INT, TIMESYNC, COMMAND_LONG, GLOBAL_ORIGIN = 24, 111, 76, 49
GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
FIX_S = 8.0  # the receiver's first fix, after the beginning of each recording
BEGUN_S = FIX_S + 3.0  # by then a navigator that began without it has begun anew with it


@pytest.fixture(scope="module")
def link(data_folder):
    """Arrivals of a recording, up to a time after its first; each stretch is read once."""
    return cache(lambda name, until_s=float("inf"): arrivals(data_folder / "ardupilot-live" / name, until_s))


@pytest.fixture(scope="module")
def rebooted(link):
    """The arrivals of the recording with a reboot, at 95.5 s, what the session was, and what it sent."""
    frames = link("reboot", 125.0)
    return frames, *play(frames)


def sent_of(sent, name):
    return [(now_s, message) for now_s, message in sent if message.msgname == name]


def longest_gap_s(sent, since_s=0.0):
    times = [now_s for now_s, _ in sent_of(sent, "ODOMETRY") if now_s >= since_s]
    return max(later - before for before, later in pairwise(times))


def began_s(sent):
    """From when on a navigator flies that has GPS."""
    return sent[0].now_s + BEGUN_S


def delayed(frames, which, by_s):
    """Frames of one message come later than they did."""
    moved = [a._replace(now_s=a.now_s + by_s) if a.message_id == which else a for a in frames]
    return sorted(moved, key=lambda arrival: arrival.now_s)


def batched(frames, period_s):
    """A radio that hands over what it has at the end of each period."""
    return [a._replace(now_s=(a.now_s // period_s + 1.0) * period_s) for a in frames]


def rms_m(sent, truth):
    """Horizontal error about its median [m], of estimates by the vehicle's own stamps."""
    told = [message for _, message in sent_of(sent, "ODOMETRY")]
    t_s = np.array([message.time_usec * 1e-6 for message in told])
    place = np.array([[message.x, message.y] for message in told])
    flown = t_s >= truth["boot_s"][0]
    true = np.column_stack([np.interp(t_s, truth["boot_s"], truth[name]) for name in ("pos_n_m", "pos_e_m")])
    error = (place - true)[flown]
    return float(np.sqrt(np.mean(np.sum((error - np.median(error, axis=0)) ** 2, axis=1))))


@pytest.mark.parametrize("shift_s", [0.0, 0.03, 0.06, 0.1])
def test_gps_is_fused_whatever_its_phase_to_the_stream(link, shift_s):
    """A 5 Hz fix repeated at 10 Hz: its first copy is up to 100 ms old. With a fixed 0.27 s all were late."""
    session, sent = play(delayed(link("square", 20.0), GPS_RAW_INT, shift_s))
    fixes = session.intake.readings[Sensor.GPS_POSITION]
    assert fixes > 50
    assert session.dropped["gps_position: repeated"] == pytest.approx(fixes, abs=2)
    assert session.dropped.get("gps_position: late", 0) <= 2  # until the horizon has followed
    assert not session.alarms
    assert session.reason == ""
    assert session.intake.horizon_s < 0.45
    assert longest_gap_s(sent, began_s(sent)) < 0.1
    assert longest_gap_s(sent) < 0.5  # where it is begun anew with GPS, on the ground


@pytest.mark.parametrize("period_s", [0.1, 0.2])
def test_a_link_that_delivers_in_batches_loses_nothing(link, period_s):
    session, sent = play(batched(link("square", 20.0), period_s))
    assert session.intake.readings[Sensor.GPS_POSITION] > 50
    assert session.intake.readings[Sensor.FLOW_RATE] > 900
    assert not [name for name in session.dropped if name.endswith(": late")]
    assert session.reason == ""
    assert longest_gap_s(sent, began_s(sent)) < period_s + 0.1


@pytest.mark.parametrize(("stated_m", "least_m", "most_m"), [(None, 5.8, 6.2), (0.3, 1.5, 2.0)])
def test_the_level_at_rest_is_what_the_receiver_is_stated_to_be_off(link, stated_m, least_m, most_m):
    """Four sigma of a receiver's slow error, which no reading of a vehicle at rest tells from a place."""
    options = Options()
    if stated_m is not None:
        slow = {"gps_slow_sigma_m": stated_m, "gps_slow_sigma_down_m": stated_m}
        options = Options(settings=options.settings.model_copy(update=slow))
    session, sent = play(link("square", 60.0), options=options)
    assert least_m < session.filtering.running.work[PROTECTION] < most_m
    last = sent_of(sent, "ODOMETRY")[-1][1]
    assert np.hypot(last.x, last.y) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("shift_s", [0.0, 0.1])
def test_the_square_is_flown_within_fifteen_centimetres(link, data_folder, shift_s):
    truth = np.genfromtxt(data_folder / "ardupilot-live" / "square" / "truth.csv", delimiter=",", names=True)
    session, sent = play(delayed(link("square"), GPS_RAW_INT, shift_s))
    assert rms_m(sent, truth) < 0.15
    assert not session.alarms


def test_gps_later_than_the_longest_horizon_is_an_alarm_and_nothing_is_sent(link):
    notes = []

    class Listener(Keeper):
        def note(self, t_s, source, kind, detail, value=float("nan")):
            notes.append((source, kind, detail))

    session, _ = play(delayed(link("square", 25.0), GPS_RAW_INT, 1.2), keeper=Listener())
    assert set(session.alarms) == set(GPS)
    assert session.alarms[Sensor.GPS_POSITION].why == "late"
    assert session.reason == "unfused"
    assert session.withheld["unfused"] > 100
    assert ("gps_position", "unfused", "late") in notes
    lenient, _ = play(delayed(link("square", 25.0), GPS_RAW_INT, 1.2), Options(limits=Limits(unfused_s=float("inf"))))
    assert not lenient.alarms


def test_after_a_freeze_of_a_second_it_sends_again_within_three(rebooted):
    """The vehicle stands still for 1 s and its clock with it: the offset from TIMESYNC is 0.9 s off since."""
    frames, _, sent = rebooted
    before = [one for one in sent if one.now_s < frames[0].now_s + 80.0]  # the reboot comes later
    flying_s = frames[0].now_s + FIX_S + 2.0
    assert 0.8 < longest_gap_s(before, flying_s) < 1.0 + 3.0
    assert longest_gap_s(before, flying_s) < 2.0  # it takes half a second


def test_a_timesync_that_lies_does_not_stop_the_sending(link):
    def lied(arrival):
        if arrival.message_id != TIMESYNC:
            return arrival
        message = coder().decode(bytearray(arrival.frame))
        if not message.tc1:
            return arrival
        mav = coder(1, 1)
        mav.seq = message.get_seq()
        return arrival._replace(frame=bytes(mav.timesync_encode(message.tc1 + 900_000_000, message.ts1).pack(mav)))

    session, sent = play([lied(arrival) for arrival in link("square", 20.0)])
    assert session.dropped["clock: timesync_refused"] > 10
    assert session.reason == ""
    assert longest_gap_s(sent, began_s(sent)) < 0.1
    stamps = [message.time_usec * 1e-6 for _, message in sent_of(sent, "ODOMETRY")]
    assert max(stamps) < session.intake.newest_s + 0.1


def test_after_a_reboot_the_streams_are_asked_for_again(rebooted):
    """It comes back with all rates 0, and only HEARTBEAT and TIMESYNC are received."""
    frames, session, sent = rebooted
    rebooted_s = frames[0].now_s + 95.5
    asked = [(now_s, message) for now_s, message in sent_of(sent, "COMMAND_LONG") if now_s > rebooted_s]
    assert asked[0][0] - rebooted_s < 3.0
    assert {int(message.param1) for _, message in asked} >= {27, 31, 24, 100, 132}
    assert session.dropped["clock: timesync_step"] == 1
    assert session.reason == "stale"


def test_the_origin_that_the_autopilot_sets_later_is_followed(link):
    """GPS moved by 2.2 m at 11 s; the autopilot's origin, at 20 s, is where the vehicle is since."""
    frames = link("origin", 30.0)
    session, sent = play(frames)
    moved_s = next(a.now_s for a in frames if a.message_id == GLOBAL_ORIGIN)
    told = sent_of(sent, "ODOMETRY")
    before = [message for now_s, message in told if now_s < moved_s][-1]
    after = next(message for now_s, message in told if now_s > moved_s + 0.05)
    assert session.intake.origin.moves == 1
    assert session.intake.origin.offset_ned_m[0] == pytest.approx(-2.21, abs=0.01)
    assert after.x - before.x == pytest.approx(-2.21, abs=0.1)
    assert (after.reset_counter - before.reset_counter) % 256 == 1
    assert abs(told[-1][1].x) < 1.0  # the vehicle stands on it; 1.6 m off where the first fix stayed the origin


def test_an_origin_on_the_other_side_of_the_country_is_refused(link):
    mav = coder(1, 1)
    frames = link("square", 15.0)
    far = bytes(mav.gps_global_origin_encode(470000000, -1052305750, 1586000).pack(mav))
    early = [frames[0], Arrival(frames[0].now_s + 0.5, far), *frames[1:]]  # before any fix, it may be
    late = sorted([*frames, Arrival(frames[0].now_s + 12.0, far)], key=lambda arrival: arrival.now_s)
    for played in (sorted(early, key=lambda arrival: arrival.now_s), late):
        session, sent = play(played)
        assert session.intake.origin.refused == 1
        assert session.intake.origin.moves == 0
        assert session.dropped["origin: refused"] == 1
        assert all(abs(message.x) < 5.0 for _, message in sent_of(sent, "ODOMETRY"))
