"""The navigator behind the horizon: what it is fed, in batches of one queue, and what comes of it."""

from collections import deque
from typing import NamedTuple

import numpy as np

from flownav.core.compile import ONE_LANE
from flownav.core.frames import Vector
from flownav.core.measurement import COLUMNS, MAX_VALUES, Array, EventQueue, Sensor, Stream
from flownav.estimation.states import POSITION, STATE
from flownav.live.horizon import Waiting
from flownav.live.options import Options
from flownav.logs.log import attitude_rates, mean_over
from flownav.logs.mavlink.messages import TrueState
from flownav.navigation.feed import equipment_of
from flownav.navigation.loop import Running, run, start_navigator
from flownav.navigation.memory import load_start
from flownav.navigation.rows import EventRow
from flownav.navigation.spikes import Witness
from flownav.navigation.tables import written_on
from flownav.navigation.tape import COMPONENTS, GPS_RESET, START, empty_tape
from flownav.navigation.told import Equipment
from flownav.sensors.datasheet import UNTURNED, in_vehicle_axes

NAN = float("nan")
BATCH_READINGS = 64  # readings at a time, 6 ms of them; all at once, the first estimates stop the loop for 130 ms
KEPT_IMU = 512  # two seconds at 250 Hz, more than the horizon and an exposure
KEPT_ATTITUDES = 128  # more than two seconds at 50 Hz
FLOW = (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)
JUMPS = (int(START), int(GPS_RESET))  # events at which the estimate jumps


class Keeper:
    """Who keeps a session's story, and what the navigator was fed and wrote: nobody; recorder.Recorder keeps all."""

    def segment(self, equipment: Equipment) -> None:
        """A navigator begins; what is fed from now on is fed to it."""

    def fed(self, queue: EventQueue, arrival_s: Array) -> None:
        """A batch is about to be fed."""

    def written(self, estimate: Array, innovation: Array, event: Array) -> None:
        """What came of it."""

    def note(self, t_s: float, source: str, kind: str, detail: str, value: float = NAN) -> None:
        """A happening."""

    def origin(self, t_s: float, origin_deg_m: tuple[float, float, float]) -> None:
        """The navigator's frame has this origin from now on."""

    def truth(self, t_s: float, state: TrueState) -> None:
        """What a simulator says is so."""


class Outcome(NamedTuple):
    """What the last batch brought: rows of the tape's innovation and event."""

    innovation: Array
    event: Array


