"""The other end of a link: a simulated flight, sent in real time as the vehicle's autopilot would send it.

Its sensor readings go out when they arrived, and the attitude that its autopilot used; it answers TIMESYNC and
MAV_CMD_SET_MESSAGE_INTERVAL, and sends the truth (SIM_STATE), so that the returned estimate can be judged.
"""

import heapq
from collections import Counter, deque
from typing import Any, NamedTuple

import numpy as np

from flownav.core.frames import euler_from_quaternion, rotation_from_quaternion, to_earth
from flownav.core.measurement import Array, Measurement, Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY
from flownav.logs.log import Log
from flownav.logs.mavlink import outgoing as say
from flownav.logs.mavlink.framing import Message, StreamFrames, coder
from flownav.logs.mavlink.signing import sign_outgoing

ORIGIN_DEG_M = (29.9765, 31.2780, 40.0)
SYSTEM, COMPONENT = 1, 1
BOOT_S = 20.0  # the vehicle's time since boot when the flight begins
SET_MESSAGE_INTERVAL = 511
ACCEPTED, UNSUPPORTED = 0, 3
RATES_HZ = {"HEARTBEAT": 1.0, "EXTENDED_SYS_STATE": 5.0, "SIM_STATE": 50.0, "ATTITUDE_QUATERNION": 50.0}
NUMBERS = {105: "HIGHRES_IMU", 31: "ATTITUDE_QUATERNION", 24: "GPS_RAW_INT", 106: "OPTICAL_FLOW_RAD",
           132: "DISTANCE_SENSOR", 245: "EXTENDED_SYS_STATE", 108: "SIM_STATE"}  # fmt: skip
OF_SENSOR = {
    Sensor.IMU: "HIGHRES_IMU",
    Sensor.GPS_POSITION: "GPS_RAW_INT",
    Sensor.FLOW_RATE: "OPTICAL_FLOW_RAD",
    Sensor.RANGE: "DISTANCE_SENSOR",
}
KEPT_ESTIMATES = 20_000  # estimates received
INTERVAL_FRACTION = 0.9  # of an interval that must have passed: schedules jitter; chosen


class Due(NamedTuple):
    """A message at its time of the flight [s]."""

    t_s: float
    order: int
    name: str
    row: int


