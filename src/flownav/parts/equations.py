"""The fast path: a filter or a vehicle of one's own written as equations, compiled into the loop and run on lanes.

The equations are written as in the navigator's own rooms: named tuples of floats in and out, `@equation` functions of
scalars. From Python they are plain Python, so the object also flies on the slow path; a test holds the two together.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import ONE_LANE, Lanes, Unit, Work, equation, lane_access, runge_kutta, stepping, unit
from flownav.core.errors import InputError
from flownav.core.frames import of_unit_length
from flownav.core.measurement import Array, Sensor
from flownav.estimation.covariance import place
from flownav.estimation.states import ACCEL_BIAS, GROUND, GYRO_BIAS, POSITION, QUATERNION, STATE, VELOCITY
from flownav.navigation.memory import (
    CLOCK,
    GROUND_SEEN,
    LAST_ESTIMATE,
    OWN_FILTER,
    OWN_ROWS,
    START,
    load_reading,
    share,
    shared,
)
from flownav.navigation.records import Reading as Row
from flownav.navigation.take import UNIT_SIGNATURE
from flownav.navigation.tape import ESTIMATE_PERIOD_S, output_of, write_estimate
from flownav.parts.calling import naming_part
from flownav.parts.protocols import Estimate, GivenSettings, Imu, Innovation, Outputs, Reading
from flownav.simulation import layout
from flownav.simulation.layout import load_around, load_controls
from flownav.vehicle.state import Around, Controls

RIGID = 13
NAN = math.nan


class EquationEstimate(NamedTuple):
    """The estimate of a filter, as `protocols.Estimate` in scalars. known: 1 once it has started; variances in m2,
    m2/s2.

    grounded: 1 once ground_d is known. Fields at its end that equations leave out have their defaults.
    """

    known: float
    pos_n: float
    pos_e: float
    pos_d: float
    vel_n: float
    vel_e: float
    vel_d: float
    qw: float
    qx: float
    qy: float
    qz: float
    variance_pos_n: float = NAN
    variance_pos_e: float = NAN
    variance_pos_d: float = NAN
    variance_vel_n: float = NAN
    variance_vel_e: float = NAN
    variance_vel_d: float = NAN
    gyro_bias_x: float = 0.0
    gyro_bias_y: float = 0.0
    gyro_bias_z: float = 0.0
    accel_bias_x: float = 0.0
    accel_bias_y: float = 0.0
    accel_bias_z: float = 0.0
    grounded: float = 0.0
    ground_d: float = 0.0


def address_of(compiled: Unit, name: str) -> int:
    """The address of a part's equations, compiled where they are not yet. InputError where they cannot be."""
    with naming_part(f"{name}: its equations cannot be compiled"):
        return compiled.address


# the rows from which simulator and tape read a filter's estimate, field by field
ESTIMATE_ROWS = (
    START,
    *range(STATE + POSITION, STATE + POSITION + 3),
    *range(STATE + VELOCITY, STATE + VELOCITY + 3),
    *range(QUATERNION, QUATERNION + 4),
    *(place(POSITION + axis, POSITION + axis) for axis in range(3)),
    *(place(VELOCITY + axis, VELOCITY + axis) for axis in range(3)),
    *range(STATE + GYRO_BIAS, STATE + GYRO_BIAS + 3),
    *range(STATE + ACCEL_BIAS, STATE + ACCEL_BIAS + 3),
    GROUND_SEEN,
    STATE + GROUND,
)
_, put_estimate = lane_access(EquationEstimate, ESTIMATE_ROWS)


Said = EquationEstimate  # its earlier name


