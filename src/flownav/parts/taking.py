"""A filter of somebody else's in the navigator's place: reading by reading, from the rows that our own takes them from.

It is called as a compiled navigator is (`navigation.take.UNIT_SIGNATURE`), by the simulator's loop and by a replay's.
"""

import math
from collections.abc import Iterable
from itertools import islice
from typing import Any

import numpy as np

from flownav.core.errors import InputError
from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import COLUMNS, MAX_VALUES, Array, Sensor
from flownav.estimation.covariance import place
from flownav.estimation.gating import Reason
from flownav.estimation.states import ACCEL_BIAS, GROUND, GYRO_BIAS, PAD, POSITION, QUATERNION, STATE, VELOCITY
from flownav.navigation.memory import CLOCK, GROUND_SEEN, PAD_KNOWN, READING, START
from flownav.navigation.pad import SEEN
from flownav.navigation.rows import EXTRA_STATES, EstimateRow, InnovationRow
from flownav.navigation.take import UNIT_SIGNATURE
from flownav.navigation.tape import ESTIMATE_PERIOD_S, ESTIMATES, OFFERED_ROWS, Tape
from flownav.parts.calling import Called, Mistakes, name_of
from flownav.parts.protocols import Estimate, Filter, GivenSettings, Imu, Innovation, Reading

STATED = 3
QUALITY, ARRIVED, WITHHELD = (READING + MAX_VALUES + STATED + i for i in range(3))
STALE_S = 0.1  # so long an inertial reading serves
LARGEST = 1e9  # metres, m/s, rad/s or m/s2 that an estimate may hold: chosen, beyond any vehicle's
UNIT_TOLERANCE = 1e-3  # how far a quaternion's length may be from 1


class Taker:
    """The filter between the rows of a lane buffer and a tape."""

    def __init__(self, part: Filter, given: GivenSettings, nav: Array, tape: Tape, mistakes: Mistakes) -> None:
        self.part, self.given, self.nav, self.tape = part, given, nav, tape
        self.name = name_of(part)
        self.called = Called(f"filter {self.name}", self._called, UNIT_SIGNATURE, mistakes)
        self.begun, self.clock_s, self.written_s, self.imu_s = False, -math.inf, -math.inf, -math.inf
        self.imu: Imu | None = None

    @property
    def address(self) -> int:
        """Address of the C function that takes readings."""
        return self.called.address

    def _called(self, *arguments: float) -> None:
        self.take(float(arguments[-2]), Sensor(int(arguments[-1])))

    def take(self, t_s: float, sensor: Sensor) -> None:
        """The reading in the rows of READING, of an instant."""
        if not self.begun:
            self.begun = True
            self.part.start(self.given)
        nav = self.nav
        values = nav[READING : READING + MAX_VALUES]
        arrived = nav[ARRIVED] > 0.0
        inertial = sensor == Sensor.IMU and arrived and bool(np.isfinite(values).all())
        if inertial:
            self.imu, self.imu_s = Imu(values[:3].copy(), values[3:].copy(), held=True), t_s
        if t_s > self.clock_s or inertial:
            imu = self.imu if t_s - self.imu_s <= STALE_S else None
            self.part.predict(t_s, self.imu._replace(held=False) if inertial and self.imu else imu)
            self.clock_s = t_s
        if sensor != Sensor.IMU and arrived and nav[WITHHELD] == 0.0:
            width = MAX_VALUES if sensor == Sensor.FLOW_RATE else len(COLUMNS[sensor])
            variance = nav[READING + MAX_VALUES : READING + MAX_VALUES + STATED].copy()
            news = self.part.update(Reading(t_s, sensor, values[:width].copy(), variance, float(nav[QUALITY])))
            self._offer(t_s, sensor, news or ())
        nav[CLOCK] = t_s
        estimate_, due = self.part.estimate(), t_s - self.written_s >= ESTIMATE_PERIOD_S
        self.written_s = t_s if due else self.written_s
        if estimate_ is not None:
            numbers = self._say(estimate_)
            if due:
                self._write(t_s, numbers)

    def _say(self, estimate_: Estimate) -> dict[str, Array]:
        """The estimate into the rows that the simulator reads; as arrays."""
        nav, numbers = self.nav, checked(self.name, estimate_)
        for row, key in (
            (STATE + POSITION, "pos_ned_m"), (STATE + VELOCITY, "vel_ned_m_s"), (QUATERNION, "quaternion"),
            (STATE + GYRO_BIAS, "gyro_bias_rad_s"), (STATE + ACCEL_BIAS, "accel_bias_m_s2"),
        ):  # fmt: skip
            nav[row : row + len(numbers[key])] = numbers[key]
        for first, key in ((POSITION, "std_pos_ned_m"), (VELOCITY, "std_vel_ned_m_s")):
            for axis in range(3):
                nav[place(first + axis, first + axis)] = numbers[key][axis] ** 2
        nav[START] = 1.0
        if estimate_.ground_d_m is not None:
            nav[STATE + GROUND], nav[GROUND_SEEN] = estimate_.ground_d_m, 1.0
        if estimate_.pad_ned_m is not None:
            nav[STATE + PAD : STATE + PAD + 3], nav[PAD_KNOWN] = tuple(estimate_.pad_ned_m), SEEN
        return numbers

    def _write(self, t_s: float, numbers: dict[str, Array]) -> None:
        """The estimate onto the tape, as ours is every 20 ms."""
        used, room = self.tape.used, len(self.tape.estimate)
        if used[ESTIMATES] >= room:
            return
        rotation = np.reshape(rotation_from_quaternion(*numbers["quaternion"]), (3, 3))
        biases = numbers["gyro_bias_rad_s"], numbers["accel_bias_m_s2"]
        row: EstimateRow[Any] = EstimateRow(
            t_s=t_s,
            pos_ned_m=numbers["pos_ned_m"],
            vel_frd_m_s=rotation.T @ numbers["vel_ned_m_s"],
            quaternion=numbers["quaternion"],
            std_pos_ned_m=numbers["std_pos_ned_m"],
            std_vel_frd_m_s=np.sqrt((rotation.T**2) @ numbers["std_vel_ned_m_s"] ** 2),
            vel_ned_m_s=numbers["vel_ned_m_s"],
            std_tilt_ned_rad=np.full(3, np.nan),
            states=np.concatenate([*biases, np.full(len(EXTRA_STATES) - 6, np.nan)]),
            std_states=np.full(len(EXTRA_STATES), np.nan),
            protection_m=np.full(2, np.nan),
        )
        self.tape.estimate[used[ESTIMATES], :, 0] = np.hstack(row)
        used[ESTIMATES] += 1

    def _offer(self, t_s: float, sensor: Sensor, news: Iterable[Innovation]) -> None:
        """Innovations onto the tape, as ours are."""
        used = self.tape.used
        for each in news:
            require_innovation(self.name, each)
            if used[OFFERED_ROWS] >= len(self.tape.innovation):
                return
            ratio = each.innovation**2 / (25.0 * each.variance) if each.variance > 0.0 else math.nan
            reason = Reason.FUSED if each.fused else Reason.INNOVATION_GATE
            self.tape.innovation[used[OFFERED_ROWS], :, 0] = InnovationRow(
                t_s, sensor, each.component, each.observation, each.observation_variance, each.innovation,
                each.variance, ratio, reason,
            )  # fmt: skip
            used[OFFERED_ROWS] += 1


