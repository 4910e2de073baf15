"""The reduced linear model about hover, as the paper uses it: six states, four inputs, exact derivatives.

States x, y, z (earth NED) and u, v, w (body); inputs lon, lat, col, ped, the blade angles. Everything else is held
at its trim value: attitude and body rates (zero) are no states, the servos are taken as settled, and the flapping
angles are frozen, which is why the columns of lon and lat are zero, as they are in the paper's B_red: tilting
reaches the velocities through flapping and attitude only.

With *frozen inflow* the induced velocities of both rotors keep their trim values (the paper's reading; right for
times well under the inflow lag of 50 ms); with *quasi-steady inflow* they are re-solved with every change.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.vehicle import airframe, helicopter
from flownav.vehicle.around import CALM
from flownav.vehicle.complex_step import jacobian
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.state import Controls, HelicopterState, Inflow
from flownav.vehicle.trim import Trim

STATES = ("x", "y", "z", "u", "v", "w")
INPUTS = ("lon", "lat", "col", "ped")

# The fins lift with |u|, which has a kink in hover: the derivatives are the mean of both sides.
BESIDE_HOVER_M_S = 1e-9

Array = NDArray[np.float64]


class LinearModel(NamedTuple):
    """ẋ = A·x + B·u about trim: A (6, 6) and B (6, 4) in STATES and INPUTS, SI, radians, 1/s."""

    a: Array
    b: Array


def reduced_model(vehicle: VehicleParameters, about: Trim, *, freeze_inflow: bool) -> LinearModel:
    """A and B of the reduced model about a trim, in still air (see the module)."""
    held = _inflow_at(about.state, vehicle) if freeze_inflow else None

    def rates(point: Sequence[Any]) -> Sequence[Any]:
        state, controls = _displaced(about, point)
        rotation = airframe.attitude(state)
        air = airframe.air_motion(state, rotation, CALM)
        blades = helicopter.blade_angles(state, vehicle)
        induced = helicopter.inflow(air, blades, 1.0, vehicle) if held is None else held
        rate = helicopter.derivative_at_inflow(state, controls, air, rotation, induced, CALM, vehicle)
        return (rate.pos_n, rate.pos_e, rate.pos_d, rate.u, rate.v, rate.w)

    trim = about.state
    here = np.array([trim.pos_n, trim.pos_e, trim.pos_d, trim.u, trim.v, trim.w, *about.controls])
    aside = np.zeros(len(here))
    aside[STATES.index("u")] = BESIDE_HOVER_M_S
    both = 0.5 * (jacobian(rates, here + aside) + jacobian(rates, here - aside))
    return LinearModel(both[:, : len(STATES)], both[:, len(STATES) :])


def _displaced(about: Trim, point: Sequence[Any]) -> tuple[HelicopterState, Controls]:
    """The trim with the reduced states and the settled inputs at a point; the rest as in trim."""
    n, e, d, u, v, w, lon, lat, col, ped = point
    moved = {"pos_n": n, "pos_e": e, "pos_d": d, "u": u, "v": v, "w": w, "lon": lon, "lat": lat, "col": col, "ped": ped}
    return about.state._replace(**moved), Controls(lon, lat, col, ped)


def _inflow_at(state: HelicopterState, vehicle: VehicleParameters) -> Inflow:
    air = airframe.air_motion(state, airframe.attitude(state), CALM)
    return helicopter.inflow(air, helicopter.blade_angles(state, vehicle), 1.0, vehicle)


def eigenvalues(a: Array) -> NDArray[np.complex128]:
    """Eigenvalues of A [1/s], ordered by real then imaginary part, the slowest last."""
    return np.sort_complex(np.linalg.eigvals(a).astype(complex))
