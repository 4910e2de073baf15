"""Flight laws tried beside the shipped one, each searched for the same margins and the least drift (minutes).

python tools/other_laws.py [--rounds N] [--law PART-OF-A-NAME] [--axis NAME] [--json FILE]

The plant is the shipped helicopter's in hover (22 states), one horizontal axis at a time, with sampling, holds and the
estimate's delay; turbulence, box, margins and search are those of `tools/shape_gains.py`. Two boxes: the sheet's, and
the vehicle's that was learnt in hover (`tools/learnt_shapes.py`, its middle node). The laws:

observer: the shipped law. Tilt by gain, integral and rate; what the accelerometers feel and the tilt does not explain
is a state of wind, low-passed and answered with tilt: a model v' = sign g tilt + d that is followed, with constant d.
The outer loop of INDI (command the tilt that is measured, and what acceleration lacks over g) is the same law to the
letter (`tests/control/test_other_laws.py`).

without: the observer is off.

wind state: the observer, and a second state of the wind at the gyros' rate. It takes the disc's own tilt out (a model
of servo and rotor, driven by the cyclic and the rate) and feeds the gust to the cyclic: the disc is held against it.

INDI: the cyclic is stepped from where the rotor is taken to be, by the angular acceleration that is lacking,

    lon = A H lon + (K (k (tilt_c - tilt) - q) - H q')/G,

A: servo and rotor as stated; H: a low-pass of second order, the same on both (Smeur, Chu and de Croon, JGCD 39, 2016);
G: angular acceleration per tilt of the disc. K, k, G and H's frequency are searched with the outer loop's gains.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import differential_evolution

from flight_laws import LAWS, Law, Searched, stiffness_of
from flownav.control.design import gains_for, nominal_model
from flownav.control.gains import AutopilotGains
from flownav.control.learnt_model import NominalModel
from flownav.control.loops import spectral_radius
from flownav.control.margins import LEAST_GAIN_DB, LEAST_PHASE_DEG
from flownav.core.frames import GRAVITY_M_S2
from flownav.vehicle.kinds import hover_of, load_vehicle
from flownav.vehicle.linearize import Complex
from flownav.vehicle.parameters import VehicleParameters
from learnt_shapes import LAGS_S, STIFFNESSES, at_node, box_of, hover_trim
from learnt_shapes import axis_of as axis_of_vehicles
from shape_gains import (
    AXES,
    OFFSET_S,
    OMEGA_RAD_S,
    RESERVE_DB,
    RESERVE_DEG,
    UNSTABLE,
    Axis,
    Paths,
    axis_of,
    cuts_of,
    drift_by,
    shape_in,
    spectrum,
    with_shape,
)  # fmt: skip

BIAS_M_S2 = 0.049  # of the accelerometers' sheet; OFFSET_S of shape_gains is its time
# vibration once a revolution of the inertial sensors' sheet, and the cyclic that it may make: chosen, 0.2 deg
SHAKEN_RAD_S, SHAKEN_M_S2, MOST_SHAKEN_RAD = float(np.radians(1.0)), 1.5, float(np.radians(0.2))
ROUNDS = 60
SOME = 8  # while it searches, one corner of this number is held stable; in the table all of them


def least_of(loops: Complex) -> tuple[float, float]:
    """The least phase [deg] and gain [dB] margin of loops (..., n), as `margins.margins` has them of one."""
    flat = loops.reshape(-1, loops.shape[-1])
    level, phase = np.log(np.abs(flat)), np.unwrap(np.angle(flat), axis=1)
    at_gain = np.diff(np.signbit(level), axis=1)
    share = level[:, :-1] / np.where(at_gain, level[:, :-1] - level[:, 1:], 1.0)
    crossed = (phase[:, :-1] + share * np.diff(phase, axis=1))[at_gain]
    off = np.abs(np.mod(crossed, 2.0 * np.pi) - np.pi)
    turns = phase / (2.0 * np.pi) - 0.5  # whole numbers are the edge
    at_edge = np.diff(np.floor(turns), axis=1) != 0.0
    edge = np.maximum(np.floor(turns[:, :-1]), np.floor(turns[:, 1:]))
    share = (edge - turns[:, :-1]) / np.where(at_edge, np.diff(turns, axis=1), 1.0)
    levels = np.abs((level[:, :-1] + share * np.diff(level, axis=1))[at_edge])
    return (
        float(np.degrees(np.min(off, initial=np.inf))),
        float(20.0 / np.log(10.0) * np.min(levels, initial=np.inf)),
    )


def by_felt(paths: Paths, axis: Axis) -> tuple[Complex, Complex]:
    """The cyclic per acceleration that is felt, past the commanded tilt and through it, (n,) each.

    The observer answers what is felt as it answers g times the tilt; past the command a velocity counts by its rate.
    """
    return (
        paths.past_command[2] / (1j * OMEGA_RAD_S),
        -AXES[axis.name][2] * paths.by_command[0] / GRAVITY_M_S2,
    )


def felt_loops(paths: Paths, axis: Axis) -> Complex:
    """The loop cut at the accelerometer, the others closed, (corners, n): no loop of the margins that are asked."""
    felt = sum(by_felt(paths, axis)) * 1j * OMEGA_RAD_S * axis.by_cyclic[:, 2]
    total = ((paths.past_command + paths.by_command) * axis.by_cyclic).sum(axis=1)
    return np.asarray(-felt / (1.0 - (total - felt)))


def drift_of(paths: Paths, axis: Axis) -> float:
    """`shape_gains.drift_by`, and what the accelerometer's bias does past the commanded tilt [m]."""
    cyclic = axis.by_cyclic[0]
    total = ((paths.past_command + paths.by_command) * cyclic).sum(axis=0)
    by_bias = cyclic[3] * by_felt(paths, axis)[0] / (1.0 - total)
    power = np.abs(by_bias) ** 2 * spectrum(BIAS_M_S2, OFFSET_S)
    return float(np.hypot(drift_by(paths, axis), np.sqrt(np.trapezoid(power, OMEGA_RAD_S))))


