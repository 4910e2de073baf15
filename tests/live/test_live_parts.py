"""The parts of a live session: links, frames in pieces, the horizon, the way from then to now, sources, clock."""

from __future__ import annotations

import math
import os
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.estimation.states import POSITION, QUATERNION, STATE, VELOCITY
from flownav.live.answers import estimate_of
from flownav.live.byte_links import SerialLink, TcpLink, open_link
from flownav.live.filtering import BATCH_READINGS, ROOM, Filtering, Keeper
from flownav.live.horizon import SILENT_S, Source, Sources
from flownav.live.link import Address, parse_url
from flownav.live.loop import Latency
from flownav.live.options import Options
from flownav.live.screen import strip
from flownav.live.vehicle_clock import VehicleClock
from flownav.logs.mavlink.framing import LARGEST_FRAME, StreamFrames
from flownav.navigation import waiting
from flownav.navigation.rings import Given, Rings, numbers_of
from mavlink_logs import flight_log, made

NO_SETTINGS = np.zeros(1000)


# -- links ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("udp:14550", Address("udp", "127.0.0.1", 14550)),
        ("udpin:0.0.0.0:14550", Address("udp", "0.0.0.0", 14550)),
        ("udpout:10.0.0.2:14550", Address("udpout", "10.0.0.2", 14550)),
        ("tcp:localhost:5760", Address("tcp", "localhost", 5760)),
        ("tcpin:5760", Address("tcpin", "127.0.0.1", 5760)),
        ("serial:/dev/ttyACM0", Address("serial", "/dev/ttyACM0", 115200)),
        ("serial:/dev/ttyS1:921600", Address("serial", "/dev/ttyS1", 921600)),
    ],
)
def test_a_url_says_where_a_link_leads_and_listening_is_on_loopback(url, address):
    assert parse_url(url) == address


@pytest.mark.parametrize(
    "url", ["", "udp", "udp:", "udp:x", "udp:70000", "tcp:5760", "udpout:14550", "http://x:1", "serial:"]
)
def test_what_is_no_url_is_one_line(url):
    with pytest.raises(InputError, match="no link; give udp:"):
        parse_url(url)


@pytest.mark.parametrize("url", ["serial:/dev/nowhere", "tcp:127.0.0.1:1"])
def test_a_link_that_cannot_be_had_is_one_line(url):
    with pytest.raises(InputError, match="cannot be opened"):
        open_link(url)


def until(what, seconds=120.0):  # what takes longer hangs
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = what()
        if found:
            return found
        time.sleep(0.002)
    raise AssertionError("it never came")


def test_tcp_carries_bytes_both_ways_and_connects_again():
    server = open_link("tcpin:0")
    assert isinstance(server, TcpLink)
    caller = open_link(f"tcp:127.0.0.1:{server.port}")
    server.read()
    caller.write(b"there")
    assert until(server.read) == [(b"there", None)]
    server.write(b"back")
    assert until(caller.read) == [(b"back", None)]
    caller.close()
    again = open_link(f"tcp:127.0.0.1:{server.port}")
    again.write(b"again")
    assert until(server.read) == [(b"again", None)]
    assert server.counts["reconnected"] == 2
    again.close()
    server.close()


def test_a_serial_port_carries_bytes_both_ways_and_a_pulled_cable_is_no_crash():
    vehicle, port = os.openpty()
    link = open_link(f"serial:{os.ttyname(port)}")
    assert isinstance(link, SerialLink)
    os.write(vehicle, b"there")
    assert until(link.read) == [(b"there", None)]
    link.write(b"back")
    assert os.read(vehicle, 10) == b"back"
    os.close(vehicle)
    os.close(port)
    until(lambda: link.fileno() < 0 or link.read() or link.fileno() < 0)
    link.write(b"nobody")
    assert link.counts["not_sent"] >= 1
    link.close()


# -- frames -----------------------------------------------------------------------------------------------
FLIGHT = [frame for _, frame in flight_log(0.3).frames]


