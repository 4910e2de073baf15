"""The companion program in C (examples/companion), built and run: it says over MAVLink what Python says of the same."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import flownav
from flownav.api.building import flight_of
from flownav.campaigns.faults.table import log_of
from flownav.campaigns.local import fly_recorded
from flownav.core.measurement import Sensor
from flownav.export.onboard.board import Board
from flownav.export.onboard.package import pace_of, packed_settings, rates_of
from flownav.live.filtering import Keeper
from flownav.live.loop import Latency, run_session
from flownav.live.options import Options
from flownav.live.session import Session
from flownav.live.simulated import SimulatedVehicle
from flownav.logs.mavlink.converted import Context, Dropped
from flownav.logs.mavlink.framing import StreamFrames, coder
from flownav.logs.mavlink.messages import measurements
from flownav.logs.mavlink.position_messages import fix_deg_m
from flownav.navigation import progress
from flownav.navigation.rings import Given, numbers_of
from flownav.sensors.datasheet import IdentifiedFlow
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from places import PROJECT
from virtual_link import UNIX_S, Clock, link_to

COMPANION = PROJECT / "examples" / "companion"
GPS_DELAY_S = 0.22
GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)

pytestmark = pytest.mark.skipif(
    shutil.which("cc") is None or shutil.which("cmake") is None, reason="no cc and cmake here: Debian's gcc and cmake"
)


@pytest.fixture(scope="module")
def setup():
    return assemble(load_scenario("pad_return"))


@pytest.fixture(scope="module")
def log(setup):
    return log_of(fly_recorded(setup, 1), setup)


@pytest.fixture(scope="module")
def record(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("flight") / "pad_return.fnr"
    flownav.fly("pad_return", seed=1).save(path)
    return path


@pytest.fixture(scope="module")
def program(record, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("companion")
    flownav.build("linux-x86_64", folder / "flownav", record=record, others_hz=400.0)
    made = folder / "made"
    for command in (
        ["cmake", "-S", COMPANION, "-B", made, f"-DFLOWNAV={folder / 'flownav'}", f"-DPYTHON={sys.executable}"],
        ["cmake", "--build", made],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "warning" not in done.stderr
    return made / "companion"


def frames_of(log) -> list[bytes]:
    vehicle = SimulatedVehicle(log)
    return vehicle.due(vehicle.end_s, UNIX_S)


def logged_digests(piece: bytes) -> list:
    reader, decoder = StreamFrames(), coder()
    return [decoder.decode(bytearray(content)) for _, content in reader.feed(piece)]


def as_python_hears(frames: list[bytes], board: Board, every_s: float = 0.02 - 1e-4):
    """The board fed with what messages say, and what it tells after inertial readings: rows of time and state."""
    origin, newest_s, told_s, fix_us, rows = None, 0.0, -1.0, None, []
    for message in logged_digests(b"".join(frames)):
        name = message.msgname
        if name not in (
            "HIGHRES_IMU",
            "OPTICAL_FLOW_RAD",
            "DISTANCE_SENSOR",
            "GPS_RAW_INT",
            "ATTITUDE_QUATERNION",
            "EXTENDED_SYS_STATE",
        ):
            continue
        if name == "GPS_RAW_INT":
            if message.fix_type < 3 or message.time_usec == fix_us:
                continue
            fix_us, origin = message.time_usec, origin or fix_deg_m(message)
        stated_s = getattr(message, "time_usec", 0) * 1e-6 or getattr(message, "time_boot_ms", 0) * 1e-3 or newest_s
        if not stated_s:
            continue
        newest_s = max(newest_s, stated_s)
        found = [
            each
            for each in measurements(message, stated_s, Context(False, True, origin))
            if not isinstance(each, Dropped)
        ]
        found.sort(
            key=lambda each: (Sensor.MAG, Sensor.BARO, Sensor.IMU).index(each.sensor) if name == "HIGHRES_IMU" else 0
        )
        for each in found:
            delay_s = GPS_DELAY_S if each.sensor in GPS else each.delay_s
            exposure_s = 2.0 * each.delay_s if each.sensor == Sensor.FLOW_RATE else 0.0
            numbers = numbers_of(each.value, each.variance, each.quality, delay_s=delay_s, exposure_s=exposure_s)
            board.take(Given(each.t_s, int(each.sensor), numbers))
        if any(each.sensor == Sensor.IMU for each in found) and newest_s - told_s >= every_s:
            told_s = newest_s
            now = board.now(newest_s)
            flies = (
                now.status == progress.STATE_GIVEN
                and now.aid != 2.0
                and not now.suspected
                and now.protection_m[0] <= 10.0
            )
            if flies:
                rows.append(now)
    return rows


@pytest.fixture(scope="module")
def told(program, log):
    done = subprocess.run([program, "-"], input=b"".join(frames_of(log)), capture_output=True, check=True)
    return done


def test_it_says_what_python_says_of_the_same_messages(told, log, record):
    flight = flight_of(record)
    rates = rates_of(flight.segment, 0.27)._replace(others_hz=400.0)
    settings, lag = packed_settings(flight, pace_of(flight.settings, rates.horizon_s))
    rows = as_python_hears(frames_of(log), Board(settings, rates.sizes, lag=lag))
    said = [message for message in logged_digests(told.stdout) if message.msgname == "ODOMETRY"]
    common = {message.time_usec for message in said} & {round(row.t_s * 1e6) for row in rows}
    assert len(common) > 2400
    assert len(said) + len(rows) - 2 * len(common) <= 2  # its GPS is Python's to the last bit but one
    said = [message for message in said if message.time_usec in common]
    rows = [row for row in rows if round(row.t_s * 1e6) in common]
    np.testing.assert_allclose([[m.x, m.y, m.z] for m in said], [row.pos_ned_m for row in rows], atol=1e-4)
    np.testing.assert_allclose([[m.vx, m.vy, m.vz] for m in said], [row.vel_frd_m_s for row in rows], atol=1e-4)
    np.testing.assert_allclose([m.q for m in said], [row.quaternion for row in rows], atol=1e-5)
    np.testing.assert_allclose(
        [m.pose_covariance for m in said], [row.pose_covariance for row in rows], rtol=1e-3, atol=1e-7
    )
    last = said[-1].velocity_covariance
    np.testing.assert_allclose(
        [last[i] for i in (0, 1, 2, 6, 7, 11)], rows[-1].vel_frd_covariance, rtol=1e-3, atol=1e-9
    )
    np.testing.assert_allclose(
        [last[i] for i in (15, 16, 17, 18, 19, 20)], rows[-1].rate_covariance, rtol=1e-3, atol=1e-12
    )
    assert b"0 dropped" in told.stderr


def test_it_flies_as_flownav_live_does(told, setup, log):
    fitted = setup.fitted
    options = Options(
        gps_delay_s=float(fitted.ages_s[Sensor.GPS_POSITION]),
        identified=IdentifiedFlow(1.0, 1.0, float(fitted.ages_s[Sensor.FLOW_RATE])),
        settings=fitted.given.settings, flow_noise=fitted.given.noise,
    )  # fmt: skip
    vehicle, clock = SimulatedVehicle(log), Clock()
    link, session = link_to(vehicle, clock), Session(options, Keeper(), 0.0, UNIX_S)
    run_session(session, link, Latency(), lambda: vehicle.finished, clock=clock)
    link.close()
    live = np.array([[m.time_usec * 1e-6, m.x, m.y, m.z] for _, m in vehicle.received if m.msgname == "ODOMETRY"])
    own = np.array(
        [[m.time_usec * 1e-6, m.x, m.y, m.z] for m in logged_digests(told.stdout) if m.msgname == "ODOMETRY"]
    )
    common = live[(live[:, 0] > own[0, 0] + 5.0) & (live[:, 0] < own[-1, 0])]
    there = np.column_stack([np.interp(common[:, 0], own[:, 0], own[:, i]) for i in (1, 2, 3)])
    apart_m = np.linalg.norm(there - common[:, 1:] - np.mean(there - common[:, 1:], axis=0), axis=1)
    assert len(common) > 500
    assert np.sqrt(np.mean(apart_m**2)) < 0.15  # another origin, horizon and age of flow; the same estimate


def test_digests_are_said_as_verify_takes_them(program, log):
    done = subprocess.run(
        [program, "-", "--digests", "1000"], input=b"".join(frames_of(log)[:8000]), capture_output=True, check=True
    )
    lines = done.stderr.decode().splitlines()[:-1]
    assert len(lines) > 3
    assert all(re.fullmatch(r"\d+ [0-9a-f]{16}", line) for line in lines)


def await_listener(own: socket.socket) -> None:
    """Wait until somebody has taken the port: until then the system refuses the second of two datagrams."""
    until_s = time.monotonic() + 120.0
    while True:
        try:
            own.send(b"\0")
            own.send(b"\0")
        except ConnectionRefusedError:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        else:
            return


def test_it_answers_over_udp(program, log):
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as spare,
    ):
        spare.bind(("127.0.0.1", 0))
        port = spare.getsockname()[1]
        spare.close()
        own.settimeout(120.0)
        own.connect(("127.0.0.1", port))
        running = subprocess.Popen([program, f"udp:{port}"], stderr=subprocess.DEVNULL)
        try:
            await_listener(own)
            for number, frame in enumerate(frames_of(log)[:8000]):
                own.send(frame)
                if number % 20 == 0:
                    time.sleep(0.001)  # the system keeps few datagrams that nobody has read
            while not any(message.msgname == "ODOMETRY" for message in logged_digests(own.recv(4096))):
                pass  # what it says before; TimeoutError where it never comes
        finally:
            running.kill()
            running.wait()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "where is the vehicle?"), (("-", "--every"), "an option lacks its value"),
        (("-", "--fast", "1"), "no such option"),
        (("tcp",), "udp:PORT, PATH:BAUD or - is needed"), (("/dev/null:1",), "PATH:BAUD, 57600 to 921600, is needed"),
        (("/absent/tty:57600",), "cannot open it"),
    ],
)  # fmt: skip
def test_what_cannot_be(program, arguments, said):
    done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert done.returncode == 2
    assert said in done.stderr


def test_cmake_says_what_it_lacks(tmp_path):
    done = subprocess.run(
        ["cmake", "-S", COMPANION, "-B", tmp_path], capture_output=True, text=True, check=False, env=os.environ
    )
    assert done.returncode == 1
    assert "no flownav.h there" in " ".join(done.stderr.split())
