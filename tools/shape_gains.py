"""Search the autopilot's gains anew and print them beside those of `control.design` (minutes).

python tools/shape_gains.py [VEHICLE]

What is sought is the least drift in turbulence, with margins at every corner of the vehicle's uncertainty box.

One axis at a time, with the seven gains from position to cyclic. What is made small is the vehicle's distance from
where it should be, in hover: its standard deviation in Dryden turbulence of a 4 m/s wind at 3 m, and under what an
accelerometer's bias and a wrong trim leave. The constraints are the margins of the axis' loops (`loops`) at every
corner of the box; that the loop is stable at all is asked of the exact sampled one (`sampled`). The search is SciPy's
differential evolution, from one seed.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from flownav.control.design import gains_for
from flownav.control.gains import AutopilotGains
from flownav.control.loops import FLOWN, hold, integral, spectral_radius
from flownav.control.margins import LEAST_GAIN_DB, LEAST_PHASE_DEG, margins
from flownav.core.errors import FlownavError
from flownav.core.frames import GRAVITY_M_S2
from flownav.vehicle.corners import corners
from flownav.vehicle.kinds import hover_of, load_vehicle
from flownav.vehicle.linearize import INPUTS, OUTPUTS, Complex, LinearPlant, frequency_response, gust_input, hover_plant

Array = NDArray[np.float64]

GUST_M_S, GUST_S = 0.79, 6.7  # Dryden along the wind at 3 m, 4 m/s at 20 ft: sigma_u and L_u/V
OFFSET_M_S2, OFFSET_S = 0.027, 30.0  # by a tilt that is not what it seems: half of 5 mg of accelerometer bias
UNSTABLE = 100.0
RESERVE_DEG, RESERVE_DB = 0.6, 0.2
OMEGA_RAD_S = np.geomspace(0.02, 200.0, 190)


class Axis(NamedTuple):
    """An axis at every corner: tilt, rate, velocity and position by its cyclic and by a gust, (corners, 4, n)."""

    name: str
    by_cyclic: Complex
    by_gust: Complex
    plants: tuple[LinearPlant, ...]


class Shape(NamedTuple):
    """Gains of one axis: cyclic per tilt, per tilt and second, per rate; position and velocity; the observer's lag."""

    attitude: float
    attitude_integral_1_s: float
    damping_s: float
    velocity_1_s: float
    position_1_s: float
    velocity_integral_1_s2: float
    gust_s: float


LEAST = Shape(0.05, 0.001, 0.004, 0.3, 0.3, 0.05, 0.1)
MOST = Shape(0.6, 0.4, 0.08, 6.0, 2.0, 3.0, 1.0)
# outputs and input of an axis, and the sign of the acceleration that its tilt gives
AXES = {
    "forward": (("pitch", "q", "vel_n", "pos_n"), "lon", -1.0),
    "right": (("roll", "p", "vel_e", "pos_e"), "lat", 1.0),
}


def axis_of(name: str, path: Path | None = None) -> Axis:
    """`forward` or `right` of a vehicle file, the shipped vehicle's where `path` is None."""
    seen, cyclic, _ = AXES[name]
    rows = [OUTPUTS.index(output) for output in seen]
    plants, cyclics, gusts = [], [], []
    for corner in corners(path):
        about = hover_of(corner.vehicle)
        plant = hover_plant(corner.vehicle, about)
        blown = plant._replace(b=gust_input(corner.vehicle, about)[:, [0 if name == "forward" else 1]])
        plants.append(plant)
        cyclics.append(frequency_response(plant, OMEGA_RAD_S)[:, rows, INPUTS.index(cyclic)].T)
        gusts.append(frequency_response(blown, OMEGA_RAD_S)[:, rows, 0].T)
    return Axis(name, np.array(cyclics), np.array(gusts), tuple(plants))