@given(st.lists(st.integers(1, 400), min_size=1, max_size=40), st.data())
def test_frames_come_out_whole_however_the_bytes_are_cut(cuts, data):
    stream = b"".join(FLIGHT)
    frames = StreamFrames()
    found, place = [], 0
    while place < len(stream):
        size = data.draw(st.sampled_from(cuts))
        found += [content for _, content in frames.feed(stream[place : place + size])]
        place += size
    assert found == FLIGHT
    assert not frames.damage


@given(st.binary(max_size=600), st.integers(0, len(FLIGHT) - 1))
def test_a_frame_after_any_bytes_is_found_and_nothing_is_kept_beyond_a_frame(junk, which):
    frames = StreamFrames()
    list(frames.feed(junk))
    quiet = bytes(LARGEST_FRAME)  # whatever the junk began is over after the longest frame
    found = [content for _, content in frames.feed(quiet + FLIGHT[which])]
    assert found[-1] == FLIGHT[which]


# -- horizon and sources ----------------------------------------------------------------------------------
@given(st.lists(st.tuples(st.floats(0.0, 10.0), st.floats(0.0, 0.3)), max_size=60))
def test_the_horizon_releases_in_order_and_counts_what_is_late(arrivals):
    rings, instants, late = Rings(ROOM, 64), [], 0
    for t_s, delay_s in arrivals:
        late += rings.take(Given(t_s, int(Sensor.RANGE), numbers_of((1.0,), delay_s=delay_s))) == waiting.LATE
        found = rings.release(NO_SETTINGS, t_s - 0.25)
        instants += found.queue.t_s.tolist()
        pairs = zip(found.queue.t_s, found.arrival_s, strict=True)
        assert set(pairs) <= {(arrival_s - delay_s, arrival_s) for arrival_s, delay_s in arrivals}
    instants += rings.release(NO_SETTINGS, math.inf).queue.t_s.tolist()
    assert instants == sorted(instants)
    assert len(instants) + late == len(arrivals)
    assert len(rings) == 0


def test_a_preferred_message_takes_over_and_a_silent_one_gives_way():
    sources = Sources()
    other, best = Source("OPTICAL_FLOW", 0), Source("OPTICAL_FLOW_RAD", 0)
    assert sources.takes(Sensor.FLOW_RATE, other, 0.0)
    assert sources.takes(Sensor.FLOW_RATE, best, 0.1)
    assert not sources.takes(Sensor.FLOW_RATE, other, 0.2)
    assert not sources.takes(Sensor.FLOW_VELOCITY, other, 0.2)
    assert sources.takes(Sensor.FLOW_RATE, other, 0.2 + SILENT_S)
    assert sources.dropped == {Sensor.FLOW_RATE: 1, Sensor.FLOW_VELOCITY: 1}


# -- clock ------------------------------------------------------------------------------------------------
def test_timesync_tells_the_wait_that_stamps_cannot():
    clock = VehicleClock(1, 1)
    for k in range(100):  # every message waits 30 ms on the link
        sent_s = 20.0 + 0.01 * k
        clock.stamped(made("ATTITUDE", time_boot_ms=round(sent_s * 1e3)), 1, 1, 100.0 + 0.01 * k + 0.03)
    now_s = 100.0 + 0.99 + 0.03
    assert clock.now_s(now_s) == pytest.approx(20.99, abs=2e-3)
    clock.exchanged(round(21.03e9), round((now_s - 0.02) * 1e9), now_s + 0.02)
    assert clock.now_s(now_s) == pytest.approx(21.03, abs=1e-6)
    clock.exchanged(round(500e9), round(now_s * 1e9), now_s)
    assert clock.counts["timesync_refused"] == 1
    assert clock.now_s(now_s) == pytest.approx(21.03, abs=1e-6)


