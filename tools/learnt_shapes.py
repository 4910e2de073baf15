"""Search the gains for vehicles that were learnt in hover and print `control/learnt_shapes.py` (an hour on one core).

python tools/learnt_shapes.py [--between]

A node is a stiffness k and a lag of the shipped helicopter's pitch or roll: its inertia is moved until the stiffness is
that, its flapping and its servos until the lag is. What is sought is what `tools/shape_gains.py` seeks, the least drift
in turbulence, for the box of what is still unknown of a vehicle that was learnt: k and lag by 10 %, how the lag is
shared by flapping and servo by 12 %, drag and flapping response by 35 %, mass by 7.6 %, and the inflow held or in
balance. Position's gain is held, since both axes have one. --between: the margins that the shipped table keeps between
its nodes, on the same boxes.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.optimize import differential_evolution, minimize

from flownav.control import learnt_shapes
from flownav.control.design import gains_for, nominal_model
from flownav.control.gains import AutopilotGains
from flownav.control.learnt_gains import shape_at
from flownav.control.loops import spectral_radius
from flownav.control.margins import LEAST_GAIN_DB, LEAST_PHASE_DEG
from flownav.vehicle.kinds import hover_of, load_vehicle
from flownav.vehicle.linearize import INPUTS, OUTPUTS, frequency_response, gust_input, hover_plant
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.trim import Trim
from shape_gains import (
    AXES,
    LEAST,
    MOST,
    OMEGA_RAD_S,
    RESERVE_DB,
    RESERVE_DEG,
    UNSTABLE,
    Axis,
    Shape,
    drift_m,
    least_margins,
    with_shape,
)

POSITION_1_S = 0.55
STIFFNESSES = {"forward": (300.0, 190.0, 120.0, 480.0), "right": (720.0, 450.0, 280.0, 1160.0)}
LAGS_S = (0.056, 0.045, 0.070)
STIFFNESS, LAG, SPLIT, DRAG, MASS = 0.10, 0.10, 0.12, 0.35, 0.076
DRAGS = ("fuselage_area_x_m2", "fuselage_area_y_m2", "flap_response")
INERTIA = {"forward": "inertia_yy_kg_m2", "right": "inertia_xx_kg_m2"}
START = {
    "forward": Shape(0.28, 0.16, 0.0265, 1.7, POSITION_1_S, 0.56, 0.1),
    "right": Shape(0.24, 0.11, 0.0122, 2.0, POSITION_1_S, 0.8, 0.1),
}
ROUNDS, POLISH = 40, 400


def lag_of(vehicle: VehicleParameters) -> float:
    """Of rotor and servo [s]."""
    return 1.0 / vehicle.flap_rate_1_s + 2.0 * vehicle.cyclic_damping_ratio / vehicle.cyclic_frequency_rad_s


def hover_trim(vehicle: VehicleParameters) -> Trim:
    """A helicopter's trim."""
    hover = hover_of(vehicle)
    assert isinstance(hover, Trim)
    return hover


def at_node(vehicle: VehicleParameters, name: str, stiffness: float, lag_s: float) -> VehicleParameters:
    """The vehicle with this stiffness [1/s2] of one axis and this lag."""
    told = nominal_model(vehicle, hover_trim(vehicle), -1)
    own = told.pitch_stiffness_1_s2 if name == "forward" else told.roll_stiffness_1_s2
    faster = lag_of(vehicle) / lag_s
    return vehicle._replace(
        **{INERTIA[name]: getattr(vehicle, INERTIA[name]) * own / stiffness},
        flap_rate_1_s=vehicle.flap_rate_1_s * faster,
        cyclic_frequency_rad_s=vehicle.cyclic_frequency_rad_s * faster,
    )


def box_of(vehicle: VehicleParameters, name: str, stiffness: float, lag_s: float) -> Iterator[VehicleParameters]:
    """The node and the corners of what is still unknown there."""
    middle = at_node(vehicle, name, stiffness, lag_s)
    yield middle
    for k, lag, split in itertools.product((-1, 1), repeat=3):
        one = at_node(vehicle, name, stiffness * np.exp(k * STIFFNESS), lag_s * np.exp(lag * LAG))
        flap = one.flap_rate_1_s * np.exp(split * SPLIT)
        servo = 2.0 * one.cyclic_damping_ratio / (lag_of(one) - 1.0 / flap)
        drags = {drag: getattr(one, drag) * (1.0 + DRAG * split * k) for drag in DRAGS}
        yield one._replace(flap_rate_1_s=flap, cyclic_frequency_rad_s=servo, **drags)
    for sign in (-1, 1):
        yield middle._replace(mass_kg=vehicle.mass_kg * (1.0 + MASS * sign))


def axis_of(name: str, vehicles: Sequence[VehicleParameters]) -> Axis:
    """One axis of all of them; of the first three with the inflow held, too."""
    seen, cyclic, _ = AXES[name]
    rows = [OUTPUTS.index(output) for output in seen]
    plants, cyclics, gusts = [], [], []
    for number, vehicle in enumerate(vehicles):
        about = hover_of(vehicle)
        for held in (False, True) if number < 3 else (False,):
            plant = hover_plant(vehicle, about, freeze_inflow=held)
            blown = plant._replace(b=gust_input(vehicle, about)[:, [0 if name == "forward" else 1]])
            plants.append(plant)
            cyclics.append(frequency_response(plant, OMEGA_RAD_S)[:, rows, INPUTS.index(cyclic)].T)
            gusts.append(frequency_response(blown, OMEGA_RAD_S)[:, rows, 0].T)
    return Axis(name, np.array(cyclics), np.array(gusts), tuple(plants))


