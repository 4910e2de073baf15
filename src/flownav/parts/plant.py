"""A vehicle, a controller and sensors of somebody else's, called by the simulator's loop in place of ours.

Readings are replaced on their way into the navigator and into the record.
"""

from collections.abc import Callable, Sequence

import numpy as np

from flownav.control.guidance import reference_at
from flownav.core.compile import ONE_LANE, runge_kutta
from flownav.core.errors import InputError
from flownav.core.frames import GRAVITY_M_S2, rotation_from_quaternion
from flownav.core.measurement import COLUMNS, MAX_VALUES, Array, Sensor
from flownav.navigation.memory import READING
from flownav.navigation.take import UNIT_SIGNATURE
from flownav.parts.calling import Called, Mistakes, name_of, naming_part
from flownav.parts.protocols import Controller, Flown, SensorModel, Truth, Values, VehicleModel
from flownav.simulation import layout
from flownav.simulation.block import Buffers
from flownav.simulation.epoch import own_attitude
from flownav.simulation.navigating import TRUTH, Timetable, first_truth
from flownav.simulation.plan import ATTITUDE_S, Flight
from flownav.simulation.records import AttitudeError, Loads
from flownav.simulation.sensing import EPOCH_S
from flownav.vehicle.state import Around, Controls

RIGID = 13
load_error, _ = layout.PLANT.access(AttitudeError)
ATTITUDE = slice(6, 10)
_, timed_step = runge_kutta(lambda timed, rate, dt_s: timed + rate * dt_s)  # the time [s], then the vehicle's state


class OwnVehicle:
    """Integrates a vehicle in the rows of the plant. work: the lane buffer of one lane."""

    def __init__(self, part: VehicleModel, work: Array, mistakes: Mistakes) -> None:
        self._part, self._work, self._t_s = part, work, 0.0
        self._state: Array = np.zeros(RIGID)
        self.called = Called(f"vehicle {name_of(part)}", self._step, "p d", mistakes)

    def _step(self, _work: int, dt_s: float) -> None:
        rows = self._work[layout.HELICOPTER : layout.HELICOPTER + RIGID]
        controls, around = layout.load_controls(self._work, ONE_LANE, 0), layout.load_around(self._work, ONE_LANE, 0)
        if dt_s == 0.0:
            self._t_s, self._state = 0.0, self._checked("start", self._part.start(rows.copy()), None)
        else:
            self._state = self._moved(dt_s, controls, around)
            self._t_s += dt_s
        rows[:] = self._state[:RIGID]
        seen = self._part.outputs(self._t_s, self._state, controls, around)
        if not np.isfinite(tuple(seen)).all():
            raise InputError(f"vehicle {name_of(self._part)}: outputs() gave {tuple(seen)}; finite ones are needed")
        layout.store_loads(self._work, ONE_LANE, 0, Loads(seen.thrust_n, seen.contact_force_n, seen.power_w))

    def _moved(self, dt_s: float, controls: Controls, around: Around) -> Array:
        """One classical fourth-order step; the quaternion is brought back to unit length."""

        def rate(timed: Array) -> Array:
            found = self._part.derivative(float(timed[0]), timed[1:], controls, around)
            return np.append(1.0, self._checked("derivative", found, len(self._state)))

        after: Array = timed_step(rate, np.append(self._t_s, self._state), dt_s)[1:]
        after[ATTITUDE] /= np.linalg.norm(after[ATTITUDE])
        return after

    def _checked(self, method: str, found: object, length: int | None) -> Array:
        array = np.array(found, dtype=float)
        if array.ndim != 1 or len(array) != (length or max(len(array), RIGID)) or not np.isfinite(array).all():
            wanted = f"({length},)" if length else f"({RIGID} or more,)"
            raise InputError(
                f"vehicle {name_of(self._part)}: {method}() gave shape {array.shape}, or what is not finite; {wanted} "
                "finite numbers are needed"
            )
        return array


