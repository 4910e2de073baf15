"""The whole vehicle as a linear plant about hover: what its controller sees, with exact derivatives.

Unlike the reduced model of `linearize`, little is held: attitude, body rates, flapping and the servos, or the rotors'
speeds, are states. A helicopter's rotor keeps its speed in `hover_plant`, as a perfect governor would have it, and its
inflow is held or in balance at once; in `rotor_plant` inflow, rotor speed and governor are states, too. Servos answer
every error: slop has no derivative.
The attitude is a small rotation about the body axes, so that the plant has no state for a quaternion's length.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.vehicle import airframe, helicopter, multirotor
from flownav.vehicle.around import CALM
from flownav.vehicle.complex_step import jacobian
from flownav.vehicle.kinds import AnyState, AnyTrim, AnyVehicle
from flownav.vehicle.linearize import BESIDE_HOVER_M_S
from flownav.vehicle.multirotor_parameters import MultirotorParameters, with_inflow_held
from flownav.vehicle.multirotor_trim import is_hexa
from flownav.vehicle.parameters import VehicleParameters, without_slop
from flownav.vehicle.state import Controls, HelicopterState
from flownav.vehicle.trim import Trim

FIELDS = HelicopterState._fields
ATTITUDE = slice(FIELDS.index("qw"), FIELDS.index("qw") + 4)
INPUTS = ("lon", "lat", "col", "ped")
# position and velocity over the ground NED [m, m/s]; sines of pitch and roll as the autopilot takes them, heading;
# body rates [rad/s]
OUTPUTS = ("pos_n", "pos_e", "pos_d", "vel_n", "vel_e", "vel_d", "pitch", "roll", "heading", "p", "q", "r")

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class LinearPlant(NamedTuple):
    """ẋ = A·x + B·u, y = C·x about hover: A (n, n), B (n, 4), C (12, n); u in INPUTS, y in OUTPUTS, SI, radians.

    n is 22 of a helicopter (25 with its rotor), 16 of a quad and 18 of a hexa, whose controls are shares of thrust
    (`motors`).
    """

    a: Array
    b: Array
    c: Array


def hover_plant(vehicle: AnyVehicle, about: AnyTrim, *, freeze_inflow: bool = False) -> LinearPlant:
    """The plant about a trim in still air, heading north.

    freeze_inflow: the induced velocities keep their trim values, the plant of the first 50 ms; else they are in
    balance at once, the plant of all that is slower. A rotor is between the two.
    """
    return _linear(_rates(vehicle, about, freeze_inflow=freeze_inflow), about, _kept(vehicle, len(about.state)))


def rotor_plant(vehicle: VehicleParameters, about: Trim) -> LinearPlant:
    """A helicopter's plant about a trim with the lag of its inflow, the droop of its rotor and its governor."""
    stiff = without_slop(vehicle)

    def rates(state: HelicopterState, controls: Controls, n: float, e: float) -> HelicopterState:
        return helicopter.derivative(state, controls, CALM._replace(wind_n_m_s=n, wind_e_m_s=e), stiff)

    return _linear(rates, about, list(range(len(about.state))))


def _linear(rates: Callable[..., Sequence[Any]], about: AnyTrim, kept: list[int]) -> LinearPlant:
    """A and B of rates of (state, controls, wind north, wind east) about a trim; the `kept` fields move."""
    trim, kind = np.array([float(x) for x in about.state]), type(about.state)
    count = len(trim)

    def displaced(point: Sequence[Any]) -> Sequence[Any]:
        return rates(kind(*point[:count]), Controls(*point[count:]), 0.0, 0.0)

    here = np.array([*trim, *about.controls])
    aside = np.zeros(len(here))
    aside[FIELDS.index("u")] = BESIDE_HOVER_M_S  # the fins' lift has a kink in hover (see linearize)
    both = 0.5 * (jacobian(displaced, here + aside) + jacobian(displaced, here - aside))
    seen = jacobian(lambda point: _outputs(kind(*point)), trim)
    out, into = _small_rotation(trim[ATTITUDE], kept, count)
    return LinearPlant(into @ both[:, :count] @ out, into @ both[:, count:], seen @ out)