def feedback(shape: Shape, axis: Axis) -> tuple[Complex, Complex, Complex, Complex]:
    """The cyclic per tilt, rate, velocity and position, (n,) each."""
    w, sign = OMEGA_RAD_S, AXES[axis.name][2]
    inner, outer, late = hold(w, FLOWN.inner_s), hold(w, FLOWN.outer_s), np.exp(-1j * w * FLOWN.estimate_delay_s)
    attitude = shape.attitude + shape.attitude_integral_1_s * integral(w, FLOWN.inner_s)
    accelerate = (shape.velocity_1_s + shape.velocity_integral_1_s2 * integral(w, FLOWN.outer_s)) / GRAVITY_M_S2
    felt = observed(shape)
    by_velocity = -sign * outer * attitude * (accelerate * late + felt * 1j * w / GRAVITY_M_S2)
    by_position = -sign * outer * attitude * accelerate * late * shape.position_1_s
    return outer * attitude * felt - inner * attitude, -inner * shape.damping_s, by_velocity, by_position


def observed(shape: Shape) -> Complex:
    """The disturbance observer's low-pass with its hold and delay, (n,)."""
    decay = np.exp(-FLOWN.outer_s / shape.gust_s)
    w = OMEGA_RAD_S
    low_pass = (1.0 - decay) / (1.0 - decay * np.exp(-1j * w * FLOWN.outer_s))
    return np.asarray(low_pass * hold(w, FLOWN.outer_s) * np.exp(-1j * w * FLOWN.estimate_delay_s))


class Paths(NamedTuple):
    """The cyclic per tilt, rate, velocity and position, (4, n) each: past the commanded tilt, and through it."""

    past_command: Complex
    by_command: Complex


def paths_of(shape: Shape, axis: Axis) -> Paths:
    """`feedback`, by whether it passes the commanded tilt."""
    attitude = shape.attitude + shape.attitude_integral_1_s * integral(OMEGA_RAD_S, FLOWN.inner_s)
    tilt, rate, velocity, position = feedback(shape, axis)
    through_command = hold(OMEGA_RAD_S, FLOWN.outer_s) * attitude * observed(shape)
    none = np.zeros_like(tilt)
    return Paths(
        np.array([tilt - through_command, rate, none, none]), np.array([through_command, none, velocity, position])
    )


def loops_of(shape: Shape, axis: Axis) -> Complex:
    """Cut at the cyclic, the rate, the tilt command and the velocity command, the others closed, (corners, 4, n)."""
    return cuts_of(paths_of(shape, axis), axis)


def cuts_of(paths: Paths, axis: Axis) -> Complex:
    """`loops_of` for any law that is linear."""
    past, commanded = (path * axis.by_cyclic for path in paths)
    total = past.sum(axis=1) + commanded.sum(axis=1)
    cuts = (total, past[:, 1], commanded.sum(axis=1), commanded[:, 3])
    return np.stack([-cut / (1.0 - (total - cut)) for cut in cuts], axis=1)


def drift_m(shape: Shape, axis: Axis) -> float:
    """Standard deviation of the position in turbulence and under a false tilt [m], the vehicle as stated."""
    return drift_by(paths_of(shape, axis), axis)


def drift_by(paths: Paths, axis: Axis) -> float:
    """`drift_m` for any law that is linear."""
    w, gains = OMEGA_RAD_S, paths.past_command + paths.by_command
    cyclic, gust = axis.by_cyclic[0], axis.by_gust[0]
    answered, total = (gains * gust).sum(axis=0), (gains * cyclic).sum(axis=0)
    by_gust = gust[3] + cyclic[3] * answered / (1.0 - total)
    by_offset = 1.0 / (w * w * (1.0 + cuts_of(paths, axis)[0, 2]))
    power = np.abs(by_gust) ** 2 * spectrum(GUST_M_S, GUST_S) + np.abs(by_offset) ** 2 * spectrum(OFFSET_M_S2, OFFSET_S)
    return float(np.sqrt(np.trapezoid(power, w)))


