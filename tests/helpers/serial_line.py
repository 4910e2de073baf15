"""A serial line of a baud rate, its far end an autopilot's UART: on a virtual clock, or a pseudo-terminal in real time.

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
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.core.measurement import Sensor
from flownav.live.byte_links import SerialLink, open_link
from flownav.live.filtering import Keeper
from flownav.live.link import Link, parse_url
from flownav.live.loop import Latency, run_session, run_vehicle
from flownav.live.options import Options
from flownav.live.session import Session
from flownav.live.simulated import BOOT_S, SimulatedVehicle

BUFFER_BYTES = 1024
SETTLED_S = 5.0  # by then the rates have been asked for, and what was sent before them has passed
BURST_S = 0.02  # of a line's pace that may pass at once, where it was not looked at for a while
STEP_S = 0.001  # of the virtual clock
UNIX_S = 1.8e9


class Pace:
    """How many bytes of a line may pass by now, one way."""

    def __init__(self, baud: int, now_s: float) -> None:
        self._bytes_s, self._at_s, self._credit = baud / 10, now_s, 0.0

    def may(self, now_s: float) -> int:
        """Whole bytes."""
        earned, self._at_s = self._bytes_s * (now_s - self._at_s), now_s
        self._credit = min(self._credit + earned, max(1.0, BURST_S * self._bytes_s))
        return int(self._credit)

    def passed(self, piece: bytes) -> bytes:
        """The piece, which has now passed."""
        self._credit -= len(piece)
        return piece


class Uart(Link):
    """The autopilot's end: what it writes waits in its buffer. `dropped`: frames that did not fit."""

    def __init__(self, baud: int, clock: Callable[[], float]) -> None:
        super().__init__()
        self._clock = clock
        self._most = max(BUFFER_BYTES, int(0.1 * baud / 10))
        self._out = b""
        self._out_pace, self._in_pace = Pace(baud, clock()), Pace(baud, clock())
        self.dropped = 0

    def fileno(self) -> int:
        return -1  # its loop sleeps: select would wake for what it may not take yet

    def write(self, frame: bytes) -> None:
        if len(self._out) + len(frame) > self._most:
            self.dropped += 1
            return
        self._out += frame

    def goes_out(self) -> bytes:
        """Bytes that have gone out onto the line since the last call."""
        many = self._out_pace.may(self._clock())
        piece, self._out = self._out[:many], self._out[many:]
        return self._out_pace.passed(piece)

    def comes_in(self, take: Callable[[int], bytes]) -> bytes:
        """Bytes that have come from the line since the last call. take: returns at most this number of the written
        bytes.
        """
        many = self._in_pace.may(self._clock())
        return self._in_pace.passed(take(many)) if many else b""

    @property
    def backlog(self) -> int:
        """Bytes that we have written and it has not taken."""
        raise NotImplementedError


class RealUart(Uart):
    """Behind a pseudo-terminal, on the machine's clock."""

    def __init__(self, baud: int) -> None:
        super().__init__(baud, time.monotonic)
        self.master, self._port = os.openpty()
        self.device = os.ttyname(self._port)
        os.set_blocking(self.master, False)

    def read(self) -> list[Any]:
        if sent := self.goes_out():
            os.write(self.master, sent)
        piece = self.comes_in(self._waiting)
        return [(piece, None)] if piece else []

    def _waiting(self, many: int) -> bytes:
        try:
            return os.read(self.master, many)
        except BlockingIOError:
            return b""

    @property
    def backlog(self) -> int:
        waiting = array.array("i", [0])
        fcntl.ioctl(self.master, termios.FIONREAD, waiting)
        return waiting[0]

    def close(self) -> None:
        os.close(self.master)
        os.close(self._port)


class VirtualUart(Uart):
    """A port without a line: time passes where it is read, and the vehicle behind it lives through that time."""

    def __init__(self, baud: int, vehicle: SimulatedVehicle) -> None:
        self.now_s = 0.0
        super().__init__(baud, lambda: self.now_s)
        self._vehicle, self._waiting = vehicle, bytearray()
        self._always_ready = os.open(os.devnull, os.O_RDONLY)

    def fileno(self) -> int:
        return self._always_ready  # the loop waits for nothing

    def take(self, content: bytes) -> int:
        """Take the bytes that the session writes."""
        self._waiting += content
        return len(content)

    def read(self, most: int) -> bytes:
        """Bytes that have come by the next step of the clock."""
        self.now_s += STEP_S
        heard = self._vehicle.hear(self.comes_in(self._taken), self.now_s)
        for frame in [*heard, *self._vehicle.due(self.now_s, UNIX_S + self.now_s)]:
            self.write(frame)
        return self.goes_out()

    def _taken(self, many: int) -> bytes:
        piece = bytes(self._waiting[:many])
        del self._waiting[:many]
        return piece

    @property
    def backlog(self) -> int:
        return len(self._waiting)

    def close(self) -> None:
        os.close(self._always_ready)


class VirtualSerialLink(SerialLink):
    """A serial link whose port is a virtual UART, and whose time is its clock."""

    def __init__(self, baud: int, uart: VirtualUart) -> None:
        self._uart, self.clock = uart, lambda: uart.now_s
        super().__init__(parse_url(f"serial:virtual:{baud}"))

    def _opened(self) -> VirtualUart:
        return self._uart

    def _sent(self, content: bytes) -> int:
        return self._uart.take(content)


