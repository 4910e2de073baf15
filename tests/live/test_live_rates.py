"""The rates that a link carries: rates that fit, in the stated order; whole frames at the line's pace, and no old
estimate.
"""

from __future__ import annotations

import itertools
import math
import os
import threading
import time
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.live.byte_links import SerialLink, open_link
from flownav.live.link import MOST_WAITING, Outgoing, message_id_of, parse_url
from flownav.live.rates import LINE_SHARE, LOOK_S, STREAMS, Rates, bytes_of, plan
from flownav.live.screen import Traffic, in_words, traffic_facts
from flownav.logs.mavlink.framing import ARDUPILOT, PX4, StreamFrames, coder
from live_ends import Hover, Wire

HUNG_S = 120.0  # whatever takes so long hangs
TRUTH = {"SIM_STATE": (108, 25.0)}
ASKED_B_S = {ARDUPILOT: 12_689, PX4: 29_589}


# -- the plan ---------------------------------------------------------------------------------------------
def test_a_link_of_unknown_capacity_is_asked_for_everything():
    for make in (ARDUPILOT, PX4):
        found = plan(make, None, "odometry")
        assert found.streams == STREAMS[make == ARDUPILOT]
        assert found.bytes_s == pytest.approx(ASKED_B_S[make])
        assert found.estimate_hz == (math.inf if make == PX4 else pytest.approx(47.6, abs=0.1))


def test_ardupilot_is_sent_none_that_it_would_drop():
    """Of 60 a second it takes 30: one less than 20 ms after the last is dropped."""
    assert 40.0 < plan(ARDUPILOT, 92_160, "odometry").estimate_hz < 50.0
    assert 40.0 < plan(ARDUPILOT, None, "vision").estimate_hz < 50.0
    assert plan(ARDUPILOT, None, "landing-target").estimate_hz == math.inf
    assert plan(PX4, 92_160, "odometry").estimate_hz > 250.0


@pytest.mark.parametrize("make", [ARDUPILOT, PX4])
@pytest.mark.parametrize("send", ["odometry", "vision", "landing-target", "none"])
@pytest.mark.parametrize("signed", [False, True])
@given(baud=st.integers(57_600, 3_000_000), truth=st.booleans())
def test_what_is_asked_for_fits_and_keeps_what_the_navigator_needs(make, send, signed, baud, truth):
    found = plan(make, baud / 10, send, signed=signed, beside=TRUTH if truth else None)
    if found.bytes_s > LINE_SHARE * baud / 10:
        assert signed
        assert baud < 60_000
        assert "the least rates" in found.lacks
    hz = {name: rate_hz for name, (_, rate_hz) in found.streams.items()}
    imu, flow = ("RAW_IMU", "OPTICAL_FLOW") if make == ARDUPILOT else ("HIGHRES_IMU", "OPTICAL_FLOW_RAD")
    assert hz[imu] >= 25  # 20 Hz is the least that the navigator takes for an IMU
    assert hz[flow] >= 10
    assert hz["DISTANCE_SENSOR"] >= 5
    assert hz["GPS_RAW_INT"] >= 5
    full = STREAMS[make == ARDUPILOT] | (TRUTH if truth else {})
    assert all(rate <= full[name][1] for name, rate in hz.items())
    frame = {"odometry": 244, "vision": 198, "landing-target": 72, "none": 0}[send]
    assert found.estimate_hz == math.inf if not frame else found.estimate_hz * frame <= baud / 10


def test_the_stated_order():
    """The truth and the pressure first, the IMU last; a step that a later one makes needless is taken back."""
    fine = {name: rate for name, (_, rate) in plan(ARDUPILOT, 11_520, "odometry").streams.items()}
    assert fine == {"RAW_IMU": 100, "OPTICAL_FLOW": 50, "ATTITUDE_QUATERNION": 25, "DISTANCE_SENSOR": 15,
                    "GPS_RAW_INT": 10, "SCALED_PRESSURE": 5, "EXTENDED_SYS_STATE": 5, "SYSTEM_TIME": 1,
                    "SCALED_IMU2": 1, "SCALED_IMU3": 1}  # fmt: skip
    slow = {name: rate for name, (_, rate) in plan(ARDUPILOT, 5_760, "odometry", beside=TRUTH).streams.items()}
    assert (slow["RAW_IMU"], slow["OPTICAL_FLOW"], slow["SIM_STATE"]) == (40, 25, 1)
    assert plan(ARDUPILOT, 92_160, "odometry").streams == STREAMS[True]