class Filtering:
    """One navigator from start to restart."""

    def __init__(self, options: Options, keeper: Keeper) -> None:
        self._options = options
        self._keeper = keeper
        self.running: Running | None = None
        self.jumps = 0
        self._imu: deque[tuple[float, ...]] = deque(maxlen=KEPT_IMU)  # without spikes
        self._witness, self._row_of_imu = Witness(), np.zeros((1, 7))
        self._attitude: deque[tuple[float, ...]] = deque(maxlen=KEPT_ATTITUDES)
        most = max(COMPONENTS.values())
        self._tape = empty_tape(BATCH_READINGS + 2, most * BATCH_READINGS, 8 * BATCH_READINGS + 8)
        self._room = _empty_queue(BATCH_READINGS)
        self._arrival_s = np.zeros(BATCH_READINGS)

    def heard(self, waiting: Waiting) -> None:
        """A reading has arrived: IMU and attitude are kept for the flow's exposure and for the way from then to now."""
        reading = waiting.reading
        if reading.sensor == Sensor.IMU and (not self._imu or waiting.t_s > self._imu[-1][0]):
            self._row_of_imu[0, 0], self._row_of_imu[0, 1:] = waiting.t_s, reading.value
            if self._witness.keeps(self._row_of_imu)[0]:
                self._imu.append((waiting.t_s, *reading.value))
        elif reading.sensor == Sensor.ATTITUDE and (not self._attitude or waiting.t_s > self._attitude[-1][0]):
            self._attitude.append((waiting.t_s, *reading.value))

    def begin(
        self, listened: list[Waiting], gps_heard: bool, origin_deg_m: tuple[float, float, float] | None = None
    ) -> None:
        """A navigator for the sensors that were listened to. gps_heard: a receiver is there, with a fix or without."""
        streams = _streams(listened)
        if gps_heard and Sensor.GPS_POSITION not in streams:
            streams[Sensor.GPS_POSITION] = Stream.of(Sensor.GPS_POSITION, np.zeros(0), np.zeros((0, 3)))
        first_s = listened[0].t_s
        settings = self._options.settings
        equipment = equipment_of(streams, first_s, _own_gyro_is_dead(streams), settings, origin_deg_m)
        if gps_heard:
            equipment = equipment._replace(deadline_s=first_s + float(settings.start_wait_s))
        self.running = start_navigator(equipment, settings, self._tape, self._options.flow_noise)
        self._keeper.segment(equipment)

    def stop(self) -> None:
        """No navigator until the next `begin`."""
        self.running = None
        self.jumps += 1
        self._imu.clear()
        self._witness = Witness()
        self._attitude.clear()

    def feed(self, released: list[Waiting]) -> Outcome:
        """At most BATCH_READINGS readings, in the order of their instants."""
        on = self.running
        assert on is not None
        room = self._room
        for row, waiting in enumerate(released):
            room.t_s[row], room.sensor[row] = waiting.t_s, waiting.reading.sensor
            room.value[row], room.variance[row] = self._row(waiting)
            room.quality[row], self._arrival_s[row] = waiting.reading.quality, waiting.reading.t_s
        count = len(released)
        queue = EventQueue(
            room.t_s[:count], room.sensor[:count], room.value[:count], room.variance[:count], room.quality[:count],
            room.row[:count], room.withheld[:count], room.arrived[:count],
        )  # fmt: skip
        self._keeper.fed(queue, self._arrival_s[:count])
        on.tape.used[:] = 0
        run(queue, on)
        written = written_on(on.tape)
        outcome = Outcome(written.innovation, written.event)
        self._keeper.written(*written)
        self.jumps += sum(kind in JUMPS for kind in EventRow.of(outcome.event).kind.tolist())
        return outcome

    def imu_after(self, t_s: float) -> Array:
        """IMU readings later than an instant, (n, 7)."""
        later = []
        for row in reversed(self._imu):
            if row[0] <= t_s:
                break
            later.append(row)
        return np.array(later[::-1]) if later else np.zeros((0, 7))

    @property
    def clock_s(self) -> float:
        """The instant that the navigator has reached; NaN without one."""
        return self.running.clock_s if self.running is not None else float("nan")

    @property
    def here_ned_m(self) -> Vector | None:
        """Where a started navigator is, about its own origin [m]; None before."""
        on = self.running
        if on is None or load_start(on.work, ONE_LANE, 0).started == 0.0:
            return None
        north, east, down = (float(value) for value in on.work[STATE + POSITION : STATE + POSITION + 3])
        return north, east, down

    @property
    def lacks_imu(self) -> bool:
        """Whether a navigator runs that was told that no IMU serves."""
        return self.running is not None and not self.running.told.equipment.use_imu

    def imu_rate_hz(self, t_s: float) -> float:
        """Rate of the IMU's readings in the two seconds before an instant."""
        return 0.5 * sum(row[0] > t_s - 2.0 for row in self._imu)

    # -- what a reading becomes -------------------------------------------------------------------------------
    def _row(self, waiting: Waiting) -> tuple[list[float], list[float]]:
        """Values and variances, MAX_VALUES each; flow in the vehicle's axes, with the turning over its exposure."""
        reading, known = waiting.reading, self._options.identified
        value = list(reading.value)
        if reading.sensor in FLOW and known is not None and known.axes != UNTURNED:
            angular = reading.sensor == Sensor.FLOW_RATE
            value = in_vehicle_axes(np.array([value]), known, angular=angular)[0].tolist()
        if reading.sensor == Sensor.FLOW_RATE:
            value = self._with_turning(value, reading.t_s, waiting.exposure_s)
        spare = MAX_VALUES - len(value)
        return value + [np.nan] * spare, list(reading.variance) + [np.nan] * (MAX_VALUES - len(reading.variance))

    def _with_turning(self, value: list[float], end_s: float, exposure_s: float) -> list[float]:
        """The IMU's mean rates over the exposure beside the sensor's own gyro, or in its place where it has none."""
        start = np.array([end_s - exposure_s])
        end = np.array([end_s])
        imu = self._since(self._imu, end_s - 2.0 * exposure_s)
        spare = np.full(2, np.nan)
        turning = spare
        if len(imu) > 1:
            spare = turning = mean_over(imu[:, 0], imu[:, 1:4], start, end)[0, :2]
        elif len(self._attitude) > 1:
            attitude = np.array(self._attitude)
            stream = Stream.of(Sensor.ATTITUDE, attitude[:, 0], attitude[:, 1:5])
            spare = attitude_rates(stream, start, end)[0, :2]
        own = [value[2 + i] if np.isfinite(value[2 + i]) else float(spare[i]) for i in range(2)]
        return [value[0], value[1], *own, *map(float, turning)]

    @staticmethod
    def _since(rows: deque[tuple[float, ...]], t_s: float) -> Array:
        """Rows from an instant on, and the one before it."""
        found = []
        for row in reversed(rows):
            found.append(row)
            if row[0] <= t_s:
                break
        return np.array(found[::-1])


def _empty_queue(count: int) -> EventQueue:
    """Room for so many readings, used again and again; who keeps what is in it copies it."""
    return EventQueue(
        np.zeros(count),
        np.zeros(count, np.int64),
        np.zeros((count, MAX_VALUES)),
        np.zeros((count, MAX_VALUES)),
        np.zeros(count),
        np.arange(count),
        np.zeros(count),
        np.ones(count),
    )


def _streams(listened: list[Waiting]) -> dict[Sensor, Stream]:
    """What was listened to, as streams."""
    by_sensor: dict[Sensor, list[Waiting]] = {}
    for waiting in listened:
        by_sensor.setdefault(waiting.reading.sensor, []).append(waiting)
    return {
        sensor: Stream.of(
            sensor,
            np.array([w.t_s for w in found]),
            np.array([w.reading.value for w in found]).reshape(len(found), len(COLUMNS[sensor])),
            quality=np.array([w.reading.quality for w in found]),
        )
        for sensor, found in by_sensor.items()
    }


def _own_gyro_is_dead(streams: dict[Sensor, Stream]) -> bool:
    """Whether the flow sensor states no turning of its own, or the same for ever."""
    if Sensor.FLOW_RATE not in streams or not len(streams[Sensor.FLOW_RATE]):
        return False
    own = streams[Sensor.FLOW_RATE].value[:, 2:4]
    known = np.isfinite(own).all(axis=1)
    return bool(known.mean() <= 0.5 or not np.all(np.ptp(own[known], axis=0)))
