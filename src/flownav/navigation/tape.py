"""A navigator's output as it runs: estimates, the outcome of each component, happenings, and a smoother's journal.

A `Tape` holds them for every lane, and `Output` is what kernels take of it: pointers. Estimates and components are
written at the same instants in all lanes (their schedule is the same); a lane without a row there has NaN for its time,
or the reason SILENT. Happenings come when they come, lane by lane. A tape without rows only counts.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import Lanes, Work, equation, places_of, pointer, procedure
from flownav.core.measurement import COLUMNS, Array, EventQueue, Sensor
from flownav.estimation.hypotheses import NAMES as FAULTS
from flownav.estimation.states import STATES
from flownav.navigation.entries import ENTRY
from flownav.navigation.memory import REASON
from flownav.navigation.reasons import SILENT
from flownav.navigation.rows import (
    ESTIMATE_COLUMNS,
    EVENT_COLUMNS,
    INNOVATION_COLUMNS,
    EstimateRow,
    EventRow,
    InnovationRow,
    estimate_row,
    innovation_row,
    store_estimate,
    store_event,
    store_innovation,
)

ESTIMATE_PERIOD_S = 0.02  # the 50 Hz at which autopilots and the simulator fly on it
OBSERVES: dict[Sensor, tuple[str, ...]] = {  # of each sensor's reading, what the filter is offered
    **{sensor: names for sensor, names in COLUMNS.items() if sensor != Sensor.IMU},
    Sensor.FLOW_RATE: COLUMNS[Sensor.FLOW_RATE][:2],
    Sensor.MAG: ("heading_rad",),
    Sensor.YAW: ("heading_rad",),
    Sensor.ATTITUDE: ("tilt_n_rad", "tilt_e_rad", "heading_rad"),
    Sensor.LANDED: COLUMNS[Sensor.GPS_VELOCITY],
}
COMPONENTS = {sensor: len(names) for sensor, names in OBSERVES.items()} | {Sensor.ATTITUDE: 6}  # its tilts twice
EVENTS_A_READING = 4

# Kinds of happening: source, kind, what the value is. NumPy numbers them, because Numba compiles a function anew for
# each Python integer that it is called with.
(START, GROUND_FOUND, GROUND_RESET, BARO_FOUND, GPS_RESET, DEAD_RECKONING, POSITION_INVALID, AIDED_AGAIN,
 RANGE_STUCK, PAD_FOUND, IMU_LOST, IMU_DOUBTED, FLOW_DOUBTED, FLOW_TRUSTED, STOOD,
 IMU_SPIKE, HEADING_FOUND, FAULT_SUSPECTED, FAULT_CLEARED, COMPASS_REFUTED) = np.arange(20)  # fmt: skip
EVENT_NAMES = (
    ("filter", "start", "at a GPS fix (1) or at the local origin (0)"),
    ("range", "datum", "ground level below the first range, down in the local frame [m]"),
    ("range", "reset", "range was rejected for long: new ground level, down in the local frame [m]"),
    ("baro", "datum", "pressure height of the local origin [m]"),
    ("gps", "reset", "GPS was rejected for long: one state went to it, by this much [m or m/s]"),
    ("filter", "dead_reckoning", "no horizontal aid for this long [s]"),
    ("filter", "position_invalid", "no horizontal aid for this long [s]"),
    ("filter", "aided", "horizontal aid is back after this long [s]"),
    ("range", "stuck", "it repeats this value while the vehicle moves [m]"),
    ("pad", "found", "the pad's distance from the local origin [m]"),
    ("imu", "lost", "no reading for this long [s]; attitude and velocity coast"),
    ("imu", "doubted", "range contradicts it by this much [m]; the accelerometer's bias is set free"),
    ("flow", "doubted", "it contradicts IMU and GPS: mean square innovation over its variance"),
    ("flow", "trusted", "it agrees again: mean square innovation over its variance"),
    ("filter", "standing", "the vehicle moves (0), stands with its motors running (1), or rests (2)"),
    ("imu", "spike", "a reading that no vehicle can follow was dropped: it read this turning [rad/s]"),
    ("heading", "found", "from the course by GPS and flow: it was off by this much [rad]"),
    ("filter", "suspects", f"a fault that innovations show: {', '.join(f'{i} {n}' for i, n in enumerate(FAULTS))}"),
    ("filter", "cleared", "that fault is no more suspected"),
    ("heading", "refuted", "flow and accelerometer contradict what is read as heading: it was off by this much [rad]"),
)
# places in `used`
ESTIMATES, OFFERED_ROWS, ENTRIES, NOTES, FIRST_EVENTS = 0, 1, 2, 3, 4


class Journal(NamedTuple):
    """A smoother's journal: entry (n, ENTRY), state and quaternion (m, STATES + 4), covariance (m, STATES, STATES)."""

    entry: Array
    state: Array
    covariance: Array