def least_margins(shape: Shape, axis: Axis) -> tuple[float, float]:
    """The least phase [deg] and gain [dB] margin of the axis' loops over the box."""
    found = [margins(loop, OMEGA_RAD_S) for corner in loops_of(shape, axis) for loop in corner]
    return min(x.phase_deg for x in found), min(x.gain_db for x in found)


def with_shape(gains: AutopilotGains, shape: Shape, name: str) -> AutopilotGains:
    """An autopilot's gains with one axis' in them."""
    decay = float(np.exp(-FLOWN.outer_s / shape.gust_s))
    tilt = "pitch" if name == "forward" else "roll"
    named = {
        f"{tilt}_gain": shape.attitude, f"{tilt}_integral": shape.attitude_integral_1_s,
        f"{tilt}_damping": shape.damping_s,
        f"{name}_gain": shape.velocity_1_s, f"{name}_integral": shape.velocity_integral_1_s2,
        f"gust_decay_{name}": decay, "position_gain": shape.position_1_s, "gust_share": 1.0,
    }  # fmt: skip
    return gains._replace(**named)


def shape_in(gains: AutopilotGains, name: str) -> Shape:
    """One axis' gains out of an autopilot's."""
    tilt = "pitch" if name == "forward" else "roll"
    of = gains._asdict()
    return Shape(
        of[f"{tilt}_gain"], of[f"{tilt}_integral"], of[f"{tilt}_damping"], of[f"{name}_gain"], gains.position_gain,
        of[f"{name}_integral"], float(-FLOWN.outer_s / np.log(of[f"gust_decay_{name}"])),
    )  # fmt: skip


def shaped(name: str, start: AutopilotGains, path: Path | None = None, *, rounds: int = 60) -> tuple[Shape, float]:
    """The best gains of an axis found in `rounds` rounds, and their drift [m]. start: the other axes' gains."""
    axis = axis_of(name, path)
    best = [np.inf]

    def objective(logarithms: Sequence[float]) -> float:
        shape = Shape(*np.exp(logarithms))
        phase, gain = least_margins(shape, axis)
        short = max(LEAST_PHASE_DEG + RESERVE_DEG - phase, 0.0) + 5.0 * max(
            LEAST_GAIN_DB + RESERVE_DB - gain, 0.0
        )  # a degree outweighs any drift
        worth = float(np.log(drift_m(shape, axis))) + short
        if worth < best[0]:  # only what would be the best needs to be stable
            gains = with_shape(start, shape, name)
            if any(spectral_radius(plant, gains) >= 1.0 for plant in axis.plants):
                return UNSTABLE
            best[0] = worth
        return worth

    bounds = list(zip(np.log(LEAST), np.log(MOST), strict=True))
    found = differential_evolution(objective, bounds, maxiter=rounds, popsize=8, seed=0, tol=1e-4, polish=False)
    shape = Shape(*(float(x) for x in np.exp(found.x)))
    return shape, drift_m(shape, axis)


def spectrum(sigma: float, time_s: float) -> Array:
    """One-sided density over angular frequency of a first-order process, (n,)."""
    return np.asarray(sigma**2 * 2.0 * time_s / np.pi / (1.0 + (time_s * OMEGA_RAD_S) ** 2))


def main(path: Path | None) -> None:
    """Both axes: gains, drift and least margins, as designed and as found."""
    vehicle = load_vehicle(path)
    gains = gains_for(vehicle, hover_of(vehicle), 0.0)
    print(f"{'':16}" + "".join(f"{name:>24}" for name in Shape._fields) + "   drift, m   phase, deg   gain, dB")
    for name in AXES:
        axis = axis_of(name, path)
        for title, shape in (("designed", shape_in(gains, name)), ("found", shaped(name, gains, path)[0])):
            phase, gain = least_margins(shape, axis)
            figures = "".join(f"{value:24.4f}" for value in shape)
            print(f"{name:8}{title:8}{figures}{drift_m(shape, axis):11.4f}{phase:13.1f}{gain:11.1f}", flush=True)


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
    except FlownavError as error:
        sys.exit(f"flownav: {error}")
