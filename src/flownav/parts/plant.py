"""A vehicle and a controller of somebody else's, called by the simulator's loop in place of ours."""

from __future__ import annotations

import numpy as np

from flownav.control.guidance import reference_at
from flownav.core.compile import ONE_LANE, runge_kutta
from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.parts.calling import Called, Mistakes, name_of
from flownav.parts.protocols import Controller, Flown, VehicleModel
from flownav.simulation import layout
from flownav.simulation.epoch import own_attitude
from flownav.simulation.layout import (
    PLANT,
    load_around,
    load_autopilot,
    load_controls,
    load_helicopter,
    store_controls,
    store_loads,
)
from flownav.simulation.plan import ATTITUDE_S, Flight
from flownav.simulation.records import AttitudeError, Loads
from flownav.vehicle.around import Around
from flownav.vehicle.state import Controls

RIGID = 13
load_error, _ = PLANT.access(AttitudeError)
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
        controls, around = load_controls(self._work, ONE_LANE, 0), load_around(self._work, ONE_LANE, 0)
        if dt_s == 0.0:
            self._t_s, self._state = 0.0, self._checked("start", self._part.start(rows.copy()), None)
        else:
            self._state = self._moved(dt_s, controls, around)
            self._t_s += dt_s
        rows[:] = self._state[:RIGID]
        seen = self._part.outputs(self._t_s, self._state, controls, around)
        if not np.isfinite(tuple(seen)).all():
            raise InputError(f"vehicle {name_of(self._part)}: outputs() gave {tuple(seen)}; finite ones are needed")
        store_loads(self._work, ONE_LANE, 0, Loads(seen.thrust_n, seen.contact_force_n, seen.power_w))

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
        part.start(flight.gains)
        self.called = Called(f"controller {name_of(part)}", self._steer, "p", mistakes)

    def _steer(self, _work: int) -> None:
        work, t_s = self._work, self._calls * ATTITUDE_S
        self._calls += 1
        state = load_helicopter(work, ONE_LANE, 0)
        seen = work[layout.ESTIMATE : layout.ESTIMATE + 9]
        home = work[layout.HOME : layout.HOME + 3]
        flown = Flown(
            seen[:3] - home, seen[3:6].copy(), np.array(own_attitude(state, load_error(work, ONE_LANE, 0))),
            np.array([state.p, state.q, state.r]), seen[6:9].copy(),
        )  # fmt: skip
        flying = load_autopilot(work, ONE_LANE, 0).flying > 0.0
        asked = self._part.command(t_s, flown, reference_at(self._flight.path, t_s), flying=flying)
        controls = tuple(float(value) for value in asked)
        if len(controls) != len(Controls._fields) or not np.isfinite(controls).all():
            raise InputError(
                f"controller {name_of(self._part)}: command() gave {controls}; four finite angles are needed "
                f"({', '.join(Controls._fields)}) [rad]"
            )
        store_controls(work, ONE_LANE, 0, Controls(*controls))