class Tape(NamedTuple):
    """Rows that a run writes, and how many of each it used.

    estimate (n, ESTIMATE_COLUMNS, lanes), innovation (m, INNOVATION_COLUMNS, lanes), event (k, EVENT_COLUMNS, lanes);
    used: estimates, components, journal entries, journal estimates, then happenings of each lane.
    """

    estimate: Array
    innovation: Array
    event: Array
    journal: Journal
    used: NDArray[np.int64]

    def estimates(self, lane: int = 0) -> Array:
        """The estimates of one lane, (n, ESTIMATE_COLUMNS)."""
        rows = self.estimate[: self.used[ESTIMATES], :, lane]
        return np.ascontiguousarray(rows[np.isfinite(rows[:, places_of(EstimateRow).t_s])])

    def offers(self, lane: int = 0) -> Array:
        """Outcomes of each component in one lane, (m, INNOVATION_COLUMNS)."""
        rows = self.innovation[: self.used[OFFERED_ROWS], :, lane]
        return np.ascontiguousarray(rows[rows[:, places_of(InnovationRow).reason] != SILENT])

    def events(self, lane: int = 0) -> Array:
        """The happenings of one lane, (k, EVENT_COLUMNS)."""
        return np.ascontiguousarray(self.event[: self.used[FIRST_EVENTS + lane], :, lane])


class Output(NamedTuple):
    """A tape as kernels take it. room: rows of estimate, innovation, event, entry and journal estimates."""

    estimate: Work
    innovation: Work
    event: Work
    entry: Work
    state: Work
    covariance: Work
    room: NDArray[np.int64]
    used: NDArray[np.int64]


def empty_tape(estimates: int, components: int, events: int, lanes: int = 1, journal: tuple[int, int] = (0, 0)) -> Tape:
    """A tape with this many rows, which take memory once they are written; journal: its entries and estimates."""
    return Tape(
        np.zeros((estimates, ESTIMATE_COLUMNS, lanes)),
        np.zeros((components, INNOVATION_COLUMNS, lanes)),
        np.zeros((events, EVENT_COLUMNS, lanes)),
        Journal(
            np.zeros((journal[0], ENTRY)), np.zeros((journal[1], STATES + 4)), np.zeros((journal[1], STATES, STATES))
        ),
        np.zeros(FIRST_EVENTS + lanes, np.int64),
    )  # fmt: skip


def new_tape(queue: EventQueue) -> Tape:
    """A tape long enough for a queue."""
    readings = {sensor: int(np.count_nonzero(queue.sensor == sensor)) for sensor in Sensor}
    return tape_for(readings, float(queue.t_s[-1] - queue.t_s[0]))


def tape_for(readings: Mapping[Sensor, int], lasts_s: float) -> Tape:
    """A tape long enough for the stated number of readings of each sensor in this time."""
    components = sum(count * readings.get(sensor, 0) for sensor, count in COMPONENTS.items())
    events = sum(readings.values())
    estimates = min(events, int(lasts_s / ESTIMATE_PERIOD_S) + 2)
    return empty_tape(estimates, components, EVENTS_A_READING * events + 8)


def room_of(tape: Tape) -> NDArray[np.int64]:
    """How many rows of each kind a tape has."""
    journal = tape.journal
    return np.array([len(tape.estimate), len(tape.innovation), len(tape.event), len(journal.entry), len(journal.state)])


@equation
def output_of(
    estimate: Array, innovation: Array, event: Array, entry: Array, state: Array, covariance: Array,
    room: NDArray[np.int64], used: NDArray[np.int64],
) -> Output:  # fmt: skip
    """The pointers of a tape's arrays."""
    return Output(
        pointer(estimate), pointer(innovation), pointer(event), pointer(entry), pointer(state), pointer(covariance),
        pointer(room), pointer(used),
    )  # fmt: skip


@procedure
def write_event(lanes: Lanes, lane: int, t_s: float, kind: np.int_ | int, value: float, o: Output) -> None:
    """A happening in one lane."""
    row = o.used[FIRST_EVENTS + lane]
    if row < o.room[2]:
        store_event(o.event, lanes, row, lane, EventRow(t_s, kind, value))
        o.used[FIRST_EVENTS + lane] = row + 1


@procedure
def write_offer(work: Work, lanes: Lanes, t_s: float, sensor: int, component: int, o: Output) -> None:
    """Write the outcome of the component that was offered last, by its REASON in each lane; no row where all are
    silent.
    """
    row = o.used[OFFERED_ROWS]
    if row >= o.room[1]:
        return
    judged = False
    for lane in range(len(lanes)):
        judged = judged or work[REASON * len(lanes) + lane] != SILENT
    if not judged:
        return
    o.used[OFFERED_ROWS] = row + 1
    for lane in range(len(lanes)):
        store_innovation(o.innovation, lanes, row, lane, innovation_row(work, lanes, lane, t_s, sensor, component))


@procedure
def write_estimate(work: Work, lanes: Lanes, t_s: float, o: Output) -> None:
    """State, attitude and standard deviations at an instant."""
    row = o.used[ESTIMATES]
    if row >= o.room[0]:
        return
    o.used[ESTIMATES] = row + 1
    for lane in range(len(lanes)):
        store_estimate(o.estimate, lanes, row, lane, estimate_row(work, lanes, lane, t_s))
