"""A session over serial lines of 57600, 115200 and 921600 baud: rates, bytes, what is lost, ages and accuracy.

Run with `python -m pytest benchmarks/test_bench_serial.py -s`; FLOWNAV_SERIAL_BENCH_S sets how long each line is flown
(30 s, the first five of which do not count). The line is a pseudo-terminal whose far end is paced each way, with a
buffer of 1 kB (tests/helpers/serial_line.py); the vehicle is the flight of `pad_return`, sent in real time. `as asked
before` is the same line without a plan: everything is asked for, and every estimate is sent.
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np

from flownav.campaigns.faults.table import log_of
from flownav.campaigns.local import fly_recorded
from flownav.live.filtering import Keeper
from flownav.live.loop import warm_up
from flownav.live.session import Session
from flownav.live.simulated import BOOT_S, SimulatedVehicle
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from serial_line import SETTLED_S, Flown, fly_over, options_of

DURATION_S = float(os.environ.get("FLOWNAV_SERIAL_BENCH_S", "30"))
BAUDS = (57_600, 115_200, 921_600)
ASKED = ("HIGHRES_IMU", "OPTICAL_FLOW_RAD", "DISTANCE_SENSOR", "GPS_RAW_INT", "ATTITUDE_QUATERNION")
HEAD = (
    "baud      asked [Hz]             in         lost  estimates out         reading's age estimate's age error",
    "          IMU flow range GPS att [kB/s] [%] [1/s] [1/s]     [kB/s] [%]  p50  p99 [ms] p50  p99 [ms]  [m]",
)


def row(name: str, baud: int, flown: Flown) -> str:
    """One line of the table."""
    imu, flow, ranges, gps, attitude = (flown.asked_hz.get(message, 0) for message in ASKED)
    into, out = flown.received_bytes_s, flown.written_bytes_s
    ages = [
        np.percentile(found, share) * 1e3 if len(found) else float("nan")
        for found in (flown.reading_age_s, flown.estimate_age_s)
        for share in (50, 99)
    ]
    return (
        f"{name:9s} {imu:3.0f} {flow:4.0f} {ranges:5.0f} {gps:3.0f} {attitude:3.0f} {into / 1e3:6.1f} "
        f"{1e3 * into / baud:3.0f} {flown.lost / (DURATION_S - SETTLED_S):5.1f} {flown.estimate_hz:5.1f}     "
        f"{out / 1e3:6.1f} {1e3 * out / baud:3.0f} {ages[0]:4.0f} {ages[1]:5.0f}      "
        f"{ages[2]:4.0f} {ages[3]:5.0f}     {flown.error_m:5.2f}"
    )


def test_bench_serial_lines() -> None:
    warm_up()
    setup: Any = assemble(load_scenario("pad_return"))
    log = log_of(fly_recorded(setup, 1), setup)
    print("", *HEAD, sep="\n")
    for baud in BAUDS:
        options = options_of(setup, baud)
        for name, chosen in ((str(baud), options), ("  before", replace(options, capacity_bytes_s=None))):
            vehicle = SimulatedVehicle(log)
            flown = fly_over(baud, vehicle, DURATION_S, chosen)
            print(row(name, baud, flown), flush=True)
            assert not vehicle.damage  # how much is lost and how true it is are tests/live/test_live_serial.py's


SLOW = {"HIGHRES_IMU": (105, 0.0), "OPTICAL_FLOW_RAD": (106, 15.0), "DISTANCE_SENSOR": (132, 10.0),
        "GPS_RAW_INT": (24, 5.0), "ATTITUDE_QUATERNION": (31, 5.0), "EXTENDED_SYS_STATE": (245, 2.0)}  # fmt: skip
STEP_S, UNTIL_S = 0.005, 30.0


def thinned(log: Any, setup: Any, imu_hz: float) -> tuple[float, int]:
    """Error [m] and jumps of a session that asks for the slowest streams and so much of the IMU, on a made clock."""
    vehicle, asked = SimulatedVehicle(log), SLOW | {"HIGHRES_IMU": (105, imu_hz)}
    session = Session(replace(options_of(setup, 57_600), capacity_bytes_s=None), Keeper(), 0.0, 1.8e9)
    session.rates.begin = lambda make, beside=None: asked  # type: ignore[method-assign]
    for step in range(round(UNTIL_S / STEP_S)):
        t_s = STEP_S * step
        for frame in vehicle.due(t_s, 1.8e9):
            session.take(frame, t_s, whole=True)
        session.tick(t_s)
        while session.outbox:
            for answer in vehicle.hear(session.outbox.popleft(), t_s):
                session.take(answer, t_s, whole=True)
    told = [message for t_s, message in vehicle.received if message.msgname == "ODOMETRY" and t_s > SETTLED_S]
    errors = [np.array([m.x, m.y]) - vehicle.truth_at(m.time_usec * 1e-6 - BOOT_S)[0][:2] for m in told]
    away = np.array(errors) - np.mean(errors, axis=0)
    return float(np.sqrt(np.mean(np.sum(away**2, axis=1)))), session.resets


def test_bench_inertial_rates() -> None:
    """How slow an IMU may be: flow of 15 Hz, range of 10, GPS of 5, attitude of 5 Hz."""
    warm_up()
    setup: Any = assemble(load_scenario("pad_return"))
    log = log_of(fly_recorded(setup, 1), setup)
    print("\nIMU [Hz]  error [m]  jumps")
    for imu_hz in (100.0, 50.0, 33.0, 25.0):
        error_m, jumps = thinned(log, setup, imu_hz)
        print(f"{imu_hz:6.0f} {error_m:11.2f} {jumps:6d}")
        assert error_m < 2.0
