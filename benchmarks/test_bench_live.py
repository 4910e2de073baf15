"""From a flow reading's arrival to the estimate's departure: 250 Hz of flow and IMU over loopback, with a record.

Run with `python -m pytest benchmarks/test_bench_live.py -s`; FLOWNAV_LIVE_BENCH_S sets how long (20 s; 600 for the ten
minutes that are asked for), FLOWNAV_LIVE_PRIORITY=0 leaves the session an ordinary process. Once alone on the machine,
and once with a process on every core that never rests (FLOWNAV_LIVE_LOAD_NICE, 0, is its niceness). Prints the
distributions, what was dropped, the share of a core, and the growth of memory after the first tenth. The vehicle is a
process of its own.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import socket
import struct
import time
from collections import deque
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from flownav.core.measurement import Sensor
from flownav.live.byte_links import open_link
from flownav.live.filtering import Options
from flownav.live.link import MOST_READS, Piece, UdpLink, parse_url
from flownav.live.loop import Latency, run_before_others, run_session, warm_up
from flownav.live.recorder import Recorder
from flownav.live.session import Session

DURATION_S = float(os.environ.get("FLOWNAV_LIVE_BENCH_S", "20"))
LOAD_NICE = int(os.environ.get("FLOWNAV_LIVE_LOAD_NICE", "0"))
PRIORITY = os.environ.get("FLOWNAV_LIVE_PRIORITY", "1") != "0"
FLOW_HZ = 250
SHARES = (0.5, 0.9, 0.99, 0.999, 1.0)
SO_TIMESTAMPNS = 35
FLOW_MESSAGE, ESTIMATE_MESSAGE = (number.to_bytes(3, "little") for number in (106, 331))


def vehicle(port: int, seconds: float) -> None:
    """A hover at 250 Hz of HIGHRES_IMU and OPTICAL_FLOW_RAD, 50 Hz attitude, 25 Hz range, 10 Hz GPS."""
    from flownav.logs.mavlink import outgoing as say
    from live_ends import ORIGIN, Hover, reading

    if PRIORITY:  # a vehicle's sensors do not wait for our processes, nor does the session wait for them
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, -15)
    link, mav = open_link(f"udpout:127.0.0.1:{port}"), Hover().mav
    noise = Hover().noise
    start = time.monotonic()
    for step in range(round(seconds * FLOW_HZ)):
        time.sleep(max(0.0, start + step / FLOW_HZ - time.monotonic()))
        link.read()
        time_us = round((20.0 + step / FLOW_HZ) * 1e6)
        a, b, c = (noise.gauss(0.0, 0.01) for _ in range(3))
        messages = [say.highres_imu(mav, time_us, reading(Sensor.IMU, a, b, c, c, a, b - 9.80665))]
        if step % FLOW_HZ == 0:
            messages.append(say.heartbeat(mav, armed=True))
        if step % 5 == 0:
            messages.append(say.attitude_quaternion(mav, time_us // 1000, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        if step % 10 == 0:
            messages.append(say.distance_sensor(mav, time_us // 1000, reading(Sensor.RANGE, 2.0 + c), (0.1, 40.0)))
        if step % 25 == 0:
            velocity = reading(Sensor.GPS_VELOCITY, a, b, 0.0, variance=0.04)
            fix = say.gps_raw_int(mav, time_us, ORIGIN, velocity, horizontal_sigma_m=0.5, vertical_sigma_m=0.8)
            messages.append(fix)
        flow = reading(Sensor.FLOW_RATE, a, b, a, b)
        messages.append(say.optical_flow_rad(mav, time_us, flow, 1.0 / FLOW_HZ))
        for message in messages:
            link.write(bytes(message.pack(mav)))


def busy() -> None:
    """Work that never ends."""
    os.nice(LOAD_NICE)
    while True:
        sum(range(10_000))


def sleeper(told: Connection) -> None:
    """How late a real-time process wakes that only sleeps for 1 ms: what the machine itself takes, from whomever."""
    if PRIORITY:
        run_before_others()
    late = Latency()
    while not told.poll():
        start_s = time.monotonic()
        time.sleep(0.001)
        late.take(time.monotonic() - start_s - 0.001)
    told.recv()
    told.send([late.quantile_s(share) for share in SHARES])


class Timed(UdpLink):
    """A link that holds the system's own stamps of arriving flow against the departure of the estimate.

    The session's own figure begins when it reads; this one begins when the datagram came to the socket, so that it has
    the time for which nobody let the session run.
    """

    def __init__(self) -> None:
        super().__init__(parse_url("udp:0"))
        self.since_arrival = Latency()
        self._arrived_s: deque[float] = deque()
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)

    def read(self) -> list[Piece]:
        """As the link does."""
        self._arrived_s.clear()
        pieces: list[Piece] = []
        while len(pieces) < MOST_READS:
            try:
                piece, beside, _, sender = self._socket.recvmsg(2048, 64)
            except BlockingIOError:
                break
            if piece[7:10] == FLOW_MESSAGE:
                seconds, nanoseconds = struct.unpack("qq", beside[0][2])
                self._arrived_s.append(seconds + 1e-9 * nanoseconds)
            pieces.append((piece, sender))
        return pieces

    def write(self, frame: bytes) -> None:
        """As the link does."""
        super().write(frame)
        if frame[7:10] == ESTIMATE_MESSAGE and self._arrived_s:
            self.since_arrival.take(time.time() - self._arrived_s.popleft())


@pytest.mark.parametrize("loaded", [False, True], ids=["alone", "both cores busy"])
def test_latency_from_flow_to_estimate(tmp_path, loaded):
    warm_up()
    link, latency, options = Timed(), Latency(), Options()
    recorder = Recorder(tmp_path / "bench.fnr", options)
    spawn = multiprocessing.get_context("spawn")
    other = spawn.Process(target=vehicle, args=(link.port, DURATION_S))
    others = [spawn.Process(target=busy, daemon=True) for _ in range(os.cpu_count() or 1) if loaded]
    ours, theirs = multiprocessing.Pipe()
    machine = spawn.Process(target=sleeper, args=(theirs,))
    for process in (other, *others, machine):
        process.start()
    scheduling = run_before_others() if PRIORITY else "ordinary"
    session = Session(options, recorder, time.monotonic(), time.time())
    memory_kb: list[int] = []
    began_s, cpu_s = time.monotonic(), _cpu_s()

    def look(now_s: float) -> None:
        memory_kb.append(_resident_kb())

    run_session(session, link, latency, lambda: not other.is_alive(), [look])
    share = (_cpu_s() - cpu_s) / (time.monotonic() - began_s)
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    for process in others:
        process.kill()
    link.close()
    grown = memory_kb[-1] - memory_kb[len(memory_kb) // 10]
    print(f"\n{DURATION_S:g} s, {'both cores busy' if loaded else 'alone'}, scheduling: {scheduling}")
    print(f"{session.intake.readings[Sensor.FLOW_RATE]} flow readings, {session.sent} estimates sent")
    print("withheld:", dict(session.withheld), "dropped:", session.dropped, "link:", dict(link.counts))
    for name, found in (("reading", latency), ("arrival", link.since_arrival)):
        print(f"from its {name}: {_shown([found.quantile_s(share) for share in SHARES])}")
    ours.send(None)
    print(f"the machine: a process that sleeps 1 ms wakes late by {_shown(ours.recv())}")
    print(f"processor: {100 * share:.1f} % of a core, {1e3 * share / FLOW_HZ:.2f} ms for each flow reading")
    print(f"memory: {grown} kB more than after a tenth of the time; at most {_peak_mb():.0f} MB")
    assert recorder.finish({}).reason == ""
    assert session.sent > 0  # how many a machine that is busy sends is printed


def _shown(quantiles_s: list[float]) -> str:
    return ", ".join(
        f"p{100 * share:g} {1e3 * value_s:.3f} ms" for share, value_s in zip(SHARES, quantiles_s, strict=True)
    )


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _resident_kb() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() // 1024


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