def searched(axis: Axis, told: AutopilotGains, start: Shape) -> Shape:
    """The shape with the least drift whose margins hold over the box."""
    best = [np.inf]

    def shape_of(logarithms: Sequence[float]) -> Shape:
        return Shape(*(float(x) for x in np.exp(logarithms)))._replace(position_1_s=POSITION_1_S)

    def objective(logarithms: Sequence[float]) -> float:
        shape = shape_of(logarithms)
        phase, gain = least_margins(shape, axis)
        short = max(LEAST_PHASE_DEG + RESERVE_DEG - phase, 0.0) + 5.0 * max(LEAST_GAIN_DB + RESERVE_DB - gain, 0.0)
        worth = float(np.log(drift_m(shape, axis))) + short
        if worth < best[0]:
            gains = with_shape(told, shape, axis.name)
            if any(spectral_radius(plant, gains) >= 1.0 for plant in axis.plants):
                return UNSTABLE
            best[0] = worth
        return worth

    low, high = np.log(LEAST), np.log(MOST)
    found = differential_evolution(
        objective, list(zip(low, high, strict=True)), maxiter=ROUNDS, popsize=6, seed=0, tol=1e-4, polish=False,
        x0=np.clip(np.log(start), low, high),
    )  # fmt: skip
    simplex = found.x + np.vstack([np.zeros(len(low)), 0.08 * np.eye(len(low))])
    polished = minimize(
        objective, found.x, method="Nelder-Mead", options={"maxfev": POLISH, "initial_simplex": simplex}
    )
    return shape_of(polished.x if polished.fun < found.fun else found.x)


def between(name: str, vehicle: VehicleParameters, told: AutopilotGains) -> Iterator[str]:
    """Lines on the margins that the shipped table keeps half way between its nodes."""
    nodes, shapes = (
        (learnt_shapes.PITCH_NODES, learnt_shapes.PITCH_SHAPES) if name == "forward"
        else (learnt_shapes.ROLL_NODES, learnt_shapes.ROLL_SHAPES)
    )  # fmt: skip
    lags = learnt_shapes.LAG_NODES
    middles = [0.5 * (nodes[i] + nodes[i + 1]) for i in range(len(nodes) - 1)]
    for k, lag in itertools.product([*nodes, *middles], [*lags, *(0.5 * (lags[1:] + lags[:-1]))]):
        axis = axis_of(name, list(box_of(vehicle, name, float(np.exp(k)), float(np.exp(lag)))))
        attitude, integral, lead, velocity, distance, gust = (shape_at(k, lag, nodes, shapes, i) for i in range(6))
        gain = attitude / at_node(vehicle, name, float(np.exp(k)), float(np.exp(lag))).flap_rate_1_s
        shape = Shape(gain, gain * integral, gain * lead, velocity, POSITION_1_S, distance, gust)
        stable = all(spectral_radius(plant, with_shape(told, shape, name)) < 1.0 for plant in axis.plants)
        phase, decibels = least_margins(shape, axis)
        drift = 1e3 * drift_m(shape, axis)
        yield (
            f"{name:8}{np.exp(k):8.0f} 1/s2 {1e3 * np.exp(lag):6.1f} ms {phase:7.1f} deg {decibels:6.1f} dB "
            f"{drift:6.1f} mm{'' if stable else ' UNSTABLE'}"
        )


def main(arguments: Sequence[str]) -> None:
    """The module's tables, or the margins between their nodes."""
    vehicle = load_vehicle()
    assert isinstance(vehicle, VehicleParameters)
    told = gains_for(vehicle, hover_of(vehicle), 0.0)
    for name in AXES:
        if "--between" in arguments:
            for line in between(name, vehicle, told):
                print(line, flush=True)
            continue
        found: dict[tuple[float, float], Shape] = {}
        for lag, stiffness in itertools.product(LAGS_S, STIFFNESSES[name]):
            axis = axis_of(name, list(box_of(vehicle, name, stiffness, lag)))
            steps = {at: abs(np.log(at[0] / stiffness)) + 2.0 * abs(np.log(at[1] / lag)) for at in found}
            start = found[min(steps, key=lambda at: steps[at])] if found else START[name]
            found[stiffness, lag] = searched(axis, told, start)
        for stiffness in sorted(STIFFNESSES[name]):
            for lag in sorted(LAGS_S):
                shape, rate = found[stiffness, lag], at_node(vehicle, name, stiffness, lag).flap_rate_1_s
                numbers = (
                    shape.attitude * rate, shape.attitude_integral_1_s / shape.attitude,
                    shape.damping_s / shape.attitude, shape.velocity_1_s, shape.velocity_integral_1_s2, shape.gust_s,
                )  # fmt: skip
                print(f"[{', '.join(f'{x:.4g}' for x in numbers)}],  # {name} {stiffness:g} 1/s2, {1e3 * lag:g} ms")


if __name__ == "__main__":
    main(sys.argv[1:])