class Flown(NamedTuple):
    """The result of a flight over the line, all after SETTLED_S of it.

    Rates [bytes/s]; lost: frames that the UART's buffer did not take; ages [s]: of the newest reading when an estimate
    is due, and of an estimate when it arrives; error_m: horizontal position of what arrived, less its mean;
    velocity_error_m_s: of all three axes, rms.
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
    velocity_error_m_s: float
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
            self.ages_s.append(self.vehicle_now_s() - self.intake.newest_s)


class Flight:
    """A session at our end of a line; it is watched once it has settled, for a given time."""

    def __init__(
        self, vehicle: SimulatedVehicle, uart: Uart, link: Link, options: Options, clock: Callable[[], float]
    ) -> None:
        self.vehicle, self.uart, self.link, self.clock = vehicle, uart, link, clock
        self.began_s = clock()
        self.session = Watched(options, Keeper(), self.began_s, UNIX_S)
        self.session.ages_s = []
        self.session.vehicle_now_s = lambda: BOOT_S + clock() - self.began_s
        self._backlog: list[int] = []
        self._settled: tuple[int, int, int] | None = None
        self.lasted_s = 0.0

    def counts(self) -> tuple[int, int, int]:
        """Bytes received and written so far, and frames dropped."""
        return self.link.received, self.link.written, self.uart.dropped

    def fly(self, seconds: float, estimates: int = 0) -> None:
        """Run until this time has passed and this number of estimates has arrived, or the vehicle's flight is over."""

        def stop() -> bool:
            now_s = self.clock() - self.began_s
            if now_s >= SETTLED_S and self._settled is None:
                self._settled, self.session.watching = self.counts(), True
            if self._settled is not None:
                self._backlog.append(self.uart.backlog)
            self.lasted_s = now_s - SETTLED_S
            return now_s >= seconds and (len(self.arrived()) >= estimates or self.vehicle.finished)

        run_session(self.session, self.link, Latency(), stop, clock=self.clock)

    def arrived(self) -> list[tuple[float, Any]]:
        """The estimates that the vehicle received since the line has settled, and when."""
        received = list(self.vehicle.received)
        return [(t_s, m) for t_s, m in received if m.msgname == "ODOMETRY" and t_s > SETTLED_S]

    def flown(self, baud: int) -> Flown:
        """The result of the flight."""
        vehicle, session, lasted_s = self.vehicle, self.session, self.lasted_s
        assert self._settled is not None
        received, written, dropped = (now - then for now, then in zip(self.counts(), self._settled, strict=True))
        told = self.arrived()
        truths = [vehicle.truth_at(m.time_usec * 1e-6 - BOOT_S) for _, m in told]
        errors = [np.array([m.x, m.y]) - position[:2] for (_, m), (position, _) in zip(told, truths, strict=True)]
        away = np.array(errors).reshape(-1, 2)
        moving = [
            np.array(to_earth(rotation_from_quaternion(*m.q), m.vx, m.vy, m.vz)) - velocity
            for (_, m), (_, velocity) in zip(told, truths, strict=True)
        ]
        return Flown(
            {name: rate_hz for name, (_, rate_hz) in session.rates.plan.streams.items()},
            received / lasted_s,
            written / lasted_s,
            dropped,
            len(told) / lasted_s,
            np.array(session.ages_s),
            np.array([BOOT_S + t_s - m.time_usec * 1e-6 for t_s, m in told]),
            max(self._backlog) / (baud / 10),
            float(np.sqrt(np.mean(np.sum((away - away.mean(axis=0)) ** 2, axis=1)))) if len(away) else float("nan"),
            float(np.sqrt(np.mean(np.sum(np.square(moving), axis=1)))) if moving else float("nan"),
            vehicle.damage + session.reception.counts,
            session,
        )


def fly_virtually(baud: int, vehicle: SimulatedVehicle, seconds: float, options: Options) -> Flown:
    """A simulated vehicle and a session at the two ends of a line, on a virtual clock: every run is the same."""
    uart = VirtualUart(baud, vehicle)
    link = VirtualSerialLink(baud, uart)
    flight = Flight(vehicle, uart, link, options, link.clock)
    try:
        flight.fly(seconds)
    finally:
        link.close()
    return flight.flown(baud)


def fly_over(baud: int, vehicle: SimulatedVehicle, seconds: float, options: Options, estimates: int = 0) -> Flown:
    """A simulated vehicle and a session at the two ends of a line, in real time, as `Flight.fly` ends it."""
    uart = RealUart(baud)
    link = open_link(f"serial:{uart.device}:{baud}")
    flight = Flight(vehicle, uart, link, options, time.monotonic)
    ended = threading.Event()
    telling = threading.Thread(target=run_vehicle, args=(vehicle, uart, 1.0, ended.is_set))
    telling.start()
    try:
        flight.fly(seconds, estimates)
    finally:
        ended.set()
        telling.join()
        link.close()
        uart.close()
    return flight.flown(baud)


def options_of(setup: Any, baud: int) -> Options:
    """The session's options that a simulated flight needs."""
    from flownav.sensors.datasheet import IdentifiedFlow

    ages_s = setup.fitted.ages_s
    return Options(
        gps_delay_s=float(ages_s[Sensor.GPS_POSITION]),
        identified=IdentifiedFlow(1.0, 1.0, float(ages_s[Sensor.FLOW_RATE])),
        settings=setup.fitted.given.settings,
        flow_noise=setup.fitted.given.noise,
        capacity_bytes_s=baud / 10,
    )
