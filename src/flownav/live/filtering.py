"""The navigator behind the horizon: the rings on which readings wait, the batches it is fed, and its outputs."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flownav.core.compile import ONE_LANE
from flownav.core.frames import Vector, rotation_from_quaternion, to_earth
from flownav.core.measurement import COLUMNS, Array, EventQueue, Measurement, Sensor, Stream
from flownav.estimation.states import POSITION, STATE
from flownav.live.options import Options
from flownav.logs.mavlink.messages import TrueState
from flownav.navigation.feed import equipment_of
from flownav.navigation.kernel_settings import FROM_MAG, NO_HEADING, Equipment
from flownav.navigation.loop import Running, run, start_navigator
from flownav.navigation.memory import load_start
from flownav.navigation.now import NowRow
from flownav.navigation.rings import Given, Rings, numbers_of
from flownav.navigation.rows import EVENT_COLUMNS, INNOVATION_COLUMNS, EventRow
from flownav.navigation.tables import written_on
from flownav.navigation.tape import COMPONENTS, GPS_RESET, START, empty_tape
from flownav.navigation.waiting_records import Sizes
from flownav.sensors.datasheet import UNTURNED, IdentifiedFlow, in_vehicle_axes

NAN = float("nan")
BATCH_READINGS = 64  # readings at a time, 6 ms of them; all at once, the first estimates stop the loop for 130 ms
# chosen: ten seconds of a busy link, inertial readings and all others; a flood is dropped and counted
# (test_live_safety). Attitudes: more than two seconds at 50 Hz
ROOM = Sizes(ring=4096.0, table=4096.0, attitudes=128.0, most=8192.0)
FLOW = (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)
JUMPS = (int(START), int(GPS_RESET))  # events at which the estimate jumps


class Keeper:
    """Who keeps a session's story, and what the navigator was fed and wrote: nobody; recorder.Recorder keeps all."""

    def segment(self, equipment: Equipment) -> None:
        """A navigator begins; what is fed from now on is fed to it."""

    def fed(self, queue: EventQueue, arrival_s: Array) -> None:
        """A batch is about to be fed."""

    def written(self, estimate: Array, innovation: Array, event: Array) -> None:
        """Keep the estimates, innovations and events of the batch."""

    def note(self, t_s: float, source: str, kind: str, detail: str, value: float = NAN) -> None:
        """A happening."""

    def origin(self, t_s: float, origin_deg_m: tuple[float, float, float]) -> None:
        """The navigator's frame has this origin from now on."""

    def truth(self, t_s: float, state: TrueState) -> None:
        """Keep a simulator's true state at `t_s`."""


class Outcome(NamedTuple):
    """The result of the last batch: its number of readings, and the tape's rows of innovation and event."""

    readings: int
    innovation: Array
    event: Array


NOTHING = Outcome(0, np.zeros((0, INNOVATION_COLUMNS)), np.zeros((0, EVENT_COLUMNS)))