class OwnController:
    """Gives controls in the attitude loop's place."""

    def __init__(self, part: Controller, flight: Flight, work: Array, mistakes: Mistakes) -> None:
        self._part, self._flight, self._work, self._calls = part, flight, work, 0
        with naming_part(f"controller {name_of(part)}"):
            part.start(flight.gains)
        self.called = Called(f"controller {name_of(part)}", self._steer, "p", mistakes)

    def _steer(self, _work: int) -> None:
        work, t_s = self._work, self._calls * ATTITUDE_S
        self._calls += 1
        state = layout.load_helicopter(work, ONE_LANE, 0)
        seen = work[layout.ESTIMATE : layout.ESTIMATE + 9]
        home = work[layout.HOME : layout.HOME + 3]
        flown = Flown(
            seen[:3] - home, seen[3:6].copy(), np.array(own_attitude(state, load_error(work, ONE_LANE, 0))),
            np.array([state.p, state.q, state.r]), seen[6:9].copy(),
        )  # fmt: skip
        flying = layout.load_autopilot(work, ONE_LANE, 0).flying > 0.0
        asked = self._part.command(t_s, flown, reference_at(self._flight.path, t_s), flying=flying)
        controls = tuple(float(value) for value in asked)
        if len(controls) != len(Controls._fields) or not np.isfinite(controls).all():
            raise InputError(
                f"controller {name_of(self._part)}: command() gave {controls}; four finite angles are needed "
                f"({', '.join(Controls._fields)}) [rad]"
            )
        layout.store_controls(work, ONE_LANE, 0, Controls(*controls))


STATED = 3
BEST_QUALITY = 255.0
MAY_LACK_DOWN = (Sensor.GPS_VELOCITY, Sensor.FLOW_VELOCITY)
QUALITY, ARRIVED = READING + MAX_VALUES + STATED, READING + MAX_VALUES + STATED + 1
Take = Callable[..., None]


class TruthSoFar:
    """The truth of every epoch up to now, as the loop's buffer remembers it for the length of the horizon."""

    def __init__(self, work: Array, table: Timetable) -> None:
        self._work, self._table = work, table
        self._rows: list[Array] = []

    def up_to(self, epoch: int) -> None:
        """Take in what is new; the epochs of an idle start are still there, since nothing is fed before the horizon."""
        kept = self._table.horizon_epochs + 1
        for k in range(len(self._rows), epoch + 1):
            first = first_truth(self._table) + (k % kept) * TRUTH
            self._rows.append(self._work[first : first + TRUTH].copy())

    def at(self, t_s: float) -> Truth:
        """At an instant, by cubic interpolation of the path between epochs."""
        last = len(self._rows) - 1
        k = int(np.clip(np.floor(t_s / EPOCH_S + 1e-9), 0, max(last - 1, 0)))
        here, there = self._rows[k], self._rows[min(k + 1, last)]
        share = float(np.clip(t_s / EPOCH_S - k, 0.0, 1.0))
        turn = there[6:] if np.dot(here[6:], there[6:]) >= 0.0 else -there[6:]
        quaternion = (1.0 - share) * here[6:] + share * turn
        quaternion /= np.linalg.norm(quaternion)
        force_ned = (there[3:6] - here[3:6]) / EPOCH_S - np.array([0.0, 0.0, GRAVITY_M_S2])
        rotation = np.reshape(rotation_from_quaternion(*quaternion), (3, 3))
        return Truth(
            t_s, _hermite(here, there, share), (1.0 - share) * here[3:6] + share * there[3:6], quaternion,
            _rate(here[6:], turn), rotation.T @ force_ned,
        )  # fmt: skip


def _hermite(here: Array, there: Array, s: float) -> Array:
    """The position a share s of the way between two epochs, by their positions and velocities."""
    a, b = (2 * s - 3) * s * s + 1, ((s - 2) * s + 1) * s * EPOCH_S
    c, d = (3 - 2 * s) * s * s, (s - 1) * s * s * EPOCH_S
    return np.asarray(a * here[:3] + b * here[3:6] + c * there[:3] + d * there[3:6])


