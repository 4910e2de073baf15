"""How the vehicle moved, from a flight's reference and IMU: velocity, the reference's heading, and delays.

The IMU's earth acceleration, integrated, is right over a second or two and wrong over more; a reference is right
over seconds and late or coarse within one. What passes a high-pass filter (the signal less its Gaussian mean of
width SPLIT_S) is compared: a reference or the flow against the IMU gives its delay on the vehicle's clock, and
the angle by which a reference's north is turned. The rest comes from the reference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flownav.identification.descent import DELAY_RANGE_S, Structure
from flownav.identification.experiment import Experiment, experiment
from flownav.identification.flight import GRAVITY_M_S2, Flight
from flownav.identification.output_error import fit
from flownav.identification.quantities import Interval, latency
from flownav.identification.statistics import Z_95
from flownav.measurement import Array

GRID_S = 0.02
SPLIT_S = 1.0
HALF_SPAN_S = 0.1  # of the differences that make a reference's velocity
ALIKE = 0.6  # correlation from which the IMU counts as seeing the same motion


class Tie(NamedTuple):
    """A velocity compared with the IMU's above 1/SPLIT_S: its delay, the angle it is turned by, and likeness."""

    delay_s: Interval
    turn_rad: float
    turn_sigma_rad: float
    likeness: float


@dataclass(frozen=True)
class Motion:
    """Velocity in earth axes of the vehicle's attitude, (n, 3) on t_s (n,); ties None without an IMU."""

    t_s: Array
    velocity_m_s: Array
    yaw_rad: float  # from the vehicle's north to the reference's: v_vehicle = Rz(-yaw) v_reference
    yaw_known: bool
    reference_delay_s: float
    reference_tie: Tie | None
    flow_tie: Tie | None
    fast_m_s: Array | None  # the IMU's part above 1/SPLIT_S, (n, 3)

    def in_body(self, flown: Flight, instants_s: Array) -> Array:
        """Velocity in body axes (n, 3) at given instants."""
        earth = np.column_stack([np.interp(instants_s, self.t_s, column) for column in self.velocity_m_s.T])
        return np.asarray(np.einsum("nji,nj->ni", flown.rotation(instants_s), earth))


def smoothed(values: Array, width_s: float = SPLIT_S) -> Array:
    """Gaussian mean along the first axis of columns on the grid (two-sided: no delay)."""
    reach = int(4.0 * width_s / GRID_S)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) * GRID_S / width_s) ** 2)
    weights /= weights.sum()
    size = 1 << (len(values) + 4 * reach).bit_length()
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="edge")
    spectrum = np.fft.rfft(padded, size, axis=0) * np.fft.rfft(weights, size)[:, None]
    return np.asarray(np.fft.irfft(spectrum, size, axis=0)[2 * reach : 2 * reach + len(values)])


def on_grid(t_s: Array, values: Array, grid: Array) -> Array:
    """Columns by straight lines between their samples."""
    return np.column_stack([np.interp(grid, t_s, column) for column in values.T])


def reference_velocity(flown: Flight, grid: Array) -> Array:
    """The reference's own velocity (n, 3), or that of its positions by differences over 2 HALF_SPAN_S or more."""
    if flown.reference_velocity is not None:
        return on_grid(flown.reference_velocity.t_s, flown.reference_velocity.value, grid)
    half = max(HALF_SPAN_S, float(np.median(np.diff(flown.reference_t_s))))
    late = on_grid(flown.reference_t_s, flown.reference_m, grid + half)
    early = on_grid(flown.reference_t_s, flown.reference_m, grid - half)
    return np.asarray((late - early) / (2.0 * half))


