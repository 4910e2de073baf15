"""How the vehicle moved, from a flight's reference and IMU: velocity, the reference's heading, and delays.

The IMU's earth acceleration, integrated, is right over a second or two and wrong over more; a reference is right
over seconds and late or coarse within one. What passes a high-pass filter (the signal less its Gaussian mean of
width SPLIT_S) is compared: a reference or the flow against the IMU gives its delay on the vehicle's clock, and
the angle by which a reference's north is turned. The rest comes from the reference.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flownav.core.frames import turned_level
from flownav.core.measurement import Array
from flownav.lab.identification.descent import DELAY_RANGE_S, Structure
from flownav.lab.identification.experiment import Experiment, experiment
from flownav.lab.identification.flight import GRAVITY_M_S2, Flight
from flownav.lab.identification.output_error import Z_95, fit
from flownav.lab.identification.quantities import Interval, latency
from flownav.logs.log import mean_over

GRID_S = 0.02
SPLIT_S = 1.0
EDGE_SPLITS = 5.0  # of those are left out at either end
HALF_SPAN_S = 0.1  # of the differences that make a reference's velocity
SIGNIFICANT_SIGMAS = 4.0  # standard errors of a correlation of nothing
IMU_ERROR_RAD = 0.25  # of its word on the reference's heading
LEAST_ALIKE = 0.5  # correlation of flow and reference from which the flow gives the reference's heading
ALIKE_S, ALIKE_LAGS_S = 0.5, (-0.2, 0.6, 0.02)
WIDEST_DELAY_S = 0.3  # an interval wider than this carries no information


class Tie(NamedTuple):
    """A velocity compared with the IMU's above 1/SPLIT_S: its delay, the angle it is turned by, and likeness.

    likeness: correlation; independent: how many independent values it is of.
    """

    delay_s: Interval
    turn_rad: float
    likeness: float
    independent: float

    @property
    def alike(self) -> bool:
        """Whether the two saw the same motion, beyond chance: their angle is known."""
        return bool(self.likeness >= SIGNIFICANT_SIGMAS / np.sqrt(self.independent))

    @property
    def holds(self) -> bool:
        """Whether they did and the delay is known."""
        return self.alike and self.delay_s.high - self.delay_s.low <= WIDEST_DELAY_S


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
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="edge")
    weights /= weights.sum()
    return np.column_stack([np.convolve(column, weights, "valid") for column in padded.T])


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
        yaw, yaw_known = _yaw(flown, grid, reference, None)
        return Motion(grid, _turned(reference, -yaw), yaw, yaw_known, 0.0, None, None, None)
    inertial = _inertial_velocity(flown, grid)
    fast = inertial - smoothed(inertial)
    if flown.reference == "imu":
        return with_flow(Motion(grid, fast, 0.0, True, 0.0, None, None, fast), flown, flown.velocity_m_s)
    tie = _tie(grid, fast, grid, (reference - smoothed(reference))[:, :2])
    yaw, yaw_known = _yaw(flown, grid, reference, tie)
    delay = tie.delay_s.value if tie.holds else 0.0
    earth = _turned(on_grid(grid, reference, grid + delay), -yaw)
    if flown.reference == "gps" and tie.holds:
        earth = smoothed(earth) + fast  # positions of a GPS receiver carry no information within a second
    moved = Motion(grid, earth, yaw, yaw_known, delay, tie, None, fast)
    return with_flow(moved, flown, flown.velocity_m_s)


def _yaw(flown: Flight, grid: Array, reference: Array, tie: Tie | None) -> tuple[float, bool]:
    """From the vehicle's north to the reference's [rad], and whether a sensor that is turned would show.

    GPS has the attitude's north. Of any other reference the IMU gives it, where it saw the same motion; where it did
    not, or differs by more than IMU_ERROR_RAD from the flow's (an accelerometer that errs), the flow gives it: as it
    is, or by whole quarter turns from the IMU's word.
    """
    if flown.reference == "gps":
        return 0.0, True
    alike = flow_likeness(flown, grid, reference)
    if tie is None or not tie.alike:
        return (alike.turn_rad, False) if alike.likeness >= LEAST_ALIKE else (0.0, False)
    apart = (alike.turn_rad - tie.turn_rad + np.pi) % (2.0 * np.pi) - np.pi
    quarters = 0.5 * np.pi * np.round(apart / (0.5 * np.pi))
    if alike.likeness < LEAST_ALIKE or abs(apart - quarters) <= IMU_ERROR_RAD:
        return tie.turn_rad, True
    return float(alike.turn_rad - quarters), True


class Likeness(NamedTuple):
    """Flow against reference, both smoothed: the angle from one to the other, their correlation, the reference's lag.

    mirrored: the correlation were the sensor's y the other way round.
    """

    turn_rad: float
    likeness: float
    lag_s: float
    mirrored: float


def flow_likeness(flown: Flight, grid: Array, reference: Array, velocity: Array | None = None) -> Likeness:
    """How the flow's earth velocity and the reference's (n, 3) on the grid go together, at the best shift.

    velocity (m, 2): the flow's with its axes put right, to use instead of the log's.
    """
    t_s = flown.t_s[flown.good]
    seen = t_s - flown.age_s
    level, flow = flown.rotation(seen)[:, :2, :2], (flown.velocity_m_s if velocity is None else velocity)[flown.good]
    lags = np.arange(*ALIKE_LAGS_S)
    others = [on_grid(grid, reference[:, :2], seen + lag) @ np.array([1.0, 1j]) for lag in lags]
    powers = [np.sum(np.abs(other) ** 2) for other in others]
    found = []
    for mirror in (1.0, -1.0):
        earth = np.einsum("nij,nj->ni", level, flow * np.array([1.0, mirror]))
        mean = mean_over(t_s, earth, t_s - ALIKE_S / 2, t_s + ALIKE_S / 2)
        signal = mean[:, 0] + 1j * mean[:, 1]
        power = np.sum(np.abs(signal) ** 2)
        for lag, other, other_power in zip(lags, others, powers, strict=True):
            size = float(np.sqrt(other_power * power))
            found.append((mirror, complex(np.sum(np.conj(signal) * other)) / max(size, 1e-12), float(lag)))
    straight = max((one for one in found if one[0] > 0.0), key=lambda one: abs(one[1]))
    mirrored = max(abs(one[1]) for one in found if one[0] < 0.0)
    return Likeness(float(np.angle(straight[1])), abs(straight[1]), straight[2], mirrored)


def velocity_response(flown: Flight, moved: Motion, age_s: float) -> Array:
    """(2, 2) regression of flow on the reference's body velocity: enough for signs and axes.

    age_s: how old a flow reading is when it arrives; the log's own where the heading is not known.
    """
    if not moved.yaw_known:
        age_s = flown.age_s
    body = moved.in_body(flown, flown.t_s[flown.good] - age_s)[:, :2]
    design = np.column_stack([body, np.ones(len(body))])
    return np.asarray(np.linalg.lstsq(design, flown.velocity_m_s[flown.good], rcond=None)[0][:2].T)


def with_flow(moved: Motion, flown: Flight, velocity: Array) -> Motion:
    """The motion with the flow's tie to the IMU, for flow velocities (n, 2) that may have been put right."""
    if moved.fast_m_s is None:
        return moved
    t_s, other = flown.t_s[flown.good], fast_flow(flown, moved.t_s, velocity)
    return replace(moved, flow_tie=_tie(moved.t_s, moved.fast_m_s, t_s, other))


