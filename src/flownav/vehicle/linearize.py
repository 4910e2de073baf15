"""A vehicle as a linear plant about hover, with exact derivatives: reduced as the paper has it, and whole.

**Reduced**, six states and four inputs. States x, y, z (earth NED) and u, v, w (body); inputs lon, lat, col, ped, the
blade angles. Everything else is held at its trim value: attitude and body rates (zero) are no states, the servos are
taken as settled, and the flapping angles are frozen, which is why the columns of lon and lat are zero, as they are in
the paper's B_red: tilting reaches the velocities through flapping and attitude only.

With *frozen inflow* the induced velocities of both rotors keep their trim values (the paper's reading; right for
times well under the inflow lag of 50 ms); with *quasi-steady inflow* they are re-solved with every change.

The model that the paper prints (A_red, B_red, R and Q, equations 18-23) stands in a file, verbatim.

**Whole**, what a controller sees. Little is held: attitude, body rates, flapping and the servos, or the rotors'
speeds, are states. A helicopter's rotor keeps its speed in `hover_plant`, as a perfect governor would have it, and its
inflow is held or in balance at once; in `rotor_plant` inflow, rotor speed and governor are states, too. Servos answer
every error: slop has no derivative.
The attitude is a small rotation about the body axes, so that the plant has no state for a quaternion's length.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.core.measurement import Array
from flownav.core.parameter_files import Number, ParameterModel, load, shipped
from flownav.vehicle import airframe, helicopter, multirotor
from flownav.vehicle.complex_step import jacobian
from flownav.vehicle.kinds import AnyState, AnyTrim, AnyVehicle
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters, with_inflow_held, without_slop
from flownav.vehicle.state import CALM, Controls, HelicopterState, Inflow
from flownav.vehicle.trim import Trim, is_hexa

STATES = ("x", "y", "z", "u", "v", "w")
INPUTS = ("lon", "lat", "col", "ped")

# The fins lift with |u|, which has a kink in hover: the derivatives are the mean of both sides.
BESIDE_HOVER_M_S = 1e-9


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


SHIPPED_MODEL = "paper_reduced_model.toml"

Row4 = tuple[float, float, float, float]
Row6 = tuple[float, float, float, float, float, float]


class ReducedModelFile(ParameterModel):
    """The file of a six-state, four-input model, schema 1."""

    schema_version: Literal[1]
    source: str
    update_rate_hz: Number = Field(gt=0.1, lt=10000.0)
    states: tuple[str, str, str, str, str, str]
    inputs: tuple[str, str, str, str]
    A: tuple[Row6, Row6, Row6, Row6, Row6, Row6]
    B: tuple[Row4, Row4, Row4, Row4, Row4, Row4]
    measurement_variance: Row6
    process_variance: Row6

    @field_validator("measurement_variance", "process_variance")
    @classmethod
    def _positive(cls, variances: Row6) -> Row6:
        if min(variances) < 0.0:
            raise ValueError("variances should not be negative")
        return variances


class ReducedModel(NamedTuple):
    """ẋ = A·x + B·u with x = (x, y, z [m, earth], u, v, w [m/s, body]) and u = (lon, lat, col, ped) [rad from trim].

    a (6, 6) and b (6, 4) continuous [1/s]; r (6, 6) and q (6, 6) covariances at each update of the filter.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    a: Array
    b: Array
    r: Array
    q: Array
    update_rate_hz: float


def load_paper_model(path: Path | None = None) -> ReducedModel:
    """The paper's model, or one of the same form from a file. InputError names file, key and what is allowed."""
    file = load(path or shipped(SHIPPED_MODEL), ReducedModelFile)
    r, q = np.diag(file.measurement_variance), np.diag(file.process_variance)
    return ReducedModel(file.states, file.inputs, np.array(file.A), np.array(file.B), r, q, file.update_rate_hz)


FIELDS = HelicopterState._fields
ATTITUDE = slice(FIELDS.index("qw"), FIELDS.index("qw") + 4)
# position and velocity over the ground NED [m, m/s]; sines of pitch and roll as the autopilot takes them, heading;
# body rates [rad/s]
OUTPUTS = ("pos_n", "pos_e", "pos_d", "vel_n", "vel_e", "vel_d", "pitch", "roll", "heading", "p", "q", "r")

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
    """Input matrix of wind from the south and from the west (it blows north, east [m/s]) on the plant's states, (n,
    2).
    """
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
