"""Sixteen lanes are sixteen vehicles: each the same bits as alone, whatever the others hear, refuse or start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from flownav.core.compile import LANES, LANES_WIDE
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import MAX_VALUES, EventQueue, Sensor, Stream, merge
from flownav.estimation.states import QUATERNION, STATE, STATES
from flownav.navigation.kernel_settings import FROM_ATTITUDE, FROM_MAG, NO_HEADING, Equipment
from flownav.navigation.loop import Running, run, start_navigator
from flownav.navigation.memory import READING, load_start, new_work
from flownav.navigation.packed import pack
from flownav.navigation.records import Reading
from flownav.navigation.rows import EventRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.take import navigate_lanes
from flownav.navigation.tape import COMPONENTS, EVENT_NAMES, Tape, empty_tape, new_tape, room_of
from navigation_streams import circle, fly
from packed_covariance import unpack

STATED = Reading._fields.index("quality") - MAX_VALUES
SETTINGS = NavigatorSettingsFile(
    flow_forward_m=0.1, flow_below_m=0.15, range_below_m=0.1, gps_forward_m=-0.3, gps_below_m=-0.1, gps_reset_s=2.0,
    invalid_s=2.0, start_wait_s=1.0,
)  # fmt: skip
FITTED = Equipment(True, False, FROM_MAG, False, 2.5)


@dataclass
class Schedule:
    """When which sensor reads, and what each lane hears of it: (n,), (n,), (n, fields, lanes)."""

    t_s: np.ndarray
    sensor: np.ndarray
    reading: np.ndarray

    def queue(self, lane: int) -> EventQueue:
        """One lane's, as one vehicle has it."""
        said = {name: np.ascontiguousarray(self.reading[:, k, lane]) for k, name in enumerate(Reading._fields)}
        variance = np.full((len(self.t_s), MAX_VALUES), np.nan)
        variance[:, :STATED] = self.reading[:, MAX_VALUES : MAX_VALUES + STATED, lane]
        return EventQueue(
            self.t_s, self.sensor, np.ascontiguousarray(self.reading[:, :MAX_VALUES, lane]), variance,
            said["quality"], np.arange(len(self.t_s)), said["withheld"], said["arrived"],
        )  # fmt: skip


def regular(sensor: Sensor, first_s: float, last_s: float, period_s: float, value: list[float]) -> Stream:
    """A sensor that says the same again and again."""
    t_s = np.arange(first_s, last_s, period_s)
    return Stream.of(sensor, t_s, np.tile(value, (len(t_s), 1)))


def schedule(seed: int, without: tuple[Sensor, ...] = (), duration_s: float = 14.0) -> Schedule:
    """A flight of which each lane hears something else: noise, drop-outs, silence, faults, its own start."""
    random = np.random.default_rng(seed)
    flown = fly(circle, duration_s, 0.3).without(*without)
    beside = [
        regular(Sensor.PAD, 5.0, duration_s, 0.13, [0.1, -0.05, 2.0]),
        regular(Sensor.LANDED, 0.0, duration_s, 0.5, [0.0]),
        regular(Sensor.YAW, 6.0, duration_s, 1.1, [0.0]),
    ]
    queue = merge([*flown.streams.values(), *beside])
    order = np.argsort(queue.t_s + random.uniform(0.0, 0.004, len(queue.t_s)))  # some come too late
    count = len(order)
    sensor, t_s = queue.sensor[order], np.ascontiguousarray(queue.t_s[order])
    reading = np.full((count, len(Reading._fields), LANES_WIDE), np.nan)
    reading[:, :MAX_VALUES] = queue.value[order][:, :, None]
    scale = np.where(sensor == Sensor.IMU, 0.05, 0.02)[:, None, None]
    reading[:, :MAX_VALUES] += scale * random.normal(size=(count, MAX_VALUES, LANES_WIDE))
    reading[:, MAX_VALUES : MAX_VALUES + STATED] = np.where(
        random.random((count, 1, LANES_WIDE)) < 0.3, random.uniform(0.01, 1.0, (count, STATED, LANES_WIDE)), np.nan
    )
    at = {name: k for k, name in enumerate(Reading._fields)}
    reading[:, at["quality"]] = random.choice([255.0, 200.0, 0.0], (count, LANES_WIDE), p=[0.9, 0.07, 0.03])
    reading[:, at["arrived"]] = random.random((count, LANES_WIDE)) > 0.1
    reading[:, at["withheld"]] = random.random((count, LANES_WIDE)) < 0.02
    spoil(reading, sensor, t_s, at)
    return Schedule(t_s, sensor, reading)