class SimulatedVehicle:
    """A flight as a list of messages. log: with an IMU, GPS, a skid switch and truth; other sensors are sent too."""

    def __init__(self, log: Log, *, key: bytes | None = None, system: int = SYSTEM, boot_s: float = BOOT_S) -> None:
        self._log, self._key, self._boot_s = log, key, boot_s
        self.mav: Any = coder(system, COMPONENT)
        self._frames, self._coder = StreamFrames(), coder()
        self._interval_s: dict[str, float] = {}
        self._last_s: dict[str, float] = {}
        self.counts: Counter[str] = Counter()
        self.received: deque[tuple[float, Message]] = deque(maxlen=KEPT_ESTIMATES)
        truth = log.truth
        assert truth is not None
        self._truth_s = truth["t_s"]
        self._position = np.column_stack([truth[name] for name in POSITION_NED])
        self._velocity = np.column_stack([truth[name] for name in VELOCITY_BODY])
        self._quaternion = np.column_stack([truth[name] for name in QUATERNION])
        self.end_s = float(self._truth_s[-1])
        self._imu_sent_s = float("-inf")
        self._origin_deg_m = log.origin_deg_m or ORIGIN_DEG_M
        self._due: list[Due] = self._schedule()

    def _schedule(self) -> list[Due]:
        due: list[Due] = []
        for sensor, name in OF_SENSOR.items():
            stream = self._log.streams.get(sensor)
            for row, t_s in enumerate(stream.t_s if stream is not None else ()):
                due.append(Due(float(t_s), len(due), name, row))
        for name in RATES_HZ:
            for step in range(int(self.end_s * RATES_HZ[name]) + 1):
                due.append(Due(step / RATES_HZ[name], -1 if name == "HEARTBEAT" else len(due), name, step))
        heapq.heapify(due)
        return due

    @property
    def damage(self) -> Counter[str]:
        """Frames that arrived damaged, by reason."""
        return self._frames.damage

    @property
    def finished(self) -> bool:
        """Whether every message has been sent."""
        return not self._due

    def truth_at(self, t_s: float) -> tuple[Array, Array]:
        """True position NED [m] and velocity NED [m/s] at a time of the flight."""
        row = int(np.clip(np.searchsorted(self._truth_s, t_s), 0, len(self._truth_s) - 1))
        rotation = rotation_from_quaternion(*self._quaternion[row])
        return self._position[row], np.array(to_earth(rotation, *self._velocity[row]))

    def due(self, t_s: float, unix_s: float) -> list[bytes]:
        """The frames up to a time of the flight; signed with the key, at a UNIX time."""
        if self._key is not None:
            sign_outgoing(self.mav, self._key, unix_s)
        frames = []
        while self._due and self._due[0].t_s <= t_s:
            found = heapq.heappop(self._due)
            interval_s = self._interval_s.get(found.name, 0.0)
            if found.t_s - self._last_s.get(found.name, -np.inf) < INTERVAL_FRACTION * interval_s or interval_s < 0.0:
                continue
            self._last_s[found.name] = found.t_s
            message = self._message(found)
            if message is not None:
                frames.append(bytes(message.pack(self.mav)))
        return frames

    def hear(self, piece: bytes, t_s: float) -> list[bytes]:
        """The answers to the bytes that arrive at a time of the flight, whole frames or pieces of them."""
        answers = []
        for _, content in self._frames.feed(piece):
            message = self._coder.decode(bytearray(content))
            self.counts[message.msgname] += 1
            if message.msgname == "TIMESYNC":
                answers.append(say.timesync_reply(self.mav, message, round((self._boot_s + t_s) * 1e9)))
            elif message.msgname == "COMMAND_LONG":
                answers.append(self._commanded(message))
            elif message.msgname != "HEARTBEAT":
                self.received.append((t_s, message))
        return [bytes(answer.pack(self.mav)) for answer in answers if answer is not None]

    def _commanded(self, message: Message) -> Message:
        name = NUMBERS.get(int(message.param1)) if message.command == SET_MESSAGE_INTERVAL else None
        if name is not None:
            self._interval_s[name] = message.param2 * 1e-6
        return self.mav.command_ack_encode(message.command, ACCEPTED if name else UNSUPPORTED)

    # -- messages ---------------------------------------------------------------------------------------------
    def _reading(self, sensor: Sensor, row: int) -> Measurement:
        stream = self._log.streams[sensor]
        value, variance = tuple(map(float, stream.value[row])), tuple(map(float, stream.variance[row]))
        return Measurement(float(stream.t_s[row]), sensor, value, variance, stream.delay_s, float(stream.quality[row]))

    def _message(self, due: Due) -> Message | None:
        time_us, time_ms = round((self._boot_s + due.t_s) * 1e6), round((self._boot_s + due.t_s) * 1e3)
        if due.name == "HEARTBEAT":
            return say.heartbeat(self.mav, armed=True)
        if due.name == "HIGHRES_IMU":
            return self._imu(due, time_us)
        if due.name == "ATTITUDE_QUATERNION":
            return self._attitude(due.t_s, time_ms)
        if due.name == "OPTICAL_FLOW_RAD":
            return self._flow(due.row, time_us)
        if due.name == "DISTANCE_SENSOR":
            reading = self._reading(Sensor.RANGE, due.row)
            return say.distance_sensor(self.mav, time_ms, reading, self._log.limits["range_m"])
        if due.name == "GPS_RAW_INT":
            return self._fix(due.row, time_us)
        if due.name == "EXTENDED_SYS_STATE":
            landed = self._log.streams[Sensor.LANDED]
            return say.extended_sys_state(self.mav, landed=bool(landed.value[_newest(landed, due.t_s), 0] > 0.5))
        return self._truth(due.t_s)

    def _imu(self, due: Due, time_us: int) -> Message:
        """The IMU with the field and the pressure that have come since it was last sent."""

        def news(sensor: Sensor) -> tuple[float, ...] | None:
            stream = self._log.streams.get(sensor)
            if stream is None or not len(stream):
                return None
            row = _newest(stream, due.t_s)
            return tuple(map(float, stream.value[row])) if self._imu_sent_s < stream.t_s[row] <= due.t_s else None

        field, altitude = news(Sensor.MAG), news(Sensor.BARO)
        self._imu_sent_s = due.t_s
        return say.highres_imu(
            self.mav, time_us, self._reading(Sensor.IMU, due.row),
            mag_gauss=None if field is None else (field[0], field[1], field[2]),
            altitude_m=None if altitude is None else altitude[0],
        )  # fmt: skip

    def _attitude(self, t_s: float, time_ms: int) -> Message | None:
        """The autopilot's attitude message: the attitude that it uses to fly."""
        own = self._log.autopilot
        if own is None:
            return None
        row = int(np.clip(np.searchsorted(own["t_s"], t_s, side="right") - 1, 0, len(own["t_s"]) - 1))
        w, x, y, z = (float(own[name][row]) for name in QUATERNION)
        imu = self._log.streams[Sensor.IMU]
        p, q, r = map(float, imu.value[_newest(imu, t_s), :3])
        return say.attitude_quaternion(self.mav, time_ms, (w, x, y, z), (p, q, r))

    def _flow(self, row: int, time_us: int) -> Message:
        """Flow and its turning over an exposure, which lasts from one reading to the next."""
        times = self._log.streams[Sensor.FLOW_RATE].t_s
        exposure_s = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
        return say.optical_flow_rad(self.mav, time_us, self._reading(Sensor.FLOW_RATE, row), exposure_s)

    def _fix(self, row: int, time_us: int) -> Message:
        import pymap3d

        position, velocity = self._reading(Sensor.GPS_POSITION, row), self._reading(Sensor.GPS_VELOCITY, row)
        fix = pymap3d.ned2geodetic(*position.value, *self._origin_deg_m)
        across, _, along = np.sqrt(position.variance)
        place = (float(fix[0]), float(fix[1]), float(fix[2]))
        return say.gps_raw_int(
            self.mav, time_us, place, velocity, horizontal_sigma_m=float(across), vertical_sigma_m=float(along)
        )

    def _truth(self, t_s: float) -> Message:
        import pymap3d

        row = int(np.clip(np.searchsorted(self._truth_s, t_s), 0, len(self._truth_s) - 1))
        w, x, y, z = map(float, self._quaternion[row])
        north, east, down = map(float, self.truth_at(t_s)[1])
        imu = self._log.streams[Sensor.IMU]
        moved = imu.value[_newest(imu, t_s)]
        place = pymap3d.ned2geodetic(*self._position[row], *self._origin_deg_m)
        angles = tuple(float(angle) for angle in euler_from_quaternion(w, x, y, z))
        return say.sim_state(
            self.mav, tuple(map(float, place)), (north, east, down), (w, x, y, z), angles,  # type: ignore[arg-type]
            tuple(map(float, moved[:3])), tuple(map(float, moved[3:])),  # type: ignore[arg-type]
        )  # fmt: skip


def _newest(stream: Stream, t_s: float) -> int:
    """The row of the newest reading that has arrived; the first before that."""
    return max(int(np.searchsorted(stream.t_s, t_s, side="right")) - 1, 0)
