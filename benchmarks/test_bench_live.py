"""From a flow reading's arrival to the estimate's departure: 250 Hz of flow and IMU over loopback, on one core.

Run with `python -m pytest benchmarks/test_bench_live.py -s`; FLOWNAV_LIVE_BENCH_S sets how long (20 s; 600 for the ten
minutes that are asked for). Prints the distribution, what was dropped, and the growth of memory after the first tenth.
The vehicle is a process of its own on another core where there is one.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import resource
import time
from pathlib import Path

from flownav.live.link import open_link
from flownav.live.loop import Latency, run_session
from flownav.live.options import Options
from flownav.live.recorder import Recorder
from flownav.live.session import Session
from flownav.live.warm import warm_up
from flownav.measurement import Sensor

DURATION_S = float(os.environ.get("FLOWNAV_LIVE_BENCH_S", "20"))
FLOW_HZ = 250


def vehicle(port: int, seconds: float) -> None:
    """A hover at 250 Hz of HIGHRES_IMU and OPTICAL_FLOW_RAD, 50 Hz attitude, 25 Hz range, 10 Hz GPS."""
    from flownav.mavlink import sensors_outgoing as say
    from live_ends import ORIGIN, Hover, reading

    if len(os.sched_getaffinity(0)) > 1:
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
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


def test_latency_from_flow_to_estimate(tmp_path):
    if len(os.sched_getaffinity(0)) > 1:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    warm_up()
    link, latency, options = open_link("udp:0"), Latency(), Options()
    recorder = Recorder(tmp_path / "bench.fnr", options)
    session = Session(options, recorder, time.monotonic(), time.time())
    other = multiprocessing.get_context("spawn").Process(target=vehicle, args=(link.port, DURATION_S))
    other.start()
    memory_kb: list[int] = []

    def look(now_s: float) -> None:
        memory_kb.append(_resident_kb())

    run_session(session, link, latency, lambda: not other.is_alive(), [look])
    link.close()
    grown = memory_kb[-1] - memory_kb[len(memory_kb) // 10]
    print(f"\n{DURATION_S:g} s: {session.readings[Sensor.FLOW_RATE]} flow readings, {session.sent} estimates sent")
    print("withheld:", dict(session.withheld), "dropped:", session.dropped, "link:", dict(link.counts))
    for share in (0.5, 0.9, 0.99, 0.999, 1.0):
        print(f"latency p{100 * share:g}: {1e3 * latency.quantile_s(share):.3f} ms")
    print(f"memory: {grown} kB more than after a tenth of the time; at most {_peak_mb():.0f} MB", gc.get_stats()[2])
    recorder.finish({})
    assert session.sent > 0.8 * FLOW_HZ * (DURATION_S - 5.0)


def _resident_kb() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() // 1024


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