class EquationFilter:
    """A filter as equations over a memory of its own.

    memory: a NamedTuple of floats, as it is before the first reading. step(memory, t_s, sensor, reading): the memory
    after a reading of an instant; reading: `flownav.navigation.records.Reading`, with `arrived` and `withheld`.
    say(memory): a `Said`. step and say are `@equation`s; sensor is compared with `flownav.core.measurement.Sensor`.
    """

    def __init__(
        self,
        name: str,
        memory: Any,
        step: Callable[[Any, float, int, Row], Any],
        say: Callable[[Any], EquationEstimate],
    ) -> None:
        if len(memory) > OWN_ROWS:
            raise InputError(f"filter {name}: its memory has {len(memory)} numbers; at most {OWN_ROWS} have room")
        self.name, self.memory, self.step, self.say = name, memory, step, say
        self._now, self._row = memory, Row(*([NAN] * len(Row._fields)))

    @cached_property
    def unit_source(self) -> Callable[..., None]:
        """The function that is compiled: `navigation.take.UNIT_SIGNATURE` and lanes."""
        step, say, initial = self.step, self.say, self.memory
        load, store = lane_access(type(self.memory), OWN_FILTER)

        def take_own(
            work: Work, p: Work, estimate: Work, innovation: Work, event: Work, entry: Work, state: Work,
            covariance: Work, room: NDArray[np.int64], used: NDArray[np.int64], t_s: float, sensor: int, lanes: Lanes,
        ) -> None:  # fmt: skip
            o = output_of(estimate, innovation, event, entry, state, covariance, room, used)
            begins = shared(work, lanes, CLOCK) == -np.inf
            for lane in range(len(lanes)):
                if begins:
                    store(work, lanes, lane, initial)
                after = step(load(work, lanes, lane), t_s, sensor, load_reading(work, lanes, lane))
                store(work, lanes, lane, after)
                put_estimate(work, lanes, lane, say(after))
            share(work, lanes, CLOCK, t_s)
            if t_s - shared(work, lanes, LAST_ESTIMATE) >= ESTIMATE_PERIOD_S:
                share(work, lanes, LAST_ESTIMATE, t_s)
                write_estimate(work, lanes, t_s, o)

        return take_own

    def unit(self, lanes: Lanes) -> Unit:
        """The unit compiled for this number of lanes when it is first run, and kept on disk."""
        if lanes not in self._units:
            self._units[lanes] = unit(self.unit_source, UNIT_SIGNATURE, lanes=lanes)
        return self._units[lanes]

    @cached_property
    def _units(self) -> dict[Lanes, Unit]:
        return {}

    def __deepcopy__(self, memo: dict[int, Any]) -> EquationFilter:
        """A new filter, in its state before the first reading; the compiled code is shared."""
        other = EquationFilter(self.name, self.memory, self.step, self.say)
        other.__dict__["_units"] = self._units
        return other

    # -- the slow path: `protocols.Filter` on the same equations
    def start(self, given: GivenSettings) -> None:
        """Begin: nothing is known yet."""
        self._now = self.memory

    def predict(self, t_s: float, imu: Imu | None) -> None:
        """An inertial reading is a reading as others are."""
        if imu is not None and not imu.held:
            row = self._row._replace(arrived=1.0, withheld=0.0, quality=255.0)
            values = dict(zip(Row._fields[:6], [*imu.rate_frd_rad_s, *imu.force_frd_m_s2], strict=True))
            self._now = self.step(self._now, t_s, int(Sensor.IMU), row._replace(**values))

    def update(self, reading: Reading) -> list[Innovation]:
        """Any other reading."""
        row = self._row._replace(arrived=1.0, withheld=0.0, quality=reading.quality)
        values = dict(zip(Row._fields, reading.value, strict=False))
        variances = dict(zip(Row._fields[6:9], reading.variance, strict=True))
        self._now = self.step(self._now, reading.t_s, int(reading.sensor), row._replace(**values, **variances))
        return []

    def estimate(self) -> Estimate | None:
        """The estimate, from `say`."""
        now = self.say(self._now)
        if not now.known:
            return None
        return Estimate(
            now[1:4], now[4:7], now[7:11], np.sqrt(now[11:14]), np.sqrt(now[14:17]), now[17:20], now[20:23],
            now.ground_d if now.grounded else None,
        )  # fmt: skip


class EquationVehicle:
    """A vehicle as equations over a state of its own, whose first 13 fields are the rigid body's.

    start: the state at the start, whose rigid part is put where the scenario begins. rate(state, controls, around):
    its rate, a state again; seen(state, controls, around): `protocols.Outputs`. Both are `@equation`s.
    """

    def __init__(
        self, name: str, start: Any, rate: Callable[[Any, Controls, Around], Any],
        seen: Callable[[Any, Controls, Around], Outputs],
    ) -> None:  # fmt: skip
        room = layout.STAGE - layout.HELICOPTER
        if not RIGID <= len(start) <= room:
            raise InputError(f"vehicle {name}: its state has {len(start)} numbers; {RIGID} to {room} have room")
        self.name, self.state, self.rate, self.seen = name, start, rate, seen

    @cached_property
    def unit_source(self) -> Callable[..., None]:
        """The function that is compiled: (work, dt [s]) and lanes; see `simulation.plan.OwnParts`."""
        rate, seen, begun = self.rate, self.seen, self.state
        load, store = lane_access(type(self.state), layout.HELICOPTER)
        _, step = runge_kutta(stepping(type(self.state)))

        def step_own(work: Work, dt: float, lanes: Lanes) -> None:
            for lane in range(len(lanes)):
                if dt == 0.0:
                    for i in range(RIGID, len(begun)):
                        work[(layout.HELICOPTER + i) * len(lanes) + lane] = begun[i]
                x, u, around = load(work, lanes, lane), load_controls(work, lanes, lane), load_around(work, lanes, lane)
                store(work, lanes, lane, step(rate, x, dt, u, around))
                unit_attitude(work, lanes, lane)
                store_outputs(work, lanes, lane, seen(load(work, lanes, lane), u, around))

        return step_own

    @cached_property
    def unit(self) -> Unit:
        """Compiled for one lane when it is first run, and kept on disk."""
        return unit(self.unit_source, "p d", lanes=ONE_LANE)

    def __deepcopy__(self, memo: dict[int, Any]) -> EquationVehicle:
        return self  # it remembers nothing

    # -- the slow path: `protocols.VehicleModel` on the same equations
    def start(self, rigid: Array) -> Array:
        """The state at the start."""
        return np.concatenate([rigid, np.array(self.state)[RIGID:]])

    def derivative(self, t_s: float, state: Array, controls: Controls, around: Around) -> Array:
        """The state's rate."""
        return np.array(self.rate(type(self.state)(*state), controls, around))

    def outputs(self, t_s: float, state: Array, controls: Controls, around: Around) -> Outputs:
        """Thrust, ground load and power."""
        return self.seen(type(self.state)(*state), controls, around)


class Turned(NamedTuple):
    """An attitude, body to earth."""

    qw: float
    qx: float
    qy: float
    qz: float


_, store_outputs = lane_access(Outputs, (layout.THRUST, layout.CONTACT, layout.POWER))
load_attitude, store_attitude = lane_access(Turned, layout.HELICOPTER + 6)


@equation
def unit_attitude(work: Work, lanes: Lanes, lane: int) -> None:
    """The quaternion brought back to unit length."""
    q = load_attitude(work, lanes, lane)
    w, x, y, z = of_unit_length((q.qw, q.qx, q.qy, q.qz))
    store_attitude(work, lanes, lane, Turned(w, x, y, z))
