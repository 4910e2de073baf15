"""A small autopilot that hovers, and its wire to a session: datagrams in memory, on a clock of the test's own."""

from __future__ import annotations

import copy
import copyreg
import math
import random
import struct
from collections import deque
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from flownav.core.measurement import Measurement, Sensor
from flownav.live.byte_links import open_link
from flownav.live.filtering import Keeper
from flownav.live.link import UdpLink
from flownav.live.options import Options
from flownav.live.session import Session
from flownav.logs.mavlink import outgoing as say
from flownav.logs.mavlink.framing import coder
from flownav.logs.mavlink.signing import sign_outgoing

ORIGIN = (47.0, 8.5, 400.0)
HEIGHT_M = 2.0
UNIX_S = 1.8e9
START_S = 5000.0  # of the test's clock
STEP_S = 0.01
GRAVITY = 9.80665
METRES_A_DEGREE = 111_132.0


def reading(sensor: Sensor, *value: float, variance: float = math.nan) -> Measurement:
    return Measurement(0.0, sensor, value, (variance,) * len(value))


@dataclass
class Hover:
    """IMU and flow at 100 and 50 Hz, attitude 50 Hz, range 20 Hz, GPS 5 Hz; stamps are boot_s + the test's time."""

    boot_s: float = 20.0
    system: int = 1
    key: bytes | None = None
    gps: bool = True
    flow: bool = True
    imu: bool = True
    sigma_m: float = 0.5
    north_m: float = 0.0  # by so much GPS is off
    north_m_s: float = 0.0  # by so much its velocity is off
    noise: random.Random = field(default_factory=lambda: random.Random(4))
    steps: int = 0
    answers: bool = False  # TIMESYNC

    def __post_init__(self) -> None:
        self.mav: Any = coder(self.system, 1)

    def frames(self, t_s: float) -> list[bytes]:
        """The frames sent in the step of 10 ms that ends at a time since the start."""
        step, time_us = self.steps, round((self.boot_s + t_s) * 1e6)
        self.steps += 1
        if self.key is not None:
            sign_outgoing(self.mav, self.key, UNIX_S + t_s)
        shake = [self.noise.gauss(0.0, 1.0) for _ in range(6)]
        messages = [say.heartbeat(self.mav, armed=True)] if step % 100 == 0 else []
        if self.imu:
            rates = [0.002 * value for value in shake[:3]]
            force = [0.02 * shake[3], 0.02 * shake[4], -GRAVITY + 0.02 * shake[5]]
            messages.append(say.highres_imu(self.mav, time_us, reading(Sensor.IMU, *rates, *force)))
        if step % 2 == 0:
            messages.append(say.attitude_quaternion(self.mav, time_us // 1000, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        if step % 2 == 0 and self.flow:
            flow = reading(Sensor.FLOW_RATE, 0.01 * shake[0], 0.01 * shake[1], 0.002 * shake[0], 0.002 * shake[1])
            messages.append(say.optical_flow_rad(self.mav, time_us, flow, 0.02))
        if step % 5 == 0:
            seen = reading(Sensor.RANGE, HEIGHT_M + 0.02 * shake[2])
            messages.append(say.distance_sensor(self.mav, time_us // 1000, seen, (0.1, 40.0)))
        if step % 20 == 0 and self.gps:
            velocity = reading(
                Sensor.GPS_VELOCITY, self.north_m_s + 0.05 * shake[3], 0.05 * shake[4], math.nan, variance=0.04
            )
            place = (ORIGIN[0] + self.north_m / METRES_A_DEGREE, *ORIGIN[1:])
            messages.append(
                say.gps_raw_int(
                    self.mav, time_us, place, velocity, horizontal_sigma_m=self.sigma_m, vertical_sigma_m=self.sigma_m
                )
            )
        return [bytes(message.pack(self.mav)) for message in messages]


class Datagrams:
    """A socket of a net in memory: what is sent to its address is there at once and in order, on any machine."""

    def __init__(self, net: dict[Any, Datagrams], to: Any = None) -> None:
        self._net, self._to = net, to
        self._address = ("127.0.0.1", 50_000 + len(net))
        self._waiting: deque[tuple[bytes, Any]] = deque()
        net[self._address] = self

    def getsockopt(self, *_: int) -> bytes:
        return bytes(36)  # nothing was lost

    def getsockname(self) -> Any:
        return self._address

    def sendto(self, content: bytes, address: Any) -> int:
        self._net[address]._waiting.append((content, self._address))
        return len(content)

    def send(self, content: bytes) -> int:
        return self.sendto(content, self._to)

    def recvfrom(self, most: int) -> tuple[bytes, Any]:
        if not self._waiting:
            raise BlockingIOError
        content, sender = self._waiting.popleft()
        return content[:most], sender

    def recv(self, most: int) -> bytes:
        return self.recvfrom(most)[0]

    def close(self) -> None:
        self._waiting.clear()


class Wire:
    """A session behind a UDP link, and a vehicle's socket. `heard` are the messages that the vehicle received."""

    def __init__(
        self, vehicle: Hover, options: Options | None = None, keeper: Any = None, reads_bytes_s: float = math.inf
    ) -> None:
        self.vehicle, self.t_s = vehicle, 0.0
        self.reads_bytes_s, self._unread = reads_bytes_s, 0.0
        self.session = Session(options or Options(), keeper or Keeper(), START_S, UNIX_S)
        link = open_link("udp:0")
        assert isinstance(link, UdpLink)
        link.close()
        self.link = link
        self._net: dict[Any, Datagrams] = {}
        self.link._socket = Datagrams(self._net)
        self.socket = self.another()
        self.heard: list[Any] = []
        self.heard_s: list[float] = []
        self.frames: list[bytes] = []
        self.turns = 0
        self.last: tuple[bytes, ...] = ()
        self._coder = coder()

    def another(self) -> Datagrams:
        """A socket that talks to the session."""
        return Datagrams(self._net, self.link._socket.getsockname())

    @property
    def now_s(self) -> float:
        return START_S + self.t_s

    def send(self, *pieces: bytes) -> None:
        for piece in pieces:
            self.socket.send(piece)
        self.last = pieces
        self.pump()

    def pump(self) -> None:
        """The session's turn, as the loop gives it."""
        while True:
            if self.session.turns > self.turns:
                self.turns = self.session.turns
                self.link.forget()
            pieces, strange = self.link.read(), self.link.overheard()
            for piece, sender in pieces:
                if self.session.take(piece, self.now_s, whole=True):
                    self.link.believe(sender)
            for piece in strange:
                self.session.overhear(piece)
            if not pieces and not strange:
                break
        self.session.tick(self.now_s)
        while self.session.outbox:
            self.link.write(self.session.outbox.popleft())
        self._unread = min(self._unread + self.reads_bytes_s * STEP_S, 0.0 + max(self.reads_bytes_s, 1.0))
        while self._unread > 0.0:
            try:
                frame = self.socket.recv(4096)
            except BlockingIOError:
                return
            self._unread -= len(frame)
            self.frames.append(frame)
            self.heard.append(self._coder.decode(bytearray(frame)))
            self.heard_s.append(self.t_s)
            if self.vehicle.answers and self.heard[-1].msgname == "TIMESYNC" and not self.heard[-1].tc1:
                reply = say.timesync_reply(
                    self.vehicle.mav, self.heard[-1], round((self.vehicle.boot_s + self.t_s) * 1e9)
                )
                self.socket.send(bytes(reply.pack(self.vehicle.mav)))

    def fly(self, seconds: float, *, silent: bool = False, beside: Any = None) -> Wire:
        """Time passes; the vehicle talks, unless it is silent. `beside` is called at each step."""
        for _ in range(round(seconds / STEP_S)):
            self.t_s += STEP_S
            if beside is not None:
                beside()
            if silent:
                self.pump()
            else:
                self.send(*self.vehicle.frames(self.t_s))
        return self

    def estimates(self, since_s: float = 0.0) -> list[Any]:
        found = zip(self.heard, self.heard_s, strict=True)
        return [message for message, t_s in found if message.msgname == "ODOMETRY" and t_s > since_s]

    def close(self) -> None:
        self.link.close()
        self.socket.close()


# -- a flight that several tests begin with ------------------------------------------------------------------
copyreg.pickle(struct.Struct, lambda packing: (struct.Struct, (packing.format,)))  # pymavlink's messages hold them


def copied(wire: Wire) -> Wire:
    """A wire that goes on as this one does, and shares nothing with it but the messages that were received."""
    return copy.deepcopy(wire, {id(message): message for message in wire.heard})


@cache
def _flown(seconds: int, vehicle: type[Hover], keeper: type[Keeper], options: Options) -> Wire:
    if seconds == 0:
        return Wire(vehicle(), options, keeper())
    return copied(_flown(seconds - 1, vehicle, keeper, options)).fly(1.0)


def hovering(
    seconds: int, vehicle: type[Hover] = Hover, keeper: type[Keeper] = Keeper, options: Options | None = None
) -> Wire:
    """A wire of one's own, whose vehicle has hovered undisturbed for so long: flown once, and copied."""
    return copied(_flown(seconds, vehicle, keeper, options or Options()))