def require_innovation(name: str, each: Innovation) -> None:
    """InputError where an innovation is no number, or its variance is none."""
    if not math.isfinite(each.innovation) or not (math.isfinite(each.variance) and each.variance > 0.0):
        raise InputError(
            f"{name}: update() gave an innovation of {each.innovation} with variance {each.variance}; finite ones, "
            "and a variance above 0, are needed"
        )


def checked(name: str, estimate_: Estimate) -> dict[str, Array]:
    """An estimate as arrays. InputError where a part of it has another length, is not finite or is no rotation."""
    lengths = {"quaternion": 4}
    found: dict[str, Array] = {}
    for key in ("pos_ned_m", "vel_ned_m_s", "quaternion", "std_pos_ned_m", "std_vel_ned_m_s", "gyro_bias_rad_s",
                "accel_bias_m_s2"):  # fmt: skip
        length = lengths.get(key, 3)
        array = np.asarray(tuple(islice(getattr(estimate_, key), length + 1)), dtype=float)
        if array.shape != (length,):
            raise InputError(f"{name}: estimate().{key} has shape {array.shape}; ({length},) is needed")
        if not key.startswith("std_") and not np.isfinite(array).all():
            raise InputError(f"{name}: estimate().{key} is not finite: {array.tolist()}")
        if (np.abs(array) > LARGEST).any():
            raise InputError(f"{name}: estimate().{key} is beyond {LARGEST:g}: {array.tolist()}")
        if key.startswith("std_") and (array < 0.0).any():
            raise InputError(f"{name}: estimate().{key} is below 0: {array.tolist()}; NaN where it states none")
        found[key] = array
    places = (("ground_d_m", 1), ("pad_ned_m", 3))
    for key, length in places:
        value = getattr(estimate_, key)
        if value is not None:
            array = np.atleast_1d(np.asarray(value, dtype=float))
            if array.shape != (length,) or not np.isfinite(array).all():
                raise InputError(f"{name}: estimate().{key} is {array.tolist()}; {length} finite, or None, is needed")
    if abs(float(np.linalg.norm(found["quaternion"])) - 1.0) > UNIT_TOLERANCE:
        raise InputError(f"{name}: estimate().quaternion has length {np.linalg.norm(found['quaternion']):.3f}, not 1")
    return found