def _inertial_velocity(flown: Flight, grid: Array) -> Array:
    """The IMU's specific force turned to earth, with gravity, integrated (n, 3); its drift is for the filter."""
    imu = flown.imu
    assert imu is not None
    force = np.einsum("nij,nj->ni", flown.rotation(imu.t_s), imu.value[:, 3:])
    force[:, 2] += GRAVITY_M_S2
    steps = 0.5 * (force[1:] + force[:-1]) * np.diff(imu.t_s)[:, None]
    return on_grid(imu.t_s, np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]), grid)


def _turned(velocity: Array, angle_rad: float) -> Array:
    north, east, down = velocity.T
    return np.column_stack([*turned_level(north, east, np.cos(angle_rad), np.sin(angle_rad)), down])


def fast_flow(flown: Flight, grid: Array, velocity: Array) -> Array:
    """The flow's earth velocity (n, 2) at the good readings' arrival, less its Gaussian mean; velocity (m, 2)."""
    t_s = flown.t_s[flown.good]
    level = flown.rotation(t_s - flown.age_s)[:, :2, :2]
    earth = np.einsum("nij,nj->ni", level, velocity[flown.good])
    return np.asarray(earth - on_grid(grid, smoothed(on_grid(t_s, earth, grid)), t_s))


def _tie(grid: Array, fast: Array, t_s: Array, other: Array) -> Tie:
    """Compare a fast velocity (n, 2) at t_s with the IMU's on the grid: best shift, then angle and likeness.

    Not near the ends, where the Gaussian mean is of what the log no longer holds.
    """
    edge = min(EDGE_SPLITS * SPLIT_S, 0.1 * (grid[-1] - grid[0]))
    inner = (t_s >= grid[0] + edge) & (t_s <= grid[-1] - edge)
    t_s, other = t_s[inner], other[inner]
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
    return Tie(delay, turn, likeness, max(4.0, float(t_s[-1] - t_s[0]) / SPLIT_S))


def fast_experiments(name: str, grid: Array, fast: Array, t_s: Array, other: Array) -> list[Experiment]:
    """North and east as two runs of one system: the IMU's fast velocity in, the other one out."""
    return [
        experiment(f"{name} {axis}", grid, fast[:, i], t_s, other[:, i]) for i, axis in enumerate(("north", "east"))
    ]


def difference(first: Interval, second: Interval) -> Interval:
    """First less second, independent."""
    sigma = np.hypot(first.high - first.low, second.high - second.low) / (2.0 * Z_95)
    return Interval.of(first.value - second.value, float(sigma))