def spoil(reading: np.ndarray, sensor: np.ndarray, t_s: np.ndarray, at: dict[str, int]) -> None:
    """Each lane's own story: a late start, a jump, a gap, a step of the ground, a doubtful accelerometer, no number,
    spikes, rest.
    """
    gps = np.isin(sensor, [Sensor.GPS_POSITION, Sensor.GPS_VELOCITY])
    for lane in range(LANES_WIDE):
        reading[gps & (t_s < 0.25 * lane), at["arrived"], lane] = 0.0  # the last start at the origin
    reading[(sensor == Sensor.GPS_POSITION) & (t_s > 7.0), 0, 1] += 30.0
    reading[(sensor == Sensor.IMU) & (t_s > 8.0) & (t_s < 9.0), at["arrived"], 2] = 0.0
    reading[(sensor == Sensor.RANGE) & (t_s > 8.0), 0, 3] += 4.0
    shaken = (sensor == Sensor.IMU) & (t_s > 6.0)
    reading[shaken, 3:6, 4] += 6.0 * np.sin(1e3 * t_s[shaken])[:, None]
    reading[(sensor == Sensor.BARO) | gps, at["arrived"], 5] = 0.0
    reading[(sensor == Sensor.RANGE) & (t_s > 9.0), 0, 5] += 1.0
    reading[(sensor == Sensor.FLOW_RATE) & (t_s > 7.0), 0:2, 6] *= -1.0
    reading[::50, 0, 7] = np.nan
    reading[(sensor == Sensor.RANGE) & (t_s > 7.0), 0, 8] = 2.0
    aids = gps | np.isin(sensor, [Sensor.FLOW_RATE, Sensor.PAD])
    reading[aids & (t_s > 6.0) & (t_s < 10.0), at["arrived"], 9] = 0.0
    reading[:, at["arrived"], 10] = 0.0  # of this one nothing ever arrives
    reading[(sensor == Sensor.LANDED) & (t_s > 12.0), 0, 11] = 1.0
    reading[np.flatnonzero((sensor == Sensor.IMU) & (t_s > 5.0))[::97], 0, 12] += 30.0
    reading[(sensor == Sensor.BARO) | gps, at["arrived"], 13] = 0.0
    reading[(sensor == Sensor.IMU) & (t_s > 6.0), 5, 13] += 6.0
    reading[(sensor == Sensor.IMU) & (t_s < 3.0), :6, 14] = 0.0, 0.0, 0.0, 0.0, 0.0, -GRAVITY_M_S2
    reading[(sensor == Sensor.RANGE) & (t_s < 3.0), 0, 14] = 0.1


def all_lanes(plan: Schedule, fitted: Equipment) -> tuple[np.ndarray, Tape]:
    """The lane buffer and the tape of sixteen vehicles side by side."""
    headed = fitted.heading != NO_HEADING or fitted.use_attitude
    sigma = SETTINGS.start_sigma(has_heading=headed, compass=fitted.heading == FROM_MAG)
    settings, work = pack(SETTINGS.settings(fitted), sigma), new_work(LANES)
    rows = sum(count * int(np.count_nonzero(plan.sensor == sensor)) for sensor, count in COMPONENTS.items())
    tape = empty_tape(len(plan.t_s), rows, 4 * len(plan.t_s), LANES_WIDE)
    arrays = [array.reshape(-1) for array in (tape.estimate, tape.innovation, tape.event, *tape.journal)]
    room, at_hand = room_of(tape), work.reshape(-1, LANES_WIDE)[READING : READING + len(Reading._fields)]
    for t_s, sensor, reading in zip(plan.t_s.tolist(), plan.sensor.tolist(), plan.reading, strict=True):
        at_hand[:] = reading
        navigate_lanes(work, settings, *arrays, room, tape.used, t_s, sensor)
    return work, tape


def alone(plan: Schedule, lane: int, fitted: Equipment) -> Running:
    queue = plan.queue(lane)
    on = start_navigator(fitted, SETTINGS, new_tape(queue))
    run(queue, on)
    return on


@pytest.mark.parametrize(("seed", "fitted", "without"), [
    (1, FITTED, ()),
    (2, FITTED._replace(flow_gyro_is_imu=True, heading=FROM_ATTITUDE), ()),
    (3, FITTED._replace(use_imu=False, use_attitude=True, heading=FROM_ATTITUDE), ()),
    (4, FITTED._replace(heading=NO_HEADING), (Sensor.ATTITUDE, Sensor.MAG)),  # few read the errors that decay
])  # fmt: skip
def test_each_of_sixteen_lanes_is_what_it_is_alone(seed, fitted, without):
    plan = schedule(seed, without)
    work, tape = all_lanes(plan, fitted)
    seen: set[int] = set()
    for lane in range(LANES_WIDE):
        on = alone(plan, lane, fitted)
        for name in ("events", "offers", "estimates"):
            together, single = plain(getattr(tape, name)(lane)), plain(getattr(on.tape, name)())
            assert together.tobytes() == single.tobytes(), f"lane {lane}: {name}, {differing(together, single)}"
        seen.update(EventRow.of(on.tape.events()).kind.astype(int).tolist())
        if load_start(on.work, (0,), 0).started:
            state = work.reshape(-1, LANES_WIDE)[STATE : QUATERNION + 4, lane]
            assert state.tobytes() == on.work[STATE : QUATERNION + 4].tobytes()
            assert unpack(work, LANES, lane, STATES).tobytes() == unpack(on.work, (0,), 0, STATES).tobytes()
    if fitted.use_imu and not without:
        assert len(seen) >= len(EVENT_NAMES) - 7, [EVENT_NAMES[k] for k in set(range(len(EVENT_NAMES))) - seen]


def plain(rows: np.ndarray) -> np.ndarray:
    """The rows with every NaN of the same bits: its sign is nobody's."""
    return np.where(np.isnan(rows), np.nan, rows)


def differing(together: np.ndarray, single: np.ndarray) -> str:
    """Where two tables differ first."""
    if together.shape != single.shape:
        rows = min(len(together), len(single))
        same = [together[k].tobytes() == single[k].tobytes() for k in range(rows)]
        row = same.index(False) if False in same else rows
        return f"{together.shape} against {single.shape}, first at row {row}"
    rows, columns = np.nonzero(together.view(np.int64) != single.view(np.int64))
    first = rows.min()
    return f"row {first} at {together[first, 0]} s, columns {columns[rows == first].tolist()}"