def test_the_estimate_takes_its_share_of_the_line():
    """13.2 of 11.5 kB/s before: 54 Hz of ODOMETRY."""
    assert plan(ARDUPILOT, 11_520, "odometry").estimate_hz == pytest.approx(37.8, abs=0.1)
    assert plan(ARDUPILOT, 11_520, "landing-target").estimate_hz == pytest.approx(128.0)
    assert plan(PX4, 11_520, "odometry").lacks == ""
    assert "30 estimates/s that PX4 fuses" in plan(PX4, 5_760, "odometry").lacks
    assert plan(ARDUPILOT, 5_760, "odometry").lacks == ""


def test_a_line_that_others_fill_is_asked_for_less():
    rates = Rates(11_520.0, "odometry", signed=False)
    before = bytes_of(rates.begin(ARDUPILOT), ardupilot=True)
    now_s, asked_again = 0.0, 0
    while now_s < 3.0 * LOOK_S:
        now_s += 0.1
        if rates.received(1140, now_s):  # 99 % of the line
            asked_again += 1
            assert bytes_of(rates.begin(ARDUPILOT), ardupilot=True) < before
    assert asked_again == 2
    unsettled = Rates(11_520.0, "odometry", signed=False)
    unsettled.begin(ARDUPILOT)
    assert not any(unsettled.received(1140, 0.1 * step, settled=False) for step in range(300))
    quiet = Rates(11_520.0, "odometry", signed=False)
    quiet.begin(ARDUPILOT)
    assert not any(quiet.received(900, 0.1 * step) for step in range(300))
    assert not Rates(None, "odometry", signed=False).received(10**9, 1.0)


@pytest.mark.parametrize(
    ("url", "capacity"),
    [("serial:/dev/ttyS1:57600", 5760.0), ("serial:/dev/ttyUSB0", 11520.0), ("serial:/dev/ttyACM0", None),
     ("udp:14550", None), ("tcp:localhost:5760", None)],
)  # fmt: skip
def test_an_address_tells_what_its_line_carries(url, capacity):
    assert parse_url(url).capacity_bytes_s == capacity


# -- frames on their way ----------------------------------------------------------------------------------
MAV = coder(1, 197)


def estimate(number):
    covariance = [0.0] * 21
    message = MAV.odometry_encode(
        number, 20, 12, 1, 2, 3, [1, 0, 0, 0], 0, 0, 0, 0, 0, 0, covariance, covariance, 0, 3, 9
    )
    return bytes(message.pack(MAV))


def beat():
    return bytes(MAV.heartbeat_encode(18, 8, 0, 0, 4, 3).pack(MAV))


@given(
    takes=st.lists(st.integers(0, 300), min_size=1, max_size=60),
    what=st.lists(st.booleans(), min_size=1, max_size=60),
    pace=st.sampled_from([None, 500.0, 5760.0]),
)
def test_only_whole_frames_go_out_and_no_estimate_after_a_newer_one(takes, what, pace):
    counts: Counter[str] = Counter()
    outgoing, out = Outgoing(counts, pace), bytearray()
    taking = iter(takes * 100)

    def write(content):
        taken = min(next(taking, len(content)), len(content))
        out.extend(content[:taken])
        return taken

    put = 0
    for step, is_estimate in enumerate(what):
        outgoing.put(estimate(step) if is_estimate else beat())
        put += 1
        outgoing.flush(write, 0.01 * step)
    for step in range(len(what), len(what) + 20_000):
        if not len(outgoing):
            break
        outgoing.flush(write, 0.01 * step)
    frames = StreamFrames()
    found = [coder().decode(bytearray(content)) for _, content in frames.feed(bytes(out))]
    assert not frames.damage
    assert len(found) + counts["replaced"] + counts["not_sent"] == put
    times = [message.time_usec for message in found if message.msgname == "ODOMETRY"]
    assert times == sorted(times)
    assert not any(what) or times[-1] == max(step for step, is_estimate in enumerate(what) if is_estimate)


def test_the_pace_of_the_line_is_kept_and_others_go_before_estimates():
    counts: Counter[str] = Counter()
    outgoing, out = Outgoing(counts, 11_520.0), bytearray()

    def write(content):
        out.extend(content)
        return len(content)

    for step in range(1000):  # 10 s of 100 Hz, 24.4 kB/s
        outgoing.put(estimate(step))
        if step % 50 == 0:
            outgoing.put(beat())
        outgoing.flush(write, 0.01 * step)
    assert len(out) == pytest.approx(10 * 11_520, rel=0.01)
    assert counts["replaced"] == pytest.approx(1000 - (len(out) - 20 * 21) / len(estimate(9)), abs=3)
    assert counts["not_sent"] == 0


def test_frames_that_are_no_estimates_wait_up_to_a_limit():
    counts: Counter[str] = Counter()
    outgoing = Outgoing(counts)
    for _ in range(1000):
        outgoing.put(beat())
    assert len(outgoing) <= MOST_WAITING
    assert counts["not_sent"] == 1000 - MOST_WAITING // len(beat())
    outgoing.clear()
    assert counts["not_sent"] == 1000


