"""A serial line of a baud rate: a pseudo-terminal whose far end is an autopilot's UART, paced each way.

The UART takes a tenth of the baud rate in bytes each second and has a small buffer: a frame that does not fit into it
is dropped whole, as autopilots do. (Of a fast line the buffer is what goes out in 0.1 s: our thread that plays the
autopilot is not always on time.) What we write and it has not taken yet is the backlog.
"""

from __future__ import annotations

import array
import fcntl
import os
import termios
import threading
import time
from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from flownav.live.link import Link, open_link
from flownav.live.loop import Latency, run_session, run_vehicle
from flownav.live.options import Options
from flownav.live.recorder import NoRecorder
from flownav.live.session import Session
from flownav.live.simulated import BOOT_S, SimulatedVehicle
from flownav.measurement import Sensor

BUFFER_BYTES = 1024
SETTLED_S = 5.0  # by then the rates have been asked for, and what was sent before them has passed


class Uart(Link):
    """The autopilot's end."""

    def __init__(self, baud: int) -> None:
        super().__init__()
        self.master, port = os.openpty()
        self.device, self._port = os.ttyname(port), port
        os.set_blocking(self.master, False)
        self._pace_bytes_s = baud / 10
        self._most = max(BUFFER_BYTES, int(0.1 * self._pace_bytes_s))
        self._out = b""
        self._may_read = self._may_write = 0.0
        self._at_s = time.monotonic()
        self.backlog = 0
        self.dropped_s: list[float] = []

    def fileno(self) -> int:
        return -1  # its loop sleeps: select would wake for what it may not take yet

    def read(self) -> list[Any]:
        now_s = time.monotonic()
        earned, self._at_s = self._pace_bytes_s * (now_s - self._at_s), now_s
        self._may_read, self._may_write = (
            min(credit + earned, 0.02 * self._pace_bytes_s) for credit in (self._may_read, self._may_write)
        )
        take = int(self._may_write)
        sent, self._out = self._out[:take], self._out[take:]
        self._may_write -= len(sent)
        if sent:
            os.write(self.master, sent)
        waiting = array.array("i", [0])
        fcntl.ioctl(self.master, termios.FIONREAD, waiting)
        self.backlog = waiting[0]
        try:
            piece = os.read(self.master, int(self._may_read)) if self._may_read >= 1.0 else b""
        except BlockingIOError:
            piece = b""
        self._may_read -= len(piece)
        self.received += len(piece)
        return [(piece, None)] if piece else []

    def write(self, frame: bytes) -> None:
        if len(self._out) + len(frame) > self._most:
            self.counts["not_sent"] += 1
            self.dropped_s.append(time.monotonic())
            return
        self._out += frame
        self.written += len(frame)

    def close(self) -> None:
        os.close(self.master)
        os.close(self._port)


class Flown(NamedTuple):
    """What became of a flight over the line, all after SETTLED_S of it.

    Rates [bytes/s]; lost: frames that the UART's buffer did not take; ages [s]: of the newest reading when an estimate
    is due, and of an estimate when it arrives; error_m: horizontal position of what arrived, less its mean.
    """

    asked_hz: dict[str, float]
    received_bytes_s: float
    written_bytes_s: float
    lost: int
    estimate_hz: float
    reading_age_s: np.ndarray
    estimate_age_s: np.ndarray
    most_backlog_s: float
    error_m: float
    damaged: Counter[str]
    session: Session


class Watched(Session):
    """A session that notes how old the newest reading is by the vehicle's own clock."""

    vehicle_now_s: Any = None
    ages_s: list[float]
    watching = False

    def tick(self, now_s: float) -> None:
        super().tick(now_s)
        if self.watching:
            self.ages_s.append(self.vehicle_now_s() - self.hearing.newest_s)


def fly_over(baud: int, vehicle: SimulatedVehicle, seconds: float, options: Options) -> Flown:
    """A simulated vehicle and a session at the two ends of a line, in real time."""
    uart = Uart(baud)
    link = open_link(f"serial:{uart.device}:{baud}")
    session = Watched(options, NoRecorder(), time.monotonic(), time.time())
    session.ages_s = []
    ended, began_s = threading.Event(), time.monotonic()
    session.vehicle_now_s = lambda: BOOT_S + time.monotonic() - began_s
    telling = threading.Thread(target=run_vehicle, args=(vehicle, uart, 1.0, ended.is_set))
    telling.start()
    backlog: list[int] = []
    marks: list[tuple[int, int, int]] = []

    def stop() -> bool:
        now_s = time.monotonic() - began_s
        if now_s >= SETTLED_S and not marks:
            marks.append((link.received, link.written, len(uart.dropped_s)))
            session.watching = True
        if marks:
            backlog.append(uart.backlog)
        return now_s >= seconds

    try:
        run_session(session, link, Latency(), stop)
    finally:
        ended.set()
        telling.join()
        lasted_s = seconds - SETTLED_S
        received, written, dropped = link.received, link.written, len(uart.dropped_s)
        link.close()
        uart.close()
    told = [(t_s, m) for t_s, m in vehicle.received if m.msgname == "ODOMETRY" and t_s > SETTLED_S]
    errors = [np.array([m.x, m.y]) - vehicle.truth_at(m.time_usec * 1e-6 - BOOT_S)[0][:2] for _, m in told]
    away = np.array(errors).reshape(-1, 2)
    return Flown(
        {name: rate_hz for name, (_, rate_hz) in session.rates.plan.streams.items()},
        (received - marks[0][0]) / lasted_s,
        (written - marks[0][1]) / lasted_s,
        dropped - marks[0][2],
        len(told) / lasted_s,
        np.array(session.ages_s),
        np.array([BOOT_S + t_s - m.time_usec * 1e-6 for t_s, m in told]),
        max(backlog) / (baud / 10),
        float(np.sqrt(np.mean(np.sum((away - away.mean(axis=0)) ** 2, axis=1)))) if len(away) else float("nan"),
        vehicle.damage + session.reception.counts,
        session,
    )


def options_of(setup: Any, baud: int) -> Options:
    """What a session needs to know of a simulated flight."""
    from flownav.sensors.identified import IdentifiedFlow

    ages_s = setup.fitted.ages_s
    return Options(
        gps_delay_s=float(ages_s[Sensor.GPS_POSITION]),
        identified=IdentifiedFlow(1.0, 1.0, float(ages_s[Sensor.FLOW_RATE])),
        settings=setup.fitted.told.settings,
        flow_noise=setup.fitted.told.noise,
        capacity_bytes_s=baud / 10,
    )