def gust_input(vehicle: AnyVehicle, about: AnyTrim) -> Array:
    """What wind from the south and from the west (it blows north, east [m/s]) makes of the plant's states, (n, 2)."""
    rates = _rates(vehicle, about, freeze_inflow=False)
    aside = np.array([BESIDE_HOVER_M_S, 0.0])

    def blown(wind: Sequence[Any]) -> Sequence[Any]:
        return rates(about.state, about.controls, wind[0], wind[1])

    count = len(about.state)
    _, into = _small_rotation(np.array(about.state[ATTITUDE]), _kept(vehicle, count), count)
    return np.asarray(into @ (0.5 * (jacobian(blown, aside) + jacobian(blown, -aside))))


def frequency_response(plant: LinearPlant, omega_rad_s: Array) -> Complex:
    """C·(jω - A)⁻¹·B at each frequency (n,): (n, outputs, inputs)."""
    resolvent = 1j * omega_rad_s[:, None, None] * np.eye(len(plant.a)) - plant.a
    return np.asarray(
        plant.c @ np.linalg.solve(resolvent, np.broadcast_to(plant.b, (len(omega_rad_s), *plant.b.shape)))
    )


def _rates(vehicle: AnyVehicle, about: AnyTrim, *, freeze_inflow: bool) -> Callable[..., Sequence[Any]]:
    """The rates of a state under controls and wind north, east [m/s], of either kind of vehicle."""
    if isinstance(vehicle, MultirotorParameters):
        flown = with_inflow_held(vehicle) if freeze_inflow else vehicle
        hexa = is_hexa(vehicle)
        return lambda state, controls, n, e: multirotor.derivative(
            state, controls, CALM._replace(wind_n_m_s=n, wind_e_m_s=e), hexa, flown
        )
    stiff = without_slop(vehicle)
    trim: Any = about.state
    held = helicopter.inflow_of(trim, CALM, stiff)

    def of_helicopter(state: HelicopterState, controls: Controls, n: float, e: float) -> HelicopterState:
        around = CALM._replace(wind_n_m_s=n, wind_e_m_s=e)
        if not freeze_inflow:
            return helicopter.derivative_in_balance(state, controls, around, stiff)
        rotation = airframe.attitude(state)
        moving = airframe.air_motion(state, rotation, around)
        return helicopter.derivative_at_inflow(state, controls, moving, rotation, held, around, stiff)

    return of_helicopter


def _kept(vehicle: AnyVehicle, count: int) -> list[int]:
    """Which fields of the state move about hover: not a helicopter's inflow and rotor speed, not the rotors that a quad
    has not, nor the battery's charge.
    """
    if not isinstance(vehicle, MultirotorParameters):
        return list(range(FIELDS.index("inflow")))
    return list(range(FIELDS.index("r") + 1 + int(vehicle.rotor_count)))


def _outputs(state: AnyState) -> tuple[Any, ...]:
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    velocity = to_earth(rotation, state.u, state.v, state.w)
    heading = rotation[3] / np.sqrt(rotation[0] * rotation[0] + rotation[3] * rotation[3])
    return (
        state.pos_n, state.pos_e, state.pos_d, *velocity, -rotation[6], rotation[7], heading, state.p, state.q, state.r,
    )  # fmt: skip


def _small_rotation(quaternion: Array, kept: list[int], count: int) -> tuple[Array, Array]:
    """From the plant's n states to the `count` of the vehicle's about a trim, (count, n), and back, (n, count).

    q = q0 ⊗ (1, δ/2): a rotation δ (3,) about the body axes stands for the quaternion's four components. What is not
    `kept` stays as in trim.
    """
    w, x, y, z = quaternion
    turned = 0.5 * np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]])
    first, last = ATTITUDE.start, ATTITUDE.stop
    behind = [field for field in kept if field >= last]
    out = np.zeros((count, first + 3 + len(behind)))
    out[:first, :first] = np.eye(first)
    out[ATTITUDE, first : first + 3] = turned
    out[behind, range(first + 3, first + 3 + len(behind))] = 1.0
    return out, np.asarray(np.linalg.pinv(out), float)
