"""Streams of a vehicle that moves level on a known path, its sensors exact, and a navigator run over them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flownav.core.compile import ONE_LANE
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import EventQueue, Sensor, Stream, merge
from flownav.estimation.covariance import variance_of
from flownav.estimation.gating import Reason
from flownav.estimation.states import STATE
from flownav.navigation.feed import equipment_of
from flownav.navigation.kernel_settings import NO_STATED_NOISE, Equipment, FlowNoise
from flownav.navigation.loop import Running, run, start_navigator
from flownav.navigation.rows import EXTRA_STATES, EstimateRow, EventRow, InnovationRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tape import EVENT_NAMES, new_tape

FIELD_GAUSS = np.array([0.21, 0.0, 0.43])
Path = Callable[[np.ndarray], np.ndarray]


def still(t_s: np.ndarray) -> np.ndarray:
    """A hover at 2 m."""
    return np.column_stack([0 * t_s, 0 * t_s, 0 * t_s - 2.0])


def circle(t_s: np.ndarray) -> np.ndarray:
    """Laps of 5 m radius at 2 m/s, 2 m above ground, from a soft start."""
    turned = 0.4 * np.clip(t_s, 0, None) ** 2 / (np.clip(t_s, 0, None) + 3.0)
    return np.column_stack([5.0 * np.sin(turned), 5.0 - 5.0 * np.cos(turned), 0 * t_s - 2.0])


@dataclass
class Flown:
    """The streams of a flight, and its truth on a fine grid."""

    streams: dict[Sensor, Stream]
    t_s: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    yaw: np.ndarray

    def without(self, *sensors: Sensor) -> Flown:
        return replace(self, streams={s: v for s, v in self.streams.items() if s not in sensors})

    def only(self, *sensors: Sensor) -> Flown:
        return replace(self, streams={s: v for s, v in self.streams.items() if s in sensors})

    def changed(self, sensor: Sensor, **columns) -> Flown:
        return replace(self, streams={**self.streams, sensor: replace(self.streams[sensor], **columns)})

    def added(self, stream: Stream) -> Flown:
        return replace(self, streams={**self.streams, stream.sensor: stream})

    def cut(self, sensor: Sensor, t0_s: float, t1_s: float) -> Flown:
        stream = self.streams[sensor]
        kept = (stream.t_s < t0_s) | (stream.t_s >= t1_s)
        names = ("t_s", "value", "variance", "quality")
        return self.changed(sensor, **{name: getattr(stream, name)[kept] for name in names})

    def at(self, t_s: np.ndarray, columns: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(t_s, self.t_s, column) for column in columns.T])


def fly(path: Path = still, duration_s: float = 20.0, yaw_rate: float = 0.0) -> Flown:
    """IMU 100 Hz, GPS 5 Hz, flow, range and LANDED-less 20 Hz, barometer and magnetometer 10 Hz, attitude 50 Hz."""
    t = np.arange(-1.0, duration_s + 1.0, 1e-3)
    position, yaw = path(t), yaw_rate * np.clip(t - 1.0, 0, None)
    velocity = np.gradient(position, t, axis=0)
    force = np.gradient(velocity, t, axis=0) - [0.0, 0.0, GRAVITY_M_S2]
    turning = np.gradient(yaw, t)
    zero = 0 * t
    body = body_axes(yaw, force)
    speed = body_axes(yaw, velocity)
    height = -position[:, 2]
    flow = np.column_stack([-speed[:, 1], speed[:, 0]]) / np.maximum(height, 0.05)[:, None]
    flown = Flown({}, t, position, velocity, yaw)

    def stream(sensor: Sensor, hz: float, *columns: np.ndarray) -> Stream:
        s = np.arange(0.0, duration_s, 1.0 / hz)
        return Stream.of(sensor, s, flown.at(s, np.column_stack(columns)))

    field = body_axes(yaw, np.tile(FIELD_GAUSS, (len(t), 1)))
    made = [
        stream(Sensor.IMU, 100.0, zero, zero, turning, body),
        stream(Sensor.ATTITUDE, 50.0, np.cos(yaw / 2), zero, zero, np.sin(yaw / 2)),
        stream(Sensor.GPS_VELOCITY, 5.0, velocity),
        stream(Sensor.GPS_POSITION, 5.0, position),
        stream(Sensor.RANGE, 20.0, height + 1e-4 * np.sin(40.0 * t)),  # no sensor repeats itself to the last digit
        stream(Sensor.BARO, 10.0, height + 100.0),
        stream(Sensor.MAG, 10.0, field),
    ]
    looked = stream(Sensor.FLOW_RATE, 20.0, flow, zero, zero)
    made.append(replace(looked, value=np.column_stack([looked.value, 0 * looked.value[:, :2]])))
    return replace(flown, streams={s.sensor: s for s in made})


def body_axes(yaw: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Earth to body of a level vehicle."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.column_stack([c * vector[:, 0] + s * vector[:, 1], -s * vector[:, 0] + c * vector[:, 1], vector[:, 2]])


@dataclass
class Navigated:
    """The navigator's outputs on a queue."""

    on: Running
    flown: Flown

    @property
    def t_s(self) -> np.ndarray:
        return self.estimate_rows.t_s

    @property
    def estimate_rows(self) -> EstimateRow[np.ndarray]:
        return EstimateRow.of(self.estimate)

    @property
    def offered(self) -> InnovationRow[np.ndarray]:
        return InnovationRow.of(self.offers)

    @property
    def estimate(self) -> np.ndarray:
        return self.on.tape.estimates()

    @property
    def offers(self) -> np.ndarray:
        return self.on.tape.offers()

    @property
    def error(self) -> np.ndarray:
        return self.estimate_rows.pos_ned_m - self.flown.at(self.t_s, self.flown.position)

    @property
    def velocity_error(self) -> np.ndarray:
        return self.estimate_rows.vel_ned_m_s - self.flown.at(self.t_s, self.flown.velocity)

    @property
    def yaw_error(self) -> np.ndarray:
        w, x, y, z = self.estimate_rows.quaternion.T
        yaw = np.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))
        difference = yaw - np.interp(self.t_s, self.flown.t_s, self.flown.yaw)
        return np.arctan2(np.sin(difference), np.cos(difference))

    def column(self, state: int, count: int = 1) -> np.ndarray:
        """States from GYRO_BIAS on, as the estimates have them, (n, count)."""
        first = EXTRA_STATES.index(state)
        return self.estimate_rows.states[:, first : first + count]

    def state(self, index: int) -> float:
        return float(self.on.work[STATE + index])

    def sigma(self, index: int) -> float:
        return float(np.sqrt(variance_of(self.on.work, ONE_LANE, index, 0)))

    def reasons(self, sensor: Sensor) -> dict[str, int]:
        rows = self.offered.reason[self.offered.sensor == sensor].astype(int)
        return {Reason(code).label: int(np.count_nonzero(rows == code)) for code in np.unique(rows)}

    def events(self, source: str, kind: str) -> np.ndarray:
        """Rows t_s, value of one kind of event."""
        happened = EventRow.of(self.on.tape.events())
        codes = [code for code, (s, k, _) in enumerate(EVENT_NAMES) if (s, k) == (source, kind)]
        assert codes, (source, kind)
        return np.column_stack([happened.t_s, happened.value])[happened.kind == codes[0]]


def equipment(flown: Flown, queue: EventQueue, **settings) -> Equipment:
    """The equipment of the streams."""
    return equipment_of(flown.streams, float(np.nanmin(queue.t_s)), False, NavigatorSettingsFile(**settings))


def navigate(
    flown: Flown, queue: EventQueue | None = None, noise: FlowNoise = NO_STATED_NOISE, **settings
) -> Navigated:
    """Run a new navigator over the streams, or over a queue made of them."""
    queue = merge(flown.streams.values()) if queue is None else queue
    fitted = equipment(flown, queue, **settings)
    on = start_navigator(fitted, NavigatorSettingsFile(**settings), new_tape(queue), noise)
    run(queue, on)
    return Navigated(on, flown)