class Filtering:
    """One navigator from start to restart, and what waits for it (`rings`)."""

    def __init__(self, options: Options, keeper: Keeper) -> None:
        self._options = options
        self._keeper = keeper
        self.running: Running | None = None
        self.jumps = 0
        self.rings = Rings(ROOM, BATCH_READINGS)
        most = max(COMPONENTS.values())
        self._tape = empty_tape(BATCH_READINGS + 2, most * BATCH_READINGS, 8 * BATCH_READINGS + 8)

    def begin(self, gps_received: bool, origin_deg_m: tuple[float, float, float] | None = None) -> None:
        """A navigator for the sensors that were listened to, whose readings wait. gps_heard: a receiver is there that
        has had a fix.

        Without one it waits for none. Its heading is then by the magnetometer all the same: a datum that the gyro alone
        keeps would turn away from the autopilot's, about which what is sent is flown.
        """
        listened = self.rings.waiting()
        streams = _streams(listened)
        if gps_received and Sensor.GPS_POSITION not in streams:
            streams[Sensor.GPS_POSITION] = Stream.of(Sensor.GPS_POSITION, np.zeros(0), np.zeros((0, 3)))
        first_s = float(listened.t_s[0])
        settings = self._options.settings
        equipment = equipment_of(streams, first_s, _own_gyro_is_dead(streams), settings, origin_deg_m)
        if gps_received:
            equipment = equipment._replace(deadline_s=first_s + float(settings.start_wait_s))
        elif equipment.heading == NO_HEADING and Sensor.MAG in streams:
            equipment = equipment._replace(heading=FROM_MAG)
            if origin_deg_m is None:
                equipment = equipment._replace(declination_rad=own_declination_rad(streams))
        self.running = start_navigator(equipment, settings, self._tape, self._options.flow_noise)
        self._keeper.segment(equipment)

    def stop(self) -> None:
        """No navigator until the next `begin`."""
        self.running = None

    def feed(self, until_s: float) -> Outcome:
        """Readings of instants up to until_s, at most BATCH_READINGS, in the order of their instants."""
        on = self.running
        assert on is not None
        queue, arrival_s = self.rings.release(on.settings, until_s)
        if not len(queue.t_s):
            return NOTHING
        self._keeper.fed(queue, arrival_s)
        on.tape.used[:] = 0
        run(queue, on)
        written = written_on(on.tape)
        self._keeper.written(*written)
        if len(written.event):
            self.jumps += sum(kind in JUMPS for kind in EventRow.of(written.event).kind.tolist())
        return Outcome(len(queue.t_s), written.innovation, written.event)

    def now(self, t_s: float) -> NowRow[Array]:
        """The state at an instant, carried on by the inertial readings that wait."""
        assert self.running is not None
        return self.rings.now(self.running.work, self.running.settings, t_s)

    @property
    def newest_imu_s(self) -> float:
        """When the newest inertial reading was taken that is believed; NaN before the first."""
        return self.rings.newest_inertial_s

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
        """Whether a navigator runs that was set up without an IMU."""
        return self.running is not None and not self.running.given.equipment.use_imu

    @property
    def lacks_gps(self) -> bool:
        """Whether a navigator runs that was set up without a GPS receiver."""
        return self.running is not None and not np.isfinite(self.running.given.equipment.deadline_s)

    def imu_rate_hz(self, t_s: float) -> float:
        """Rate of the IMU's readings in the two seconds before an instant."""
        return 0.5 * float(np.count_nonzero(self.rings.inertial()[:, 0] > t_s - 2.0))


def given_of(reading: Measurement, exposure_s: float, known: IdentifiedFlow | None) -> Given:
    """A reading as the rings take it: flow in the vehicle's axes."""
    value: Sequence[float] = reading.value
    if reading.sensor in FLOW and known is not None and known.axes != UNTURNED:
        value = in_vehicle_axes(np.array([value]), known, angular=reading.sensor == Sensor.FLOW_RATE)[0].tolist()
    numbers = numbers_of(value, reading.variance, reading.quality, reading.delay_s, exposure_s)
    return Given(reading.t_s, int(reading.sensor), numbers)


def _streams(listened: EventQueue) -> dict[Sensor, Stream]:
    """The readings collected while listening, as streams by sensor."""
    return {
        Sensor(number): Stream.of(
            Sensor(number),
            listened.t_s[rows],
            listened.value[rows, : len(COLUMNS[Sensor(number)])],
            quality=listened.quality[rows],
        )
        for number in np.unique(listened.sensor)
        for rows in [listened.sensor == number]
    }


def own_declination_rad(streams: dict[Sensor, Stream]) -> float:
    """For a vehicle without a known place on earth: the bearing of the field by the autopilot's own attitude [rad].

    The frame that is sent is then the autopilot's, whatever its compass and its idea of north are. 0 without attitude.
    """
    mag, attitude = streams.get(Sensor.MAG), streams.get(Sensor.ATTITUDE)
    if mag is None or attitude is None or not len(mag) or not len(attitude):
        return 0.0
    before = np.clip(np.searchsorted(attitude.t_s, mag.t_s), 0, len(attitude.t_s) - 1)
    angles = []
    for field, quaternion in zip(mag.value, attitude.value[before], strict=True):
        rotation = rotation_from_quaternion(*map(float, quaternion))
        north, east, _ = to_earth(rotation, *map(float, field))
        angles.append(math.atan2(east, north))
    return math.atan2(float(np.mean(np.sin(angles))), float(np.mean(np.cos(angles))))


def _own_gyro_is_dead(streams: dict[Sensor, Stream]) -> bool:
    """Whether the flow sensor states no turning of its own, or the same for ever."""
    if Sensor.FLOW_RATE not in streams or not len(streams[Sensor.FLOW_RATE]):
        return False
    own = streams[Sensor.FLOW_RATE].value[:, 2:4]
    known = np.isfinite(own).all(axis=1)
    return bool(known.mean() <= 0.5 or not np.all(np.ptp(own[known], axis=0)))