def shaken_rad(paths: Paths, stated: NominalModel) -> float:
    """The cyclic that the vibration of gyros and accelerometers makes past the commanded tilt [rad]."""
    at = int(np.argmin(np.abs(OMEGA_RAD_S - 1.0 / stated.per_rotor_speed_s)))
    rate, velocity = np.abs(paths.past_command[1:3, at])
    return float(rate * SHAKEN_RAD_S + velocity / OMEGA_RAD_S[at] * SHAKEN_M_S2)


class Case(NamedTuple):
    """An axis on a box: its plants, the vehicle as it is stated, the other axes' gains."""

    title: str
    axis: Axis
    stated: NominalModel
    gains: AutopilotGains


def stable(law: Law, numbers: Searched, case: Case, every: int = 1) -> bool:
    """The exact sampled loop at the corners, or at one of `every`."""
    gains = with_shape(case.gains, law.shape(numbers, case.axis.name, case.stated), case.axis.name)
    return all(
        spectral_radius(law.inside(numbers, case.axis.name, plant, case.stated), gains) < 1.0
        for plant in case.axis.plants[::every]
    )


def searched(law: Law, case: Case, rounds: int = ROUNDS, seed: int = 0) -> Searched:
    """The numbers with the least drift whose margins hold over the box."""
    low, high = np.log(law.least), np.log(law.most)
    free = high > low
    best = [np.inf]

    def numbers_of(logarithms: Sequence[float]) -> Searched:
        found = low.copy()
        found[free] = logarithms
        return Searched(*(float(x) for x in np.exp(found)))

    def objective(logarithms: Sequence[float]) -> float:
        numbers = numbers_of(logarithms)
        paths = law.paths(numbers, case.axis, case.stated)
        phase, gain = least_of(cuts_of(paths, case.axis))
        short = max(LEAST_PHASE_DEG + RESERVE_DEG - phase, 0.0) + 5.0 * max(LEAST_GAIN_DB + RESERVE_DB - gain, 0.0)
        short += 20.0 * max(float(np.log(shaken_rad(paths, case.stated) / MOST_SHAKEN_RAD)), 0.0)
        worth = float(np.log(drift_of(paths, case.axis))) + short
        if worth < best[0]:
            if not stable(law, numbers, case, SOME):
                return UNSTABLE
            best[0] = worth
        return worth

    name = case.axis.name
    start = np.log(law.start(shape_in(case.gains, name), stiffness_of(case.stated, name)))
    bounds = list(zip(low[free], high[free], strict=True))
    return numbers_of(
        differential_evolution(
            objective,
            bounds,
            maxiter=rounds,
            popsize=8,
            seed=seed,
            tol=1e-4,
            polish=False,
            x0=np.clip(start, low, high)[free],
        ).x
    )