def test_the_number_of_a_message():
    assert message_id_of(estimate(1)) == 331
    assert message_id_of(beat()) == 0
    assert message_id_of(b"hello") == -1


def test_a_serial_port_that_is_full_does_not_stop_us_and_nothing_is_torn():
    """pyserial's write tries for ever while the port is full: the session stood still, in flight."""
    far, port = os.openpty()
    os.set_blocking(far, False)
    link = open_link(f"serial:{os.ttyname(port)}:3000000")
    assert isinstance(link, SerialLink)
    link.clock = iter(0.001 * step for step in itertools.count()).__next__  # what goes out follows this clock
    done = threading.Event()
    last = 4000

    def write_all():
        for number in range(last):
            link.write(estimate(number))
            link.write(beat())
        done.set()

    threading.Thread(target=write_all, daemon=True).start()
    assert done.wait(HUNG_S), "the writer stands still"
    assert link.counts["replaced"] > 100
    frames, found, end_s = StreamFrames(), [], time.monotonic() + HUNG_S
    while (not found or found[-1] != last - 1) and time.monotonic() < end_s:
        link.read()  # flushes
        try:
            piece = os.read(far, 4096)
        except BlockingIOError:
            time.sleep(0.001)
            continue
        for frame, content in frames.feed(piece):
            if frame.message_id == 331:
                found.append(coder().decode(bytearray(content)).time_usec)
    assert found[-1] == last - 1  # the newest
    assert found == sorted(found)
    assert not frames.damage
    link.close()
    os.close(far)
    os.close(port)


def test_a_tcp_peer_that_does_not_read_gets_the_newest_estimate_when_it_does():
    server = open_link("tcpin:0")
    caller = open_link(f"tcp:127.0.0.1:{server.port}")
    caller.write(b"")
    server.read()
    last = 60_000
    for number in range(last):
        server.write(estimate(number))
    assert server.counts["replaced"] > 1000
    frames, newest, end_s = StreamFrames(), -1, time.monotonic() + HUNG_S
    while newest != last - 1 and time.monotonic() < end_s:
        server.read()
        for piece, _ in caller.read():
            for _, content in frames.feed(piece):
                newest = coder().decode(bytearray(content)).time_usec
    assert newest == last - 1
    assert not frames.damage
    caller.close()
    server.close()


# -- in the session ---------------------------------------------------------------------------------------
@pytest.fixture
def wires():
    made = []

    def make(**options):
        from flownav.live.options import Options

        made.append(Wire(Hover(), Options(**options)))
        return made[-1]

    yield make
    for wire in made:
        wire.close()


def test_on_a_slow_link_estimates_come_as_often_as_it_carries(wires):
    wire = wires(capacity_bytes_s=5_760.0).fly(10.0)
    found = wire.estimates(5.0)
    assert 15.0 <= len(found) / 5.0 <= 19.0
    assert wire.session.intake.flow_waited > 100
    newest = [message.time_usec for message in found]
    assert newest == sorted(newest)
    fast = wires().fly(10.0)
    assert len(fast.estimates(5.0)) / 5.0 > 45.0


def test_what_the_link_does_is_told_on_the_screen_and_in_json(wires):
    from io import StringIO

    from rich.console import Console

    from flownav.live.display import draw
    from flownav.live.loop import Latency
    from flownav.live.screen import Screen

    wire = wires(capacity_bytes_s=5_760.0)
    wire.link.capacity_bytes_s = 5_760.0
    screen = Screen(wire.session, Latency(), "udp:1", link=wire.link)
    traffic = Traffic(wire.link, wire.session, wire.now_s)
    console = Console(width=200, file=StringIO(), record=True)
    console.print(draw(screen.view(wire.now_s)))
    wire.fly(2.0)
    wire.link.counts["replaced"] += 7
    wire.link.counts["overflowed"] = 12
    console.print(draw(screen.view(wire.now_s)))
    text = console.export_text()
    assert "at most 19 estimates/s" in text
    assert "not sent: 7 old estimates, 0 other frames" in text
    assert "LOST 12 datagrams: more came than could be read" in text
    facts = traffic_facts(wire.link, wire.session, wire.t_s)
    assert facts["received_share"] == pytest.approx(facts["received_bytes_s"] / 5_760.0)
    assert facts["received_bytes_s"] > 5_000.0  # this vehicle does not do what it is asked
    assert facts["asked_hz"]["HIGHRES_IMU"] == 33
    assert facts["estimates_replaced"] == 7
    assert in_words(traffic.look(wire.now_s)).startswith("Link: in ")
