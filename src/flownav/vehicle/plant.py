"""The whole helicopter as a linear plant about hover: what its controller sees, with exact derivatives.

Unlike the reduced model of `linearize`, nothing is held: attitude, body rates, flapping and the servos are states.
The attitude is a small rotation about the body axes, so that the plant has no state for a quaternion's length.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.frames import to_earth
from flownav.vehicle import helicopter
from flownav.vehicle.complex_step import jacobian
from flownav.vehicle.linearize import BESIDE_HOVER_M_S
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.state import Controls, HelicopterState, Inflow
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
    """ẋ = A·x + B·u, y = C·x about hover: A (22, 22), B (22, 4), C (12, 22); u in INPUTS, y in OUTPUTS, SI, radians."""

    a: Array
    b: Array
    c: Array


def hover_plant(vehicle: VehicleParameters, about: Trim, *, freeze_inflow: bool = False) -> LinearPlant:
    """The plant about a trim in still air, heading north.

    freeze_inflow: the induced velocities keep their trim values, the plant of the first 50 ms; else they are in
    balance at once, the plant of all that is slower. A rotor is between the two.
    """
    trim = about.state
    air = helicopter.air_motion(trim, helicopter.attitude(trim), 0.0, 0.0, 0.0)
    held = helicopter.inflow(air, helicopter.blade_angles(trim, vehicle), vehicle) if freeze_inflow else None
    count = len(FIELDS)

    def rates(point: Sequence[Any]) -> Sequence[Any]:
        return _rates(HelicopterState(*point[:count]), Controls(*point[count:]), held, vehicle)

    here = np.array([*trim, *about.controls])
    aside = np.zeros(len(here))
    aside[FIELDS.index("u")] = BESIDE_HOVER_M_S  # the fins' lift has a kink in hover (see linearize)
    both = 0.5 * (jacobian(rates, here + aside) + jacobian(rates, here - aside))
    seen = jacobian(lambda point: _outputs(HelicopterState(*point)), np.array(trim))
    out, into = _small_rotation(np.array(trim[ATTITUDE]))
    return LinearPlant(into @ both[:, :count] @ out, into @ both[:, count:], seen @ out)


def gust_input(vehicle: VehicleParameters, about: Trim) -> Array:
    """What wind from the south and from the west (it blows north, east [m/s]) makes of the plant's states, (22, 2)."""

    def rates(wind: Sequence[Any]) -> Sequence[Any]:
        return helicopter.derivative(about.state, about.controls, wind[0], wind[1], 0.0, vehicle)

    aside = np.array([BESIDE_HOVER_M_S, 0.0])
    _, into = _small_rotation(np.array(about.state[ATTITUDE]))
    return np.asarray(into @ (0.5 * (jacobian(rates, aside) + jacobian(rates, -aside))))


def frequency_response(plant: LinearPlant, omega_rad_s: Array) -> Complex:
    """C·(jω - A)⁻¹·B at each frequency (n,): (n, outputs, inputs)."""
    resolvent = 1j * omega_rad_s[:, None, None] * np.eye(len(plant.a)) - plant.a
    return np.asarray(
        plant.c @ np.linalg.solve(resolvent, np.broadcast_to(plant.b, (len(omega_rad_s), *plant.b.shape)))
    )


def _rates(
    state: HelicopterState, controls: Controls, held: Inflow | None, vehicle: VehicleParameters
) -> HelicopterState:
    if held is None:
        return helicopter.derivative(state, controls, 0.0, 0.0, 0.0, vehicle)
    rotation = helicopter.attitude(state)
    air = helicopter.air_motion(state, rotation, 0.0, 0.0, 0.0)
    return helicopter.derivative_at_inflow(state, controls, air, rotation, held, vehicle)


def _outputs(state: HelicopterState) -> tuple[Any, ...]:
    rotation = helicopter.attitude(state)
    velocity = to_earth(rotation, state.u, state.v, state.w)
    heading = rotation[3] / np.sqrt(rotation[0] * rotation[0] + rotation[3] * rotation[3])
    return (
        state.pos_n, state.pos_e, state.pos_d, *velocity, -rotation[6], rotation[7], heading, state.p, state.q, state.r,
    )  # fmt: skip


def _small_rotation(quaternion: Array) -> tuple[Array, Array]:
    """From 22 states to the 23 of HelicopterState about a trim, (23, 22), and back, (22, 23).

    q = q0 ⊗ (1, δ/2): a rotation δ (3,) about the body axes stands for the quaternion's four components.
    """
    w, x, y, z = quaternion
    turned = 0.5 * np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]])
    first, last = ATTITUDE.start, ATTITUDE.stop
    out = np.zeros((len(FIELDS), len(FIELDS) - 1))
    out[:first, :first] = np.eye(first)
    out[ATTITUDE, first : first + 3] = turned
    out[last:, first + 3 :] = np.eye(len(FIELDS) - last)
    return out, np.asarray(np.linalg.pinv(out), float)