def _rate(here: Array, there: Array) -> Array:
    """The mean body rate between two attitudes an epoch apart [rad/s]: twice the vector of here^-1 * there."""
    w, x, y, z = here
    vector = np.array([
        w * there[1] - x * there[0] - y * there[3] + z * there[2],
        w * there[2] + x * there[3] - y * there[0] - z * there[1],
        w * there[3] - x * there[2] + y * there[1] - z * there[0],
    ])  # fmt: skip
    return np.asarray(2.0 * vector / EPOCH_S)


class OwnReadings:
    """Stands before the navigator: readings of a kind that a user's sensor provides are replaced."""

    def __init__(
        self, parts: Sequence[SensorModel], table: Timetable, b: Buffers, then: Take, mistakes: Mistakes
    ) -> None:
        kinds = [_kind(part) for part in parts]
        if len(set(kinds)) < len(kinds) or Sensor.IMU in kinds:
            raise InputError("sensors: one of a kind can be replaced, and the IMU cannot")
        self._parts, self._table, self._b, self._then = dict(zip(kinds, parts, strict=True)), table, b, then
        self._truth, self._taken = TruthSoFar(b.work, table), 0
        missing = [kind.name for kind in kinds if kind not in table.sensor]
        if missing:
            raise InputError(f"sensors: the scenario's vehicle carries no {', '.join(missing)} to be replaced")
        self.called = Called(f"sensor {', '.join(map(name_of, parts))}", self._take, UNIT_SIGNATURE, mistakes)

    @property
    def address(self) -> int:
        """Address of the C function that takes readings."""
        return self.called.address

    def _take(self, *arguments: float) -> None:
        k, self._taken = self._taken, self._taken + 1
        self._truth.up_to(int(self._table.epoch[k]))
        kind = Sensor(int(arguments[-1]))
        if kind in self._parts:
            self._replace(k, kind, float(arguments[-2]))
        self._then(*arguments)

    def _replace(self, k: int, kind: Sensor, t_s: float) -> None:
        nav, read_values = self._b.nav, self._parts[kind].read(self._truth.at(t_s))
        nav[ARRIVED] = 0.0 if read_values is None else 1.0
        if read_values is not None:
            nav[READING : READING + len(COLUMNS[kind])] = _values(kind, self._parts[kind], read_values)
            nav[READING + MAX_VALUES : READING + MAX_VALUES + STATED] = _stated(self._parts[kind], read_values)
            nav[QUALITY] = read_values.quality
        if k < len(self._b.fed):  # what the record keeps of it
            self._b.fed[k, :, 0] = nav[READING : READING + self._b.fed.shape[1]]


def _values(kind: Sensor, part: SensorModel, read_values: Values) -> tuple[float, ...]:
    values = tuple(float(value) for value in read_values.value)
    if len(values) != len(COLUMNS[kind]):
        names = ", ".join(COLUMNS[kind])
        raise InputError(f"sensor {name_of(part)}: read() gave {len(values)} values; {kind.name} has {names}")
    needed = values[:2] if kind in MAY_LACK_DOWN else values
    if not np.isfinite(needed).all():
        raise InputError(f"sensor {name_of(part)}: read() gave {values}; finite values, or None, are needed")
    return values


def _stated(part: SensorModel, read_values: Values) -> tuple[float, ...]:
    variance = tuple(float(value) for value in read_values.variance)
    if len(variance) != STATED or any(value < 0.0 for value in variance):
        raise InputError(f"sensor {name_of(part)}: variance {variance}: three of 0 or more, NaN for none, are needed")
    if not 0.0 <= read_values.quality <= BEST_QUALITY:
        raise InputError(f"sensor {name_of(part)}: quality {read_values.quality}: 0 (no data) to 255 is needed")
    return variance


def _kind(part: SensorModel) -> Sensor:
    """InputError where its `sensor` is none that there is."""
    try:
        return Sensor[part.sensor.upper()] if isinstance(part.sensor, str) else Sensor(part.sensor)
    except (KeyError, ValueError):
        known = ", ".join(kind.name for kind in Sensor)
        raise InputError(f"sensor {name_of(part)}: sensor = {part.sensor!r}; one of {known} is needed") from None