def cases(axes: Sequence[str] = tuple(AXES)) -> tuple[Case, ...]:
    """The axes on the box of the sheet, and on that of the learnt vehicle in the middle of its table."""
    vehicle = load_vehicle()
    assert isinstance(vehicle, VehicleParameters)
    gains = gains_for(vehicle, hover_of(vehicle), 0.0)
    found = []
    for name in axes:
        learnt = at_node(vehicle, name, STIFFNESSES[name][0], LAGS_S[0])
        for title, axis, own in (
            ("sheet", axis_of(name), vehicle),
            ("learnt", axis_of_vehicles(name, list(box_of(vehicle, name, STIFFNESSES[name][0], LAGS_S[0]))), learnt),
        ):
            found.append(Case(title, axis, nominal_model(own, hover_trim(own), -1), gains))
    return tuple(found)


class Row(NamedTuple):
    """A law on a box: its drift [m]; least margins, the phase at the accelerometer apart; the cyclic that vibration
    makes; whether every corner is stable.
    """

    law: str
    box: str
    axis: str
    drift_m: float
    phase_deg: float
    gain_db: float
    felt_deg: float
    shaken_deg: float
    stable: bool
    numbers: Searched


def row_of(law: Law, case: Case, numbers: Searched) -> Row:
    """The figures of a law with these numbers."""
    paths = law.paths(numbers, case.axis, case.stated)
    phase, gain = least_of(cuts_of(paths, case.axis))
    return Row(
        law.name, case.title, case.axis.name, drift_of(paths, case.axis), phase, gain,
        least_of(felt_loops(paths, case.axis))[0],
        float(np.degrees(shaken_rad(paths, case.stated))), stable(law, numbers, case), numbers,
    )  # fmt: skip


def main(rounds: int, path: Path | None, only: Sequence[str], axes: Sequence[str] = tuple(AXES)) -> None:
    """The table, row by row."""
    print(
        "| box | axis | law | drift, mm | least, deg | dB | at the accelerometer, deg | cyclic shaken, deg | stable |\n"
        + "|---" * 9
        + "|"
    )
    rows = []
    for case in cases(axes):
        for law in LAWS:
            if only and not any(each in law.name for each in only):
                continue
            row = row_of(law, case, searched(law, case, rounds))
            rows.append(row._asdict() | {"numbers": row.numbers._asdict()})
            print(
                f"| {row.box} | {row.axis} | {row.law} | {1e3 * row.drift_m:.1f} | {row.phase_deg:.1f} "
                f"| {row.gain_db:.1f} | {row.felt_deg:.1f} | {row.shaken_deg:.2f} | {'yes' if row.stable else 'NO'} |",
                flush=True,
            )
            if path is not None:
                path.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Flight laws tried beside the shipped one.")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="of each search")
    parser.add_argument("--json", type=Path, help="the rows with their numbers")
    parser.add_argument("--law", action="append", default=[], help="part of a law's name")
    parser.add_argument("--axis", action="append", choices=tuple(AXES), help="one of them alone")
    arguments = parser.parse_args()
    main(arguments.rounds, arguments.json, arguments.law, arguments.axis or tuple(AXES))