@pytest.mark.parametrize("wait_s", [0.02, 0.08, 0.2])
def test_the_time_never_steps_back_when_the_link_is_loaded_and_is_right_again_soon(wait_s):
    """A flood of messages in the queue: everything seems to arrive later, all of a sudden."""
    clock, said_s = VehicleClock(1, 1), []
    for k in range(500):
        now_s = 100.0 + 0.01 * k
        waits = wait_s if k >= 200 else 0.0
        clock.stamped(made("ATTITUDE", time_boot_ms=round((now_s - 80.0 - waits) * 1e3)), 1, 1, now_s)
        said_s.append(clock.now_s(now_s))
    assert said_s == sorted(said_s)
    assert said_s[-1] == pytest.approx(now_s - 80.0 - wait_s, abs=2e-3)


# -- from then to now -------------------------------------------------------------------------------------
def test_the_estimate_of_now_is_where_the_filter_will_be_when_it_gets_there():
    """IMU alone between two fixes: carried ahead, and fed to the filter, the same readings give the same bits; the
    noise that the filter follows meanwhile is 4 % of a variance.
    """
    chance = np.random.default_rng(3)

    def imu(t_s):
        value = np.array([0.0, 0.0, 0.0, 0.5, -0.3, -9.8]) + chance.normal(0.0, 0.4, 6)
        return Given(t_s, int(Sensor.IMU), numbers_of(value))

    attitude = Given(-0.01, int(Sensor.ATTITUDE), numbers_of((0.9, 0.1, -0.2, 0.3742)))
    fix = Given(0.505, int(Sensor.GPS_POSITION), numbers_of((1.0, 2.0, -3.0), (1.0,) * 3))
    filtering = Filtering(Options(), Keeper())
    for reading in [attitude, *(imu(0.01 * k) for k in range(100)), fix]:
        assert filtering.rings.take(reading) == waiting.TAKEN
    filtering.begin(gps_received=True)
    for readings in (BATCH_READINGS, 102 - BATCH_READINGS, 0):
        assert filtering.feed(0.999).readings == readings
    for k in range(30):
        filtering.rings.take(imu(1.0 + 0.01 * k))
    on = filtering.running
    ahead = estimate_of(on, filtering.now(1.29), 1.29, 1.29, 0)
    sure = estimate_of(on, filtering.now(filtering.clock_s), filtering.clock_s, 0.99, 0)
    assert ahead.pose_covariance[0, 0] > sure.pose_covariance[0, 0]
    assert filtering.feed(2.0).readings == 30
    there = estimate_of(on, filtering.now(filtering.clock_s), filtering.clock_s, 1.29, 0)
    np.testing.assert_allclose(np.diag(ahead.pose_covariance), np.diag(there.pose_covariance), rtol=0.06)
    np.testing.assert_allclose(np.diag(ahead.velocity_covariance), np.diag(there.velocity_covariance), rtol=0.02)
    assert filtering.clock_s == pytest.approx(1.29)
    assert ahead.pos_ned_m == tuple(on.work[STATE + POSITION : STATE + POSITION + 3])
    assert ahead.vel_ned_m_s == tuple(on.work[STATE + VELOCITY : STATE + VELOCITY + 3])
    assert ahead.quaternion == tuple(on.work[QUATERNION : QUATERNION + 4])
    for covariance in (ahead.pose_covariance, ahead.velocity_covariance):
        assert np.linalg.eigvalsh(covariance).min() > -1e-12


# -- figures ----------------------------------------------------------------------------------------------
def test_the_latency_histogram_knows_its_quantiles():
    latency, values = Latency(), np.geomspace(1e-4, 1e-2, 1000)
    for value in values:
        latency.take(float(value))
    for share in (0.5, 0.9, 0.99):
        assert latency.quantile_s(share) == pytest.approx(np.quantile(values, share), rel=0.07)
    assert latency.quantile_s(1.0) == pytest.approx(1e-2)


def test_a_strip_shows_least_greatest_and_gaps():
    from collections import deque

    assert strip(deque([0.0, 1.0, math.nan, 0.5])) == "▁█ ▅"
    assert strip(deque([2.0, 2.0])) == "▁▁"