def motion(flown: Flight) -> Motion:
    """The vehicle's velocity while the flow was usable."""
    t_s = flown.t_s[flown.good]
    grid = np.arange(t_s[0] - 2.0, t_s[-1] + 2.0, GRID_S)
    reference = reference_velocity(flown, grid)
    if flown.imu is None:
        return Motion(grid, reference, 0.0, flown.reference == "gps", 0.0, None, None, None)
    inertial = _inertial_velocity(flown, grid)
    fast = inertial - smoothed(inertial)
    tie = _tie(grid, fast, grid, (reference - smoothed(reference))[:, :2])
    alike = tie.likeness >= ALIKE
    yaw = tie.turn_rad if alike and flown.reference == "truth" else 0.0
    delay = tie.delay_s.value if alike else 0.0
    earth = _turned(on_grid(grid, reference, grid + delay), -yaw)
    if flown.reference == "gps" and alike:
        earth = smoothed(earth) + fast  # positions of a GPS receiver say nothing within a second
    flow_tie = _tie(grid, fast, flown.t_s[flown.good], fast_flow(flown, grid, flown.velocity_m_s))
    return Motion(grid, earth, yaw, alike or flown.reference == "gps", delay, tie, flow_tie, fast)


def _inertial_velocity(flown: Flight, grid: Array) -> Array:
    """The IMU's specific force turned to earth, with gravity, integrated (n, 3); its drift is for the filter."""
    imu = flown.imu
    assert imu is not None
    force = np.einsum("nij,nj->ni", flown.rotation(imu.t_s), imu.value[:, 3:])
    force[:, 2] += GRAVITY_M_S2
    steps = 0.5 * (force[1:] + force[:-1]) * np.diff(imu.t_s)[:, None]
    return on_grid(imu.t_s, np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]), grid)


def _turned(velocity: Array, angle_rad: float) -> Array:
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    north, east, down = velocity.T
    return np.column_stack([cosine * north - sine * east, sine * north + cosine * east, down])


def fast_flow(flown: Flight, grid: Array, velocity: Array) -> Array:
    """The flow's earth velocity (n, 2) at the good readings' arrival, less its Gaussian mean; velocity (m, 2)."""
    t_s = flown.t_s[flown.good]
    level = flown.rotation(t_s - flown.age_s)[:, :2, :2]
    earth = np.einsum("nij,nj->ni", level, velocity[flown.good])
    return np.asarray(earth - on_grid(grid, smoothed(on_grid(t_s, earth, grid)), t_s))


def _tie(grid: Array, fast: Array, t_s: Array, other: Array) -> Tie:
    """Compare a fast velocity (n, 2) at t_s with the IMU's on the grid: best shift, then angle and likeness."""
    signal = other[:, 0] + 1j * other[:, 1]
    products = []
    shifts = np.arange(DELAY_RANGE_S[0], DELAY_RANGE_S[1], GRID_S)
    for shift in shifts:
        inertial = np.interp(t_s - shift, grid, fast[:, 0]) + 1j * np.interp(t_s - shift, grid, fast[:, 1])
        size = np.sqrt(np.sum(np.abs(inertial) ** 2) * np.sum(np.abs(signal) ** 2))
        products.append(np.sum(np.conj(inertial) * signal) / max(float(size), 1e-12))
    best = products[int(np.argmax(np.abs(products)))]
    turn, likeness = float(np.angle(best)), float(abs(best))
    turned = _turned(np.column_stack([fast[:, :2], np.zeros(len(fast))]), turn)
    runs = fast_experiments("IMU", grid, turned[:, :2], t_s, other)
    delay = latency(fit(runs, Structure(0)))
    independent = max(4.0, (t_s[-1] - t_s[0]) / SPLIT_S)
    sigma = float(np.sqrt(max(1.0 / max(likeness, 1e-3) ** 2 - 1.0, 0.0) / (2.0 * independent)))
    return Tie(delay, turn, sigma, likeness)


def fast_experiments(name: str, grid: Array, fast: Array, t_s: Array, other: Array) -> list[Experiment]:
    """North and east as two runs of one system: the IMU's fast velocity in, the other one out."""
    return [
        experiment(f"{name} {axis}", grid, fast[:, i], t_s, other[:, i]) for i, axis in enumerate(("north", "east"))
    ]


def difference(first: Interval, second: Interval) -> Interval:
    """First less second, independent."""
    sigma = np.hypot(first.high - first.low, second.high - second.low) / (2.0 * Z_95)
    return Interval.of(first.value - second.value, float(sigma))
